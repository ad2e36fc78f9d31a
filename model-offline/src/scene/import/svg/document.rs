//! Drawings as XML documents, with what they declare themselves.

use super::super::ImportError;
use roxmltree::{Document, ParsingOptions};

/// What declares an entity; and bytes that all together may become at most: those of other programs are addresses.
const ENTITY: &str = "<!ENTITY";
const MOST_OF_ENTITIES: usize = 1 << 24;
/// Bytes before the value of an entity at most: its name, and what says where else it is.
const LONGEST_NAME: usize = 500;

/// A document, which may begin with a DOCTYPE, as those of many programs do. Nothing is fetched, and what would grow is refused before
/// it does: entities that hold elements or others, or are too long to be used so often.
pub(super) fn parsed(text: &str) -> Result<Document<'_>, ImportError> {
    let longest = text.match_indices(ENTITY).map(|(at, _)| length(&text[at + ENTITY.len()..])).max().unwrap_or(0);
    if longest.saturating_mul(text.matches('&').count().max(1)) > MOST_OF_ENTITIES {
        let what = "its entities hold elements or other entities, or are too long to be used so often: write out what they stand for";
        return Err(ImportError::Syntax { line: 1, what: what.to_owned() });
    }
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(text, options)
        .map_err(|error| ImportError::Syntax { line: error.pos().row as usize, what: error.to_string() })
}

/// Bytes of the value of an entity that is declared here; no number is large enough for one that holds others or elements, or where
/// no value begins or ends.
fn length(declared: &str) -> usize {
    let begins = declared.bytes().take(LONGEST_NAME).position(|byte| matches!(byte, b'"' | b'\''));
    let value = begins.and_then(|from| {
        let (quote, rest) = declared[from..].split_at(1);
        rest.find(quote).map(|to| &rest[..to])
    });
    let Some(value) = value else { return usize::MAX };
    let holds_more = value.contains('<') || value.match_indices('&').any(|(at, _)| !value[at..].starts_with("&#"));
    if holds_more { usize::MAX } else { value.len() }
}
