//! The full model, solved now and then and extrapolated between: what a simulation needs that asks for the next state a
//! thousand times a second, of a body that is the same function of depth and paddle all the while.
//!
//! Every solve leaves the target displacement u₀ and its [first and second derivatives](Derivatives), A and H; from there
//!
//! ```text
//! u(z) ≈ u₀ + A Δ + ½ H(Δ, Δ),   Δ = z − z₀,   z = (depth, paddle x, paddle y)
//! ```
//!
//! is third order in whichever direction the body goes on. The next solve shows how far off that was, which sets the
//! distance to the one after. (Keeping exact states with their derivatives, and answering from them within a controlled
//! error, is the idea of in situ adaptive tabulation: Pope, Combustion Theory and Modelling 1, 1997.)

use crate::model::{Body, Derivatives, TissueModel};
use crate::solver::equilibrium::{Failure, NewtonSettings};
use nalgebra::{Vector2, Vector3};

/// First distance between solves, over the depth that the scene inserts to: nothing is known of the error yet.
const FIRST: f64 = 1e-3;
/// Longest distance between solves, over that depth: a body that loses its stability for good is found out no later.
const LONGEST: f64 = 0.03;
/// Each distance is no longer than this times the last.
const GROWTH: f64 = 1.5;
/// Order of the error in the distance.
const ORDER: i32 = 3;
/// Aim at this part of the tolerated error.
const AIM: f64 = 0.5;
/// Error of a solve over the tolerated error.
const SOLVED: f64 = 0.1;

/// A body between exact states; see the module's documentation.
#[derive(Debug, Clone)]
pub struct Extrapolated<'m> {
    /// At the last solve, or beyond it where one has failed.
    body: Body<'m>,
    /// Where it is now.
    at: Vector3<f64>,
    /// The depth that the scene inserts to.
    depth: f64,
    tolerance: f64,
    /// How far extrapolation is trusted.
    reach: f64,
    /// How far it went since the last solve.
    furthest: f64,
    known: Known,
    account: Extrapolation,
}

/// An exact state.
#[derive(Debug, Clone)]
struct Known {
    at: Vector3<f64>,
    coefficients: Vec<f64>,
    target: Vector2<f64>,
    derivatives: Derivatives,
}

/// What extrapolating has cost in accuracy, and spared.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Extrapolation {
    /// States that were solved for.
    pub solves: u64,
    /// Largest error of an extrapolated target displacement, length: found at every solve, as far as extrapolation had gone
    /// before it.
    pub largest_error: f64,
}

impl<'m> Extrapolated<'m> {
    /// A body at rest with the paddle at this place of the scene's list attached, or none; an error of `tolerance` (length)
    /// of the target displacement is aimed at. Not for a body that is [held weakly](TissueModel::is_held_weakly): its
    /// states depend on those before.
    ///
    /// # Errors
    /// [`Failure`] when the tangent at rest is singular.
    pub fn at_rest(model: &'m TissueModel, paddle: Option<usize>, tolerance: f64) -> Result<Self, Failure> {
        // From one solve to the next the tangent changes by a few per cent: iterations with the last factor converge fast,
        // and the one factor that the derivatives need anyway proves the new state to be stable.
        let solve = NewtonSettings {
            residual_tolerance: 1e-8,
            step_tolerance: f64::min(1e-7, SOLVED * tolerance / model.spacing()),
            ..NewtonSettings::SMALL_STEPS
        };
        let mut body = model.body(paddle, solve)?;
        let known = Known::of(&mut body)?;
        let depth = model.scene().needle.depth;
        let account = Extrapolation { solves: 1, ..Extrapolation::default() };
        Ok(Self { body, at: known.at, depth, tolerance, reach: FIRST * depth, furthest: 0.0, known, account })
    }

    /// Takes needle and paddle to the given depth and displacement.
    ///
    /// # Errors
    /// [`Failure`] where the next solve fails; depth and paddle are then where the last converged state has them.
    pub fn drive(&mut self, depth: f64, paddle: Vector2<f64>) -> Result<(), Failure> {
        self.at = Vector3::new(depth, paddle.x, paddle.y);
        let distance = (self.at - self.known.at).norm();
        if distance <= self.reach {
            self.furthest = self.furthest.max(distance);
            return Ok(());
        }
        self.solve(distance)
    }

    /// Solves for where it is now, so that the account covers all of the way here.
    ///
    /// # Errors
    /// As [`Extrapolated::drive`].
    pub fn settle(&mut self) -> Result<(), Failure> {
        let distance = (self.at - self.known.at).norm();
        if distance > 0.0 { self.solve(distance) } else { Ok(()) }
    }

    fn solve(&mut self, distance: f64) -> Result<(), Failure> {
        let foretold = self.target_displacement();
        self.account.solves += 1;
        let known = match (self.body.drive(self.at.x, self.at.yz()), Known::of(&mut self.body)) {
            (Ok(()), Ok(known)) => known,
            (Err(failure), Ok(reached)) => {
                (self.at, self.known) = (reached.at, reached);
                (self.reach, self.furthest) = (FIRST * self.depth, 0.0);
                return Err(failure);
            }
            (driven, Err(unstable)) => {
                self.at = self.known.at;
                return Err(driven.err().unwrap_or(unstable));
            }
        };
        let error = (foretold - known.target).norm();
        // What was jumped over was not extrapolated.
        let gone = f64::min(1.0, self.furthest / distance);
        self.account.largest_error = self.account.largest_error.max(error * gone.powi(ORDER));
        let room = (AIM * self.tolerance / error.max(f64::MIN_POSITIVE)).powf(1.0 / f64::from(ORDER));
        let longest = if known.derivatives.bend.is_some() { LONGEST } else { FIRST };
        self.reach = (distance * room).min(GROWTH * self.reach).min(longest * self.depth);
        (self.known, self.furthest) = (known, 0.0);
        Ok(())
    }

    /// Needle depth.
    pub fn depth(&self) -> f64 {
        self.at.x
    }

    /// Target displacement.
    pub fn target_displacement(&self) -> Vector2<f64> {
        let step = self.at - self.known.at;
        let Derivatives { slope, bend, .. } = &self.known.derivatives;
        let bend =
            bend.map_or_else(Vector2::zeros, |bend| Vector2::from_fn(|row, _| 0.5 * step.dot(&(bend[row] * step))));
        self.known.target + slope * step + bend
    }

    /// Nodal coefficients, to first order from the last solve: good for a picture.
    pub fn coefficients(&self) -> Vec<f64> {
        let mut out = self.known.coefficients.clone();
        let step = self.at - self.known.at;
        for (response, by) in self.known.derivatives.responses.chunks_exact(out.len()).zip(step.iter()) {
            out.iter_mut().zip(response).for_each(|(d, r)| *d += by * r);
        }
        out
    }

    /// What extrapolating has cost and spared so far.
    pub fn account(&self) -> Extrapolation {
        self.account
    }
}

impl Known {
    /// Of a body at an exact state.
    fn of(body: &mut Body<'_>) -> Result<Self, Failure> {
        Ok(Self {
            derivatives: body.derivatives()?,
            at: Vector3::new(body.depth(), body.paddle().x, body.paddle().y),
            coefficients: body.equilibrium().coefficients().to_vec(),
            target: body.target_displacement(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::scene::starter::{StarterNames, starter};

    /// A millimetre block of neo-Hookean tissue and the paper's square of Fung's, with and without inclusion.
    fn models() -> Vec<TissueModel> {
        let paper = Scene::bundled("paper").unwrap();
        let names = StarterNames { name: "block".into(), length: "mm".into(), stress: "kPa".into() };
        let mut block = Scene::parse(&starter(&names, None), "block").unwrap();
        block.discretization.resolution = crate::discretization::Resolution::Spacing(7.0);
        [paper.without_inclusions(), paper, block].iter().map(|scene| TissueModel::new(scene).unwrap()).collect()
    }

    /// In, held with a trembling paddle that then goes across its way and back, and half out again on another way: every
    /// state against the exact one.
    #[test]
    fn every_state_keeps_to_the_tolerance() {
        for model in models() {
            let depth = model.scene().needle.depth;
            let tolerance = 1e-7 * depth;
            let way = |k: u32| {
                let t = f64::from(k);
                let inside = if k < 300 { t / 500.0 } else { f64::min(0.6, 0.6 - (t - 500.0) / 500.0) };
                let tremble = 1e-3 * Vector2::new((1.3 * t).sin(), (0.7 * t).cos() - 1.0);
                let across = if (300..400).contains(&k) { 5e-3 * (std::f64::consts::PI * t / 50.0).sin() } else { 0.0 };
                let along = if k < 500 { Vector2::new(0.2, -0.1) } else { Vector2::new(0.2, 0.1) };
                let tremble = if (300..400).contains(&k) { Vector2::zeros() } else { tremble };
                (inside * depth, (along * inside + tremble + Vector2::new(0.5, 1.0) * across) * depth)
            };
            for paddle in [None, Some(1)] {
                let mut body = Extrapolated::at_rest(&model, paddle, tolerance).unwrap();
                let settings = NewtonSettings { step_tolerance: 1e-9, ..NewtonSettings::default() };
                let mut exact = model.body(paddle, settings).unwrap();
                let mut worst = 0.0_f64;
                for k in 0..600 {
                    let (depth, place) = way(k);
                    let place = if paddle.is_some() { place } else { Vector2::zeros() };
                    body.drive(depth, place).unwrap();
                    exact.drive(depth, place).unwrap();
                    worst = worst.max((body.target_displacement() - exact.target_displacement()).norm());
                }
                body.settle().unwrap();
                let account = body.account();
                assert!(account.solves < 200, "{account:?} of 600 steps");
                assert!(worst < 2.0 * tolerance, "{worst:.1e}, {account:?} for {tolerance}");
                let found = account.largest_error;
                assert!(found < 2.0 * tolerance && found > 0.3 * worst, "{worst:.1e} where {account:?} was found");
            }
        }
    }

    #[test]
    fn a_jump_is_solved_for_and_a_state_that_does_not_exist_is_refused() {
        for model in models() {
            let depth = model.scene().needle.depth;
            let mut body = Extrapolated::at_rest(&model, Some(1), 1e-6 * depth).unwrap();
            let mut exact = model.body(Some(1), NewtonSettings::default()).unwrap();
            let place = Vector2::new(0.1, 0.05) * depth;
            body.drive(0.5 * depth, place).unwrap();
            exact.drive(0.5 * depth, place).unwrap();
            let off = |body: &Extrapolated<'_>, exact: &Body<'_>| {
                (body.target_displacement() - exact.target_displacement()).norm() / depth
            };
            assert!(off(&body, &exact) < 1e-9, "{}", off(&body, &exact));
            // A picture is good to first order.
            exact.drive(0.501 * depth, place).unwrap();
            body.drive(0.501 * depth, place).unwrap();
            let pictured = body.coefficients();
            let furthest = pictured.iter().zip(exact.equilibrium().coefficients()).map(|(a, b)| (a - b).abs());
            assert!(furthest.fold(0.0, f64::max) < 1e-5 * depth);

            let far = body.drive(50.0 * depth, place).unwrap_err();
            assert!(far.reached < 1.0 && body.depth() < 50.0 * depth, "{far}");
            let (depth_reached, place_reached) = (body.at.x, body.at.yz());
            let mut there = model.body(Some(1), NewtonSettings::default()).unwrap();
            there.drive(depth_reached, place_reached).unwrap();
            assert!(off(&body, &there) < 1e-6, "{} after {far}", off(&body, &there));
            let pictured = body.coefficients();
            let furthest = pictured.iter().zip(there.equilibrium().coefficients()).map(|(a, b)| (a - b).abs());
            assert!(furthest.fold(0.0, f64::max) < 1e-5 * depth);
            // It is still there, and goes on from where it got to.
            body.drive(0.5 * depth, place).unwrap();
            exact.drive(0.5 * depth, place).unwrap();
            assert!(off(&body, &exact) < 1e-6, "{}", off(&body, &exact));
        }
    }
}
