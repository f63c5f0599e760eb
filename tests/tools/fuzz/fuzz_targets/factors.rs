//! Inputs for [`regen_fuzz::factors`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::factors(input));
