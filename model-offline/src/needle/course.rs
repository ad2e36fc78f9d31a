//! A body through everything that its scene says may happen to it, in time.

use super::error::NeedleError;
use super::reading::NeedleReading;
use super::state::SlippingNeedle;
use crate::model::{Body, Pose, TissueModel};
use crate::solver::equilibrium::{Failure, NewtonSettings};
use nalgebra::{Matrix2, Vector2};

/// The first increment within tissue grows by doublings, as many as this: the tip holds for a moment before it cuts.
const BEGINNING: i32 = 7;

/// A body whose contact moves with the needle, or whose needle slips once it has punctured the skin; its tissue relaxes
/// if it does.
///
/// # Example
/// ```
/// use model_offline::model::{Pose, TissueModel};
/// use model_offline::{Scene, needle::Course};
///
/// let model = TissueModel::new(&Scene::bundled("paper").expect("bundled"))?;
/// let mut course = Course::at_rest(&model, None).expect("a body at rest");
/// course.take_in(Pose { depth: 0.05, ..Pose::default() }, 1.0).expect("an equilibrium");
/// assert!(course.target_displacement().norm() > 0.0);
/// # Ok::<(), model_offline::ModelError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Course<'m> {
    model: &'m TissueModel,
    paddle: Option<usize>,
    state: State<'m>,
}

#[derive(Debug, Clone)]
enum State<'m> {
    /// The contact moves with the needle; where it may be punctured, with what the needle would go through once it was.
    Pushing { body: Box<Body<'m>>, puncture_force: Option<f64>, so_far: Vec<(Pose, f64)> },
    /// The needle is in.
    Within(Box<SlippingNeedle<'m>>),
}

impl<'m> Course<'m> {
    /// A body at rest, the paddle at this place of the scene's list attached, or none.
    ///
    /// # Errors
    /// [`NeedleError`].
    pub fn at_rest(model: &'m TissueModel, paddle: Option<usize>) -> Result<Self, NeedleError> {
        Self::with_settings(model, paddle, NewtonSettings::default())
    }

    /// The same for steps so small that the last factor serves the next one as well.
    ///
    /// # Errors
    /// [`NeedleError`].
    pub fn in_small_steps(model: &'m TissueModel, paddle: Option<usize>) -> Result<Self, NeedleError> {
        Self::with_settings(model, paddle, NewtonSettings::SMALL_STEPS)
    }

    /// With these settings as long as the contact moves with the needle; a needle that is in has its own.
    fn with_settings(
        model: &'m TissueModel,
        paddle: Option<usize>,
        settings: NewtonSettings,
    ) -> Result<Self, NeedleError> {
        let shaft = model.scene().needle.shaft;
        if shaft.is_some() && model.is_held_weakly() {
            return Err(NeedleError::HeldWeakly);
        }
        let puncture_force = shaft.map(|shaft| shaft.puncture_force);
        let state = match puncture_force {
            Some(force) if force <= 0.0 => {
                let mut needle = SlippingNeedle::at_rest(model, paddle)?;
                // The tip touches the skin, and holds the point that it touches.
                needle.take_in(Pose::default(), 0.0)?;
                State::Within(Box::new(needle))
            }
            puncture_force => {
                let body = model.body(paddle, settings).map_err(failed(0.0))?;
                State::Pushing { body: Box::new(body), puncture_force, so_far: Vec::new() }
            }
        };
        Ok(Self { model, paddle, state })
    }

    /// Takes everything that moves the body to a pose in so many seconds.
    ///
    /// The jump at a puncture is not followed: the state within is that of a needle that has come the same way through skin
    /// that was open.
    ///
    /// # Errors
    /// [`NeedleError`]; a needle that is in is then where it was, one that pushes the skin where its last equilibrium was.
    pub fn take_in(&mut self, pose: Pose, seconds: f64) -> Result<(), NeedleError> {
        match &mut self.state {
            State::Within(needle) => {
                let before = needle.clone();
                let outcome = enter(needle, pose, seconds);
                if outcome.is_err() {
                    *needle = before;
                }
                outcome
            }
            State::Pushing { body, puncture_force, so_far } => {
                let Some(force) = *puncture_force else {
                    return body.take_in(pose, seconds).map_err(failed(pose.depth));
                };
                let before = body.clone();
                body.take_in(pose, seconds).map_err(failed(pose.depth))?;
                so_far.push((pose, seconds));
                if body.contact_force() < force {
                    return Ok(());
                }
                match within(self.model, self.paddle, so_far) {
                    Ok(needle) => self.state = State::Within(Box::new(needle)),
                    Err(error) => {
                        // Whoever comes in smaller steps begins where this one did.
                        so_far.pop();
                        *body = before;
                        return Err(error);
                    }
                }
                Ok(())
            }
        }
    }

    /// Whether the needle pushes the skin, which may give way.
    pub fn pushes_the_skin(&self) -> bool {
        matches!(self.state, State::Pushing { puncture_force: Some(_), .. })
    }

    /// Where everything is that moves the body.
    pub fn pose(&self) -> Pose {
        match &self.state {
            State::Pushing { body, .. } => body.pose(),
            State::Within(needle) => needle.pose(),
        }
    }

    /// Target displacement.
    pub fn target_displacement(&self) -> Vector2<f64> {
        match &self.state {
            State::Pushing { body, .. } => body.target_displacement(),
            State::Within(needle) => needle.target_displacement(),
        }
    }

    /// Nodal coefficients, two numbers per node.
    pub fn coefficients(&self) -> &[f64] {
        match &self.state {
            State::Pushing { body, .. } => body.equilibrium().coefficients(),
            State::Within(needle) => needle.equilibrium().coefficients(),
        }
    }

    /// Force that pushes the needle at its base.
    pub fn base_force(&self) -> f64 {
        match &self.state {
            State::Pushing { body, .. } => body.contact_force(),
            State::Within(needle) => needle.base_force(),
        }
    }

    /// Forces on the needle, and what its shaft does.
    pub fn reading(&self) -> NeedleReading {
        match &self.state {
            State::Pushing { body, .. } => NeedleReading::pushing(body.depth(), body.contact_force()),
            State::Within(needle) => NeedleReading::within(needle),
        }
    }

    /// Actuation Jacobian d(target displacement)/d(paddle displacement) within the last step, the needle as it is.
    ///
    /// # Errors
    /// [`NeedleError`].
    pub fn actuation_jacobian(&mut self) -> Result<Matrix2<f64>, NeedleError> {
        match &mut self.state {
            State::Pushing { body, .. } => {
                let depth = body.depth();
                body.actuation_jacobian().map_err(failed(depth))
            }
            State::Within(needle) => needle.actuation_jacobian(),
        }
    }
}

/// A needle that has come this way through skin that was open.
fn within<'m>(
    model: &'m TissueModel,
    paddle: Option<usize>,
    so_far: &[(Pose, f64)],
) -> Result<SlippingNeedle<'m>, NeedleError> {
    let mut needle = SlippingNeedle::at_rest(model, paddle)?;
    for (pose, seconds) in so_far {
        enter(&mut needle, *pose, *seconds)?;
    }
    Ok(needle)
}

fn failed(depth: f64) -> impl FnOnce(Failure) -> NeedleError {
    move |source| NeedleError::Equilibrium { depth, source }
}

/// One increment of a needle that is in, the first one in pieces.
pub(super) fn enter(needle: &mut SlippingNeedle<'_>, pose: Pose, seconds: f64) -> Result<(), NeedleError> {
    let from = needle.pose();
    let first = from.depth <= 0.0 && pose.depth > 0.0;
    let shares = (1..=if first { BEGINNING } else { 0 }).rev().map(|halvings| 0.5_f64.powi(halvings));
    let mut done = 0.0;
    for share in shares.chain([1.0]) {
        needle.take_in(from.towards(&pose, share), seconds * (share - done))?;
        done = share;
    }
    Ok(())
}
