//! The tissue solved again along an insertion that is over: nothing is added to a loop on the machine's clock.

use model_offline::model::TissueModel;

use super::error::WorldError;
use super::tissue::{TissuePlant, TissueResponse as _, WantedPlant};
use super::truth::Truth;

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
