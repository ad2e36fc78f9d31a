//! What simulated loops do.

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
