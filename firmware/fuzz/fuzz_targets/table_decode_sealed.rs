//! Proptest calls the same entry with the same kinds of bytes, see `firmware/tests/entries/mod.rs`.
#![no_main]

#[path = "../../tests/entries/table_decode_sealed.rs"]
mod table_decode_sealed;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| table_decode_sealed::table_decode_sealed(bytes));
