//! Checks of a derived robot. Each check has a statement that must hold, the largest error found,
//! and the bound of the error.
//!
//! | function | checks |
//! |---|---|
//! | [`identities`] | the robot's functions against each other and against differences |
//! | [`numeric_path`] | its base parameters against singular values and QR (Gautier, 1991) |
//! | [`independent`] | its functions and base parameters against derivations that share no code with it, with bounds computed from roundoff |
//!
//! All of them use random closed states that depend on a fixed seed and the robot alone; the
//! numbers are computed by the interpreter, and are the same on every machine.
//!
//! ```
//! use regen_codegen::{diag::Source, pipeline};
//!
//! let text = "\
//! name: arm
//! limbs:
//!   - name: arm
//!     joints:
//!       - {name: q1, type: revolute, body: link, actuated: true}
//! ";
//! let robot = pipeline::derive(&Source::new("arm.yaml", text))?;
//! let report = regen_verify::identities(&robot)?;
//! assert_eq!(report.failed().count(), 0);
//! let report = regen_verify::independent(&robot, text, None)?;
//! assert_eq!(report.failed().count(), 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod base_identities;
mod check;
mod control_identities;
mod error;
mod identities;
mod independent;
mod numeric;
mod numeric_path;
pub mod print;
mod states;
mod svd;
#[cfg(test)]
mod testing;
mod vector;

pub use check::{Check, Report, Statement, Verdict};
pub use error::VerifyError;
pub use identities::identities;
pub use independent::{INDEPENDENT, Vectors, independent};
pub use numeric::Rank;
pub use numeric_path::{NumericPath, Reduced, numeric_path};
pub use svd::scaled_singular_values;
