//! Words of an ASCII mesh or numbers of a binary one, one after the other.

use super::super::ImportError;

/// The bytes of a mesh and how far they are read. Nothing is stored by a count that stands in the file: every number
/// that is read is there.
pub(super) struct Input<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    pub(super) binary: bool,
}

impl<'a> Input<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 1, binary: false }
    }

    /// What is wrong where the reading is.
    pub(super) fn wrong(&self, what: impl Into<String>) -> ImportError {
        let what = what.into();
        if self.binary {
            ImportError::Binary { at: self.at, what }
        } else {
            ImportError::Syntax { line: self.line, what }
        }
    }

    fn ends(&self) -> ImportError {
        self.wrong("the file ends in the middle of a section: it is cut off")
    }

    /// The rest of the line.
    pub(super) fn line(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let length = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        self.at += (length + 1).min(rest.len());
        self.line += 1;
        Some(&rest[..length])
    }

    /// The name of the next section, its `$` left out.
    pub(super) fn section(&mut self) -> Option<String> {
        while let Some(line) = self.line() {
            let line = line.trim_ascii();
            if let Some(name) = line.strip_prefix(b"$")
                && name.len() < 40
                && name.iter().all(u8::is_ascii_alphanumeric)
            {
                return Some(String::from_utf8_lossy(name).into_owned());
            }
        }
        None
    }

    /// The end of a section whose contents were read: what is left over was not counted.
    pub(super) fn closes(&mut self, section: &str) -> Result<(), ImportError> {
        while let Some(line) = self.line() {
            let line = line.trim_ascii();
            if line.strip_prefix(b"$End") == Some(section.as_bytes()) {
                return Ok(());
            }
            if !line.is_empty() {
                let what =
                    format!("${section} has more in it than it counts: the count is wrong, or the file is damaged");
                return Err(self.wrong(what));
            }
        }
        Err(self.ends())
    }

    /// The next word of an ASCII section.
    pub(super) fn word(&mut self) -> Result<&'a str, ImportError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let blank = rest.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        self.line += rest[..blank].iter().filter(|byte| **byte == b'\n').count();
        let word = &rest[blank..];
        let length = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
        self.at += blank + length;
        if length == 0 {
            return Err(self.ends());
        }
        std::str::from_utf8(&word[..length]).map_err(|_| self.wrong("a number is expected, and this is no text"))
    }

    fn ascii<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, ImportError> {
        let word = self.word()?;
        let shown: String = word.chars().take(40).collect();
        word.parse().map_err(|_| self.wrong(format!("{what} is expected, not {shown:?}")))
    }

    /// So many bytes.
    pub(super) fn raw<const N: usize>(&mut self) -> Result<[u8; N], ImportError> {
        let found = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk::<N>()).copied();
        let found = found.ok_or_else(|| self.ends())?;
        self.at += N;
        Ok(found)
    }

    /// A whole number of four bytes.
    pub(super) fn int(&mut self) -> Result<i64, ImportError> {
        if self.binary { Ok(i32::from_le_bytes(self.raw()?).into()) } else { self.ascii("a whole number") }
    }

    /// A count or a number of a node, of eight bytes.
    pub(super) fn size(&mut self) -> Result<u64, ImportError> {
        if self.binary { Ok(u64::from_le_bytes(self.raw()?)) } else { self.ascii("a whole number") }
    }

    pub(super) fn number(&mut self) -> Result<f64, ImportError> {
        let number = if self.binary { f64::from_le_bytes(self.raw()?) } else { self.ascii("a number")? };
        if number.is_finite() { Ok(number) } else { Err(self.wrong("a coordinate is no finite number")) }
    }

    /// A count that stands in the text of a section, also of a binary file: it ends its line.
    pub(super) fn count(&mut self) -> Result<u64, ImportError> {
        let count = self.ascii("a count")?;
        if self.binary {
            self.line();
        }
        Ok(count)
    }

    /// After the header, the number 1 of a binary file: it tells the order of bytes.
    pub(super) fn order_of_bytes(&mut self) -> Result<(), ImportError> {
        match i32::from_le_bytes(self.raw()?) {
            1 => Ok(()),
            0x0100_0000 => Err(ImportError::Unsupported(
                "the mesh is binary with the most significant byte first: save it as ASCII, or on a common computer"
                    .into(),
            )),
            _ => Err(self.wrong("the number 1 is expected after the header of a binary mesh")),
        }
    }
}
