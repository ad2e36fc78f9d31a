//! Where each method stops working, and how: the needle is driven up to twice the scene's depth while one parameter at
//! a time is varied, for every meshfree rule and finite element.
//!
//! What limits a run may be the method or the law. [`law_limit`] gives the stretch past which the law itself no longer
//! resists compression; every run reports the smallest principal stretch of its last converged state beside it, and whether
//! strong ellipticity was lost anywhere: past that no continuum would stay whole, whatever the method.

pub mod bloch;
pub mod law_limit;
pub mod plan;
pub mod probe;
pub mod probe_space;
pub mod setting;
pub mod zero_energy;

mod chart;
mod claim;
mod files;

use crate::discretization::Resolution;
use crate::model::{ModelError, ModelFailure};
use crate::parallel;
use crate::scene::Scene;
use crate::scene::space::SpaceScene;
use crate::solver::equilibrium::FailureReason;
use crate::study::extent::Extent;
use law_limit::{Lateral, limit_stretch};
use plan::{Entry, Experiment};
use probe::{ExperimentResult, StopReason};
use setting::Setting;
use std::sync::OnceLock;
use zero_energy::{Unmeasured, ZeroEnergy};

pub use chart::figure;
pub use claim::{ClaimCounts, Pairs, claim_counts, summary};
pub use files::{csv, zero_energy_csv};

/// Whether the law with some factor c has a limit in compression, and where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawLimit {
    /// Factor c of the exponential term; absent for the scene's own law.
    pub c: Option<f64>,
    /// Stretch at the peak of nominal stress, lateral faces confined.
    pub confined: Option<f64>,
    /// The same with free lateral faces.
    pub free: Option<f64>,
}

/// A finished study.
#[derive(Debug, Clone)]
pub struct Stability {
    /// The scene.
    pub setting: Setting,
    /// Spacing that the sweeps are made at, length units.
    pub spacing: f64,
    /// Index of the paddle that was attached, static.
    pub paddle: u32,
    /// What was varied, and what came of it, in the order of the files.
    pub rows: Vec<(Entry, ExperimentResult)>,
    /// Limits of the scene's law, and of the law with every c that was tried.
    pub limits: Vec<LawLimit>,
    /// Zero-energy modes by method; in space they are not measured.
    pub zero_energy: Vec<ZeroEnergy>,
    /// Methods that have no model on those nodes.
    pub unmeasured: Vec<Unmeasured>,
}

impl Stability {
    /// Every setting once, however many sweeps it is part of.
    pub fn distinct(&self) -> Vec<(Experiment, &ExperimentResult)> {
        let mut distinct: Vec<(Experiment, &ExperimentResult)> = Vec::new();
        for (entry, outcome) in &self.rows {
            if !distinct.iter().any(|d| d.0 == entry.experiment) {
                distinct.push((entry.experiment, outcome));
            }
        }
        distinct
    }
}

/// Ends for want of memory, and for more nodes than are tried; no study asks for a tolerance.
const TOO_LARGE: [StopReason; 2] = [
    StopReason::Model(ModelFailure::Solve(FailureReason::TooLarge)),
    StopReason::Model(ModelFailure::ToleranceNotReached),
];

/// A study with its runs known, to say how many there are before they start.
#[derive(Debug)]
pub struct Plan {
    setting: Setting,
    entries: Vec<Entry>,
    /// Settings that differ, finest first, so that long runs do not come last.
    experiments: Vec<Experiment>,
}

impl Plan {
    /// What the study of a scene will run. Empty when the scene's resolution is not a spacing.
    pub fn new(setting: Setting, extent: Extent) -> Self {
        let entries = plan::entries(&setting, extent);
        let mut experiments: Vec<Experiment> = Vec::new();
        for entry in &entries {
            if !experiments.contains(&entry.experiment) {
                experiments.push(entry.experiment);
            }
        }
        experiments.sort_by(|a, b| a.spacing.total_cmp(&b.spacing));
        Self { setting, entries, experiments }
    }

    /// Number of runs.
    pub fn runs(&self) -> usize {
        self.experiments.len()
    }

    /// Runs everything with the paddle of this index attached; the result does not depend on `threads`.
    ///
    /// # Errors
    /// [`ModelError`] when the scene's own model cannot be made, has no paddle of this index, or when a run's model is too
    /// large: that is a limit of the machine and none of a method. A run that fails otherwise is a row of the result.
    pub fn run(
        &self,
        scene: &Scene,
        paddle: u32,
        threads: usize,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Stability, ModelError> {
        let place = scene.paddle_position(paddle)?;
        let mut study = self.with(paddle, threads, progress, &|experiment| probe::run(scene, place, experiment))?;
        (study.zero_energy, study.unmeasured) = zero_energy::measure(scene, study.spacing);
        Ok(study)
    }

    /// The same of a scene in space.
    ///
    /// # Errors
    /// As [`Plan::run`].
    pub fn run_in_space(
        &self,
        scene: &SpaceScene,
        paddle: u32,
        threads: usize,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Stability, ModelError> {
        let place = scene.paddle_position(paddle)?;
        let probe = |experiment: &Experiment| probe_space::run_in_space(scene, place, experiment);
        self.with(paddle, threads, progress, &probe)
    }

    fn with(
        &self,
        paddle: u32,
        threads: usize,
        progress: &(dyn Fn() + Sync),
        probe: &(dyn Fn(&Experiment) -> ExperimentResult + Sync),
    ) -> Result<Stability, ModelError> {
        let Resolution::Spacing(spacing) = self.setting.discretization.resolution else {
            return Err(ModelError::NoSpacing);
        };
        // The first that is too large; after it, nothing more is begun.
        let too_large = OnceLock::new();
        let outcomes = parallel::map(self.experiments.len(), threads, |i| {
            if too_large.get().is_some() {
                return None;
            }
            let outcome = probe(&self.experiments[i]);
            if TOO_LARGE.contains(&outcome.reason) {
                // Whoever was first.
                let _ = too_large.set(ModelError::StudyTooLarge {
                    spacing: self.experiments[i].spacing,
                    detail: outcome.detail.clone(),
                });
            }
            progress();
            Some(outcome)
        });
        if let Some(error) = too_large.into_inner() {
            return Err(error);
        }
        let rows = self
            .entries
            .iter()
            .filter_map(|entry| {
                let place = self.experiments.iter().position(|s| *s == entry.experiment)?;
                Some((*entry, outcomes[place].clone()?))
            })
            .collect();
        Ok(Stability {
            spacing,
            paddle,
            rows,
            limits: limits(&self.setting, &self.entries),
            zero_energy: Vec::new(),
            unmeasured: Vec::new(),
            setting: self.setting.clone(),
        })
    }
}

/// Limits of the scene's own law, then of those with every c of the plan.
fn limits(setting: &Setting, entries: &[Entry]) -> Vec<LawLimit> {
    let mut values: Vec<f64> = entries.iter().filter_map(|e| e.experiment.c).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    std::iter::once(None)
        .chain(values.into_iter().map(Some))
        .filter_map(|c| {
            let law = match c {
                None => setting.material.clone(),
                Some(c) => setting.material.with_exponential_factor(c)?.ok()?,
            };
            let at = |lateral| limit_stretch(&law, lateral);
            Some(LawLimit { c, confined: at(Lateral::Confined), free: at(Lateral::Free) })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::equilibrium::Failure;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A model that is too large ends the study; one that fails is a row.
    #[test]
    fn what_does_not_fit_into_memory_is_no_failure_of_a_method() {
        let mut scene = Scene::bundled("paper").unwrap();
        scene.discretization.resolution = Resolution::Spacing(0.1);
        let plan = Plan::new((&scene).into(), Extent::of_flag(true));
        let of = |reason| ModelError::Solve(Failure { reason, reached: 0.0, detail: "3 GB missing".to_owned() });
        let ends = |error: ModelError| {
            let runs = AtomicUsize::new(0);
            let probe = |_: &Experiment| {
                runs.fetch_add(1, Ordering::Relaxed);
                probe::stopped(100, &error)
            };
            (plan.with(3, 1, &|| (), &probe), runs.into_inner())
        };
        let (study, runs) = ends(of(FailureReason::LostStability));
        assert_eq!((study.unwrap().distinct().len(), runs), (plan.runs(), plan.runs()));
        let many = ModelError::TooManyNodes { nodes: 3000, limit: 2000 };
        for (error, why) in [(of(FailureReason::TooLarge), "3 GB missing"), (many, "3000 nodes are needed")] {
            let (refused, runs) = ends(error);
            let refused = refused.unwrap_err();
            let told = refused.to_string();
            assert!(told.contains("at spacing ") && told.contains(why) && !refused.is_usage(), "{told}");
            assert_eq!(runs, 1);
        }
    }
}
