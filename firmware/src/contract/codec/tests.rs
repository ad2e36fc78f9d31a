//! Round trips, and refusal of everything damaged.

use std::{string::ToString, vec::Vec};

use nalgebra::Matrix2;

use super::super::{Field, example};
use super::*;

fn encoded<T: Scalar>(table: &Table<T>) -> Vec<u8> {
    let mut buffer = std::vec![0; MAX_TABLE_BYTES];
    let length = encode(table, &mut buffer).unwrap();
    buffer.truncate(length);
    buffer
}

/// `bytes` with a checksum that matches again.
fn resealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let covered = bytes.len() - CHECKSUM_BYTES;
    let checksum = CRC.checksum(&bytes[..covered]).to_le_bytes();
    bytes[covered..].copy_from_slice(&checksum);
    bytes
}

fn refusal(bytes: &[u8]) -> TableError {
    decode::<f64, 2, 1, 1>(bytes).unwrap_err()
}

#[test]
fn round_trip_in_both_precisions() {
    let table = example::table();
    let single = table.cast::<f32>();
    assert_eq!(decode::<f64, 2, 1, 1>(&encoded(&table)).unwrap(), table);
    assert_eq!(decode::<f32, 2, 1, 1>(&encoded(&single)).unwrap(), single);
    let header = Header::read(&encoded(&single)).unwrap();
    assert_eq!((header.scalar, header.dimension, header.paddle_dof), (ScalarKind::F32, 2, 2));
    assert_eq!(header.scene_hash, table.scene_hash);
}

#[test]
fn payloads_are_read_as_derived_decoders_would() {
    let bytes = encoded(&example::table());
    let payload = &bytes[HEADER_BYTES..bytes.len() - CHECKSUM_BYTES];
    let derived = Table { scene_hash: example::table().scene_hash, ..postcard::from_bytes(payload).unwrap() };
    assert_eq!(decode::<f64, 2, 1, 1>(&bytes).unwrap(), derived);
}

#[test]
fn a_table_read_in_place_has_everything_but_labels() {
    let mut table = std::boxed::Box::new(Table::empty());
    decode_into::<f64, 2, 1, 1>(&encoded(&example::table()), &mut table).unwrap();
    let Table { units, tissue, .. } = Table::<f64>::empty();
    assert_eq!(*table, Table { units, tissue, ..example::table() });
}

#[test]
fn a_table_read_in_place_with_its_labels_is_the_whole_table() {
    let mut table = std::boxed::Box::new(Table::empty());
    let good = encoded(&example::table());
    decode_labelled_into::<f64, 2, 1, 1>(&good, &mut table).unwrap();
    assert_eq!(*table, example::table());
    assert!(decode_labelled_into::<f64, 2, 1, 1>(&good[1..], &mut table).is_err());
    assert!(table.knots.is_empty(), "what is refused leaves no table behind");
}

#[test]
fn the_largest_table_fits() {
    let mut table = example::table();
    let last = table.knots.last().unwrap().clone();
    while let Ok(()) = table.knots.push(last.clone()) {}
    for (index, knot) in table.knots.iter_mut().enumerate() {
        knot.depth = index as f64;
    }
    table.validity.depth_end = 255.0;
    assert_eq!(decode::<f64, 2, 1, 1>(&encoded(&table)).unwrap(), table);
}

#[test]
fn every_single_bit_flip_is_refused() {
    let mut bytes = encoded(&example::table());
    for bit in 0..8 * bytes.len() {
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(decode::<f64, 2, 1, 1>(&bytes).is_err(), "bit {bit}");
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
}

#[test]
fn a_flipped_payload_with_a_right_checksum_never_panics() {
    let bytes = encoded(&example::table());
    for bit in 8 * HEADER_BYTES..8 * (bytes.len() - CHECKSUM_BYTES) {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        if let Ok(table) = decode::<f64, 2, 1, 1>(&resealed(flipped)) {
            table.validate().unwrap();
        }
    }
}

#[test]
fn every_truncation_and_any_tail_is_refused() {
    let bytes = encoded(&example::table());
    for length in 0..bytes.len() {
        assert!(decode::<f64, 2, 1, 1>(&bytes[..length]).is_err(), "length {length}");
    }
    for missing in [1, 7, bytes.len() - HEADER_BYTES - CHECKSUM_BYTES] {
        assert_eq!(refusal(&bytes[..bytes.len() - missing]), TableError::Truncated { missing });
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert_eq!(refusal(&longer), TableError::TrailingBytes { extra: 1 });
    // A tail inside the checksum: the payload itself is longer than a table.
    let mut padded = bytes;
    let payload = u32::from_le_bytes(*padded[48..].first_chunk().unwrap());
    padded[48..52].copy_from_slice(&(payload + 1).to_le_bytes());
    padded.push(0);
    assert_eq!(refusal(&resealed(padded)), TableError::PayloadTrailing { extra: 1 });
}

#[test]
fn header_refusals_are_typed() {
    let bytes = encoded(&example::table());
    let with = |offset: usize, value: u8| {
        let mut changed = bytes.clone();
        changed[offset] = value;
        refusal(&resealed(changed))
    };
    assert_eq!(with(0, b'X'), TableError::NotATable);
    assert_eq!(with(8, 9), TableError::FormatVersion { found: 9 });
    assert_eq!(with(10, 5), TableError::UnknownScalar { found: 5 });
    assert_eq!(with(10, 4), TableError::ScalarKind { found: ScalarKind::F32, expected: ScalarKind::F64 });
    assert_eq!(with(11, 3), TableError::Dimension { found: 3, expected: 2 });
    assert_eq!(with(12, 4), TableError::PaddleDof { found: 4, expected: 2 });
    assert_eq!(with(14, 1), TableError::Reserved);
    assert_eq!(refusal(&[]), TableError::TooShort { bytes: 0 });
    assert_eq!(with(8, 1), TableError::FormatVersion { found: 1 }, "before space");
    assert!(with(8, 1).to_string().contains("model-offline table SCENE -o FILE"));
}

/// The table after `change` in place of a good one: what the writer says.
fn invariant(change: impl FnOnce(&mut Table<f64>)) -> TableError {
    let mut table = example::table();
    change(&mut table);
    let mut buffer = std::vec![0; MAX_TABLE_BYTES];
    let refused = encode(&table, &mut buffer).unwrap_err();
    // A writer that does not validate is caught by the reader.
    let payload = postcard::to_slice(&table, &mut buffer[HEADER_BYTES..]).unwrap().len();
    let good = encoded(&example::table());
    let mut forged = good[..HEADER_BYTES].to_vec();
    forged[48..52].copy_from_slice(&(payload as u32).to_le_bytes());
    forged.extend_from_slice(&buffer[HEADER_BYTES..HEADER_BYTES + payload]);
    forged.extend([0; CHECKSUM_BYTES]);
    assert_eq!(decode::<f64, 2, 1, 1>(&resealed(forged)).unwrap_err(), refused);
    refused
}

#[test]
fn invariants_are_checked_by_writer_and_reader() {
    use TableError::*;
    let found = invariant(|t| t.knots.truncate(1));
    assert_eq!(found, TooFewKnots { found: 1 });
    assert_eq!(invariant(|t| t.knots.clear()), TooFewKnots { found: 0 });
    assert_eq!(invariant(|t| t.knots.swap(3, 4)), DepthOrder { knot: 4 });
    assert_eq!(invariant(|t| t.validity.depth_start = 0.01), DepthRange);
    assert_eq!(invariant(|t| t.orthogonal.x = 1.1), NotUnit { field: Field::OrthogonalDirection });
    assert_eq!(invariant(|t| t.needle_axis = t.orthogonal), NotOrthogonal);
    assert_eq!(invariant(|t| t.paddles[0].max_displacement = 1e-5), PathBeyondLimit { knot: 1 });
    assert_eq!(invariant(|t| t.paddles[0].max_displacement = 1.0), DisplacementRange);
    assert_eq!(invariant(|t| t.paddles[0].max_rate = 0.0), NotPositive { field: Field::PaddleRateLimit });
    for gain in [-0.25, 0.0, 1.0, 1.5] {
        assert_eq!(invariant(|t| t.gains.loop_gain = gain), Gains, "{gain}");
    }
    assert_eq!(invariant(|t| t.gains.lambda_max = 0.5), Gains);
    let nan = invariant(|t| t.knots[5].jacobian[0].m12 = f64::NAN);
    assert_eq!(nan, NotFinite { field: Field::KnotJacobian });
    for smallest in [0.0, 1e-12, 1e-6, 1e-4] {
        let jacobian = Matrix2::new(1.0, 0.0, 0.0, smallest);
        assert_eq!(invariant(|t| t.knots[2].jacobian = [jacobian]), IllConditioned { knot: 2 });
    }
}

#[test]
fn a_small_buffer_is_an_error() {
    let table = example::table();
    let length = encoded(&table).len();
    for bytes in 0..length {
        let mut buffer = std::vec![0; bytes];
        assert_eq!(encode(&table, &mut buffer), Err(TableError::BufferTooSmall { bytes }));
    }
}

/// `tests/planar.table` is the example table as version 2 of the format wrote it on 24 November 2026. After a change of
/// the format it is to be made again: from `encode(&example::table())`.
#[test]
fn the_format_is_that_of_the_file_in_the_examples() {
    let file = include_bytes!("../../../tests/planar.table");
    assert_eq!(encoded(&example::table()), file);
    assert_eq!(decode::<f64, 2, 1, 1>(file).unwrap(), example::table());
}
