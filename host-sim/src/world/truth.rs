//! What really happens, which the controller does not see.

/// The true state of the world at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
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
