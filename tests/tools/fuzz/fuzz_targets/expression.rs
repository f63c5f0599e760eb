//! Inputs for [`regen_fuzz::expression`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::expression(input));
