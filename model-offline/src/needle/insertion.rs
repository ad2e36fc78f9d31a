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

/// Takes a needle that slips on its way; the paddle at this place of the scene's list is attached, or none.
///
/// The jump at the puncture is not followed: the state within is that of a needle that has come the same way through skin
/// that was open, which sliding friction makes the same where everything slides.
///
/// # Errors
/// [`NeedleError`].
pub fn insert<'m>(model: &'m TissueModel, paddle: Option<usize>, way: Way) -> Result<Inserted<'m>, NeedleError> {
    let shaft = model.scene().needle.shaft.ok_or(NeedleError::NoShaft)?;
    if model.is_held_weakly() {
        return Err(NeedleError::HeldWeakly);
    }
    let mut punctured_at = 0.0;
    if shaft.puncture_force > 0.0 {
        let failed = |depth| move |source| NeedleError::Equilibrium { depth, source };
        let mut body = model.body(paddle, NewtonSettings::default()).map_err(failed(0.0))?;
        let mut before = (0.0, 0.0);
        let punctured = (1..=way.increments.max(1)).find_map(|increment| {
            let mut halvings = 0;
            let (start, goal) = (way.after(increment - 1), way.after(increment));
            let (mut done, mut share) = (0.0, 1.0);
            // Skin that cannot be pushed as far as that may have given way before.
            loop {
                let pose = start.towards(&goal, share);
                let depth = pose.depth;
                if let Err(source) = body.take_in(pose, way.step() * (share - done)) {
                    halvings += 1;
                    share = 0.5 * (done + share);
                    if halvings > HALVINGS {
                        return Some(Err(NeedleError::Equilibrium { depth, source }));
                    }
                    continue;
                }
                let force = body.contact_force();
                if force >= shaft.puncture_force {
                    let share = (shaft.puncture_force - before.1) / (force - before.1);
                    return Some(Ok(before.0 + (depth - before.0) * share.clamp(0.0, 1.0)));
                }
                (before, done) = ((depth, force), share);
                if share >= 1.0 {
                    return None;
                }
                share = f64::min(1.0, share + 0.5_f64.powi(halvings));
            }
        });
        match punctured {
            None => return Ok(Inserted::Pushing(Box::new(body))),
            Some(at) => punctured_at = at?,
        }
    }
    let mut needle = SlippingNeedle::at_rest(model, paddle)?;
    for increment in 1..=way.increments.max(1) {
        enter(&mut needle, way.after(increment), way.step())?;
    }
    Ok(Inserted::Within { needle: Box::new(needle), punctured_at })
}
