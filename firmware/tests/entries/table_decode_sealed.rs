//! Payloads of table files.
#![allow(clippy::unwrap_used)]

use firmware::contract::{TableError, decode};

/// Bytes before the payload of a table, and of the checksum after it.
const HEADER: usize = 52;
const CHECKSUM: usize = 4;

/// A payload of any bytes under a header and a checksum that are right: the decoder itself is reached.
pub(crate) fn table_decode_sealed(payload: &[u8]) {
    let mut bytes = Vec::with_capacity(HEADER + payload.len() + CHECKSUM);
    bytes.extend_from_slice(b"STILLPT\0");
    bytes.extend_from_slice(&[2, 0, 8, 2, 2, 0, 0, 0]);
    bytes.extend_from_slice(&[7; 32]);
    bytes.extend_from_slice(&(payload.len() as u32).to_le_bytes());
    bytes.extend_from_slice(payload);
    let shift = |sum: u32, _| if sum & 1 == 1 { (sum >> 1) ^ 0xedb8_8320 } else { sum >> 1 };
    let sum = !bytes.iter().fold(u32::MAX, |sum, byte| (0..8).fold(sum ^ u32::from(*byte), shift));
    bytes.extend_from_slice(&sum.to_le_bytes());
    let decoded = decode::<f64, 2, 1, 1>(&bytes);
    assert!(!matches!(decoded, Err(TableError::Checksum { .. })), "sealed");
    if let Ok(table) = decoded {
        table.validate().unwrap();
    }
}
