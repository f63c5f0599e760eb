//! Inputs for [`regen_fuzz::derive`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::derive(input));
