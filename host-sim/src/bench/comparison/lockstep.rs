//! Controlled insertions in simulated time, side by side: none has a clock that the others could disturb.

use model_offline::parallel;

use super::{Comparison, EncodedTable};
use crate::bench::error::SimError;
use crate::bench::insertion::{MeasuredInsertion, SimulatedInsertion};
use crate::bench::strategy::Strategy;
use crate::runtime::error::RuntimeError;
use crate::runtime::plant::observer::Spectator;
use crate::runtime::signals;
use crate::runtime::time::mode::RunMode;
use crate::world::simulation::Simulation;
use crate::world::tissue::WantedPlant;

/// Nodes times ticks of the largest insertion that is simulated again in full: a minute or so, at 5 to 13 µs each.
const MOST_WORK: u64 = 5_000_000;
/// What one node takes for one tick, s.
const NODE_TICK_S: f64 = 8e-6;

impl Comparison<'_> {
    /// The dynamic strategy of all cases in lockstep; none where only free-run is asked for. Who looks on sees one after
    /// the other.
    ///
    /// # Errors
    /// [`SimError`].
    pub(super) fn in_lockstep(
        &self,
        spectator: Option<&dyn Spectator>,
    ) -> Result<Vec<Option<MeasuredInsertion>>, SimError> {
        if self.options.mode == Some(RunMode::FreeRun) {
            return Ok(self.cases.iter().map(|_| None).collect());
        }
        let step = || self.progress.step();
        let insertion = |i: usize| -> SimulatedInsertion<'_> {
            let case = &self.cases[i];
            self.insertion(case, case.label(Strategy::dynamic(RunMode::Lockstep)), &step)
        };
        self.begins(&format!("dynamic, {}", RunMode::Lockstep));
        if spectator.is_some() {
            let watched = |(i, table): (usize, &EncodedTable)| {
                self.progress.say(&format!("{}: dynamic, {}", self.cases[i].tissue, RunMode::Lockstep));
                insertion(i).controlled(&self.controller(table, RunMode::Lockstep, spectator))
            };
            let measured = self.tables.iter().enumerate().map(watched).collect::<Result<Vec<_>, _>>()?;
            return self.in_full_where_off(measured);
        }
        let all: Vec<usize> = (0..self.cases.len()).collect();
        let measured = self.side_by_side(&all, &self.simulation, &step)?;
        self.in_full_where_off(measured.into_iter().collect::<Result<Vec<_>, _>>()?)
    }

    /// The dynamic strategy of these cases, in their order, each with what became of it.
    ///
    /// What leaves nothing to tidy up ends at once with a signal; the runs themselves look at signals, and each tidies up its link.
    /// One must not end while another runs: hence one step after the other. Plants are made in order: cases share reduced models,
    /// and one is trained on all threads.
    ///
    /// # Errors
    /// [`SimError`] where a plant cannot be made.
    fn side_by_side(
        &self,
        cases: &[usize],
        simulation: &Simulation,
        step: &(dyn Fn() + Sync),
    ) -> Result<Vec<Result<MeasuredInsertion, SimError>>, SimError> {
        let step = || step();
        let insertion = |i: usize| -> SimulatedInsertion<'_> {
            let label = self.cases[i].label(Strategy::dynamic(RunMode::Lockstep));
            SimulatedInsertion { simulation, ..self.insertion(&self.cases[i], label, &step) }
        };
        let controller = |i: usize| self.controller(&self.tables[i], RunMode::Lockstep, None);
        let plants = signals::ends_at_once(|| {
            cases.iter().map(|&i| Ok((i, insertion(i).plant(&controller(i))?))).collect::<Result<Vec<_>, SimError>>()
        })?;
        let finished = parallel::map_each(plants, self.options.threads, |(i, plant)| {
            (i, insertion(i).with_controller(&controller(i), plant))
        });
        Ok(signals::ends_at_once(|| {
            parallel::map_each(finished, self.options.threads, |(i, run)| {
                run.and_then(|run| insertion(i).measured(&controller(i), run))
            })
        }))
    }

    /// Tissue that has a past is simulated by the neighbourhood of the way that its paddle is planned to go, unless somebody says
    /// otherwise. A controller that goes elsewhere leaves it: where that makes the tissue off by much of the error, the insertion is
    /// simulated once more with the full model, unless that takes long.
    fn in_full_where_off(&self, measured: Vec<MeasuredInsertion>) -> Result<Vec<Option<MeasuredInsertion>>, SimError> {
        let mut measured: Vec<Option<MeasuredInsertion>> = measured.into_iter().map(Some).collect();
        let work = |i: usize| self.studied(self.cases[i].tissue).plant().nodes() as u64 * self.simulation.ticks();
        let off = |i: usize, near: &MeasuredInsertion| {
            let is_near_a_way = near.result.plant.path_knots.is_some() && self.simulation.plant.is_none();
            near.result.tissue_off_in_words().filter(|_| is_near_a_way && work(i) <= MOST_WORK)
        };
        let all = measured.iter().enumerate();
        let again: Vec<(usize, String)> = all.filter_map(|(i, near)| Some((i, off(i, near.as_ref()?)?))).collect();
        let Some((first, why)) = again.first() else { return Ok(measured) };
        let cases: Vec<usize> = again.iter().map(|(i, _)| *i).collect();
        let node_ticks: u64 = cases.iter().map(|&i| work(i)).sum();
        let side_by_side = self.options.threads.min(cases.len()).max(1) as f64;
        self.begins_in_addition(
            &format!("{}: the full model, because {why}", self.cases[*first].tissue),
            cases.len() as u64 * self.simulation.ticks(),
            NODE_TICK_S * node_ticks as f64 / side_by_side,
        );
        let simulation = Simulation { plant: Some(WantedPlant::Full), ..self.simulation.clone() };
        let step = || self.progress.step();
        for (outcome, (i, why)) in self.side_by_side(&cases, &simulation, &step)?.into_iter().zip(again) {
            match outcome {
                Ok(mut full) => {
                    let peak = measured[i].as_ref().map_or(0.0, |near| near.result.max_orthogonal_error);
                    full.result.plant.first_fallback =
                        Some(format!("near the planned way {peak:.1e} came out, and {why}"));
                    full.result.plant.left_the_way = true;
                    measured[i] = Some(full);
                }
                // Where the full model cannot go, the other one's answer is all there is, and is said not to be trusted.
                Err(SimError::Runtime(RuntimeError::World(error))) => {
                    let near = measured[i].as_mut().map(|near| &mut near.result.plant.not_in_full);
                    near.into_iter().for_each(|known| *known = Some(error.to_string()));
                }
                Err(error) => return Err(error),
            }
        }
        Ok(measured)
    }
}
