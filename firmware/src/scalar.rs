//! The number type that the controller computes with.

use core::fmt::{Debug, Display};

use nalgebra::RealField;
use serde::{Serialize, de::DeserializeOwned};

/// Which floating-point type a table holds, as written in its header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ScalarKind {
    /// IEEE 754 binary32.
    F32 = 4,
    /// IEEE 754 binary64.
    F64 = 8,
}

impl ScalarKind {
    /// The kind written as `byte`, or `None` for a byte that no version ever wrote.
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            4 => Some(Self::F32),
            8 => Some(Self::F64),
            _ => None,
        }
    }

    /// Name as Rust spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
}

/// A real scalar: `f32` or `f64`.
///
/// The control law uses only `+ − × ÷ √`, rounding to whole numbers and comparisons. IEEE 754 has one right answer for each of
/// these, so the same inputs give the same bits on every target.
pub trait Scalar: RealField + Copy + Debug + Display + Default + Serialize + DeserializeOwned {
    /// Kind written into the table header.
    const KIND: ScalarKind;
    /// How far the norm of a unit vector may be from 1: a few rounding errors of this type.
    const UNIT_TOLERANCE: f64;
    /// 0, where a constant is needed.
    const ZERO: Self;

    /// Nearest value of this type.
    fn of(value: f64) -> Self;
    /// Exact value as `f64`.
    fn to_f64(self) -> f64;
}

impl Scalar for f32 {
    const KIND: ScalarKind = ScalarKind::F32;
    const UNIT_TOLERANCE: f64 = 1e-6;
    const ZERO: Self = 0.0;

    fn of(value: f64) -> Self {
        value as f32
    }

    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Scalar for f64 {
    const KIND: ScalarKind = ScalarKind::F64;
    const UNIT_TOLERANCE: f64 = 1e-12;
    const ZERO: Self = 0.0;

    fn of(value: f64) -> Self {
        value
    }

    fn to_f64(self) -> f64 {
        self
    }
}

/// `value` moved into `low..=high`.
///
/// Instead of `clamp`, which panics for bounds in the wrong order, and of `max` and `min`, whose choice between −0 and
/// +0 differs from target to target.
pub(crate) fn bounded<T: Scalar>(value: T, low: T, high: T) -> T {
    if value < low {
        low
    } else if value > high {
        high
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_have_rusts_names_and_are_read_back() {
        for (kind, name) in [(<f32 as Scalar>::KIND, "f32"), (<f64 as Scalar>::KIND, "f64")] {
            assert_eq!((kind.name(), ScalarKind::from_byte(kind as u8)), (name, Some(kind)));
        }
        assert_eq!(ScalarKind::from_byte(0), None);
    }

    #[test]
    fn bounds_are_inclusive_and_keep_the_bits_of_what_is_inside() {
        assert_eq!([-2.0, 0.5, 2.0].map(|x| bounded(x, -1.0, 1.0)), [-1.0, 0.5, 1.0]);
        // A zero of either sign lies on a bound of the other: it stays as it is.
        assert_eq!(bounded(-0.0_f64, 0.0, 1.0).to_bits(), (-0.0_f64).to_bits());
        assert_eq!(bounded(0.0_f64, -1.0, -0.0).to_bits(), 0.0_f64.to_bits());
    }
}
