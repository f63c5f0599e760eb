//! Tests of signals and estimates against numpy and scipy, and of their properties.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "estimation/correlated.rs"]
mod correlated;
#[path = "estimation/properties.rs"]
mod properties;
#[path = "estimation/spectrum.rs"]
mod spectrum;
#[path = "estimation/vectors.rs"]
mod vectors;
