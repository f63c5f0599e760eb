//! Inputs for [`regen_fuzz::import`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::import(input));
