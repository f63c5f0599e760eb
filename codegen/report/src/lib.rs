//! Results of the other libraries, as tables, as values to be serialised, and as pages for a
//! browser, each one HTML file that needs no network.
//!
//! | function | page |
//! |---|---|
//! | [`report`] | an identified model: tables and figures of the motion, the forces, the parameters, friction, singular values and errors |
//! | [`inspected`] | logs before any fit: columns, curves, spectra, and what they can identify |
//! | [`calibrated`] | the geometry that fits measurements: residuals before and after, where the poses are, what was found |
//! | [`view::page`] | a mechanism in 3D, moving along a trajectory or swept coordinate by coordinate |
//! | [`results`] | no page: tables as text, and values for JSON |
//! | [`documents`] | the JSON schemas of these values |
//!
//! This package writes no files: pages and figures are returned as text.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.

mod calibrated;
mod charts;
pub mod documents;
mod error;
mod estimators;
mod figures;
mod gather;
mod identified;
mod inspected;
mod logs;
mod mechanics;
mod page;
mod residuals;
pub mod results;
mod summary;
pub mod view;

pub use calibrated::calibrated;
pub use charts::Figure;
pub use error::{ReportError, ViewError};
pub use identified::{Inputs, Report, report};
pub use inspected::inspected;
