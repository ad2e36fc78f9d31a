//! States and fault codes, as every command carries them.

use core::fmt;
use core::ops::{BitOr, BitOrAssign};

use serde::{Deserialize, Serialize};

/// State of the controller, with its number on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum Mode {
    /// The paddle keeps its position; RUN follows by itself when the reason is gone. Start state.
    #[default]
    Hold = 1,
    /// Feed-forward and feedback act.
    Run = 2,
    /// The paddle keeps its position until somebody re-arms the controller.
    Safe = 3,
}

impl Mode {
    /// The mode with this number on the wire.
    pub const fn from_wire(number: u32) -> Option<Self> {
        match number {
            1 => Some(Self::Hold),
            2 => Some(Self::Run),
            3 => Some(Self::Safe),
            _ => None,
        }
    }

    /// Name as reports show it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hold => "HOLD",
            Self::Run => "RUN",
            Self::Safe => "SAFE",
        }
    }
}

/// [`Mode::name`].
impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Bit set of fault codes; the values are part of the contract and never reused.
///
/// ```
/// use firmware::Faults;
///
/// let seen = Faults::TARGET_LOST | Faults::NEEDLE_TOO_FAST;
/// assert!(seen.contains(Faults::TARGET_LOST));
/// assert_eq!(Faults::from_bits(seen.bits()), seen);
/// assert_eq!(seen.to_string(), "TARGET_LOST | NEEDLE_TOO_FAST");
/// ```
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Faults(u64);

macro_rules! fault_codes {
    ($($(#[$doc:meta])* $name:ident = $bit:expr;)*) => {
        impl Faults {
            $($(#[$doc])* pub const $name: Self = Self(1 << $bit);)*

            /// Every code with its name, in the order of bits.
            pub const NAMES: &'static [(Self, &'static str)] = &[$((Self::$name, stringify!($name)),)*];
        }
    };
}

fault_codes! {
    /// Not armed: some input has never been heard, or the measured paddle position is not adopted yet. HOLD.
    WAITING = 0;
    /// Needle sample older than its first limit. HOLD.
    NEEDLE_STALE = 1;
    /// Target sample older than its first limit. HOLD.
    TARGET_STALE = 2;
    /// Paddle sample older than its first limit. HOLD.
    PADDLE_STALE = 3;
    /// The sensor does not see the target. HOLD.
    TARGET_LOST = 4;
    /// Needle faster than the table holds for. HOLD.
    NEEDLE_TOO_FAST = 5;
    /// The measured paddle moves: its position is not adopted. HOLD.
    PADDLE_MOVING = 6;
    /// The measured paddle is further out than it may be commanded: its position is not adopted. HOLD.
    PADDLE_BEYOND_LIMIT = 7;
    /// Needle sample older than its second limit. SAFE.
    NEEDLE_DEAD = 8;
    /// Target sample older than its second limit. SAFE.
    TARGET_DEAD = 9;
    /// Paddle sample older than its second limit. SAFE.
    PADDLE_DEAD = 10;
    /// The tick's time or number did not go on; the tick's inputs were not read. SAFE.
    CLOCK_REVERSED = 11;
    /// Too many ticks were preceded by skipped ones. SAFE.
    OVERRUN = 12;
    /// The paddle does not follow its commands. SAFE.
    FOLLOWING_ERROR = 13;
    /// Another paddle is attached than the table was made for. SAFE.
    PADDLE_IDENTITY = 14;
    /// The error grows although the controller acts: wrong sign, wrong table or wrong tissue. SAFE.
    DIVERGENCE = 15;
    /// The law gave a number that is not finite; not emitted. SAFE.
    INTERNAL = 16;
    /// The watchdog outside of the controller has taken over. SAFE; never set by the controller itself.
    WATCHDOG = 17;
    /// The tick's time and number went on by different amounts; the tick's inputs were not read. SAFE.
    CLOCK_JUMPED = 18;
    /// Depth outside the table, its nearest end is used. Goes on.
    DEPTH_CLAMPED = 24;
    /// Command limited in position. Goes on.
    POSITION_LIMITED = 25;
    /// Command limited in rate. Goes on.
    RATE_LIMITED = 26;
    /// Sequence numbers of an input skipped some. Goes on.
    SAMPLE_GAP = 27;
    /// An input arrived twice. Goes on.
    DUPLICATE = 28;
    /// An input arrived after a newer one and was discarded. Goes on.
    OUT_OF_ORDER = 29;
    /// An input with NaN, infinity or a subnormal was discarded. Goes on until stale.
    NOT_FINITE = 30;
    /// An implausible input was discarded (wrong units?). Goes on until stale.
    OUT_OF_RANGE = 31;
    /// An input from the future, or not after the one before it, was discarded. Goes on until stale.
    SAMPLE_TIME = 32;
    /// An input that jumped was discarded. Goes on until stale.
    INNOVATION = 33;
    /// An input whose value no longer changes was discarded. Goes on until stale.
    FROZEN = 34;
    /// Periods before this tick were skipped. Goes on until too many in a row.
    TICKS_SKIPPED = 35;
    /// What another code of this tick says of a paddle, it says of the second one, at least. Goes on by itself; what it
    /// says with a code that holds or latches, that code does. A paddle's code without it is the first one's.
    SECOND_PADDLE = 36;
}

impl Faults {
    /// No fault.
    pub const NONE: Self = Self(0);
    /// Codes that keep the paddle where it is as long as they are present: bits 0 to 7.
    pub const HOLDING: Self = Self(0x0000_00ff);
    /// Codes that latch SAFE: bits 8 to 23.
    pub const LATCHING: Self = Self(0x00ff_ff00);

    /// The set as bits.
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// The set with these bits, known or not.
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// Whether no code is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether all codes of `other` are in the set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Codes that are in both sets.
    pub const fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Adds `code` if `present`.
    pub(crate) fn set_if(&mut self, code: Self, present: bool) {
        if present {
            *self |= code;
        }
    }
}

impl BitOr for Faults {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for Faults {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

/// The names of the codes, joined by ` | `; `NONE` for the empty set.
impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for (code, name) in Self::NAMES {
            if self.contains(*code) {
                write!(f, "{separator}{name}")?;
                separator = " | ";
            }
        }
        if separator.is_empty() { f.write_str("NONE") } else { Ok(()) }
    }
}

impl fmt::Debug for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString;

    use super::*;

    #[test]
    fn modes_have_their_numbers_and_names() {
        for (mode, number, name) in [(Mode::Hold, 1, "HOLD"), (Mode::Run, 2, "RUN"), (Mode::Safe, 3, "SAFE")] {
            assert_eq!((mode as u32, Mode::from_wire(number), mode.name()), (number, Some(mode), name));
            assert_eq!(std::format!("{mode:>6}"), std::format!("{name:>6}"));
        }
        assert_eq!((Mode::from_wire(0), Mode::from_wire(4)), (None, None));
    }

    #[test]
    fn codes_hold_latch_or_go_on_by_their_place() {
        let holding = Faults::PADDLE_MOVING | Faults::PADDLE_BEYOND_LIMIT | Faults::WAITING | Faults::NEEDLE_TOO_FAST;
        let latching = Faults::NEEDLE_DEAD | Faults::CLOCK_JUMPED | Faults::WATCHDOG | Faults::OVERRUN;
        let goes_on = Faults::DEPTH_CLAMPED | Faults::TICKS_SKIPPED | Faults::FROZEN;
        assert_eq!(holding.intersection(Faults::HOLDING), holding);
        assert_eq!(latching.intersection(Faults::LATCHING), latching);
        assert!(goes_on.intersection(Faults::HOLDING | Faults::LATCHING).is_empty());
        assert!((holding | latching).contains(latching) && !holding.contains(latching));
        assert!(!(holding | Faults::OVERRUN).contains(latching), "all of them");
        assert_eq!((Faults::from_bits(1 << 18), Faults::CLOCK_JUMPED.bits()), (Faults::CLOCK_JUMPED, 1 << 18));
        let mut set = Faults::NONE;
        set.set_if(Faults::FROZEN, false);
        assert!(set.is_empty());
        set.set_if(Faults::FROZEN, true);
        assert_eq!(set, Faults::FROZEN);
    }

    #[test]
    fn codes_are_distinct_and_named() {
        let mut all = Faults::NONE;
        for (code, _) in Faults::NAMES {
            assert!(all.intersection(*code).is_empty());
            all |= *code;
        }
        assert_eq!((Faults::TARGET_LOST | Faults::OVERRUN).to_string(), "TARGET_LOST | OVERRUN");
        assert_eq!(Faults::NONE.to_string(), "NONE");
        assert_eq!(std::format!("{:?}", Faults::TARGET_LOST | Faults::OVERRUN), "TARGET_LOST | OVERRUN");
    }
}
