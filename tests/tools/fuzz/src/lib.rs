//! Checks of the readers that must pass for any input bytes.
//!
//! Each function takes the bytes of a file and panics unless the reader returns a result or an
//! error that can be printed. The targets of cargo-fuzz in `fuzz_targets/` call one function each;
//! `tests/kept.rs` calls them on stable Rust with the inputs in `kept/`, with the repository's own
//! files and with mutations of both. `RECORD.md` records the long runs.
//!
//! ```
//! regen_fuzz::yaml(b"name: [");
//! regen_fuzz::expression(b"2^2^2^2^2^2");
//! regen_fuzz::csv(b"t,q1,tau_q1\n0,0,0\n\"");
//! regen_fuzz::parquet(b"PAR1PAR1");
//! regen_fuzz::bag(b"\x89MCAP0\r\n");
//! regen_fuzz::arrays(b"\x93NUMPY\x01\0");
//! regen_fuzz::experiment(b"runs: [{files: a.csv}]");
//! ```

mod description;
mod log;
mod other;

pub use description::{c, derive, expression, yaml};
pub use log::{arrays, bag, csv, parquet};
pub use other::{experiment, factors, import};

/// The name of a reader and the function that checks it.
pub type Target = (&'static str, fn(&[u8]));

/// All targets; the names are those of the fuzz targets and of the directories in `kept/`.
pub const TARGETS: [Target; 11] = [
    ("yaml", yaml),
    ("expression", expression),
    ("derive", derive),
    ("c", c),
    ("csv", csv),
    ("parquet", parquet),
    ("bag", bag),
    ("arrays", arrays),
    ("import", import),
    ("factors", factors),
    ("experiment", experiment),
];
