//! Identifies the dynamic parameters of a robot from logs of its motion.
//!
//! The steps: [`data`] reads samples from a log, with the settings of an [`experiment_file`] if
//! there is one, [`signals`] differentiates them to states of motion, [`identify`] sets up the
//! equations in the base parameters, [`estimate`] reduces them to a QR factor and solves for the
//! parameters and their standard deviations. [`feasibility`] finds
//! parameters of bodies that can exist, [`friction`] fits nonlinear friction laws,
//! [`gains`] fits unknown gains of drives and payloads with the parameters,
//! [`identifiability`] computes which parameters a motion can identify, and [`intervals`] computes
//! confidence intervals of estimates under constraints, which no formula gives. [`observation`] is
//! the observation matrix as a whole, for small samples.
//!
//! The crate works on any [`BaseModel`](regen_runtime::BaseModel), generated or interpreted.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.
//!
//! # Features
//!
//! - `arrays`: reads logs from NPY, NPZ, MAT, HDF5, MDF 4 and TDMS files too.
//! - `parquet`: reads logs from Parquet files too, of every usual compression.
//! - `lapack-system`: the conic solver calls the dense routines of a BLAS and LAPACK that the
//!   program links.
#![allow(
    clippy::doc_markdown,
    reason = "A_e and qdd_i are formulas, written as in the equations"
)]

pub mod choice;
pub mod data;
mod document;
pub mod estimate;
pub mod experiment_file;
pub mod feasibility;
pub mod files;
pub mod friction;
pub mod gains;
pub mod identifiability;
pub mod identify;
pub mod intervals;
pub mod model;
pub mod observation;
mod qr_update;
pub mod session;
pub mod signals;
mod singular;
pub mod states;
pub mod status;
pub mod suspect;
pub mod text;
mod turned;

pub use model::IdentifiedModel;
pub use singular::SingularValues;
