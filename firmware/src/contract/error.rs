//! Why a table is refused, and what to do about it.

use core::fmt;

use super::Field;
use crate::scalar::ScalarKind;

/// Refusal of a controller table. Each variant says what was wrong; its `Display` also says what to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TableError {
    /// Fewer bytes than a header and a checksum.
    TooShort {
        /// Bytes given.
        bytes: usize,
    },
    /// The file does not start with the magic of a table.
    NotATable,
    /// Written in another version of the format.
    FormatVersion {
        /// Version found.
        found: u16,
    },
    /// Reserved header bytes are not zero.
    Reserved,
    /// The scalar kind byte is none that any version wrote.
    UnknownScalar {
        /// Byte found.
        found: u8,
    },
    /// Shorter than the header says.
    Truncated {
        /// Payload bytes missing.
        missing: usize,
    },
    /// Longer than the header says.
    TrailingBytes {
        /// Bytes too many.
        extra: usize,
    },
    /// CRC-32 over header and payload does not match.
    Checksum {
        /// CRC written in the file.
        written: u32,
        /// CRC of the bytes.
        computed: u32,
    },
    /// Intact, but holds another scalar type than asked for.
    ScalarKind {
        /// Kind of the file.
        found: ScalarKind,
        /// Kind asked for.
        expected: ScalarKind,
    },
    /// Intact, but for another dimension of space.
    Dimension {
        /// Dimension of the file.
        found: usize,
        /// Dimension asked for.
        expected: usize,
    },
    /// Intact, but for another number of paddle degrees of freedom.
    PaddleDof {
        /// Number in the file.
        found: usize,
        /// Number asked for.
        expected: usize,
    },
    /// The payload is not a table in this format, although its checksum is right.
    Payload,
    /// The payload goes on after the table.
    PayloadTrailing {
        /// Bytes too many.
        extra: usize,
    },
    /// A number is NaN or infinite.
    NotFinite {
        /// Field that holds it.
        field: Field,
    },
    /// A number that must be positive is not.
    NotPositive {
        /// Field that holds it.
        field: Field,
    },
    /// A direction is not a unit vector.
    NotUnit {
        /// Field that holds it.
        field: Field,
    },
    /// A direction orthogonal to the needle is not orthogonal to its axis, or to another one of them.
    NotOrthogonal,
    /// Fewer than two knots.
    TooFewKnots {
        /// Knots found.
        found: usize,
    },
    /// Depths do not increase strictly.
    DepthOrder {
        /// First knot that is not deeper than its predecessor.
        knot: usize,
    },
    /// The validity range of depth is not that of the knots.
    DepthRange,
    /// The paddle may go further than the table is valid.
    DisplacementRange,
    /// A Jacobian is singular or too close to it.
    IllConditioned {
        /// Knot with that Jacobian.
        knot: usize,
    },
    /// The feed-forward path leaves the paddle's range.
    PathBeyondLimit {
        /// Knot whose path does.
        knot: usize,
    },
    /// The suggested gain is outside (0, 1) or the model error margin is below 1.
    Gains,
    /// A number is out of proportion with the rest of the table.
    Implausible {
        /// Field that holds it.
        field: Field,
    },
    /// The output buffer cannot hold the table.
    BufferTooSmall {
        /// Bytes given.
        bytes: usize,
    },
}

impl TableError {
    /// Number of the check that failed, for where there is no room for words. Part of the contract, never reused.
    pub const fn code(&self) -> u8 {
        match self {
            Self::TooShort { .. } => 1,
            Self::NotATable => 2,
            Self::FormatVersion { .. } => 3,
            Self::Reserved => 4,
            Self::UnknownScalar { .. } => 5,
            Self::Truncated { .. } => 6,
            Self::TrailingBytes { .. } => 7,
            Self::Checksum { .. } => 8,
            Self::ScalarKind { .. } => 9,
            Self::Dimension { .. } => 10,
            Self::PaddleDof { .. } => 11,
            Self::Payload => 12,
            Self::PayloadTrailing { .. } => 13,
            Self::NotFinite { .. } => 14,
            Self::NotPositive { .. } => 15,
            Self::NotUnit { .. } => 16,
            Self::NotOrthogonal => 17,
            Self::TooFewKnots { .. } => 18,
            Self::DepthOrder { .. } => 19,
            Self::DepthRange => 20,
            Self::DisplacementRange => 21,
            Self::IllConditioned { .. } => 22,
            Self::PathBeyondLimit { .. } => 23,
            Self::Gains => 24,
            Self::BufferTooSmall { .. } => 25,
            Self::Implausible { .. } => 26,
        }
    }
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const REWRITE: &str = "the file is damaged: write it again with `model-offline table`";
        match *self {
            Self::TooShort { bytes } => {
                write!(f, "{bytes} bytes cannot hold a controller table; {REWRITE}")
            }
            Self::NotATable => write!(f, "not a controller table: give a file written by `model-offline table`"),
            Self::FormatVersion { found } => write!(
                f,
                "table format version {found}, this build reads version {}: write the table again with the \
                 `model-offline` of this build, as `model-offline table SCENE -o FILE`",
                super::format::FORMAT_VERSION
            ),
            Self::Reserved => write!(f, "reserved header bytes are not zero; {REWRITE}"),
            Self::UnknownScalar { found } => write!(f, "unknown scalar kind {found}; {REWRITE}"),
            Self::Truncated { missing } => {
                write!(f, "the last {missing} bytes are missing; {REWRITE}")
            }
            Self::TrailingBytes { extra } => write!(f, "{extra} bytes follow the table; {REWRITE}"),
            Self::Checksum { written, computed } => {
                write!(f, "checksum {computed:08x}, the file says {written:08x}; {REWRITE}")
            }
            Self::ScalarKind { found, expected } => {
                let (found, expected) = (found.name(), expected.name());
                write!(f, "the table holds {found}, this controller computes in {expected}: write it as {expected}")
            }
            Self::Dimension { found, expected } => {
                write!(
                    f,
                    "the table is {found}-dimensional, this controller {expected}-dimensional: give it a table of a \
                     scene with dimension {expected}"
                )
            }
            Self::PaddleDof { found, expected } => {
                write!(
                    f,
                    "the table has {found} degrees of freedom of paddles, this controller {expected}: write the table \
                     for as many paddles as the controller moves"
                )
            }
            Self::Payload => write!(f, "the payload is no table although its checksum is right; {REWRITE}"),
            Self::PayloadTrailing { extra } => {
                write!(f, "the payload is {extra} bytes too long; {REWRITE}")
            }
            Self::NotFinite { field } => write!(f, "{field} is not a finite number: check the scene, solve again"),
            Self::NotPositive { field } => write!(f, "{field} must be positive: correct the scene"),
            Self::NotUnit { field } => write!(f, "{field} is not a unit vector: normalise it before writing"),
            Self::NotOrthogonal => {
                write!(
                    f,
                    "orthogonal directions and needle axis are not orthogonal to each other: project before writing"
                )
            }
            Self::TooFewKnots { found } => {
                write!(f, "{found} knots in depth, at least 2 are needed")
            }
            Self::DepthOrder { knot } => write!(f, "knot {knot} is not deeper than the one before it: sort the knots"),
            Self::DepthRange => write!(f, "validity must start at the first knot's depth and end at the last one's"),
            Self::DisplacementRange => {
                write!(f, "the paddle's limit exceeds the range where the table is valid: lower the limit")
            }
            Self::IllConditioned { knot } => write!(
                f,
                "the Jacobian of knot {knot} is (nearly) singular: its paddles cannot control the target, choose others"
            ),
            Self::PathBeyondLimit { knot } => {
                write!(f, "the feed-forward path leaves a paddle's range at knot {knot}: raise the paddle's limit")
            }
            Self::Gains => write!(f, "the suggested gain must lie in (0, 1) and lambda_max be at least 1"),
            Self::Implausible { field } => {
                write!(f, "{field} is out of proportion with the rest of the table: check its unit in the scene")
            }
            Self::BufferTooSmall { bytes } => {
                write!(f, "{bytes} bytes cannot hold the table: give {}", super::format::MAX_TABLE_BYTES)
            }
        }
    }
}

impl core::error::Error for TableError {}

#[cfg(test)]
mod tests {
    use super::*;

    /// They are part of the contract: a board has no room for words.
    #[test]
    fn numbers_of_checks_stay() {
        use TableError as E;
        let field = Field::Gains;
        let numbered = [
            (E::TooShort { bytes: 1 }, 1),
            (E::NotATable, 2),
            (E::FormatVersion { found: 9 }, 3),
            (E::Reserved, 4),
            (E::UnknownScalar { found: 9 }, 5),
            (E::Truncated { missing: 1 }, 6),
            (E::TrailingBytes { extra: 1 }, 7),
            (E::Checksum { written: 1, computed: 2 }, 8),
            (E::ScalarKind { found: ScalarKind::F32, expected: ScalarKind::F64 }, 9),
            (E::Dimension { found: 3, expected: 2 }, 10),
            (E::Payload, 12),
            (E::NotFinite { field }, 14),
            (E::NotPositive { field }, 15),
            (E::NotUnit { field }, 16),
            (E::NotOrthogonal, 17),
            (E::Gains, 24),
            (E::BufferTooSmall { bytes: 1 }, 25),
        ];
        for (error, number) in numbered {
            assert_eq!(error.code(), number, "{error:?}");
        }
    }
}
