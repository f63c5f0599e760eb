//! Inputs for [`regen_fuzz::yaml`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::yaml(input));
