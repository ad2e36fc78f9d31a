//! Files that are read to their end: of none more than its kind may have, because a device or a pipe may have no end.

use std::fs::File;
use std::io::{Error, ErrorKind, Read as _, Result};
use std::path::Path;

/// What scenes, tables, lists, drawings and results may be long, bytes.
pub const TEXT: u64 = 256 << 20;
/// What scans and meshes may be long, bytes.
pub const DATA: u64 = 2 << 30;

/// All bytes of a file of at most so many.
///
/// # Errors
/// As of any reading; [`ErrorKind::FileTooLarge`] where there are more, after no more than these have been read.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    let too_long = || {
        let unit = if most < 1 << 20 { "bytes" } else { "MiB" };
        let most = if most < 1 << 20 { most } else { most >> 20 };
        Error::new(ErrorKind::FileTooLarge, format!("longer than {most} {unit}, the most that is read of such a file"))
    };
    if length > most {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(length as usize)?;
    file.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(too_long()) } else { Ok(bytes) }
}

/// The same of what must be text.
///
/// # Errors
/// As [`read`]; [`ErrorKind::InvalidData`] where it is no UTF-8.
pub fn read_text(path: &Path, most: u64) -> Result<String> {
    String::from_utf8(read(path, most)?).map_err(|error| Error::new(ErrorKind::InvalidData, error.utf8_error()))
}

/// The same of what may be as long as it is, such as a recording of many hours: of what has no length of its own, a device or
/// a pipe, [`DATA`].
///
/// # Errors
/// As [`read`].
pub fn read_of_any_length(path: &Path) -> Result<Vec<u8>> {
    let is_file = std::fs::metadata(path)?.is_file();
    read(path, if is_file { u64::MAX - 1 } else { DATA })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_is_read_than_a_file_may_have() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ten");
        std::fs::write(&path, b"0123456789").unwrap();
        assert_eq!(read(&path, 10).unwrap(), b"0123456789");
        assert_eq!(read_of_any_length(&path).unwrap(), read(&path, 11).unwrap());
        assert_eq!(read_text(&path, 10).unwrap(), "0123456789");
        for (path, most) in [(path.as_path(), 9), (Path::new("/dev/zero"), 1000), (Path::new("/dev/zero"), 3 << 20)] {
            let error = read(path, most).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::FileTooLarge, "{error}");
        }
        // As long as it says, and nothing in it: no byte of it is read.
        File::create(&path).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(
            read(&path, DATA).unwrap_err().to_string(),
            "longer than 2048 MiB, the most that is read of such a file"
        );
        std::fs::write(&path, [0xff, 0xfe]).unwrap();
        assert_eq!(read_text(&path, 10).unwrap_err().kind(), ErrorKind::InvalidData);
        assert_eq!(read(&folder.path().join("none"), 10).unwrap_err().kind(), ErrorKind::NotFound);
    }
}
