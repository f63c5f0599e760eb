//! Results of the other libraries, as tables, as values to be serialised, and as pages for a
//! browser, each one HTML file that needs no network.
//!
//! | function | page |
//! |---|---|
//! | [`report`] | what was identified from logs: tables and figures of the motion, the forces, the parameters, friction, singular values and errors |
//! | [`inspected`] | what logs hold before anything is fitted: columns, curves, spectra, what they can identify |
//! | [`view::page`] | a mechanism in 3D, moving along a trajectory or swept coordinate by coordinate |
//! | [`results`] | no page: tables for people, and values for programs |
//! | [`documents`] | the schemas of these values as JSON |
//!
//! Nothing here writes a file: a page and its figures are returned as text.

mod charts;
pub mod documents;
mod error;
mod estimators;
mod figures;
mod gather;
mod identified;
mod inspected;
mod mechanics;
mod page;
mod residuals;
pub mod results;
mod summary;
pub mod view;

pub use charts::Figure;
pub use error::{ReportError, ViewError};
pub use identified::{Inputs, Report, report};
pub use inspected::inspected;
