//! Inputs for [`regen_fuzz::arrays`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::arrays(input));
