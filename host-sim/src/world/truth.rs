//! What really happens, which the controller does not see.

use firmware::contract::frames::{MAX_DIMENSION, MAX_PADDLES};
use model_offline::needle::NeedleReading;
use nalgebra::SVector;

/// The true state of the world at a tick, with displacements as frames have them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Truth {
    /// Tick of the plant.
    pub tick: u64,
    /// Time of that tick, ns.
    pub time_ns: u64,
    /// Needle depth, length.
    pub depth: f64,
    /// Target displacement x, y, z, length; z is 0 in the plane.
    pub target: [f64; MAX_DIMENSION],
    /// Displacement of each paddle in the order of the table, length; 0 for one that is not there.
    pub paddles: [[f64; MAX_DIMENSION]; MAX_PADDLES],
}

impl Truth {
    /// Target displacement in D dimensions, length.
    pub fn target<const D: usize>(&self) -> SVector<f64, D> {
        from_frame(self.target)
    }

    /// Displacement of the first paddle in D dimensions, length.
    pub fn paddle<const D: usize>(&self) -> SVector<f64, D> {
        from_frame(self.paddles[0])
    }
}

/// A displacement as frames have it: what is missing of three components is 0.
pub fn to_frame<const D: usize>(displacement: &SVector<f64, D>) -> [f64; MAX_DIMENSION] {
    std::array::from_fn(|k| displacement.as_slice().get(k).copied().unwrap_or(0.0))
}

/// The first D of the components that frames have.
pub fn from_frame<const D: usize>(components: [f64; MAX_DIMENSION]) -> SVector<f64, D> {
    SVector::from_fn(|k, _| components.get(k).copied().unwrap_or(0.0))
}

/// What the needle meets at a moment of a run: known where the world has a needle that slips, and only after the run where
/// a reduced model answered.
#[derive(Clone, Debug, PartialEq)]
pub struct NeedleMoment {
    /// Time since the start of the needle, s.
    pub since_start_s: f64,
    /// Forces and slip.
    pub reading: NeedleReading,
}
