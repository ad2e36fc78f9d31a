//! What can be wrong with a scene file, pointed at where it is wrong.

use miette::{Diagnostic, NamedSource, SourceSpan};
use std::ops::Range;
use std::sync::Arc;

/// A scene that cannot be used: one message with file, line and column, and what to do about it.
#[derive(Debug, Clone, thiserror::Error, Diagnostic)]
#[error("{file}:{line}:{column}: {message}")]
pub struct SceneError {
    /// Path as the user gave it.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// What is wrong.
    pub message: String,
    /// What to do.
    #[help]
    pub help: String,
    /// The file's text, for the excerpt.
    #[source_code]
    pub source_text: Arc<NamedSource<String>>,
    /// The part of the text that is at fault.
    #[label("here")]
    pub at: SourceSpan,
}

/// The text of a scene file, to build errors from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) file: &'a str,
    pub(crate) text: &'a str,
}

impl Source<'_> {
    pub(crate) fn error(self, span: Range<usize>, message: impl Into<String>, help: impl Into<String>) -> SceneError {
        let start = span.start.min(self.text.len());
        let before = &self.text[..self.text.floor_char_boundary(start)];
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        SceneError {
            file: self.file.to_owned(),
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            message: message.into(),
            help: help.into(),
            source_text: Arc::new(NamedSource::new(self.file, self.text.to_owned())),
            at: (start, span.end.min(self.text.len()).saturating_sub(start)).into(),
        }
    }
}

/// An index that none of the scene's paddles has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the scene has no paddle {index}: choose one of {known}")]
pub struct NoSuchPaddle {
    /// The index.
    pub index: u32,
    /// Those that there are.
    pub known: String,
}

impl NoSuchPaddle {
    /// The place of an index among those that there are.
    pub(super) fn find(index: u32, mut all: impl Iterator<Item = u32> + Clone) -> Result<usize, Self> {
        let known = || all.clone().map(|index| index.to_string()).collect::<Vec<_>>().join(", ");
        let error = Self { index, known: known() };
        all.position(|other| other == index).ok_or(error)
    }
}
