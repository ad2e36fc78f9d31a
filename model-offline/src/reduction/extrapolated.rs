//! The full model, solved now and then and extrapolated between: what a simulation needs that asks for the next state a
//! thousand times a second, of a body that is the same function of depth and paddle all the while.
//!
//! Every solve leaves a target displacement u₀ and its exact derivatives A; from there
//!
//! ```text
//! u(z) ≈ u₀ + A Δ + ½ H(Δ, Δ),   Δ = z − z₀,   z = (depth, paddle x, paddle y)
//! ```
//!
//! with second derivatives H that learn from the change of A between solves (Powell's symmetric form of Broyden's update:
//! Powell, in Nonlinear Programming, Academic Press 1970). The next solve shows how far off that was, which sets the
//! distance to the one after. On the way that the body has come the error grows up to the next solve, so that what is
//! measured there is the largest. Aside of that way H is not known: a body that turns aside by less than the distance to
//! the next solve, and stays or comes back, is off by more than anything shows. (Keeping exact states with their
//! derivatives, and answering from them within a controlled error, is the idea of in situ adaptive tabulation: Pope,
//! Combustion Theory and Modelling 1, 1997.)

use crate::model::{Body, TissueModel};
use crate::solver::equilibrium::{Failure, NewtonSettings};
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};

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

/// From one solve to the next the tangent changes by a few per cent: iterations with the last factor converge fast, and
/// the one factor that the derivatives need anyway proves the new state to be stable.
const SOLVE: NewtonSettings =
    NewtonSettings { residual_tolerance: 1e-8, step_tolerance: 1e-7, ..NewtonSettings::SMALL_STEPS };

/// A body between exact states; see the module's documentation.
#[derive(Debug, Clone)]
pub struct Extrapolated<'m> {
    model: &'m TissueModel,
    /// At the last solve.
    body: Body<'m>,
    /// Where it is now.
    at: Vector3<f64>,
    tolerance: f64,
    /// How far extrapolation is trusted.
    reach: f64,
    known: Known,
    /// Second derivatives of the target's x and y.
    bend: [Matrix3<f64>; 2],
    account: Extrapolation,
}

/// An exact state's linearisation.
#[derive(Debug, Clone)]
struct Known {
    at: Vector3<f64>,
    coefficients: Vec<f64>,
    target: Vector2<f64>,
    /// d(target)/d(depth, paddle x, paddle y).
    slope: Matrix2x3<f64>,
    /// Responses of the coefficients, one after the other.
    responses: Vec<f64>,
}

/// What extrapolating has cost in accuracy, and spared.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Extrapolation {
    /// States that were solved for.
    pub solves: u64,
    /// Largest distance between an extrapolated target displacement and the one solved for in its place, length. States
    /// aside of the way between two solves may be further off.
    pub largest_error: f64,
}

impl<'m> Extrapolated<'m> {
    /// A body at rest with the paddle at this place of the scene's list attached, or none; an error of `tolerance` (length)
    /// of the target displacement is aimed at.
    ///
    /// # Errors
    /// [`Failure`] when the tangent at rest is singular.
    pub fn at_rest(model: &'m TissueModel, paddle: Option<usize>, tolerance: f64) -> Result<Self, Failure> {
        let mut body = model.body(paddle, SOLVE)?;
        let known = Known::of(model, &mut body)?;
        let reach = FIRST * model.scene().needle.depth;
        let account = Extrapolation { solves: 1, ..Extrapolation::default() };
        Ok(Self { model, body, at: known.at, tolerance, reach, known, bend: [Matrix3::zeros(); 2], account })
    }

    /// Takes needle and paddle to the given depth and displacement.
    ///
    /// # Errors
    /// [`Failure`] where the next solve fails; depth and paddle are then where the last converged state has them.
    pub fn drive(&mut self, depth: f64, paddle: Vector2<f64>) -> Result<(), Failure> {
        self.at = Vector3::new(depth, paddle.x, paddle.y);
        let distance = (self.at - self.known.at).norm();
        if distance <= self.reach { Ok(()) } else { self.solve(distance) }
    }

    fn solve(&mut self, distance: f64) -> Result<(), Failure> {
        let foretold = self.target_displacement();
        let driven = self.body.drive(self.at.x, self.at.yz());
        let known = Known::of(self.model, &mut self.body);
        let known = match (driven, known) {
            (Ok(()), Ok(known)) => known,
            (Err(failure), Ok(reached)) => {
                (self.at, self.known) = (reached.at, reached);
                return Err(failure);
            }
            (driven, Err(unstable)) => {
                self.at = self.known.at;
                return Err(driven.err().unwrap_or(unstable));
            }
        };
        let error = (foretold - known.target).norm();
        let longest = LONGEST * self.model.scene().needle.depth;
        // What was jumped over in one step was not extrapolated.
        if distance <= GROWTH * self.reach {
            self.account.largest_error = self.account.largest_error.max(error);
        }
        self.account.solves += 1;
        let room = (AIM * self.tolerance / error.max(f64::MIN_POSITIVE)).powf(1.0 / f64::from(ORDER));
        self.reach = (distance * room).min(GROWTH * self.reach).min(longest);
        learn(&mut self.bend, known.at - self.known.at, known.slope - self.known.slope);
        self.known = known;
        Ok(())
    }

    /// Needle depth.
    pub fn depth(&self) -> f64 {
        self.at.x
    }

    /// Target displacement.
    pub fn target_displacement(&self) -> Vector2<f64> {
        let step = self.at - self.known.at;
        let bend = Vector2::from_fn(|row, _| 0.5 * step.dot(&(self.bend[row] * step)));
        self.known.target + self.known.slope * step + bend
    }

    /// Nodal coefficients, to first order from the last solve: good for a picture.
    pub fn coefficients(&self) -> Vec<f64> {
        let mut out = self.known.coefficients.clone();
        let step = self.at - self.known.at;
        for (response, by) in self.known.responses.chunks_exact(out.len()).zip(step.iter()) {
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
    fn of(model: &TissueModel, body: &mut Body<'_>) -> Result<Self, Failure> {
        let responses = body.responses()?;
        let mut slope = Matrix2x3::zeros();
        for (column, response) in responses.chunks_exact(model.dofs()).enumerate() {
            slope.set_column(column, &model.target_row().interpolate(response));
        }
        let at = Vector3::new(body.depth(), body.paddle().x, body.paddle().y);
        let coefficients = body.equilibrium().coefficients().to_vec();
        Ok(Self { at, coefficients, target: body.target_displacement(), slope, responses })
    }
}

/// Second derivatives that explain how the first have changed over `step`, and are else as close to the old ones as
/// symmetric ones can be.
fn learn(bend: &mut [Matrix3<f64>; 2], step: Vector3<f64>, change: Matrix2x3<f64>) {
    let length = step.norm_squared();
    if length == 0.0 {
        return;
    }
    for (row, bend) in bend.iter_mut().enumerate() {
        let unexplained = change.row(row).transpose() - *bend * step;
        let product = unexplained * step.transpose();
        *bend += (product + product.transpose()) / length
            - step * step.transpose() * (unexplained.dot(&step) / (length * length));
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

    /// In, held with a trembling paddle, and half out again on another way: every state against the exact one.
    #[test]
    fn every_state_keeps_to_the_tolerance() {
        for model in models() {
            let depth = model.scene().needle.depth;
            let tolerance = 1e-6 * depth;
            let way = |k: u32| {
                let t = f64::from(k);
                let inside = if k < 300 { t / 500.0 } else { f64::min(0.6, 0.6 - (t - 400.0) / 500.0) };
                let tremble = 1e-3 * Vector2::new((1.3 * t).sin(), (0.7 * t).cos() - 1.0);
                let along = if k < 400 { Vector2::new(0.2, -0.1) } else { Vector2::new(0.2, 0.1) };
                (inside * depth, (along * inside + tremble) * depth)
            };
            for paddle in [None, Some(1)] {
                let mut body = Extrapolated::at_rest(&model, paddle, tolerance).unwrap();
                let mut exact = model.body(paddle, NewtonSettings::default()).unwrap();
                let mut worst = 0.0_f64;
                for k in 0..500 {
                    let (depth, place) = way(k);
                    let place = if paddle.is_some() { place } else { Vector2::zeros() };
                    body.drive(depth, place).unwrap();
                    exact.drive(depth, place).unwrap();
                    worst = worst.max((body.target_displacement() - exact.target_displacement()).norm());
                }
                let account = body.account();
                assert!(account.solves < 120, "{account:?} of 500 steps");
                assert!(account.largest_error > 0.01 * tolerance, "{account:?} for {tolerance}");
                // A sudden turn is followed with second derivatives that were learnt on another way.
                assert!(worst.max(account.largest_error) < 3.0 * tolerance, "{worst:.1e}, {account:?} for {tolerance}");
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
