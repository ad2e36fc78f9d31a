//! What a comparison consists of, and how long its parts take.

use super::Comparison;
use crate::bench::forecast::Part;
use crate::runtime::executor::Hardware;
use crate::runtime::time::mode::RunMode;
use model_offline::scene::TissueVariant;

/// Work of the jobs of a comparison, on one thread: medians of scenes of 100 to 2,700 nodes, from which single ones differ by
/// a factor of up to two.
struct Jobs {
    study: f64,
    table: f64,
    uncontrolled: f64,
    controlled: f64,
}

/// Of tissue that answers to where needle and paddle are.
const ELASTIC: Jobs = Jobs { study: 0.2, table: 1.0, uncontrolled: 0.6, controlled: 0.87 };

/// Of tissue and needles that have a past: they are solved for at more moments.
const WITH_A_PAST: Jobs = Jobs { study: 0.2, table: 1.0, uncontrolled: 1.4, controlled: 3.2 };

impl Comparison<'_> {
    /// What the comparison consists of, in the order in which it is done; nothing where that says too little of how long it
    /// takes.
    pub(super) fn parts(&self) -> Vec<Part> {
        let options = &self.options;
        if options.hardware == Hardware::Qemu || options.causes {
            return Vec::new();
        }
        let has_a_past = TissueVariant::ALL.iter().any(|tissue| tissue.of(&self.scene).has_a_past());
        let jobs = if has_a_past { WITH_A_PAST } else { ELASTIC };
        let tissues = self.tissues();
        let tables = tissues.iter().filter(|tissue| self.needs_table(**tissue)).count();
        let uncontrolled = self.cases.iter().map(|case| if case.is_mismatch { 1 } else { 2 }).sum();
        let in_parallel = |count: usize, work: f64| {
            let rounds = (count as f64 / options.threads as f64).max(1.0);
            Part::work(work * rounds)
        };
        let mut parts: Vec<Part> = tissues.iter().map(|_| in_parallel(1, jobs.study)).collect();
        parts.extend((tables > 0).then(|| in_parallel(tables, jobs.table)));
        parts.push(in_parallel(uncontrolled, jobs.uncontrolled));
        if options.mode != Some(RunMode::FreeRun) {
            parts.push(in_parallel(self.cases.len(), jobs.controlled));
        }
        let free_run = Part::free_run(self.simulation.duration_s);
        parts.extend(self.cases.iter().filter(|case| self.is_in_free_run(case)).map(|_| free_run));
        parts
    }

    /// Something that nobody foresaw begins: of so many steps, and of so many seconds.
    pub(super) fn begins_in_addition(&self, what: &str, steps: u64, takes_s: f64) {
        self.progress.extend(steps);
        self.forecast.interpose(takes_s);
        self.begins(what);
    }

    /// The next of the parts begins.
    pub(super) fn begins(&self, what: &str) {
        self.forecast.begins(what, self.progress);
    }
}
