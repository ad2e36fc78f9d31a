//! What a needle meets at one moment of its way.

use super::state::SlippingNeedle;
use super::station::StationState;
use serde::Serialize;

/// Forces that push a needle, and what its shaft does: positive on the way in (planar: per unit thickness).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NeedleReading {
    /// Depth of the needle, length.
    pub depth: f64,
    /// Force that pushes the needle at its base, force.
    pub base_force: f64,
    /// Part of it that the tip takes; all of it while the skin holds.
    pub tip_force: f64,
    /// Length of tissue that the tip has passed; none while the skin holds.
    pub cut_length: Option<f64>,
    /// The shaft, from the entry to the tip; empty while the skin holds.
    pub shaft: Vec<StationState>,
}

impl NeedleReading {
    /// Of a needle that pushes the contact before it.
    pub(super) fn pushing(depth: f64, force: f64) -> Self {
        Self { depth, base_force: force, tip_force: force, cut_length: None, shaft: Vec::new() }
    }

    /// Of a needle that is in.
    pub(super) fn within(needle: &SlippingNeedle<'_>) -> Self {
        Self {
            depth: needle.depth(),
            base_force: needle.base_force(),
            tip_force: needle.tip_force(),
            cut_length: Some(needle.cut_length()),
            shaft: needle.stations(),
        }
    }

    /// Force of the shaft: friction all along it.
    pub fn friction(&self) -> f64 {
        self.base_force - self.tip_force
    }

    /// Farthest that the needle has slid past the tissue anywhere, length: negative where it slid out.
    pub fn largest_slip(&self) -> f64 {
        let slips = self.shaft.iter().map(|station| station.slip);
        slips.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0)
    }
}
