//! Inputs for [`regen_fuzz::experiment`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::experiment(input));
