//! Experiments with a robot: [`excite`] finds trajectories that excite its base parameters within
//! its limits, [`reach`] computes the range of each coordinate, and [`simulate`] integrates a
//! closed-loop mechanism with friction, controllers, drives and sensors, and returns its log.
//! [`closed_loop`] simulates the loop of a run with an estimate, [`instruments`] identifies a robot
//! by instrumental variables from its smoothed or simulated motion, and [`trajectory`] reads and
//! writes trajectory files.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.
#![allow(
    clippy::doc_markdown,
    reason = "A_e and qdd_i are formulas, written as in the equations"
)]

pub mod closed_loop;
pub mod excite;
pub mod instruments;
pub mod reach;
pub mod simulate;
pub mod trajectory;
