//! See `firmware/tests/entries/mod.rs`, which proptest calls with the same bytes.
#![no_main]

// A target calls one entry of several.
#[allow(dead_code)]
#[path = "../../tests/entries/mod.rs"]
mod entries;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| entries::table_decode_sealed(bytes));
