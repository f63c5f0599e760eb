//! The tests are in `tests/`; nothing is exported.
