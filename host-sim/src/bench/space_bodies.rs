//! The deformed body at the end of every insertion in space, for pictures: solved once more, in full.

use model_offline::output::space_picture::{SpaceGeometry, SpaceState};
use model_offline::placement::space::InsertionModel;
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// States on the way of an insertion at which the body is solved: the path matters near the limits of stability.
const ON_THE_WAY: usize = 5;

/// Bodies of a run, and the body at rest that they have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpaceBodies {
    /// At rest, with the scene's inclusions.
    pub geometry: SpaceGeometry,
    /// Per case: no paddle, static, dynamic. Without inclusions where the case has homogeneous tissue.
    pub cases: Vec<CaseBodies>,
}

impl SpaceBodies {
    /// Whether they can be drawn as those of so many cases: what is read from a file may be anything.
    pub(super) fn are_of(&self, cases: usize) -> bool {
        self.cases.len() == cases
            && self.geometry.check().is_ok()
            && self.cases.iter().flatten().flatten().all(|state| state.check(&self.geometry).is_ok())
    }
}

/// Bodies of a case: no paddle, static, dynamic. Why there is none where the model did not get there.
pub type CaseBodies = [Result<SpaceState, String>; 3];

/// The body at the end of an insertion with these paddles (indices in the scene): needle depths and the paddles'
/// displacements on the way, length.
pub(super) fn at_end(
    model: &InsertionModel,
    paddles: &[u32],
    way: &[(f64, &[[f64; 3]])],
) -> Result<SpaceState, String> {
    let places = paddles.iter().map(|&index| model.scene().paddle_position(index));
    let attached = places.collect::<Result<Vec<usize>, _>>().map_err(|error| error.to_string())?;
    let mut body = model.body(&attached, NewtonSettings::default()).map_err(|failure| failure.to_string())?;
    let stride = way.len().div_ceil(ON_THE_WAY).max(1);
    // The last one is among them.
    let first = way.len().saturating_sub(1) % stride;
    for (depth, displacements) in way.iter().skip(first).step_by(stride) {
        let displacements: Vec<Vector3<f64>> = displacements.iter().map(|u| Vector3::from(*u)).collect();
        body.drive(*depth, &displacements).map_err(|failure| failure.to_string())?;
    }
    Ok(SpaceState::new(&body, paddles))
}
