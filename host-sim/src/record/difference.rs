//! In what two commands differ.

use std::fmt;

use firmware::contract::PaddleCommand;

/// A field in which two commands differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Difference {
    /// An integer.
    Integer {
        /// Name of the field.
        field: &'static str,
        /// Recorded.
        was: u64,
        /// Computed again.
        is: u64,
    },
    /// A component of the displacement.
    Displacement {
        /// Axis, 0 or 1.
        axis: usize,
        /// Recorded, length.
        was: f64,
        /// Computed again, length.
        is: f64,
    },
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Integer { field, was, is } => write!(f, "{field} was {was}, is {is}"),
            Self::Displacement { axis, was, is } => {
                let axis = if axis == 0 { "x" } else { "y" };
                write!(f, "displacement {axis} was {was:?}, is {is:?}")
            }
        }
    }
}

/// The first field that differs in a single bit; NaN and −0 are not excused.
pub fn difference(recorded: &PaddleCommand, again: &PaddleCommand) -> Option<Difference> {
    macro_rules! compare {
        ($($field:ident),*) => {
            $(if recorded.$field != again.$field {
                let (was, is) = (recorded.$field.into(), again.$field.into());
                return Some(Difference::Integer { field: stringify!($field), was, is });
            })*
        };
    }
    compare!(sequence, state, tick, time_ns, faults, needle_sequence, target_sequence, paddle_index, flags);
    let pairs = recorded.displacement.into_iter().zip(again.displacement).enumerate();
    let differs = |(_, (was, is)): &(usize, (f64, f64))| was.to_bits() != is.to_bits();
    pairs.into_iter().find(differs).map(|(axis, (was, is))| Difference::Displacement { axis, was, is })
}
