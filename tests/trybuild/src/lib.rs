//! The tests are in `tests/`; this package exports nothing.
