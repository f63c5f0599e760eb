//! The tests of this folder as one program, which links once: a file is a module here.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod adjustable;
mod base_random;
mod base_ranks;
mod base_support;
mod base_table;
mod c;
mod certificate;
mod completion;
mod emission;
mod explain;
mod expressions;
mod files;
mod kept_parameters;
mod mutations;
mod mutations_derive;
mod oracle;
mod rounding;
mod scene;
mod spec_fuzz;
mod spec_invalid;
mod spec_schema;
mod spec_valid;
