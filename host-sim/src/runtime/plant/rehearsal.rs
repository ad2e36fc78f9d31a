//! How long a step of the tissue takes, found out before a run whose time the machine's clock drives.

use std::time::Instant;

use model_offline::model::TissueModel;
use nalgebra::Vector2;

use crate::world::World;
use crate::world::error::WorldError;
use crate::world::needle::NeedleTrajectory;
use crate::world::simulation::Simulation;
use crate::world::space::{PreparedBody, SpaceTissue};
use crate::world::tissue::{AttachedPaddle, Reductions, TissuePlant, TissueResponse as _, WantedPlant};

/// Steps that are timed.
const STEPS: usize = 101;
/// Part of the period that a step may take on average: the rest is for samples and the machine. The average and not the
/// median: some steps take a new factor, and a step that takes ten times as long as the others makes the loop late too.
const PART_OF_PERIOD: f64 = 0.8;
/// Sideways motion of the paddle per motion of the needle: steps as large as those of a run.
const PADDLE_PER_DEPTH: f64 = 0.1;

/// What a step takes, against the period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rehearsal {
    /// Mean of a step, µs.
    pub step_us: f64,
    /// Period of the loop, µs.
    pub period_us: f64,
}

impl Rehearsal {
    /// Whether a loop at this period has time for the step.
    pub fn keeps_the_period(&self) -> bool {
        self.step_us <= PART_OF_PERIOD * self.period_us
    }

    /// Why there is no run.
    pub fn too_slow(&self) -> WorldError {
        self.too_slow_without(None)
    }

    /// The same, and why no reduced tissue takes its place.
    fn too_slow_without(&self, reduced: Option<WorldError>) -> WorldError {
        let Self { step_us, period_us } = *self;
        WorldError::TooSlow {
            step_us,
            period_us,
            rate_hz: (PART_OF_PERIOD * 1e6 / step_us).floor(),
            instead: reduced.map(Box::new),
        }
    }
}

/// As [`World::new`], for a loop that the machine's clock drives: the tissue's step is timed before the run. A full model
/// that takes too long makes room for the reduced one, unless the full one was asked for.
///
/// # Errors
/// [`WorldError`]; [`WorldError::TooSlow`] when no model keeps the period.
pub fn world_in_time<'m>(
    model: &'m TissueModel,
    paddle: AttachedPaddle<'_>,
    simulation: &Simulation,
    reductions: &Reductions,
) -> Result<World<TissuePlant<'m>>, WorldError> {
    let (world, full) = timed_full(model, paddle, simulation, reductions)?;
    if full.keeps_the_period() {
        return Ok(world);
    }
    if simulation.plant.is_some() {
        return Err(full.too_slow());
    }
    let mut world =
        reduced_world(model, paddle, simulation, reductions).map_err(|why| full.too_slow_without(Some(why)))?;
    let rehearsed = rehearse(&mut world.tissue, simulation)?;
    if !rehearsed.keeps_the_period() {
        return Err(rehearsed.too_slow());
    }
    world.tissue.stands_in_for_full(full.step_us);
    Ok(world)
}

/// Whether [`world_in_time`] will ask for a reduced model, since the full one takes too long.
pub fn needs_reduction(
    model: &TissueModel,
    paddle: AttachedPaddle<'_>,
    simulation: &Simulation,
    reductions: &Reductions,
) -> bool {
    // Tissue with a past is never reduced to its states alone.
    simulation.plant.is_none()
        && !model.scene().has_a_past()
        && timed_full(model, paddle, simulation, reductions).is_ok_and(|(_, full)| !full.keeps_the_period())
}

/// Trains that reduced model, and tells whether there is one; refusals are remembered as well, and told by [`world_in_time`].
pub fn train_reduction(
    model: &TissueModel,
    paddle: AttachedPaddle<'_>,
    simulation: &Simulation,
    reductions: &Reductions,
) -> bool {
    reduced_world(model, paddle, simulation, reductions).is_ok()
}

fn timed_full<'m>(
    model: &'m TissueModel,
    paddle: AttachedPaddle<'_>,
    simulation: &Simulation,
    reductions: &Reductions,
) -> Result<(World<TissuePlant<'m>>, Rehearsal), WorldError> {
    let mut world = World::sharing(model, paddle, simulation, reductions)?;
    world.tissue.solve_every_step()?;
    let full = rehearse(&mut world.tissue, simulation)?;
    Ok((world, full))
}

fn reduced_world<'m>(
    model: &'m TissueModel,
    paddle: AttachedPaddle<'_>,
    simulation: &Simulation,
    reductions: &Reductions,
) -> Result<World<TissuePlant<'m>>, WorldError> {
    let reduced = Simulation { plant: Some(WantedPlant::Reduced), ..simulation.clone() };
    World::sharing(model, paddle, &reduced, reductions)
}

/// Takes the tissue through some steps from the middle of the insertion, and back to rest.
///
/// # Errors
/// [`WorldError::Tissue`].
pub fn rehearse(tissue: &mut TissuePlant<'_>, simulation: &Simulation) -> Result<Rehearsal, WorldError> {
    let paddle = |aside: f64| Vector2::new(0.0, PADDLE_PER_DEPTH * aside);
    tissue.aside(|tissue| timed(simulation, |depth, aside| tissue.step(depth, &[paddle(aside)]).map(drop)))
}

/// The world of a body in space, for a loop that the machine's clock drives: its step is timed on the way that it was tabulated
/// along.
///
/// # Errors
/// [`WorldError::TooSlow`] when it does not keep the period, [`WorldError::Tissue`].
pub fn space_in_time<'m>(
    body: &PreparedBody<'m>,
    simulation: &Simulation,
) -> Result<World<SpaceTissue<'m>, NeedleTrajectory, 3>, WorldError> {
    let mut tissue = body.tissue();
    let rehearsed = timed(simulation, |depth, _| tissue.step(depth, &body.table().way(depth)).map(drop))?;
    if rehearsed.keeps_the_period() { Ok(body.world(simulation)) } else { Err(rehearsed.too_slow()) }
}

/// Times steps from the middle of the insertion on, each told its depth and how far that is from the first.
fn timed(
    simulation: &Simulation,
    mut step: impl FnMut(f64, f64) -> Result<(), WorldError>,
) -> Result<Rehearsal, WorldError> {
    let trajectory = &simulation.needle;
    let period_us = simulation.loop_settings.period_ns() as f64 * 1e-3;
    let middle_s = trajectory.midway_s();
    let (mut total_us, mut timed) = (0.0, 0_u32);
    let middle = trajectory.at(middle_s).depth;
    step(middle, 0.0)?;
    let mut last = middle;
    for k in 1..=STEPS {
        let depth = trajectory.at(middle_s + k as f64 * period_us * 1e-6).depth;
        // A needle that has arrived leaves nothing to solve for.
        if depth == last {
            break;
        }
        last = depth;
        let before = Instant::now();
        step(depth, depth - middle)?;
        total_us += before.elapsed().as_secs_f64() * 1e6;
        timed += 1;
    }
    Ok(Rehearsal { step_us: total_us / f64::from(timed.max(1)), period_us })
}

#[cfg(test)]
mod tests {
    use model_offline::scene::Scene;

    use super::*;
    use crate::world::loop_settings::LoopSettings;
    use crate::world::tissue::PlantAccount;

    #[test]
    fn the_rule_of_the_period() {
        assert!(Rehearsal { step_us: 800.0, period_us: 1000.0 }.keeps_the_period());
        let slow = Rehearsal { step_us: 801.0, period_us: 1000.0 };
        assert!(!slow.keeps_the_period());
        assert!(slow.too_slow().to_string().contains("at most 998 Hz"), "{}", slow.too_slow());
    }

    /// A period of 2 µs is too short for any nonlinear model, one of 50 s for none: nothing here depends on how fast the
    /// machine is.
    #[test]
    fn a_plant_that_cannot_keep_the_period_is_found_before_the_run() {
        let scene = Scene::bundled("paper").unwrap();
        let model = TissueModel::new(&scene).unwrap();
        let at = |rate, plant| {
            let loop_settings = LoopSettings { rate, target_rate: rate.min(50.0), ..LoopSettings::default() };
            Simulation { loop_settings, plant, ..Simulation::new(&scene) }
        };
        for plant in [None, Some(WantedPlant::Full)] {
            let refused = world_in_time(&model, AttachedPaddle::Moved(2), &at(5e5, plant), &Reductions::default());
            assert!(matches!(refused, Err(WorldError::TooSlow { .. })), "{plant:?}: {refused:?}");
        }
        let mut world =
            world_in_time(&model, AttachedPaddle::Moved(2), &at(0.02, None), &Reductions::default()).unwrap();
        assert_eq!(world.plant_account(), PlantAccount::default(), "a rehearsal leaves no trace");
        assert!(world.advance(0, 0).unwrap().target.iter().all(|x| x.abs() < 1e-9), "at rest again");
    }
}
