//! What really happens, which the controller does not see.

use model_offline::needle::NeedleReading;

/// The true state of the world at a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Truth {
    /// Tick of the plant.
    pub tick: u64,
    /// Time of that tick, ns.
    pub time_ns: u64,
    /// Needle depth, length.
    pub depth: f64,
    /// Target displacement, length.
    pub target: [f64; 2],
    /// Paddle displacement, length.
    pub paddle: [f64; 2],
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
