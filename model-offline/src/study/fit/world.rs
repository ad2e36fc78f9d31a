//! Which of its own effects a scene needs, and how far a model with these is from a finer one with all of them.
//!
//! Every subset of the scene's effects is held against the model with all of them, from the cheapest up: what an effect
//! changes depends on what else there is. They are judged on nodes that do not depend on the tolerance, so that a smaller
//! one never needs less: those of the scene's spacing, else graded ones, coarse.

use super::change::Change;
use super::error::FitError;
use super::rejection::{Alternative, Rejected, RejectionReason, names};
use crate::discretization::{Discretization, Resolution};
use crate::model::{ModelError, TissueModel};
use crate::parallel;
use crate::placement::study::best_dynamic;
use crate::scene::Effect::{Breathing, Creep, Shaft};
use crate::scene::{Effect, Scene};
use crate::study::effects::{EffectsError, Followed, follow, followed, with_linear_laws};
use crate::study::measurement::Linearity;
use serde::Serialize;
use std::fmt::Write as _;

/// Every choice of effects but all, from the cheapest up: the fewest first, and of as many that of breathing, which leaves
/// the state of the tissue to needle, paddle and patient, before creep, and the shaft with its forces that are searched for
/// last.
const CHOICES: [&[Effect]; 7] =
    [&[], &[Breathing], &[Creep], &[Shaft], &[Creep, Breathing], &[Shaft, Breathing], &[Shaft, Creep]];
/// Refinement level that effects are judged at where the scene names no spacing.
const LEVEL: i32 = -2;
/// Largest finer model that a world is held against: it is followed through 60 increments.
const FINER_NODES: usize = 3000;
/// How often the chosen nodes are made coarser to get there.
const COARSENINGS: u32 = 8;

/// What a scene needs of its own effects.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct World {
    /// The effects that it needs.
    pub needed: Vec<Effect>,
    /// Those that it has and that can be left out.
    pub left_out: Vec<Effect>,
    /// What leaving them out changes, against the model with all.
    pub change: Change,
    /// Share of the tolerance that this may take up.
    pub share: f64,
    /// Paddle that is attached, and stays where it rests.
    pub paddle: u32,
    /// Nodes that effects were judged on.
    pub nodes: usize,
    /// Whether the table's knots were fitted; else they are the scene's, or the usual ones. Tables along an insertion with
    /// a past are not.
    pub is_table_fitted: bool,
    /// The model with the effects that are needed against the one with all on finer nodes.
    pub end_to_end: WorldEndToEnd,
}

/// The world that is needed against the one with all effects and the scene's own law, one level finer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldEndToEnd {
    /// How far the two are apart; none where one of them fails.
    pub change: Option<Change>,
    /// Nodes of the two.
    pub nodes: [usize; 2],
    /// Whether both are coarser than what was chosen, because the finer one would be too large to be followed.
    pub is_coarser: bool,
    /// Why there is no number.
    pub failure: Option<String>,
}

/// The effects that a scene needs, and what rejected every cheaper choice.
#[derive(Debug, Clone)]
pub struct JudgedWorld {
    /// The effects that it needs.
    pub needed: Vec<Effect>,
    /// What leaving the others out changes, against the model with all.
    pub change: Change,
    /// What was asked of that change: the larger of its shares.
    pub tolerance: f64,
    /// Paddle that is attached, and stays where it rests.
    pub paddle: u32,
    /// Nodes that effects are judged on.
    pub nodes: usize,
    /// Every cheaper choice.
    pub rejected: Vec<Rejected>,
    /// The scene on these nodes.
    on: Scene,
    /// The insertion with the effects that are needed.
    found: Followed,
}

/// The cheapest choice of the scene's own effects that is within the tolerance of the model with all of them.
///
/// # Errors
/// [`FitError::World`] where the model with all of them cannot be followed.
pub fn judge_world(scene: &Scene, tolerance: f64, threads: usize) -> Result<JudgedWorld, FitError> {
    let on = on_fixed_nodes(scene);
    let model = TissueModel::new(&on.without_a_past())?;
    let (paddle, nodes) = (best_dynamic(&model)?, model.nodes());
    let own = on.own_effects();
    let failed = |source| FitError::World { effects: names(&own), source };
    let all = followed(&on, paddle).map_err(failed)?;
    let is_part = |choice: &&[Effect]| choice.len() < own.len() && choice.iter().all(|effect| own.contains(effect));
    let cheaper: Vec<&'static [Effect]> = CHOICES.into_iter().filter(is_part).collect();
    let mut rejected = Vec::new();
    // As many effects at a time are tried side by side.
    for same in cheaper.chunk_by(|a, b| a.len() == b.len()) {
        let tried = parallel::map(same.len(), threads, |k| followed(&on.keeping_only(same[k]), paddle));
        for (choice, outcome) in same.iter().zip(tried) {
            let reason = match outcome {
                Ok(found) => match Change::between(&found, &all, &on) {
                    change if change.worst() <= tolerance => {
                        let needed = choice.to_vec();
                        return Ok(JudgedWorld { needed, change, tolerance, paddle, nodes, rejected, on, found });
                    }
                    change => RejectionReason::LeavesOut(change),
                },
                Err(error) => RejectionReason::NotFollowed(error),
            };
            rejected.push(Rejected::new(Alternative::Effects(choice), reason));
        }
    }
    let change = Change { target: 0.0, controllability: 0.0 };
    Ok(JudgedWorld { needed: own, change, tolerance, paddle, nodes, rejected, on, found: all })
}

/// The scene on the nodes that effects are judged on.
fn on_fixed_nodes(scene: &Scene) -> Scene {
    let spec = scene.discretization;
    let resolution = match spec.resolution {
        Resolution::Spacing(spacing) => Resolution::Spacing(spacing),
        Resolution::Tolerance(_) | Resolution::Level(_) => Resolution::Level(LEVEL),
    };
    scene.with_discretization(Discretization { resolution, ..spec })
}

fn has_linear_laws(scene: &Scene) -> bool {
    let own = scene.inclusions.iter().filter_map(|inclusion| inclusion.material.as_ref());
    std::iter::once(&scene.material).chain(own).all(|law| law.is_linear())
}

/// Models of two scenes, the second one level finer: on the chosen nodes, or on the finest coarser ones of the kind that can
/// be followed.
fn pair(one: &Scene, other: &Scene, chosen: &Discretization) -> Result<[TissueModel; 2], ModelError> {
    let mut resolution = chosen.resolution;
    let mut coarsenings = 0..COARSENINGS;
    loop {
        let on = |scene: &Scene, resolution| {
            TissueModel::new(&scene.with_discretization(Discretization { resolution, ..*chosen }))
        };
        let outcome = match on(other, resolution.finer()) {
            Ok(finer) if finer.nodes() > FINER_NODES => {
                Err(ModelError::TooManyNodes { nodes: finer.nodes(), limit: FINER_NODES })
            }
            finer => finer.and_then(|finer| Ok([on(one, resolution)?, finer])),
        };
        match outcome {
            Err(ModelError::TooManyNodes { .. }) if coarsenings.next().is_some() => resolution = resolution.coarser(),
            outcome => return outcome,
        }
    }
}

impl JudgedWorld {
    /// Whether the linear law will do with the effects that are needed; where not, what it changes.
    pub(super) fn law(&self, tolerance: f64) -> (Linearity, Vec<Rejected>) {
        let own = self.on.keeping_only(&self.needed);
        let linear = with_linear_laws(&own);
        if has_linear_laws(&own) {
            return (Linearity::Linear, Vec::new());
        }
        if !has_linear_laws(&linear) {
            // A law without a small-strain limit to try.
            return (Linearity::Nonlinear, Vec::new());
        }
        let reason = match followed(&linear, self.paddle) {
            Ok(found) => match Change::between(&found, &self.found, &self.on) {
                change if change.worst() <= tolerance => return (Linearity::Linear, Vec::new()),
                change => RejectionReason::LinearLawInWorld(change),
            },
            Err(error) => RejectionReason::NotFollowed(error),
        };
        (Linearity::Nonlinear, vec![Rejected::new(Alternative::LinearLawInWorld, reason)])
    }

    /// The result, held against the model with all effects one level finer.
    pub(super) fn against_finer(&self, chosen: &Discretization, law: Linearity, threads: usize) -> World {
        let kept = self.on.keeping_only(&self.needed);
        let kept = if law == Linearity::Linear { with_linear_laws(&kept) } else { kept };
        let models = pair(&kept, &self.on, chosen);
        let nodes = models.as_ref().map_or([0; 2], |models| [models[0].nodes(), models[1].nodes()]);
        let is_coarser =
            models.as_ref().is_ok_and(|models| models[0].scene().discretization.resolution != chosen.resolution);
        let found = models.map_err(EffectsError::from).and_then(|models| {
            let followed = parallel::map(2, threads, |k| follow(&models[k], self.paddle));
            followed.into_iter().collect::<Result<Vec<Followed>, EffectsError>>()
        });
        let apart = found.map(|found| Change::between(&found[0], &found[1], &self.on));
        let left_out = self.on.own_effects().into_iter().filter(|effect| !self.needed.contains(effect)).collect();
        World {
            needed: self.needed.clone(),
            left_out,
            change: self.change,
            share: self.tolerance,
            paddle: self.paddle,
            nodes: self.nodes,
            is_table_fitted: !self.needs_a_table_along_the_insertion(),
            end_to_end: WorldEndToEnd {
                change: apart.as_ref().ok().copied(),
                nodes,
                is_coarser,
                failure: apart.err().map(|error| error.to_string()),
            },
        }
    }

    /// Whether tables follow the insertion in time: tissue that slips or relaxes. A table knows no breath.
    pub(super) fn needs_a_table_along_the_insertion(&self) -> bool {
        self.needed.iter().any(|effect| *effect != Breathing)
    }
}

impl World {
    /// What is needed, what is left out, and how far the rest is from everything.
    pub(super) fn summary(&self, tolerance: f64) -> String {
        let list = |effects: &[Effect]| if effects.is_empty() { "nothing".to_owned() } else { names(effects) };
        let left_out = match self.left_out.is_empty() {
            true => "nothing left out".to_owned(),
            false => format!("{} left out: changes {}", names(&self.left_out), self.change),
        };
        let mut out = format!(
            "world needs: {}; {left_out} (at most {:.3} %; paddle {}, {} nodes)\n",
            list(&self.needed),
            100.0 * self.share,
            self.paddle,
            self.nodes
        );
        let [chosen, finer] = self.end_to_end.nodes;
        let _ = match (&self.end_to_end.change, &self.end_to_end.failure) {
            (Some(change), _) => {
                let beyond = match (self.end_to_end.is_coarser, change.worst() <= tolerance) {
                    (true, true) => " (coarser than the chosen ones, which take too long to follow)",
                    (true, false) => {
                        ": ABOVE the tolerance, on nodes that are coarser than the chosen ones; these take too long to follow, \
                         and whether they keep it is not known"
                    }
                    (false, true) => "",
                    (false, false) => ": ABOVE the tolerance",
                };
                writeln!(out, "{chosen} nodes with these effects against {finer} with all: {change}{beyond}")
            }
            (None, failure) => {
                let why = failure.as_deref().unwrap_or("unknown");
                writeln!(out, "these effects against all on finer nodes: no number: {why}")
            }
        };
        if !self.is_table_fitted {
            out.push_str(
                "the table is not fitted: one along an insertion in time has as many knots as it is asked for\n",
            );
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On nodes coarser than the chosen ones nothing was said of a tolerance that they do not keep.
    #[test]
    fn what_is_above_the_tolerance_is_said_on_whatever_nodes_it_was_found() {
        let summary = |controllability: f64, is_coarser: bool| {
            let change = Change { target: 0.01, controllability };
            let end_to_end = WorldEndToEnd { change: Some(change), nodes: [616, 941], is_coarser, failure: None };
            let change = Change { target: 0.0, controllability: 0.0 };
            let (needed, left_out) = (vec![Shaft], Vec::new());
            World { needed, left_out, change, share: 0.0075, paddle: 1, nodes: 9, is_table_fitted: true, end_to_end }
                .summary(0.05)
        };
        let told = |controllability, is_coarser| {
            let text = summary(controllability, is_coarser);
            ["ABOVE the tolerance", "coarser than the chosen ones", "is not known"].map(|part| text.contains(part))
        };
        assert_eq!(told(0.049, false), [false, false, false]);
        assert_eq!(told(0.051, false), [true, false, false]);
        assert_eq!(told(0.049, true), [false, true, false]);
        assert_eq!(told(0.051, true), [true, true, true]);
        assert_eq!(told(f64::NAN, true), [true, true, true]);
    }
}
