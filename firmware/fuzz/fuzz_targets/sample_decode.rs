//! Proptest calls the same entry with the same kinds of bytes, see `firmware/tests/entries/mod.rs`.
#![no_main]

#[path = "../../tests/entries/sample_decode.rs"]
mod sample_decode;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| sample_decode::sample_decode(bytes));
