//! What one model changes against another one, as a share.

use crate::scene::Scene;
use crate::study::effects::Followed;
use serde::Serialize;
use std::fmt;

/// What a model changes against another one along an insertion. Shares; not a number where that is not known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Change {
    /// Largest change of the target's displacement, across the needle or along it, over the other's largest displacement.
    pub target: f64,
    /// Change of the controllability measure at full depth, over the other's.
    pub controllability: f64,
}

impl Change {
    /// What one insertion changes against another one of the same scene.
    pub(super) fn between(one: &Followed, other: &Followed, scene: &Scene) -> Self {
        let added = one.over(other, scene);
        Self {
            target: added.orthogonal.max(added.axial) / other.largest(),
            controllability: added.controllability.abs(),
        }
    }

    /// The larger of the two; not a number where one is none.
    pub fn worst(&self) -> f64 {
        if self.target >= self.controllability || self.target.is_nan() { self.target } else { self.controllability }
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:.3} % of the target's displacement, {:.3} % of the controllability",
            100.0 * self.target,
            100.0 * self.controllability
        )
    }
}
