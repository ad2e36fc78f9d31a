//! In what two commands differ.

use firmware::contract::frames::MAX_DIMENSION;
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
        /// Place of the paddle, 0 or 1.
        paddle: usize,
        /// Axis, 0 to 2.
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
            Self::Displacement { paddle, axis, was, is } => {
                let axis = ["x", "y", "z"].get(axis).unwrap_or(&"?");
                let paddle = if paddle == 0 { "" } else { " of the second paddle" };
                write!(f, "displacement {axis}{paddle} was {was:?}, is {is:?}")
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
    compare!(sequence, state, tick, time_ns, faults, needle_sequence, target_sequence, flags);
    if let Some((was, is)) = recorded.paddle_index.into_iter().zip(again.paddle_index).find(|(was, is)| was != is) {
        return Some(Difference::Integer { field: "paddle_index", was: was.into(), is: is.into() });
    }
    let recorded = recorded.displacement.into_iter().flatten();
    let pairs = recorded.zip(again.displacement.into_iter().flatten()).enumerate();
    let differs = |(_, (was, is)): &(usize, (f64, f64))| was.to_bits() != is.to_bits();
    pairs.into_iter().find(differs).map(|(place, (was, is))| Difference::Displacement {
        paddle: place / MAX_DIMENSION,
        axis: place % MAX_DIMENSION,
        was,
        is,
    })
}
