//! Controlled insertions in simulated time, side by side: none has a clock that the others could disturb.

use model_offline::parallel;

use super::{Comparison, EncodedTable};
use crate::bench::error::SimError;
use crate::bench::insertion::{MeasuredInsertion, SimulatedInsertion};
use crate::bench::strategy::Strategy;
use crate::runtime::plant::observer::Spectator;
use crate::runtime::signals;
use crate::runtime::time::mode::RunMode;

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
                insertion(i).controlled(&self.controller(table, RunMode::Lockstep, spectator)).map(Some)
            };
            return self.tables.iter().enumerate().map(watched).collect();
        }
        let controller = |i: usize| self.controller(&self.tables[i], RunMode::Lockstep, None);
        // What leaves nothing to tidy up ends at once with a signal; the runs themselves look at signals, and each tidies
        // up its link. One must not end while another runs: hence one step after the other. Plants are made in order:
        // cases share reduced models, and one is trained on all threads.
        let plants = signals::ends_at_once(|| {
            (0..self.cases.len())
                .map(|i| Ok((i, insertion(i).plant(&controller(i))?)))
                .collect::<Result<Vec<_>, SimError>>()
        })?;
        let finished = parallel::map_each(plants, self.options.threads, |(i, plant)| {
            Ok((i, insertion(i).with_controller(&controller(i), plant)?))
        });
        let finished = finished.into_iter().collect::<Result<Vec<_>, SimError>>()?;
        let measured = signals::ends_at_once(|| {
            parallel::map_each(finished, self.options.threads, |(i, run)| insertion(i).measured(&controller(i), run))
        });
        measured.into_iter().map(|measured| measured.map(Some)).collect()
    }
}
