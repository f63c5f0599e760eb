//! The equations of a derived robot as a person writes them: intermediate terms with names in the
//! order in which they are computed, then the entries of the result.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.
//!
//! ```
//! use regen_codegen::Mechanism;
//! use regen_codegen::diag::Source;
//! use regen_equations::{EquationSet, Parameters, Style, equations, kinds};
//!
//! let text = "\
//! name: arm
//! gravity: [0, -9.81, 0]
//! limbs:
//!   - name: arm
//!     joints:
//!       - {name: q1, type: revolute, body: link, actuated: true}
//! ";
//! let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
//! let robot = mechanism.robot_in_names(&kinds(EquationSet::Dynamics, Parameters::Base))?;
//! let text = equations(&robot, EquationSet::Dynamics, Parameters::Base, Style::Text).unwrap();
//! assert!(text.contains("c_1 = cos(q1)"), "{text}");
//! assert!(text.contains("tau_1 = "), "{text}");
//! # Ok::<(), regen_codegen::diag::Report>(())
//! ```

mod constants;
mod graph;
mod identifiers;
mod latex;
mod load;
mod measure;
mod names;
mod page;
mod plain;
mod sympy;
mod text;

pub use page::{EquationSet, MissingFunction, Parameters, Style, equations, kinds};
