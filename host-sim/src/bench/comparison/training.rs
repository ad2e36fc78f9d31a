//! Reduced models of several tissues, trained side by side before insertions that the clock drives.

use model_offline::parallel;

use super::{Case, Comparison, EncodedTable};
use crate::runtime::plant::rehearsal::{needs_reduction, train_reduction};
use crate::runtime::signals;
use crate::world::tissue::AttachedPaddle;

/// What is said of it.
const WHAT: &str = "reduced models for free-run";
/// What a training takes over what the tables before it took: of 1,000 to 3,000 nodes.
const TRAINING: f64 = 2.7;

impl Comparison<'_> {
    /// Trains what insertions in free-run will ask for, of several tissues at once: most of a training has a single thread. What
    /// fails is told where it is needed.
    pub(super) fn train_for_free_run(&self) {
        let mut bodies: Vec<(&Case, &EncodedTable)> = Vec::new();
        for (case, table) in self.cases.iter().zip(&self.tables).filter(|(case, _)| self.is_in_free_run(case)) {
            let is_known = |(other, its): &(&Case, &EncodedTable)| {
                other.tissue == case.tissue && its.table.paddles[0].index == table.table.paddles[0].index
            };
            if !bodies.iter().any(is_known) {
                bodies.push((case, table));
            }
        }
        if bodies.len() < 2 || self.options.threads < 2 {
            return;
        }
        signals::ends_at_once(|| {
            // Timed one after the other, as they are before their runs.
            bodies.retain(|(case, table)| {
                let studied = self.studied(case.tissue);
                let paddle = AttachedPaddle::Steered(&table.table);
                needs_reduction(studied.plant(), paddle, &self.simulation, &studied.reductions)
            });
            if bodies.len() < 2 {
                return;
            }
            // Tables that were given say nothing of how fast it goes.
            match self.options.table {
                None => self.begins_in_addition(WHAT, 0, TRAINING * self.tables_took_s),
                Some(_) => self.progress.say(WHAT),
            }
            parallel::map(bodies.len(), self.options.threads, |i| {
                let (case, table) = bodies[i];
                let studied = self.studied(case.tissue);
                let paddle = AttachedPaddle::Steered(&table.table);
                train_reduction(studied.plant(), paddle, &self.simulation, &studied.reductions)
            });
        });
    }
}
