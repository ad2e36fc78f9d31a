//! How much of a study is run: all of it, or a first look.

/// How much of a study is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Every setting.
    Full,
    /// Few settings, for a first look.
    Quick,
}

impl Extent {
    /// What the command line asks for.
    pub fn of_flag(quick: bool) -> Self {
        if quick { Self::Quick } else { Self::Full }
    }

    /// The one or the other.
    pub(super) fn choose<T>(self, full: T, quick: T) -> T {
        match self {
            Self::Full => full,
            Self::Quick => quick,
        }
    }
}
