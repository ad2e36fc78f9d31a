//! Proptest calls the same entry with the same kinds of bytes, see `firmware/tests/entries/mod.rs`.
#![no_main]

#[path = "../../tests/entries/step.rs"]
mod step;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| step::step(bytes));
