//! Fits to responses and to efforts of simulated robots, whose parameters are known.
#![allow(clippy::unwrap_used, clippy::expect_used)]

/// A model, to be compiled once for all tests.
mod models {
    #![allow(missing_docs)]
    regen_runtime::robot_model!("../../guide/fivebar/fivebar.yaml");
    regen_runtime::robot_model!("responses/picker_asymmetric.yaml");
    regen_runtime::robot_model!("responses/arm.yaml");
}

#[path = "responses/efforts.rs"]
mod efforts;
#[path = "responses/exact.rs"]
mod exact;
#[path = "responses/hard.rs"]
mod hard;
#[path = "responses/signals.rs"]
mod signals;
#[path = "responses/twin.rs"]
mod twin;
