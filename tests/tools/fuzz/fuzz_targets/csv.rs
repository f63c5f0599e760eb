//! Inputs for [`regen_fuzz::csv`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::csv(input));
