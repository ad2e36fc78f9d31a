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

/// Letters in which a name may differ from the one that it was meant for.
const LETTERS: usize = 2;

/// The name that a word was meant for: a letter or two differ, of at least three times as many.
pub(crate) fn nearest<'n>(word: &str, names: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    let word = word.to_lowercase();
    let distances = names.into_iter().map(|name| (strsim::osa_distance(&word, &name.to_lowercase()), name));
    let (distance, name) = distances.min_by_key(|near| near.0)?;
    (distance <= LETTERS && 3 * distance <= word.chars().count()).then_some(name)
}

/// Sections without which there is no scene, and what they say at least.
const SECTIONS: [(&str, &str); 7] = [
    ("scene", "with a `name`"),
    ("domain", "with the `outline` of the body (in space a `box`, a `solid` or a file)"),
    ("material", "with a `model` and its moduli (`model-offline materials` lists some)"),
    ("immobile", "with what holds the body"),
    ("needle", "with the tissue that it moves, its `axis` and its `depth`"),
    ("target", "with a `position`"),
    ("discretization", "e.g. with `tolerance = 0.02`"),
];

/// What the parser says, in words of people, and what to do: with the key or the word that was meant, where one is near.
fn parsed(message: &str, schema: &str) -> (String, String) {
    let words = [
        ("expected u32", "expected a whole number from 0 to 4294967295"),
        ("expected usize", "expected a whole number, 0 or more"),
        ("expected i32", "expected a whole number"),
        ("expected f64", "expected a number"),
    ];
    let told = words.iter().fold(message.to_owned(), |told, (from, to)| told.replace(from, to));
    let told = match told.split_once("expected struct ") {
        Some((before, _)) => format!("{before}expected a table"),
        None => told,
    };
    let mut names = message.split('`').skip(1).step_by(2);
    if message.starts_with("missing field")
        && let Some(section) = names.next()
        && let Some((_, example)) = SECTIONS.iter().find(|(name, _)| *name == section)
    {
        let help =
            format!("add it, {example}; `{schema}` has every key, and `model-offline new` a scene to start from");
        return (format!("the section [{section}] is missing"), help);
    }
    let mut names = message.split('`').skip(1).step_by(2);
    let is_unknown = message.starts_with("unknown ");
    let meant = names.next().filter(|_| is_unknown).and_then(|word| nearest(word, names));
    let meant = meant.map_or_else(String::new, |name| format!("did you mean `{name}`? "));
    (told, format!("{meant}see `{schema}` for every key, its type and its meaning"))
}

/// The text of a scene file, to build errors from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) file: &'a str,
    pub(crate) text: &'a str,
}

impl Source<'_> {
    /// What the parser refuses; `schema` is the command that tells what a scene may say.
    pub(crate) fn refused(self, error: &toml::de::Error, schema: &str) -> SceneError {
        let (message, help) = parsed(error.message(), schema);
        self.error(error.span().unwrap_or(0..0), message, help)
    }

    /// Line and column of a byte of the text, both from 1, the latter in characters.
    pub(crate) fn line_and_column(self, byte: usize) -> (usize, usize) {
        let before = &self.text[..self.text.floor_char_boundary(byte.min(self.text.len()))];
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }

    pub(crate) fn error(self, span: Range<usize>, message: impl Into<String>, help: impl Into<String>) -> SceneError {
        let start = span.start.min(self.text.len());
        let (line, column) = self.line_and_column(start);
        let end = span.end.clamp(start, self.text.len());
        let (shown, at) = excerpt(self.text, start..end);
        SceneError {
            file: self.file.to_owned(),
            line,
            column,
            message: message.into(),
            help: help.into(),
            source_text: Arc::new(NamedSource::new(self.file, shown)),
            at: (at.start, at.len()).into(),
        }
    }
}

/// Bytes of a line that are shown whole, and of a longer one on either side of what is at fault.
const LONGEST: usize = 240;
const BESIDE: usize = 80;
const CUT: &str = " … ";

/// The text with its long lines cut, and where in it the part at fault is: a mesh of a line would fill screens.
fn excerpt(text: &str, fault: Range<usize>) -> (String, Range<usize>) {
    let (mut shown, mut at, mut begin) = (String::new(), 0..0, 0);
    for line in text.split_inclusive('\n') {
        let (before, end) = (shown.len(), begin + line.len());
        let is_here = (begin..end).contains(&fault.start) || (end == text.len() && fault.start == end);
        let from = if is_here { fault.start - begin } else { 0 };
        let kept = if line.len() > LONGEST {
            let first = line.floor_char_boundary(from.saturating_sub(BESIDE));
            let last = line.ceil_char_boundary((from.max(first) + BESIDE).min(line.len()));
            shown.push_str(if first > 0 { CUT } else { "" });
            shown.push_str(line[first..last].trim_end_matches('\n'));
            shown.push_str(if last < line.len() { CUT } else { "" });
            shown.push_str(if line.ends_with('\n') { "\n" } else { "" });
            first..last
        } else {
            shown.push_str(line);
            0..line.len()
        };
        if is_here {
            let lead = if kept.start > 0 { CUT.len() } else { 0 };
            let start = before + lead + from - kept.start;
            let length = if kept.len() < line.len() { fault.len().min(kept.end - from) } else { fault.len() };
            at = start..start + length;
        }
        begin = end;
    }
    let end = at.end.min(shown.len());
    (shown, at.start..end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_meant_is_named_where_it_is_near() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Section {
            #[expect(dead_code, reason = "only read")]
            tolerance: Option<f64>,
            #[expect(dead_code, reason = "only read")]
            index: Option<u32>,
        }
        let refused = |text: &str| {
            let error =
                Source { file: "mine.toml", text }.refused(&toml::from_str::<Section>(text).unwrap_err(), "schema");
            (error.message, error.help)
        };
        for (text, name) in [("tolerence = 1", "tolerance"), ("Index = 1", "index"), ("idnex = 1", "index")] {
            let (message, help) = refused(text);
            assert!(
                message.contains("unknown field") && help.starts_with(&format!("did you mean `{name}`? see")),
                "{help}"
            );
        }
        // Nothing is near, and what is wrong is no name.
        for text in ["spacing = 1", "id = 1", "index = -1", "tolerance = \"index\""] {
            assert!(refused(text).1.starts_with("see `schema`"), "{:?}", refused(text));
        }
        for section in SECTIONS {
            let (message, help) = parsed(&format!("missing field `{}`", section.0), "schema");
            assert_eq!(message, format!("the section [{}] is missing", section.0));
            assert!(help.contains(section.1) && help.contains("`schema`"), "{help}");
        }
        assert_eq!(parsed("missing field `depth`", "schema").0, "missing field `depth`");
        assert!(refused("index = -1").0.contains("expected a whole number from 0 to"), "{:?}", refused("index = -1"));
        assert!(refused("tolerance = \"a\"").0.contains("expected a number"), "{:?}", refused("tolerance = \"a\""));
    }

    #[test]
    fn long_lines_are_cut_around_what_is_at_fault() {
        let long = format!("box = {}é wrong é{}", "1, ".repeat(10_000), "2, ".repeat(10_000));
        let text = format!("first\n{long}\n{}\nlast wrong", "x".repeat(5_000));
        for start in [text.find("wrong").unwrap(), text.rfind("wrong").unwrap()] {
            let (shown, at) = excerpt(&text, start..start + 5);
            assert_eq!(&shown[at], "wrong");
            assert!(shown.len() < 700 && shown.lines().count() == 4, "{} {}", shown.len(), shown.lines().count());
        }
        let (shown, at) = excerpt(&text, text.len()..text.len());
        assert_eq!(at, shown.len()..shown.len());
        // What spans lines, and short texts, stay.
        let short = "a = 1\nb = [\n2]\n";
        assert_eq!(excerpt(short, 10..14), (short.to_owned(), 10..14));
        assert_eq!(excerpt("", 0..0), (String::new(), 0..0));
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
