//! Exact numbers and expressions.
