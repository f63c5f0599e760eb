//! Logs from CSV and Parquet files, files of laboratories and recordings: assigns columns, checks rows and computes states
//! of motion.

#[cfg(feature = "arrays")]
mod arrays;
mod average;
#[cfg(feature = "bags")]
mod bags;
mod bridge;
mod bursts;
mod columns;
mod csv_rows;
mod dates;
mod discretisation;
mod dropouts;
pub(crate) mod expression;
mod fewer_states;
mod file_rows;
mod held;
mod joined;
mod layout;
mod lines;
mod logs;
mod memory;
mod motion;
mod noise_levels;
mod number;
#[cfg(feature = "parquet")]
mod parquet;
mod parsed;
mod policy;
mod problem;
mod rates;
mod raw;
mod reader;
mod replaced;
mod resample;
mod row_checker;
mod run;
mod sample;
mod settings;
mod shift;
mod sketch;
mod spikes;
mod stale;
mod standstill;
mod start;
mod stretch;
mod stuck;
mod survey;
mod table;
mod thinned;
mod tracks;
mod unmeasured;
mod window;
mod wrapped;

pub use bridge::Bridged;
pub(crate) use columns::UNITS;
pub use columns::{Assignment, AssignmentError, Quantity, ValuesFrom, file_unit};
pub use logs::{FileReport, Logs, MissingRows};
pub(crate) use noise_levels::NoiseLevels;
pub use parsed::ParsedFiles;
pub use policy::{Checks, Gaps, Policies, Policy};
pub use problem::{DataError, Fault, Problem, Problems};
pub use raw::{RawLog, RawRow};
pub use run::{Join, Run};
pub use sample::{Measured, STATES, Sample, Spikes};
pub use settings::{Decision, Settings};
pub use sketch::Sketch;
pub use standstill::{Differences, Encoder, context as rest_context, resting};
pub use table::{Decimal, Format, Header, Separator};
pub use tracks::{Track, tracks};
pub use wrapped::Wrapped;
