//! Words of a text file, with the lines they stand in.

use super::error::{Place, ReadError};

/// The bytes of a text and how far they are read.
#[derive(Debug, Clone)]
pub(crate) struct Words<'a> {
    format: &'static str,
    bytes: &'a [u8],
    at: usize,
    line: usize,
    /// Whether it is one line only, as messages say.
    is_line: bool,
}

impl<'a> Words<'a> {
    pub(crate) fn new(format: &'static str, bytes: &'a [u8]) -> Self {
        Self { format, bytes, at: 0, line: 1, is_line: false }
    }

    /// A text that begins in a later line of its file.
    pub(crate) fn from_line(format: &'static str, bytes: &'a [u8], line: usize) -> Self {
        Self { format, bytes, at: 0, line, is_line: false }
    }

    /// A line of a file.
    pub(crate) fn of_line(format: &'static str, bytes: &'a [u8], line: usize) -> Self {
        Self { format, bytes, at: 0, line, is_line: true }
    }

    /// What is wrong where the reading is.
    pub(crate) fn wrong(&self, what: impl Into<String>) -> ReadError {
        ReadError::broken(self.format, Place::Line(self.line), what)
    }

    /// The line that the reading is in, from 1.
    pub(crate) fn line_number(&self) -> usize {
        self.line
    }

    /// What is not read yet.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// The rest of the line, without its end; none at the end of the file.
    pub(crate) fn line(&mut self) -> Option<&'a [u8]> {
        let rest = Some(self.rest()).filter(|rest| !rest.is_empty())?;
        let length = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        self.at += (length + 1).min(rest.len());
        self.line += 1;
        Some(rest[..length].trim_ascii_end())
    }

    /// The next word; none at the end of the file.
    pub(crate) fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest();
        let blank = rest.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        self.line += rest[..blank].iter().filter(|byte| **byte == b'\n').count();
        let word = &rest[blank..];
        let length = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
        self.at += blank + length;
        Some(&word[..length]).filter(|word| !word.is_empty())
    }

    /// The next word, or what is missing.
    pub(crate) fn word(&mut self, wanted: &str) -> Result<&'a [u8], ReadError> {
        let ends = |words: &Self| match words.is_line {
            true => words.wrong(format!("the line ends where {wanted} is expected")),
            false => words.wrong(format!("the file ends where {wanted} is expected: it is cut off")),
        };
        self.next().ok_or_else(|| ends(self))
    }

    /// A word that has to stand here, in whatever case.
    pub(crate) fn expect(&mut self, wanted: &str) -> Result<(), ReadError> {
        let word = self.word(&format!("`{wanted}`"))?;
        if word.eq_ignore_ascii_case(wanted.as_bytes()) {
            Ok(())
        } else {
            Err(self.wrong(format!("`{wanted}` is expected, not {}", quoted(word))))
        }
    }

    /// A number of any kind.
    pub(crate) fn parse<T: std::str::FromStr>(&mut self, wanted: &str) -> Result<T, ReadError> {
        let word = self.word(wanted)?;
        parsed(word).ok_or_else(|| self.wrong(format!("{wanted} is expected, not {}", quoted(word))))
    }

    /// A finite number.
    pub(crate) fn coordinate(&mut self) -> Result<f64, ReadError> {
        let number: f64 = self.parse("a coordinate (a decimal number with a point)")?;
        if number.is_finite() { Ok(number) } else { Err(self.wrong(format!("a coordinate is {number}"))) }
    }
}

/// A word as a number; none where it is none.
pub(crate) fn parsed<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The beginning of a word as messages show it.
pub(crate) fn quoted(word: &[u8]) -> String {
    format!("{:?}", String::from_utf8_lossy(word).chars().take(40).collect::<String>())
}
