//! Logs from CSV and Parquet files: assigns columns, checks rows and computes states of motion.

mod average;
mod columns;
mod discretisation;
mod logs;
#[cfg(feature = "parquet")]
mod parquet;
mod problem;
mod rates;
mod reader;
mod sample;
mod shift;
mod standstill;
mod stuck;
mod tracks;
mod window;

pub use columns::{Assignment, AssignmentError, Quantity};
pub use logs::{FileReport, Logs, Settings};
pub use problem::{DataError, Fault, Policy, Problem, Problems};
pub use tracks::{Track, tracks};
