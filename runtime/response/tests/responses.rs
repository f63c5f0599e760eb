//! Fits to responses and to efforts of simulated robots, whose parameters are known.
#![allow(clippy::unwrap_used, clippy::expect_used, missing_docs)]

regen_runtime::robot_model!("../../guide/fivebar/fivebar.yaml");
regen_runtime::robot_model!("responses/arm.yaml");

#[path = "responses/exact.rs"]
mod exact;
#[path = "responses/twin.rs"]
mod twin;
