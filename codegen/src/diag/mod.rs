//! Errors with places.
