//! Properties of everything that outsiders can reach with bytes; the same entries as the fuzz targets.

mod entries;

use proptest::prelude::*;

fn bytes(longest: usize) -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(any::<u8>(), 0..longest)
}

/// A good table with some bytes changed.
fn damaged() -> impl Strategy<Value = (Vec<u8>, usize)> {
    let mut good = vec![0; firmware::contract::MAX_TABLE_BYTES];
    let length = firmware::contract::encode(&entries::step::table(), &mut good).unwrap();
    good.truncate(length);
    let changes = prop::collection::vec((0..length, any::<u8>()), 0..8);
    (changes, 0..=length).prop_map(move |(changes, cut)| {
        let mut bytes = good.clone();
        changes.iter().for_each(|(place, value)| bytes[*place] = *value);
        (bytes, cut)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_refused_or_a_valid_table(bytes in bytes(4096)) {
        entries::table_decode::table_decode(&bytes);
        entries::table_decode_sealed::table_decode_sealed(&bytes);
    }

    #[test]
    fn a_damaged_table_is_refused_or_valid((bytes, cut) in damaged()) {
        entries::table_decode::table_decode(&bytes);
        entries::table_decode::table_decode(&bytes[..cut]);
        // Only the payload, sealed again.
        if bytes.len() > 56 {
            entries::table_decode_sealed::table_decode_sealed(&bytes[52..bytes.len() - 4]);
        }
    }

    #[test]
    fn any_bytes_are_a_frame_or_not(bytes in bytes(256)) {
        entries::sample_decode::sample_decode(&bytes);
    }

    #[test]
    fn any_inputs_keep_the_invariants(bytes in bytes(16_000)) {
        entries::step::step(&bytes);
    }
}

/// What the fuzz target `step` has found.
#[test]
fn inputs_that_once_broke_an_invariant_keep_them() {
    // A refused sample, then a good one whose number is right across the range.
    let found: &[u8] = &[
        0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0xd1, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51,
        0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51,
        0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
        0x51, 0x32, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x51, 0x33, 0x01,
        0x28, 0x29,
    ];
    entries::step::step(found);
}
