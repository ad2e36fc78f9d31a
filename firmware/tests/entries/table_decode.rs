//! Table files.
#![allow(clippy::unwrap_used)]

use firmware::contract::decode;

/// A table file of any bytes: refused or valid, never a panic.
pub(crate) fn table_decode(bytes: &[u8]) {
    if let Ok(table) = decode::<f64, 2, 1, 1>(bytes) {
        table.validate().unwrap();
    }
    if let Ok(table) = decode::<f32, 2, 1, 1>(bytes) {
        table.validate().unwrap();
    }
}
