//! What every image is tried with, in the plane and in space.

use super::measure::{Figures, MeasureError, Scenario, measure, scenarios};
use super::space;
use crate::exchange::board::image::{Control, Image};
use crate::record::recording::Recording;

/// What an image is tried with: the scenarios of its dimension.
#[derive(Debug)]
pub struct Scenarios {
    planar: Vec<Scenario>,
    in_space: Vec<Scenario<3, 2, 2>>,
}

impl Scenarios {
    /// Those in the plane with the inputs of a recording as their corpus, and those in space.
    ///
    /// # Errors
    /// As [`scenarios`].
    pub fn of(recording: &Recording) -> Result<Self, MeasureError> {
        Ok(Self { planar: scenarios(recording)?, in_space: space::scenarios() })
    }

    /// Runs those of an image on it. Every command must be the host's, bit by bit.
    ///
    /// # Errors
    /// [`MeasureError`]; [`MeasureError::Differs`] for a command that is not the host's.
    pub fn measure(&self, image: &Image) -> Result<Figures, MeasureError> {
        match image.control {
            Control::Plane => measure(image, &self.planar),
            Control::SpacePair => measure(image, &self.in_space),
        }
    }
}
