//! Numbers of the table format that its errors name.

/// Version of the table format. postcard cannot append fields compatibly, so every change of the payload bumps it.
pub const FORMAT_VERSION: u16 = 1;

/// A buffer of this size holds every encoded table of dimension 2 or 3.
pub const MAX_TABLE_BYTES: usize = 64 * 1024;
