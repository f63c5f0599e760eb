//! Inputs for [`regen_fuzz::c`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::c(input));
