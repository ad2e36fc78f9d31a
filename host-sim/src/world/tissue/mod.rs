//! What answers for the tissue at every tick: the full model, a reduced one with the full one behind it, or the
//! condensed linear one.
//!
//! Where time is simulated, the full model is solved as often as an error of [`EXTRAPOLATION`] asks, and extrapolated
//! between; a loop that the machine's clock drives solves at every tick, because it has no time for one tick's solve
//! after many without.

use std::sync::Arc;

use clap::ValueEnum;
use model_offline::model::{Body, Pose, TissueModel};
use model_offline::needle::Course;
use model_offline::output::NodalFields;
use model_offline::reduction::along_path::{PathBody, along};
use model_offline::reduction::online::{ReducedBody, ReducedModel};
use model_offline::reduction::{Condensed, Extrapolated, TrainingError};
use model_offline::scene::PlantModel;
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::{SVector, Vector2};

use super::error::WorldError;
use super::needle::NeedleTrajectory;
use super::truth::NeedleMoment;

mod account;
mod answered;
mod attachment;
mod reductions;

pub use account::PlantAccount;
use answered::{Answer, Answered};
pub use attachment::{AttachedPaddle, Attachment, Insertion, PaddlePlan};
pub use reductions::Reductions;

/// Error of an extrapolated target displacement that is aimed at, over the depth that the scene inserts to: a thousandth of
/// the noise that the target is seen with.
pub const EXTRAPOLATION: f64 = 1e-7;

/// Time between two readings of the needle, s.
const READING_S: f64 = 0.02;

/// Which model is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum WantedPlant {
    /// The full nonlinear model: solved at every tick in free-run, else as often as an error of 1e-7 of the depth asks
    #[default]
    Full,
    /// A reduced nonlinear model, trained before the run; the full one where it does not hold; of tissue that has a past the
    /// neighbourhood of the insertion
    Reduced,
    /// The linear model, statically condensed: exact for small depths only
    Condensed,
    /// What `model-offline fit` wrote into the scene, else the reduced model if it can be trained
    Auto,
}

/// What answers for the tissue in D dimensions.
pub trait TissueResponse<const D: usize = 2> {
    /// Takes needle and paddles to where they are now; returns the target displacement, length.
    ///
    /// # Errors
    /// [`WorldError::Tissue`] when there is no equilibrium.
    fn step(&mut self, depth: f64, paddles: &[SVector<f64, D>]) -> Result<SVector<f64, D>, WorldError>;

    /// The same so many seconds after the start of the needle (negative: not started), for tissue that has a past.
    ///
    /// # Errors
    /// [`WorldError`].
    fn step_at(
        &mut self,
        since_start_s: f64,
        depth: f64,
        paddles: &[SVector<f64, D>],
    ) -> Result<SVector<f64, D>, WorldError> {
        let _ = since_start_s;
        self.step(depth, paddles)
    }
}

/// The tissue of a scene, by the model that was chosen.
#[derive(Debug)]
pub struct TissuePlant<'m> {
    model: &'m TissueModel,
    paddle: Option<usize>,
    kind: Kind<'m>,
    at: (f64, Vector2<f64>),
    account: PlantAccount,
    /// What a model that stands in for the full one answered itself.
    answered: Answered,
    needle: Vec<NeedleMoment>,
}

#[derive(Debug)]
enum Kind<'m> {
    Full(Box<Body<'m>>),
    Extrapolated(Box<Extrapolated<'m>>),
    Reduced {
        body: Box<ReducedBody>,
        /// Made when it is first needed.
        full: Option<Box<Body<'m>>>,
        /// Whether the full one has the present state.
        full_answers: bool,
    },
    Condensed(Condensed),
    /// The full model of tissue that has a past, taken on in time.
    Course {
        course: Box<Course<'m>>,
        since_start_s: f64,
    },
    /// The neighbourhood of one insertion of it.
    Path(Box<AlongInsertion>),
}

/// A body beside the path of an insertion, and where the paddle was at its knots and half way between.
#[derive(Debug)]
struct AlongInsertion {
    body: PathBody,
    trajectory: NeedleTrajectory,
    interval_s: f64,
    paddle: Vec<Vector2<f64>>,
}

impl AlongInsertion {
    /// The same insertion, from its start.
    fn afresh(&self) -> Self {
        let Self { body, trajectory, interval_s, .. } = self;
        Self { body: body.afresh(), trajectory: trajectory.clone(), interval_s: *interval_s, paddle: Vec::new() }
    }

    /// The full model on the same way.
    fn held_against_full(&self, model: &TissueModel, paddle: Option<usize>) -> Result<HeldAgainst, TrainingError> {
        let way = |time: f64| model.pose_at(time, self.trajectory.at(time).depth);
        let full = along(model, paddle, &way, self.interval_s, &self.paddle)?;
        let mut body = self.body.afresh();
        let mut held = HeldAgainst { largest: 0.0, at_end: 0.0, apart_s: 0.0, apart: 0.0, needle: Vec::new() };
        for (k, (full, paddle)) in full.into_iter().zip(&self.paddle).enumerate() {
            let since_start_s = self.interval_s * k as f64;
            body.go_to(since_start_s, *paddle);
            held.at_end = (body.target_displacement() - full.target).norm();
            if body.is_apart_from(full.needle.cut_length.is_none()) {
                held.apart_s += self.interval_s;
                held.apart = held.apart.max(held.at_end);
            } else {
                held.largest = held.largest.max(held.at_end);
            }
            held.needle.push(NeedleMoment { since_start_s, reading: full.needle });
        }
        if held.apart_s > MOST_APART_S {
            held.largest = held.largest.max(held.apart);
        }
        Ok(held)
    }
}

/// What became of holding a learnt insertion against the full model.
struct HeldAgainst {
    /// Largest distance between the targets, while the skin holds in both or in neither, length.
    largest: f64,
    /// The last one, length.
    at_end: f64,
    /// How long the skin held in one of them only, s.
    apart_s: f64,
    /// Largest distance between the targets meanwhile, length.
    apart: f64,
    /// What the needle met.
    needle: Vec<NeedleMoment>,
}

/// Where the skin gives way at moments further apart than this, s, they are not the same insertion any more.
const MOST_APART_S: f64 = 0.1;

impl<'m> TissuePlant<'m> {
    /// Tissue at rest; `paddle` is the place of the attached one in the scene's list.
    ///
    /// # Errors
    /// [`WorldError::Tissue`] or, of tissue that has a past, [`WorldError::Needle`] when the body is not held; [`WorldError::Training`] or [`WorldError::Condensation`] when
    /// the reduced model that was asked for cannot be made (with [`WantedPlant::Auto`] the full one answers, and the account says why).
    pub fn new(model: &'m TissueModel, paddle: Option<usize>, choice: WantedPlant) -> Result<Self, WorldError> {
        Self::sharing(model, Attachment::moved(paddle), choice, &Reductions::default())
    }

    /// The same with reduced models that others of this tissue have asked for, or will.
    ///
    /// # Errors
    /// As [`TissuePlant::new`].
    pub fn sharing(
        model: &'m TissueModel,
        attachment: Attachment,
        choice: WantedPlant,
        reductions: &Reductions,
    ) -> Result<Self, WorldError> {
        let paddle = attachment.paddle;
        if model.scene().has_a_past() {
            return Self::on_course(model, paddle);
        }
        let mut account = PlantAccount::default();
        let wanted = match (choice, &model.scene().fit) {
            (WantedPlant::Full, _) => PlantModel::Full,
            (WantedPlant::Condensed, _) => PlantModel::Condensed,
            (WantedPlant::Reduced, _) | (WantedPlant::Auto, None) => PlantModel::Reduced,
            (WantedPlant::Auto, Some(fit)) => fit.plant,
        };
        let kind = match wanted {
            PlantModel::Full => in_simulated_time(model, paddle)?,
            PlantModel::Condensed => {
                account.model = PlantModel::Condensed;
                let condensed = Condensed::new(model, paddle).map_err(WorldError::Condensation)?;
                Kind::Condensed(condensed)
            }
            PlantModel::Reduced => match reductions.of(model, attachment) {
                Ok((reduced, report)) => {
                    account.model = PlantModel::Reduced;
                    account.modes = Some(report.modes);
                    account.points = Some([report.points, report.full_points]);
                    return Ok(Self { account, ..Self::reduced(model, paddle, &reduced) });
                }
                Err(error) if choice == WantedPlant::Auto => {
                    account.first_fallback = Some(error.to_string());
                    in_simulated_time(model, paddle)?
                }
                Err(error) => return Err(WorldError::Training(error)),
            },
        };
        Ok(Self::at_rest(model, paddle, kind, account))
    }

    fn at_rest(model: &'m TissueModel, paddle: Option<usize>, kind: Kind<'m>, account: PlantAccount) -> Self {
        let (at, answered) = ((0.0, Vector2::zeros()), Answered::default());
        Self { model, paddle, kind, at, account, answered, needle: Vec::new() }
    }

    /// The full model of tissue that has a past: at every step it is taken on in time.
    ///
    /// # Errors
    /// [`WorldError::Needle`] when the body is not held.
    fn on_course(model: &'m TissueModel, paddle: Option<usize>) -> Result<Self, WorldError> {
        let course = Course::in_small_steps(model, paddle).map_err(WorldError::Needle)?;
        let kind = Kind::Course { course: Box::new(course), since_start_s: 0.0 };
        Ok(Self::at_rest(model, paddle, kind, PlantAccount::default()))
    }

    /// Tissue that has a past, as a scene has it, along one insertion: by the neighbourhood of it, which is learnt unless the full model is
    /// asked for.
    ///
    /// # Errors
    /// [`WorldError`].
    pub fn along(
        model: &'m TissueModel,
        attachment: Attachment,
        choice: Option<WantedPlant>,
        insertion: Insertion,
        reductions: &Reductions,
    ) -> Result<Self, WorldError> {
        match choice {
            Some(WantedPlant::Full) => return Self::on_course(model, attachment.paddle),
            Some(WantedPlant::Condensed) => return Err(WorldError::CondensedHasNoPast),
            Some(WantedPlant::Reduced | WantedPlant::Auto) | None => {}
        }
        let path = reductions.path(model, attachment, &insertion).map_err(WorldError::Training)?;
        let mut plant = Self::on_course(model, attachment.paddle)?;
        plant.account.model = PlantModel::Reduced;
        plant.account.path_knots = Some(path.knots());
        plant.account.largest_estimate = Some(0.0);
        // The full model is held against it in half of its steps.
        let interval_s = 0.5 * path.interval();
        plant.kind = Kind::Path(Box::new(AlongInsertion {
            body: path.body(),
            trajectory: insertion.trajectory,
            interval_s,
            paddle: Vec::new(),
        }));
        Ok(plant)
    }

    /// Tissue at rest by a reduced model that has been trained on it with this paddle; the full one answers where the
    /// reduced one does not hold.
    pub fn reduced(model: &'m TissueModel, paddle: Option<usize>, trained: &Arc<ReducedModel>) -> Self {
        let kind = Kind::Reduced { body: Box::new(trained.body()), full: None, full_answers: false };
        let account = PlantAccount { model: PlantModel::Reduced, ..PlantAccount::default() };
        Self::at_rest(model, paddle, kind, account)
    }

    /// Largest error of the target displacement so far that the model estimated of itself, length.
    pub fn largest_estimate(&self) -> Option<f64> {
        self.account.largest_estimate
    }

    /// What the needle has met, where the world has one that slips: at every moment of a full model's way, and of a reduced
    /// one's once its [`account`](Self::account) has been made.
    pub fn needle(&self) -> &[NeedleMoment] {
        &self.needle
    }

    /// Solves the full model at every step from now on, where it answers.
    ///
    /// # Errors
    /// [`WorldError::Tissue`].
    pub fn solve_every_step(&mut self) -> Result<(), WorldError> {
        if matches!(self.kind, Kind::Extrapolated(_)) {
            self.kind = Kind::Full(self.solved_in_full()?);
        }
        Ok(())
    }

    /// Notes that this model answers because the full one takes so long, µs a step.
    pub fn stands_in_for_full(&mut self, full_step_us: f64) {
        self.account.full_step_us = Some(full_step_us);
    }

    /// Does something with the tissue that is no part of the run: it is at rest afterwards, and its account is as before,
    /// but for the solves of a full model that is extrapolated.
    ///
    /// # Errors
    /// [`WorldError::Tissue`].
    pub fn aside<R>(&mut self, act: impl FnOnce(&mut Self) -> Result<R, WorldError>) -> Result<R, WorldError> {
        let (account, answered) = (self.account.clone(), std::mem::take(&mut self.answered));
        let past = match &self.kind {
            Kind::Course { course, since_start_s } => {
                Some(Kind::Course { course: course.clone(), since_start_s: *since_start_s })
            }
            Kind::Path(along) => Some(Kind::Path(Box::new(along.afresh()))),
            _ => None,
        };
        let outcome = act(self)?;
        match past {
            Some(kind) => {
                (self.kind, self.at) = (kind, (0.0, Vector2::zeros()));
                self.needle.clear();
            }
            None => drop(self.step(0.0, &[Vector2::zeros()])?),
        }
        (self.account, self.answered) = (account, answered);
        Ok(outcome)
    }

    /// The coefficients behind the present state, where the model has them (the condensed one has not).
    pub fn copy_coefficients(&self, into: &mut Vec<f64>) {
        into.clear();
        match &self.kind {
            Kind::Full(body) => into.extend_from_slice(body.equilibrium().coefficients()),
            Kind::Extrapolated(body) => into.extend(body.coefficients()),
            Kind::Reduced { full: Some(body), full_answers: true, .. } => {
                into.extend_from_slice(body.equilibrium().coefficients());
            }
            Kind::Reduced { body, .. } => into.extend(body.coefficients()),
            Kind::Condensed(_) => into.resize(self.model.dofs(), 0.0),
            Kind::Course { course, .. } => into.extend_from_slice(course.coefficients()),
            Kind::Path(along) => into.extend_from_slice(along.body.coefficients()),
        }
    }

    /// The coefficients of a picture: those behind the present state, solved for where the model has condensed them out.
    fn picture(&self) -> Option<Vec<f64>> {
        // The linear model has condensed the nodes out; the picture is the full model's.
        if matches!(self.kind, Kind::Condensed(_)) {
            return Some(self.solved_in_full().ok()?.equilibrium().coefficients().to_vec());
        }
        let mut coefficients = Vec::new();
        self.copy_coefficients(&mut coefficients);
        Some(coefficients)
    }

    /// Where the nodes are now.
    pub fn deformed_nodes(&self) -> Vec<[f64; 2]> {
        let Some(coefficients) = self.picture() else { return Vec::new() };
        let displacements = self.model.nodal_displacements(&coefficients).unwrap_or_default();
        self.model
            .positions()
            .iter()
            .zip(displacements)
            .map(|(rest, displacement)| [rest.x + displacement.x, rest.y + displacement.y])
            .collect()
    }

    /// Strain and stress at the nodes now; none where there is no state to show.
    pub fn nodal_fields(&self) -> Option<NodalFields> {
        Some(NodalFields::new(self.model, &self.picture()?))
    }

    /// The account, with the distance from the full model in some of the states that another one answered. A full model that was
    /// extrapolated is solved where it is: that is the state of a picture, too.
    pub fn account(&mut self) -> PlantAccount {
        let mut account = self.account.clone();
        if let Kind::Extrapolated(body) = &mut self.kind {
            // Where there is no equilibrium any more the next step says so.
            let _ = body.settle();
            account.solves = Some(body.account().solves);
            account.extrapolation_error = Some(body.account().largest_error);
        } else if let Kind::Path(taken) = &self.kind {
            match taken.held_against_full(self.model, self.paddle) {
                Ok(HeldAgainst { largest, at_end, apart_s, apart, needle }) => {
                    account.extrapolation_error = Some(largest);
                    account.error_at_end = Some(at_end);
                    account.puncture_apart_s = (apart_s > 0.0).then_some(apart_s);
                    account.puncture_apart_error = (apart_s > 0.0).then_some(apart);
                    if self.model.scene().needle.shaft.is_some() {
                        self.needle = needle;
                    }
                }
                Err(error) => account.not_verified = Some(error.to_string()),
            }
        } else if !matches!(self.kind, Kind::Full(_) | Kind::Course { .. }) {
            (account.states_verified, account.largest_error) = match self.answered_against_full() {
                Ok((_, 0)) => (None, None),
                Ok((largest, states)) => (Some(states), Some(largest)),
                Err(error) => {
                    account.not_verified = Some(error.to_string());
                    (None, None)
                }
            };
        }
        account
    }

    /// The largest distance from the full model in the states that were kept of those that another one answered, and how many
    /// these are. The full one goes from each to the next, as the other did.
    fn answered_against_full(&self) -> Result<(f64, usize), WorldError> {
        let mut body = full(self.model, self.paddle)?;
        let (mut largest, mut states) = (0.0_f64, 0);
        for answer in self.answered.states() {
            let truth = drive(&mut body, answer.depth, answer.paddle)?;
            largest = largest.max((answer.target - truth).norm());
            states += 1;
        }
        Ok((largest, states))
    }

    fn solved_in_full(&self) -> Result<Box<Body<'m>>, WorldError> {
        let mut body = full(self.model, self.paddle)?;
        drive(&mut body, self.at.0, self.at.1)?;
        Ok(body)
    }
}

impl TissueResponse for TissuePlant<'_> {
    fn step_at(
        &mut self,
        since_start_s: f64,
        depth: f64,
        paddles: &[Vector2<f64>],
    ) -> Result<Vector2<f64>, WorldError> {
        let paddle = only(paddles);
        let moment_s = since_start_s.max(0.0);
        match &mut self.kind {
            Kind::Course { course, since_start_s: before_s } => {
                self.at = (depth, paddle);
                let pose = Pose { paddle, ..self.model.pose_at(moment_s, depth) };
                if pose != course.pose() || moment_s > *before_s {
                    // To the nanosecond: steps of one length have one set of moduli.
                    let elapsed_s = ((moment_s - *before_s).max(0.0) * 1e9).round() * 1e-9;
                    course.take_in(pose, elapsed_s).map_err(WorldError::Needle)?;
                }
                *before_s = moment_s;
                let due = self.needle.last().is_none_or(|last| moment_s >= last.since_start_s + READING_S);
                if due && since_start_s >= 0.0 && self.model.scene().needle.shaft.is_some() {
                    self.needle.push(NeedleMoment { since_start_s, reading: course.reading() });
                }
                Ok(course.target_displacement())
            }
            Kind::Path(along) => {
                self.at = (depth, paddle);
                along.body.go_to(moment_s, paddle);
                while along.paddle.len() as f64 * along.interval_s <= moment_s {
                    along.paddle.push(paddle);
                }
                self.account.largest_estimate = Some(along.body.error_estimate());
                Ok(along.body.target_displacement())
            }
            _ => self.step(depth, paddles),
        }
    }

    fn step(&mut self, depth: f64, paddles: &[Vector2<f64>]) -> Result<Vector2<f64>, WorldError> {
        let paddle = only(paddles);
        self.at = (depth, paddle);
        match &mut self.kind {
            Kind::Full(body) => drive(body, depth, paddle),
            Kind::Extrapolated(body) => {
                let driven = body.drive(depth, paddle);
                driven.map_err(|source| WorldError::Tissue { depth: body.depth(), source })?;
                Ok(body.target_displacement())
            }
            Kind::Condensed(condensed) => {
                let target = condensed.target_displacement(depth, paddle);
                self.answered.take_in(Answer { depth, paddle, target });
                Ok(target)
            }
            Kind::Course { since_start_s, .. } => {
                let now_s = *since_start_s;
                self.step_at(now_s, depth, paddles)
            }
            Kind::Path(along) => {
                along.body.displace(paddle);
                Ok(along.body.target_displacement())
            }
            Kind::Reduced { body, full: behind, full_answers } => match body.drive(depth, paddle) {
                Ok(()) => {
                    *full_answers = false;
                    let largest = self.account.largest_estimate.get_or_insert(0.0);
                    *largest = largest.max(body.error_estimate());
                    let target = body.target_displacement();
                    self.answered.take_in(Answer { depth, paddle, target });
                    Ok(target)
                }
                Err(invalid) => {
                    self.account.fallbacks += 1;
                    self.account.first_fallback.get_or_insert_with(|| invalid.to_string());
                    *full_answers = true;
                    let body = match behind {
                        Some(body) => body,
                        None => behind.insert(full(self.model, self.paddle)?),
                    };
                    drive(body, depth, paddle)
                }
            },
        }
    }
}

/// The paddle of the plane, at rest where there is none.
fn only(paddles: &[Vector2<f64>]) -> Vector2<f64> {
    paddles.first().copied().unwrap_or_default()
}

fn full(model: &TissueModel, paddle: Option<usize>) -> Result<Box<Body<'_>>, WorldError> {
    model
        .body(paddle, NewtonSettings::SMALL_STEPS)
        .map(Box::new)
        .map_err(|source| WorldError::Tissue { depth: 0.0, source })
}

/// The full model for a loop without a clock: extrapolated between solves, unless its states depend on those before.
fn in_simulated_time<'m>(model: &'m TissueModel, paddle: Option<usize>) -> Result<Kind<'m>, WorldError> {
    if model.is_held_weakly() {
        return full(model, paddle).map(Kind::Full);
    }
    let tolerance = EXTRAPOLATION * model.scene().needle.depth;
    let body = Extrapolated::at_rest(model, paddle, tolerance);
    body.map(|body| Kind::Extrapolated(Box::new(body))).map_err(|source| WorldError::Tissue { depth: 0.0, source })
}

fn drive(body: &mut Body<'_>, depth: f64, paddle: Vector2<f64>) -> Result<Vector2<f64>, WorldError> {
    if depth != body.depth() || paddle != body.paddle() {
        let driven = body.drive(depth, paddle);
        driven.map_err(|source| WorldError::Tissue { depth: body.depth(), source })?;
    }
    Ok(body.target_displacement())
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_offline::parallel;
    use model_offline::scene::Scene;

    #[test]
    fn where_the_reduced_model_does_not_hold_the_full_one_answers_and_it_is_counted() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let mut reduced = TissuePlant::new(&model, Some(2), WantedPlant::Reduced).unwrap();
        let mut exact = TissuePlant::new(&model, Some(2), WantedPlant::Full).unwrap();
        let inside = (0.05, Vector2::new(0.001, -0.002));
        let far = (0.05, Vector2::new(0.04, 0.0));
        for (depth, paddle) in [inside, far] {
            let (r, e) = (reduced.step(depth, &[paddle]).unwrap(), exact.step(depth, &[paddle]).unwrap());
            assert!((r - e).norm() < 0.01 * e.norm(), "{r} {e}");
        }
        let account = reduced.account();
        assert_eq!((account.model, account.fallbacks), (PlantModel::Reduced, 1));
        assert!(account.first_fallback.as_ref().unwrap().contains("outside the trained range"));
        // The end, which the full one answered, is none of the states in which the reduced one is held against it.
        let off = (reduced.step(inside.0, &[inside.1]).unwrap() - exact.step(inside.0, &[inside.1]).unwrap()).norm();
        assert_eq!(account.states_verified, Some(1));
        assert!((account.largest_error.unwrap() / off - 1.0).abs() < 1e-3, "{account:?} {off}");
        reduced.step(far.0, &[far.1]).unwrap();
        assert_eq!(reduced.deformed_nodes().len(), model.nodes());
    }

    #[test]
    fn a_held_paddle_asks_for_less_and_is_answered_by_the_full_model_once_it_moves() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let reductions = Reductions::default();
        let of = |attachment| TissuePlant::sharing(&model, attachment, WantedPlant::Reduced, &reductions).unwrap();
        let mut held = of(Attachment::held(Some(2)));
        let mut moved = of(Attachment::moved(Some(2)));
        let mut exact = TissuePlant::new(&model, Some(2), WantedPlant::Full).unwrap();
        for (paddle, fallbacks) in [(Vector2::zeros(), 0), (Vector2::new(1e-4, 0.0), 1)] {
            let (h, e) = (held.step(0.05, &[paddle]).unwrap(), exact.step(0.05, &[paddle]).unwrap());
            assert!((h - e).norm() < 0.01 * e.norm(), "{h} {e}");
            assert_eq!((held.account.fallbacks, moved.account.fallbacks), (fallbacks, 0));
            moved.step(0.05, &[paddle]).unwrap();
        }
        // Each was trained once, whoever asks again.
        let again = of(Attachment::held(Some(2)));
        let reduced = |plant: &TissuePlant<'_>| plant.account.modes.zip(plant.account.points);
        assert_eq!(reduced(&again), reduced(&held));
        assert_eq!(reductions.states.lock().unwrap().len(), 2);
    }

    /// Whoever trains waits for other threads, and may be given another insertion meanwhile, which trains as well.
    #[test]
    fn insertions_side_by_side_do_not_wait_for_each_other() {
        let (finished, finish) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
            let reductions = Reductions::default();
            let trained = parallel::map(12, 2, |k| {
                let attachment = Attachment::held((k % 4 > 0).then_some(k % 4));
                TissuePlant::sharing(&model, attachment, WantedPlant::Reduced, &reductions).is_ok()
            });
            finished.send(trained)
        });
        let trained = finish.recv_timeout(std::time::Duration::from_secs(60)).expect("they wait for each other");
        assert_eq!(trained, [true; 12]);
    }

    #[test]
    fn the_condensed_model_says_how_far_off_it_is() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let mut condensed = TissuePlant::new(&model, Some(2), WantedPlant::Condensed).unwrap();
        let shallow = condensed.step(1e-4, &[]).unwrap();
        assert!(condensed.account().largest_error.unwrap() < 1e-3 * shallow.norm());
        let deep = condensed.step(0.1, &[]).unwrap();
        assert!(condensed.account().largest_error.unwrap() > 1e-2 * deep.norm());
        // Back at the skin both are at rest: what was off on the way stays told.
        condensed.step(0.0, &[]).unwrap();
        assert!(condensed.account().largest_error.unwrap() > 1e-2 * deep.norm());
    }

    #[test]
    fn auto_does_what_the_scene_says() {
        let mut scene = Scene::bundled("paper").unwrap();
        let model = TissueModel::new(&scene).unwrap();
        let name = |model: &TissueModel| TissuePlant::new(model, None, WantedPlant::Auto).unwrap().account().model;
        assert_eq!(name(&model), PlantModel::Reduced);
        let section = "[fit]\nplant = \"condensed\"\ntable_knots = 9\ntable_scalar = \"f32\"\n";
        let text = format!("{}\n{section}", model_offline::scene::BUNDLED[0].1);
        scene.fit = Scene::parse(&text, "fitted.toml").unwrap().fit;
        assert_eq!(name(&model.with_tissue_of(&scene)), PlantModel::Condensed);
    }
}
