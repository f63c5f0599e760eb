//! Inputs for [`regen_fuzz::bag`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::bag(input));
