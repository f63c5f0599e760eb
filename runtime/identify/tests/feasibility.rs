//! Tests of physical feasibility: verdicts with proofs, and identification under the constraints.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "feasibility/completions.rs"]
mod completions;
#[path = "feasibility/friction.rs"]
mod friction;
#[path = "feasibility/friction_logs.rs"]
mod friction_logs;
#[path = "feasibility/identified.rs"]
mod identified;
#[path = "feasibility/intervals.rs"]
mod intervals;
#[path = "feasibility/optimum.rs"]
mod optimum;
#[path = "feasibility/outputs.rs"]
mod outputs;
#[path = "feasibility/problems.rs"]
mod problems;
#[path = "feasibility/robots.rs"]
mod robots;
#[path = "feasibility/scales.rs"]
mod scales;
#[path = "feasibility/verdicts.rs"]
mod verdicts;

#[allow(unreachable_pub, reason = "examples include the files too")]
mod models {
    include!("../../tests/models/slider_crank.rs");
    include!("../../tests/models/slider_crank_base.rs");
}
