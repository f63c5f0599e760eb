//! Inputs for [`regen_fuzz::parquet`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| regen_fuzz::parquet(input));
