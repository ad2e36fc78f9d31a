//! Where the parts of a scene stand in its file, for what only a mesh shows to be wrong with them.

use crate::scene::error::Source;
use std::fmt;
use std::sync::Arc;

/// A place in the file of a scene; displayed as `file:line:column`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FilePlace {
    /// Path as the user gave it, or the name of a bundled scene.
    pub file: Arc<str>,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
}

impl FilePlace {
    /// The place of a byte of the scene's text.
    pub(super) fn of(source: Source<'_>, byte: usize) -> Self {
        let (line, column) = source.line_and_column(byte);
        Self { file: source.file.into(), line, column }
    }
}

impl fmt::Display for FilePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

/// Where the regions of a scene are given.
#[derive(Debug, Clone)]
pub struct PartsInFile {
    /// Regions of what is immobile, in their order; at least one.
    pub immobile: Vec<FilePlace>,
    /// The needle's contact.
    pub needle: FilePlace,
    /// Paddles, by their indices.
    pub paddles: Vec<(u32, FilePlace)>,
    /// Inclusions, in their order.
    pub inclusions: Vec<FilePlace>,
}

impl PartsInFile {
    /// The place of a paddle, by its index.
    pub fn paddle(&self, index: u32) -> Option<&FilePlace> {
        self.paddles.iter().find(|(other, _)| *other == index).map(|(_, place)| place)
    }
}
