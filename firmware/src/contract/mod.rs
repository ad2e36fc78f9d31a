//! What the controller shares with everyone else: sample frames, states and fault codes, and the table format.
//!
//! The constrained side owns the contract. A change of a frame's layout bumps [`frames::LAYOUT_VERSION`], a change
//! of the table's payload bumps [`codec::FORMAT_VERSION`]; readers refuse versions that they do not know.

mod bounds;
pub mod codec;
mod each;
pub mod error;
#[cfg(test)]
pub(crate) mod example;
pub mod faults;
mod field;
pub mod format;
pub mod frames;
pub mod table;
mod validate;

pub(crate) use bounds::TableBounds;
pub use codec::{Header, decode, decode_into, decode_labelled_into, encode};
pub use error::TableError;
pub use faults::{Faults, Mode};
pub use field::Field;
pub use format::MAX_TABLE_BYTES;
pub use frames::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
pub use table::{Gains, Knot, MAX_KNOTS, Paddle, PlanarTable, SpatialTable, Table, Units, Validity};
pub(crate) use validate::relative_weights;
pub use validate::{CONDITION_LIMIT, condition_number};
