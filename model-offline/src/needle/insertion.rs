//! An insertion from the skin on.

use super::course::enter;
use super::error::NeedleError;
use super::state::SlippingNeedle;
use crate::model::{Body, Pose, TissueModel};
use crate::solver::equilibrium::NewtonSettings;
use nalgebra::Vector2;

/// How often the increment that does not find an equilibrium before the puncture is halved.
const HALVINGS: i32 = 8;

/// A straight way of needle and paddle from rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// Depth at its end, length.
    pub depth: f64,
    /// Paddle displacement at its end, length.
    pub paddle: Vector2<f64>,
    /// Increments.
    pub increments: u32,
    /// How long it takes, s, where tissue relaxes meanwhile.
    pub seconds: f64,
}

impl Way {
    /// Where it is after so many increments.
    fn after(&self, increment: u32) -> Pose {
        let end = Pose { depth: self.depth, paddle: self.paddle, ..Pose::default() };
        Pose::default().towards(&end, f64::from(increment) / f64::from(self.increments.max(1)))
    }

    /// What an increment takes, s.
    fn step(&self) -> f64 {
        self.seconds / f64::from(self.increments.max(1))
    }
}

/// Where an insertion has got to.
#[derive(Debug, Clone)]
pub enum Inserted<'m> {
    /// The skin holds: the needle pushes the contact.
    Pushing(Box<Body<'m>>),
    /// The needle is in.
    Within {
        /// The needle.
        needle: Box<SlippingNeedle<'m>>,
        /// Depth at which the skin was punctured, to the accuracy of an increment.
        punctured_at: f64,
    },
}

/// What is known of a needle at a depth.
#[derive(Debug, Clone, Copy, Default)]
struct Pushed {
    depth: f64,
    /// Force along the axis.
    force: f64,
    /// Work that has gone in: of skin that holds, its strain energy.
    stored: f64,
}

impl Pushed {
    fn of(body: &Body<'_>, depth: f64) -> Self {
        Self { depth, force: body.contact_force(), stored: body.equilibrium().energy() }
    }

    /// Where the force was first this one, on the way to a later state.
    fn until(&self, later: &Self, force: f64) -> Self {
        let share = ((force - self.force) / (later.force - self.force)).clamp(0.0, 1.0);
        self.at(later, self.depth + share * (later.depth - self.depth))
    }

    /// On the way to a later state: the force goes straight, and the energy as that says; what the paddle does of it, straight.
    fn at(&self, later: &Self, depth: f64) -> Self {
        let (deeper, rise) = (later.depth - self.depth, later.force - self.force);
        let share = (depth - self.depth) / deeper;
        let by_needle = |share: f64| deeper * share * (self.force + 0.5 * rise * share);
        let other = later.stored - self.stored - by_needle(1.0);
        let stored = self.stored + by_needle(share) + share * other;
        Self { depth, force: self.force + share * rise, stored }
    }
}

/// Pushes the skin until it gives way, which is answered, or to the way's end: the body there.
fn push<'m>(
    model: &'m TissueModel,
    paddle: Option<usize>,
    way: &Way,
    puncture_force: f64,
) -> Result<Result<Pushed, Box<Body<'m>>>, NeedleError> {
    let failed = |depth| move |source| NeedleError::Equilibrium { depth, source };
    let mut body = model.body(paddle, NewtonSettings::default()).map_err(failed(0.0))?;
    let mut before = Pushed::default();
    for increment in 1..=way.increments.max(1) {
        let mut halvings = 0;
        let (start, goal) = (way.after(increment - 1), way.after(increment));
        let (mut done, mut share) = (0.0, 1.0);
        // Skin that cannot be pushed as far as that may have given way before.
        while done < 1.0 {
            let pose = start.towards(&goal, share);
            if let Err(source) = body.take_in(pose, way.step() * (share - done)) {
                halvings += 1;
                share = 0.5 * (done + share);
                if halvings > HALVINGS {
                    return Err(failed(pose.depth)(source));
                }
                continue;
            }
            let now = Pushed::of(&body, pose.depth);
            if now.force >= puncture_force {
                return Ok(Ok(before.until(&now, puncture_force)));
            }
            (before, done) = (now, share);
            share = f64::min(1.0, share + 0.5_f64.powi(halvings));
        }
    }
    Ok(Err(Box::new(body)))
}

/// Takes a needle that slips on its way; the paddle at this place of the scene's list is attached, or none.
///
/// The jump at the puncture is not followed: the state within is that of a needle that has come the same way through skin
/// that was open, which sliding friction makes the same where everything slides. What the jump dissipates is in the needle's
/// [`EnergyAccount::puncture`](super::EnergyAccount::puncture).
///
/// # Errors
/// [`NeedleError`].
pub fn insert<'m>(model: &'m TissueModel, paddle: Option<usize>, way: Way) -> Result<Inserted<'m>, NeedleError> {
    let shaft = model.scene().needle.shaft.ok_or(NeedleError::NoShaft)?;
    if model.is_held_weakly() {
        return Err(NeedleError::HeldWeakly);
    }
    let mut gave_way = None;
    if shaft.puncture_force > 0.0 {
        match push(model, paddle, &way, shaft.puncture_force)? {
            Ok(pushed) => gave_way = Some(pushed),
            Err(body) => return Ok(Inserted::Pushing(body)),
        }
    }
    let mut needle = SlippingNeedle::at_rest(model, paddle)?;
    let within = |needle: &SlippingNeedle<'_>| Pushed {
        depth: needle.pose().depth,
        force: needle.base_force(),
        stored: needle.energy().put_in(),
    };
    let mut not_counted = gave_way;
    for increment in 1..=way.increments.max(1) {
        let before = within(&needle);
        enter(&mut needle, way.after(increment), way.step())?;
        let after = within(&needle);
        if let Some(pushed) = not_counted.take_if(|pushed| pushed.depth <= after.depth) {
            needle.skin_gave_way(pushed.stored - before.at(&after, pushed.depth).stored);
        }
    }
    Ok(Inserted::Within { needle: Box::new(needle), punctured_at: gave_way.map_or(0.0, |pushed| pushed.depth) })
}
