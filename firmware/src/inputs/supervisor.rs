//! The rule that leads from fault codes to a state.

use crate::contract::{Faults, Mode};

/// Remembers what SAFE was entered for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Supervisor {
    latched: Faults,
}

impl Supervisor {
    /// Mode for the faults of this tick; latching ones stay.
    pub(crate) fn decide(&mut self, faults: Faults) -> Mode {
        if !faults.intersection(Faults::LATCHING).is_empty() {
            // With which paddle it was, if it was one.
            self.latched |= faults.intersection(Faults::LATCHING | Faults::SECOND_PADDLE);
        }
        if !self.latched.is_empty() {
            Mode::Safe
        } else if !faults.intersection(Faults::HOLDING).is_empty() {
            Mode::Hold
        } else {
            Mode::Run
        }
    }

    /// The codes that SAFE was entered for.
    pub(crate) const fn latched(&self) -> Faults {
        self.latched
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn safe_is_latched_and_hold_is_not() {
        let mut supervisor = Supervisor::default();
        assert_eq!(supervisor.decide(Faults::TARGET_STALE), Mode::Hold);
        assert_eq!(supervisor.decide(Faults::RATE_LIMITED), Mode::Run);
        assert_eq!(supervisor.decide(Faults::DIVERGENCE), Mode::Safe);
        assert_eq!(supervisor.decide(Faults::NONE), Mode::Safe);
        assert_eq!(supervisor.latched(), Faults::DIVERGENCE);
    }
}
