//! Results as tables of at most 80 columns for people, and as values to be serialised for programs.
//!
//! ```
//! # use regen_codegen::{diag::Source, pipeline};
//! # let text = "\
//! # name: arm
//! # limbs:
//! #   - name: arm
//! #     joints:
//! #       - {name: q1, type: revolute, body: link, actuated: true}
//! # ";
//! use regen_report::results;
//!
//! let robot = pipeline::derive(&Source::new("arm.yaml", text))?;
//! assert!(results::info_text(&robot).contains("independent"));
//! let json = serde_json::to_value(results::info(&robot))?;
//! assert_eq!(json["dof"], 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod base;
mod calibration;
mod excitation;
mod explanation;
mod identification;
mod info;
mod inspection;
mod observation;
mod rehearsal;

pub use base::{BaseJson, BaseSummary, base, base_lines, base_summary};
pub use calibration::{
    Calibrated, ChosenPoses, Compared, FixedNumber, FoundNumber, Instrument, MeasuredFit,
    calibrated_text, chosen_text,
};
pub(crate) use calibration::{
    combinations, facts as calibration_facts, group_name, measured_rows, stays as calibration_stays,
};
pub use excitation::{Excited, excited_text};
pub use explanation::{ExplanationJson, explanation, explanation_text};
pub use identification::{
    BiasRemedy, EffortSummary, EffortsOfLogs, Identification, Instruments, LOCK_JOINTS, LogFile,
    ModelErrors, READ_AS_POSES, ReductionStep, Rounds, Search, Simulated, Summary, Suspected,
    coarse_friction, corrected_delays_text, doubts_of_log, error_percent, filter_text,
    identification_text, noise_alone, noisy_accelerations, notes_of_logs, reduction_steps, resting,
    states_delays, stem, too_few, too_short, unexplained,
};
pub(crate) use identification::{Field, choice_fields, delay_fields};
pub use info::{Info, info, info_text};
pub use inspection::{Inspection, inspection_text};
pub use observation::{Observed, observed_text};
pub use rehearsal::{Rehearsed, rehearsed_text};
