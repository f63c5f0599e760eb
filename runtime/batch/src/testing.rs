//! Models for tests.
#![allow(unreachable_pub, reason = "examples include the file too")]

include!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../tests/models/slider_crank.rs"
));
