//! What must hold of every input of the readers, whatever its bytes.
//!
//! Each function takes a file's bytes and fails, by a panic, if the reader does not answer them
//! with a result or with an error that can be shown. The targets of cargo-fuzz in
//! `fuzz_targets/` call one function each; `tests/kept.rs` calls them on stable with the kept
//! inputs, with the repository's own files and with mutations of both. `RECORD.md` has the long
//! runs.
//!
//! ```
//! regen_fuzz::yaml(b"name: [");
//! regen_fuzz::expression(b"2^2^2^2^2^2");
//! regen_fuzz::csv(b"t,q1,tau_q1\n0,0,0\n\"");
//! regen_fuzz::parquet(b"PAR1PAR1");
//! ```

mod description;
mod log;
mod other;

pub use description::{derive, expression, yaml};
pub use log::{csv, parquet};
pub use other::{factors, import};

/// A reader by its name, with what must hold of it.
pub type Target = (&'static str, fn(&[u8]));

/// All of them; the names are those of the fuzz targets and of the directories in `kept/`.
pub const TARGETS: [Target; 7] = [
    ("yaml", yaml),
    ("expression", expression),
    ("derive", derive),
    ("csv", csv),
    ("parquet", parquet),
    ("import", import),
    ("factors", factors),
];
