//! What simulated loops do, and how closely one looks.

/// What a simulated loop does in the long run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Behaviour {
    /// The error dies out.
    Settles,
    /// The error stays, bounded by the actuator's limits.
    Cycles,
    /// The error grows.
    Diverges,
}

impl Behaviour {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Settles => "settles",
            Self::Cycles => "cycles",
            Self::Diverges => "diverges",
        }
    }
}

/// How wide the cells are that are simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// For a look.
    Quick,
    /// For numbers.
    Fine,
}
