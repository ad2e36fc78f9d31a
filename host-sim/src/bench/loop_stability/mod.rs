//! Where the closed loop stops being stable: simulated beside the theory of [`firmware::loop_stability`].
//!
//! Three questions, each answered by simulation with the controller's own law and, where there is one, by theory:
//! - [`cells`]: gain × delay × Jacobian error, for which the theory is exact;
//! - [`mismatch`]: a table without the inclusion on tissue with it, and the other way round, along the depth;
//! - [`rate_limit`]: limit cycles from rate limits with delay, which linear theory does not show.

pub mod behaviour;
pub mod cells;
pub mod mismatch;
pub mod rate_limit;

use model_offline::model::ModelError;
use model_offline::placement::model_with_paddle;
use model_offline::scene::Scene;
use model_offline::solver::equilibrium::NewtonSettings;
use model_offline::study::Extent;
use model_offline::table::TableOptions;
use nalgebra::Matrix2;

use self::cells::{Boundary, boundaries};
use self::mismatch::{Mismatch, Refused, mismatches};
use self::rate_limit::Cell;
use super::error::SimError;

/// Everything that was simulated.
#[derive(Debug)]
pub struct LoopStabilityResult {
    /// The scene's name.
    pub scene: String,
    /// Paddle whose Jacobian the cells are simulated around.
    pub paddle: u32,
    /// Its Jacobian at rest.
    pub jacobian: Matrix2<f64>,
    /// Narrow cells, or wide ones for a first look.
    pub extent: Extent,
    /// Gain × delay × Jacobian error.
    pub boundaries: Vec<Boundary>,
    /// Table and tissue swapped, by paddle and depth; empty without inclusions.
    pub mismatches: Vec<Mismatch>,
    /// Paddles without a table, and why.
    pub refused: Vec<Refused>,
    /// Largest |λ| that the tables' gain allows for.
    pub lambda_max: f64,
    /// Rate limits with delay.
    pub cells: Vec<Cell>,
}

impl LoopStabilityResult {
    /// Gains of the cells along every boundary.
    pub fn gains(&self) -> Vec<f64> {
        cells::gains(self.extent)
    }
}

/// Simulates everything, three parts; `progress` is called after each.
///
/// # Errors
/// [`SimError`]: tissue that cannot be modelled.
pub fn simulate(
    scene: &Scene,
    extent: Extent,
    threads: usize,
    progress: &dyn Fn(),
) -> Result<LoopStabilityResult, SimError> {
    let plain = scene.without_inclusions();
    let (model, paddle) = model_with_paddle(&plain, None)?;
    let place = model.paddle_position(paddle);
    let jacobian = model
        .body(place, NewtonSettings::default())
        .and_then(|mut body| body.actuation_jacobian())
        .map_err(ModelError::from)?;
    let boundaries = boundaries(&jacobian, extent);
    progress();
    let (mut rows, mut refused) = (Vec::new(), Vec::new());
    if !scene.inclusions.is_empty() {
        let knots = match extent {
            Extent::Quick => 6,
            Extent::Full => 11,
        };
        (rows, refused) = mismatches(scene, knots, threads)?;
    }
    progress();
    let cells = rate_limit::map(extent);
    progress();
    let lambda_max = TableOptions::default().lambda_max;
    Ok(LoopStabilityResult {
        scene: scene.name.clone(),
        paddle,
        jacobian,
        extent,
        boundaries,
        mismatches: rows,
        refused,
        lambda_max,
        cells,
    })
}
