//! Reduced models of several tissues, trained side by side before insertions that the clock drives.

use model_offline::parallel;

use super::{Case, Comparison, EncodedTable};
use crate::runtime::plant::rehearsal::{needs_reduction, train_reduction};
use crate::runtime::signals;
use crate::world::tissue::AttachedPaddle;

/// What a training takes over what the tables before it took: of 1,000 to 3,000 nodes.
const TRAINING: f64 = 2.7;

impl Comparison<'_> {
    /// Trains what insertions in free-run will ask for, of several tissues at once: one after the other each would have a thread
    /// of its own and no more. What fails is told where it is needed.
    pub(super) fn train_for_free_run(&self) {
        let mut slow: Vec<(&Case, &EncodedTable)> = Vec::new();
        for (case, table) in self.cases.iter().zip(&self.tables).filter(|(case, _)| self.is_in_free_run(case)) {
            let is_known = |(other, its): &(&Case, &EncodedTable)| {
                other.tissue == case.tissue && its.table.paddles[0].index == table.table.paddles[0].index
            };
            let studied = self.studied(case.tissue);
            let paddle = AttachedPaddle::Steered(&table.table);
            if !slow.iter().any(is_known)
                && needs_reduction(studied.plant(), paddle, &self.simulation, &studied.reductions)
            {
                slow.push((case, table));
            }
        }
        if slow.len() < 2 || self.options.threads < 2 {
            return;
        }
        self.begins_in_addition("reduced models for free-run", 0, TRAINING * self.tables_took_s);
        signals::ends_at_once(|| {
            parallel::map(slow.len(), self.options.threads, |i| {
                let (case, table) = slow[i];
                let studied = self.studied(case.tissue);
                let paddle = AttachedPaddle::Steered(&table.table);
                train_reduction(studied.plant(), paddle, &self.simulation, &studied.reductions);
            })
        });
    }
}
