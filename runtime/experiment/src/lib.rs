//! Experiments with a robot: [`excite`] finds trajectories that excite its base parameters within
//! its limits, [`reach`] how far each coordinate can go, [`simulate`] moves a closed chain with
//! friction, control and sensors and writes the log of it. [`instruments`] identifies a robot by
//! instruments from its simulated motion. [`trajectory`] is the file that
//! trajectories are kept in.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.
#![allow(
    clippy::doc_markdown,
    reason = "A_e and qdd_i are formulas, written as in the equations"
)]

pub mod excite;
pub mod instruments;
pub mod reach;
pub mod simulate;
pub mod trajectory;
