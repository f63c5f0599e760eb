//! Physical feasibility: verdicts with proofs, identification under the constraints.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![cfg(feature = "feasibility")]

#[path = "feasibility/friction.rs"]
mod friction;
#[path = "feasibility/identified.rs"]
mod identified;
#[path = "feasibility/robots.rs"]
mod robots;
#[path = "feasibility/verdicts.rs"]
mod verdicts;
