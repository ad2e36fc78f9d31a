//! What outsiders can reach with bytes: a file per fuzz target. cargo-fuzz calls them under nightly, proptest in every
//! `cargo test`.

pub(crate) mod sample_decode;
pub(crate) mod step;
pub(crate) mod table_decode;
pub(crate) mod table_decode_sealed;
