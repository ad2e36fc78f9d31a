//! Numbers of the table format that its errors name.

/// Version of the table format. postcard cannot append fields compatibly, so every change of the payload bumps it.
///
/// Version 1 knew the plane and one paddle only.
pub const FORMAT_VERSION: u16 = 2;

/// A buffer of this size holds every encoded table: 256 knots in f64 with two paddles in space take 82 KB.
pub const MAX_TABLE_BYTES: usize = 96 * 1024;
