//! Arrays of numbers in VTK's XML files: text, base64 or raw bytes, compressed or not.

use super::bytes::{Bytes, Kind};
use super::error::{Place, ReadError};
use super::words::parsed;
use flate2::read::ZlibDecoder;
use roxmltree::Node;
use std::io::Read as _;

pub(super) const FORMAT: &str = "VTU";
/// Bytes of an array at most, unpacked: corners of four million tetrahedra, and not all of the memory.
const MOST_BYTES: usize = 1 << 27;
/// Numbers of an array at most: those of one byte are eight times as large here.
const MOST_NUMBERS: usize = 1 << 25;

/// What is wrong with the file, at no place in particular: XML has no lines in what is read here.
pub(super) fn wrong(what: impl Into<String>) -> ReadError {
    ReadError::broken(FORMAT, Place::Whole, what)
}

/// How a file writes its arrays.
pub(super) struct Arrays<'a> {
    big: bool,
    /// Numbers that tell of lengths.
    header: Kind,
    compressed: bool,
    appended: Option<&'a [u8]>,
    /// Whether what is appended is base64.
    is_base64: bool,
}

impl<'a> Arrays<'a> {
    /// As the root says.
    pub(super) fn new(root: &Node<'_, '_>, appended: Option<&'a [u8]>) -> Result<Self, ReadError> {
        let header = match root.attribute("header_type") {
            None | Some("UInt32") => Kind::U32,
            Some("UInt64") => Kind::U64,
            Some(other) => return Err(wrong(format!("header_type {other:?} is neither UInt32 nor UInt64"))),
        };
        let compressed = match root.attribute("compressor") {
            None => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                let help = "save it compressed by zlib, or not at all";
                return Err(ReadError::unsupported(FORMAT, format!("it is compressed by {other}"), help));
            }
        };
        let encoding = root.children().find(|node| node.has_tag_name("AppendedData"));
        let is_base64 = encoding.and_then(|node| node.attribute("encoding")) == Some("base64");
        let big = root.attribute("byte_order") == Some("BigEndian");
        Ok(Self { big, header, compressed, appended, is_base64 })
    }

    /// All numbers of an array.
    pub(super) fn read(&self, array: &Node<'_, '_>) -> Result<Vec<f64>, ReadError> {
        let name = array.attribute("Name").unwrap_or("of points");
        let kind = kind(array.attribute("type").unwrap_or_default())
            .ok_or_else(|| wrong(format!("array {name:?} has a type that is not known")))?;
        // Keys may stand behind the numbers.
        let text: String = array.children().filter(Node::is_text).filter_map(|node| node.text()).collect();
        match array.attribute("format").unwrap_or("ascii") {
            "ascii" => {
                let number = |word: &str| {
                    parsed(word.as_bytes()).ok_or_else(|| wrong(format!("array {name:?}: {word:?} is no number")))
                };
                text.split_ascii_whitespace().map(number).collect()
            }
            "binary" => self.numbers(&base64(text.as_bytes(), name)?, kind, name),
            "appended" => {
                let offset = array.attribute("offset").and_then(|offset| offset.trim().parse::<usize>().ok());
                let from = offset.and_then(|offset| self.appended?.get(offset..));
                let from = from.ok_or_else(|| wrong(format!("array {name:?} has no offset in what is appended")))?;
                if self.is_base64 {
                    let end = from.iter().position(|byte| *byte == b'<').unwrap_or(from.len());
                    self.numbers(&base64(&from[..end], name)?, kind, name)
                } else {
                    self.numbers(from, kind, name)
                }
            }
            other => Err(wrong(format!("array {name:?} has the format {other:?}"))),
        }
    }

    /// Numbers behind a header that tells how many bytes they have.
    fn numbers(&self, bytes: &[u8], kind: Kind, name: &str) -> Result<Vec<f64>, ReadError> {
        let mut input = Bytes::new(FORMAT, bytes, 0, self.big);
        let unpacked;
        let data = if self.compressed {
            unpacked = self.unpacked(&mut input, name)?;
            unpacked.as_slice()
        } else {
            let length = self.length(&mut input)?;
            input.take(length)?
        };
        if data.len() % kind.size() != 0 {
            return Err(wrong(format!("array {name:?} ends within a number")));
        }
        if data.len() / kind.size() > MOST_NUMBERS {
            let what = format!("{} numbers of an array", data.len() / kind.size());
            return Err(ReadError::TooLarge { format: FORMAT, what, most: MOST_NUMBERS as u64 });
        }
        Ok(data.chunks_exact(kind.size()).map(|bytes| kind.number(bytes, self.big)).collect())
    }

    fn length(&self, input: &mut Bytes<'_>) -> Result<usize, ReadError> {
        let length = input.number(self.header)?;
        if length <= MOST_BYTES as f64 {
            return Ok(length as usize);
        }
        Err(ReadError::TooLarge {
            format: FORMAT,
            what: format!("{length} bytes of an array"),
            most: MOST_BYTES as u64,
        })
    }

    /// Blocks of zlib: how many, their length, that of the last, and those that they have packed.
    fn unpacked(&self, input: &mut Bytes<'_>, name: &str) -> Result<Vec<u8>, ReadError> {
        let blocks = self.length(input)?;
        self.length(input)?;
        self.length(input)?;
        if blocks > input.left() / self.header.size() {
            return Err(wrong(format!("array {name:?} has {blocks} blocks, more than its bytes can hold")));
        }
        let mut lengths = Vec::with_capacity(blocks);
        for _ in 0..blocks {
            lengths.push(self.length(input)?);
        }
        let mut all = Vec::new();
        for length in lengths {
            let left = (MOST_BYTES - all.len()) as u64;
            let packed = ZlibDecoder::new(input.take(length)?);
            let unpacked = packed.take(left + 1).read_to_end(&mut all);
            unpacked.map_err(|error| wrong(format!("array {name:?} cannot be unpacked: {error}")))?;
            if all.len() > MOST_BYTES {
                let what = format!("more than {MOST_BYTES} bytes of an array");
                return Err(ReadError::TooLarge { format: FORMAT, what, most: MOST_BYTES as u64 });
            }
        }
        Ok(all)
    }
}

/// VTK's names of numbers.
fn kind(name: &str) -> Option<Kind> {
    Some(match name {
        "Int8" => Kind::I8,
        "UInt8" => Kind::U8,
        "Int16" => Kind::I16,
        "UInt16" => Kind::U16,
        "Int32" => Kind::I32,
        "UInt32" => Kind::U32,
        "Int64" => Kind::I64,
        "UInt64" => Kind::U64,
        "Float32" => Kind::F32,
        "Float64" => Kind::F64,
        _ => return None,
    })
}

/// Bytes that base64 stands for. Header and data may be texts of their own, one behind the other, each padded.
fn base64(text: &[u8], name: &str) -> Result<Vec<u8>, ReadError> {
    let value = |byte: u8| match byte {
        b'A'..=b'Z' => Some(byte - b'A'),
        b'a'..=b'z' => Some(byte - b'a' + 26),
        b'0'..=b'9' => Some(byte - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let digits: Vec<u8> = text.iter().copied().filter(|byte| !byte.is_ascii_whitespace()).collect();
    let mut bytes = Vec::with_capacity(digits.len() / 4 * 3);
    for group in digits.chunks(4) {
        let kept = group.iter().position(|byte| *byte == b'=').unwrap_or(group.len());
        let values: Option<Vec<u8>> = group[..kept].iter().map(|byte| value(*byte)).collect();
        let values = values.filter(|values| values.len() > 1 && group.len() == 4);
        let values = values.ok_or_else(|| wrong(format!("array {name:?} is no base64, or is cut off")))?;
        let word = (0..4).fold(0_u32, |word, k| word << 6 | u32::from(values.get(k).copied().unwrap_or(0)));
        bytes.extend(&word.to_be_bytes()[1..values.len()]);
    }
    Ok(bytes)
}
