//! Tables as CSV (RFC 4180), for all that writes or reads one.

use crate::reading;
pub use csv::Error as CsvError;
use serde::de::DeserializeOwned;
use std::path::Path;

/// A header and one line per item, as long as the header; fields that need quotes get them.
///
/// # Example
/// ```
/// use model_offline::output::csv::table;
///
/// let bytes = table(["depth", "what"], [(0.1, "needle, in"), (0.2, "out")], |(depth, what)| [depth.to_string(), what.to_owned()]);
/// assert_eq!(bytes, b"depth,what\n0.1,\"needle, in\"\n0.2,out\n");
/// ```
pub fn table<T, H: AsRef<[u8]>, L: IntoIterator<Item = String>>(
    header: impl IntoIterator<Item = H>,
    items: impl IntoIterator<Item = T>,
    line: impl Fn(T) -> L,
) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    // Memory takes everything.
    let _ = writer.write_record(header);
    for item in items {
        let _ = writer.write_record(line(item));
    }
    writer.into_inner().unwrap_or_default()
}

/// The rows of a file, with or without a line of names before them; lines that begin with `#` are left out.
///
/// # Errors
/// [`CsvError`] says in which line what cannot be read.
pub fn rows<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, CsvError> {
    let bytes = reading::read(path, reading::TEXT)?;
    let mut builder = csv::ReaderBuilder::new();
    let mut reader = builder.has_headers(false).comment(Some(b'#')).trim(csv::Trim::All).from_reader(&bytes[..]);
    let rows: Vec<Result<T, CsvError>> = reader.deserialize().collect();
    // Names are no row.
    let named = matches!(rows.first(), Some(Err(error)) if matches!(error.kind(), csv::ErrorKind::Deserialize { .. }));
    rows.into_iter().skip(usize::from(named)).collect()
}
