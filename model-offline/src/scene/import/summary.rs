//! What was taken from a file, what was left out and why.

use super::role::Role;
use std::fmt;

/// Lines of one kind that are shown; of more, the number is told.
const SHOWN: usize = 20;

/// A shape that has a place in the scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Taken {
    /// As what.
    pub role: Role,
    /// Which shape.
    pub from: String,
    /// What had to be done to it, or why it was taken.
    pub note: Option<String>,
}

/// A shape that has none.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// Which shape.
    pub what: String,
    /// Why.
    pub why: String,
}

/// What became of everything in a file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Summary {
    /// How the file's numbers became the scene's.
    pub notes: Vec<String>,
    /// What is in the scene.
    pub taken: Vec<Taken>,
    /// What is not.
    pub left_out: Vec<LeftOut>,
    /// What nothing in the file gives.
    pub suggested: Vec<&'static str>,
}

impl Summary {
    /// Asks about a name that is nearly another one.
    pub(super) fn ask(&mut self, told: &str, meant: Option<&str>) {
        if let Some(meant) = meant {
            self.note(format!("{told}: did you mean `{meant}` in its name?"));
        }
    }

    pub(super) fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }

    pub(super) fn take(&mut self, role: Role, from: &str, note: Option<String>) {
        self.taken.push(Taken { role, from: from.to_owned(), note });
    }

    pub(super) fn leave(&mut self, what: &str, why: impl Into<String>) {
        self.left_out.push(LeftOut { what: what.to_owned(), why: why.into() });
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for note in &self.notes {
            writeln!(f, "{note}")?;
        }
        let taken = self.taken.iter().map(|Taken { role, from, note }| {
            let note = note.as_ref().map_or_else(String::new, |note| format!(" ({note})"));
            format!("{role} ← {from}{note}")
        });
        let left_out = self.left_out.iter().map(|LeftOut { what, why }| format!("{what}: {why}"));
        for (title, lines) in [("taken", taken.collect::<Vec<_>>()), ("left out", left_out.collect())] {
            for line in lines.iter().take(SHOWN) {
                writeln!(f, "{title}: {line}")?;
            }
            if lines.len() > SHOWN {
                writeln!(f, "{title}: {} more", lines.len() - SHOWN)?;
            }
        }
        if !self.suggested.is_empty() {
            writeln!(f, "suggested, as nothing gives them: {}", self.suggested.join(", "))?;
        }
        Ok(())
    }
}
