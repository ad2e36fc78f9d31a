//! The tissue solved again along an insertion that is over: nothing is added to a loop on the machine's clock.

use model_offline::model::TissueModel;
use model_offline::model::space::SpaceModel;
use model_offline::output::space_picture::SpaceState;
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::Vector3;

use super::error::WorldError;
use super::tissue::{TissuePlant, TissueResponse as _, WantedPlant};
use super::truth::{Truth, from_frame};

/// Pictures along an insertion, without that at rest.
pub const PICTURES: usize = 20;
/// Steps from one picture to the next where a state depends on those before.
const STEPS: usize = 8;

/// The full model on its way along the ticks of a run.
#[derive(Debug)]
pub struct Retrace<'m> {
    tissue: TissuePlant<'m>,
    truths: &'m [Truth],
    started_ns: u64,
    steps: usize,
    reached: usize,
}

impl<'m> Retrace<'m> {
    /// At rest before the first tick; the needle started at `started_ns`.
    ///
    /// # Errors
    /// [`WorldError`] when the body is not held.
    pub fn new(
        model: &'m TissueModel,
        paddle: Option<u32>,
        truths: &'m [Truth],
        started_ns: u64,
    ) -> Result<Self, WorldError> {
        let position = paddle.and_then(|index| model.paddle_position(index));
        let mut tissue = TissuePlant::new(model, position, WantedPlant::Full)?;
        tissue.solve_every_step()?;
        let steps = if model.scene().has_a_past() { STEPS } else { 1 };
        Ok(Self { tissue, truths, started_ns, steps, reached: 0 })
    }

    /// Goes on to this tick's place in the list, which is not before the last one's.
    ///
    /// # Errors
    /// [`WorldError`] where there is no equilibrium.
    pub fn go_on_to(&mut self, index: usize) -> Result<&TissuePlant<'m>, WorldError> {
        let from = self.reached;
        for step in 1..=self.steps {
            let at = from + (index - from) * step / self.steps;
            let truth = &self.truths[at];
            let since_start_s = truth.time_ns.saturating_sub(self.started_ns) as f64 * 1e-9;
            self.tissue.step_at(since_start_s, truth.depth, &[truth.paddle()])?;
            self.reached = at;
        }
        Ok(&self.tissue)
    }
}

/// A body in space as it is at a tick of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct SolvedBody {
    /// What happened at that tick.
    pub truth: Truth,
    /// The body, and its target where the run had it.
    pub state: SpaceState,
    /// The model's coefficients, three per node.
    pub coefficients: Vec<f64>,
}

/// The model solved again in full, with the paddles of these indices, at the last tick before the needle moves and at
/// [`PICTURES`] ticks after it; fewer where there is no equilibrium.
///
/// # Errors
/// [`WorldError::NoPaddle`], [`WorldError::Tissue`] when the body is not held.
pub fn solved_bodies(model: &SpaceModel, paddles: &[u32], truths: &[Truth]) -> Result<Vec<SolvedBody>, WorldError> {
    let place = |index: &u32| model.scene().paddle_position(*index).map_err(|_| WorldError::NoPaddle { index: *index });
    let attached = paddles.iter().map(place).collect::<Result<Vec<_>, _>>()?;
    let mut body =
        model.body(&attached, NewtonSettings::default()).map_err(|source| WorldError::Tissue { depth: 0.0, source })?;
    let first = truths.partition_point(|truth| truth.depth <= 0.0).saturating_sub(1);
    let Some(way) = truths.len().checked_sub(first + 1) else { return Ok(Vec::new()) };
    let mut ticks: Vec<usize> = (0..=PICTURES).map(|i| first + way * i / PICTURES).collect();
    ticks.dedup();
    let mut solved = Vec::new();
    for truth in ticks.into_iter().map(|tick| truths[tick]) {
        let places: Vec<Vector3<f64>> = truth.paddles.iter().take(paddles.len()).map(|p| from_frame(*p)).collect();
        if body.drive(truth.depth, &places).is_err() {
            break;
        }
        let state = SpaceState { target: truth.target, ..SpaceState::new(&body, paddles) };
        solved.push(SolvedBody { truth, state, coefficients: body.equilibrium().coefficients().to_vec() });
    }
    Ok(solved)
}
