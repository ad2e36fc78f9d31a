//! The strategies that are compared.

use crate::runtime::time::mode::RunMode;

/// What is done about the target's displacement, and, with a controller, what drives its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::Display, strum::IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Strategy {
    /// No paddle.
    None,
    /// The best static paddle, held.
    Static,
    /// The best dynamic paddle, moved by the controller in lockstep.
    Dynamic,
    /// The same on the machine's clock.
    DynamicFreeRun,
}

impl Strategy {
    /// In the order in which they are shown.
    pub const ALL: [Self; 4] = [Self::None, Self::Static, Self::Dynamic, Self::DynamicFreeRun];

    /// The dynamic paddle in one of its two modes.
    pub fn dynamic(mode: RunMode) -> Self {
        match mode {
            RunMode::Lockstep => Self::Dynamic,
            RunMode::FreeRun => Self::DynamicFreeRun,
        }
    }

    /// Name in files and in the page's identifiers.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// What a person reads.
    pub fn title(self) -> &'static str {
        match self {
            Self::None => "no paddle",
            Self::Static => "static",
            Self::Dynamic => "dynamic",
            Self::DynamicFreeRun => "dynamic, free-run",
        }
    }

    /// Whether a controller moves the paddle.
    pub fn has_controller(self) -> bool {
        matches!(self, Self::Dynamic | Self::DynamicFreeRun)
    }

    /// Whether its insertion depends on nothing but the seed: what the machine's clock drives is never the same twice.
    pub fn is_reproducible(self) -> bool {
        self != Self::DynamicFreeRun
    }
}
