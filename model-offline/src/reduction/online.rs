//! The reduced nonlinear model, step by step.
//!
//! Displacements are `d = Σ_c L_c c + Σ_m Φ_m q_m`: the responses at rest to needle and paddle (exact on the constrained nodes)
//! plus modes that vanish there. The energy is summed over a few integration points with weights of their own,
//! `E(q) = Σ_s ξ_s w_s W(I + Σ_c c H_sc + Σ_m q_m H_sm)`, and a step is Newton's method on it: r unknowns, no mesh.
//!
//! **Error.** A second sample of points, none of them in the first, adds up the residual at the solution once more: on
//! guard modes, which the solution has not used, it measures what the modes miss (a hierarchical estimate, Bank & Smith
//! 1993), on the used modes, where the first sample says zero, what the samples miss. Solved with the tangent at rest it
//! becomes a target displacement. Its scale is calibrated on states of the full model: the largest ratio of error to
//! estimate on n of them bounds that of one more, drawn like them, with probability n/(n + 1) (split conformal
//! prediction, Vovk, Gammerman & Shafer 2005).

use crate::material::Material as _;
use crate::mechanics::Tissue;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix2, Vector2};
use std::sync::Arc;

/// Newton iterations before a step is given up.
const MAX_ITERATIONS: u32 = 20;
/// Last step over the largest mode amplitude seen in training at convergence: the step after it would be its square.
const STEP_TOLERANCE: f64 = 1e-7;
/// A piece of the way from rest, over the way, where neither the last state nor rest is a start near enough; and the
/// shortest that is tried.
const PIECE: f64 = 0.125;
const SHORTEST_PIECE: f64 = PIECE / 64.0;
/// A kept tangent is renewed when an iteration gains less than this.
const CONTRACTION: f64 = 0.1;

/// Why the reduced model has no answer. The full model has to be asked, or the simulation held.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Invalid {
    /// Needle or paddle are where it was not trained.
    #[error(
        "depth {depth:.4} with the paddle displaced by ({x:.4}, {y:.4}) is outside the trained range (depth up to {max_depth:.4}, displacement up to {max_x:.4} and {max_y:.4} along the axes)"
    )]
    OutsideDomain {
        /// Needle depth asked for.
        depth: f64,
        /// Paddle displacement asked for.
        x: f64,
        /// Paddle displacement asked for.
        y: f64,
        /// Largest depth trained.
        max_depth: f64,
        /// Largest paddle displacement trained along x.
        max_x: f64,
        /// Largest paddle displacement trained along y.
        max_y: f64,
    },
    /// The error estimate is too large.
    #[error("the estimated error of the target displacement, {estimate:.2e}, is above {tolerance:.2e}")]
    TooInaccurate {
        /// Estimated error of the target displacement, length.
        estimate: f64,
        /// Largest that is accepted.
        tolerance: f64,
    },
    /// Newton's method found no equilibrium on the modes.
    #[error("no equilibrium on the modes at depth {depth:.4}")]
    NoEquilibrium {
        /// Needle depth asked for.
        depth: f64,
    },
}

/// Where the model was trained.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Domain {
    /// Largest needle depth, length units.
    pub depth: f64,
    /// Largest paddle displacement along each axis, length units.
    pub paddle: Vector2<f64>,
}

impl Domain {
    fn contains(&self, depth: f64, paddle: Vector2<f64>) -> bool {
        // A rounding error beyond the last trained state is still that state.
        let slack = 1.0 + 1e-9;
        (0.0..=self.depth * slack).contains(&depth) && (0..2).all(|k| paddle[k].abs() <= self.paddle[k] * slack)
    }
}

/// A reduced model of one body with one paddle, or none.
#[derive(Debug, Clone)]
pub struct ReducedModel {
    /// Controls (1 or 3), modes, guard modes: columns of everything below, in this order.
    pub(super) controls: usize,
    pub(super) modes: usize,
    pub(super) guards: usize,
    pub(super) tissue: Tissue,
    /// The points that the solution is computed with, and those that judge it.
    pub(super) sample: Sample,
    pub(super) control: Sample,
    /// Constant stabilisation between all columns.
    pub(super) stabilisation: DMatrix<f64>,
    /// Target displacement of every column.
    pub(super) target: Vec<Vector2<f64>>,
    /// Target displacement per residual on modes and guard modes (2 × both).
    pub(super) residual_response: DMatrix<f64>,
    /// What the raw estimate is multiplied with, and what is added to it before, length.
    pub(super) scale: f64,
    pub(super) floor: f64,
    /// Largest error estimate that is accepted, length.
    pub(super) tolerance: f64,
    /// Largest norm of q in training.
    pub(super) amplitude: f64,
    pub(super) domain: Domain,
    /// Nodal coefficients of controls and modes.
    pub(super) columns: Vec<Vec<f64>>,
}

/// Weighted integration points that stand for all.
#[derive(Debug, Clone)]
pub(super) struct Sample {
    pub points: Vec<SampledPoint>,
    /// Displacement gradients: point by point, component by component (row-major), column by column.
    pub gradients: Vec<f64>,
}

/// An integration point that was kept.
#[derive(Debug, Clone, Copy)]
pub(super) struct SampledPoint {
    /// Its weight times that of the sample, reference volume.
    pub weight: f64,
    pub cell: u32,
}

impl ReducedModel {
    /// Displacement modes.
    pub fn modes(&self) -> usize {
        self.modes
    }

    /// Integration points that are left.
    pub fn points(&self) -> usize {
        self.sample.points.len()
    }

    /// Where it was trained.
    pub fn domain(&self) -> Domain {
        self.domain
    }

    /// Largest error of the target displacement that it accepts from itself, length.
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// A body at rest.
    pub fn body(self: &Arc<Self>) -> ReducedBody {
        ReducedBody {
            model: Arc::clone(self),
            amplitudes: vec![0.0; self.controls + self.modes],
            residual: vec![0.0; self.modes + self.guards],
            factor: None,
            estimate: self.scale * self.floor,
        }
    }

    fn width(&self) -> usize {
        self.controls + self.modes + self.guards
    }

    /// Adds up the residual on modes and guard modes at these amplitudes, and the tangent on the modes where asked for.
    /// False when the configuration is not admissible.
    fn evaluate(
        &self,
        sample: &Sample,
        amplitudes: &[f64],
        residual: &mut [f64],
        mut tangent: Option<&mut DMatrix<f64>>,
    ) -> bool {
        let (width, used) = (self.width(), self.controls + self.modes);
        for (row, r) in residual.iter_mut().enumerate() {
            let along = self.stabilisation.row(self.controls + row);
            *r = along.iter().zip(&amplitudes[..used]).map(|(s, a)| s * a).sum();
        }
        if let Some(k) = tangent.as_deref_mut() {
            k.copy_from(&self.stabilisation.view((self.controls, self.controls), (self.modes, self.modes)));
        }
        let mut response = vec![0.0; 4 * self.modes];
        for (point, gradients) in sample.points.iter().zip(sample.gradients.chunks_exact(4 * width)) {
            let component = |k: usize| &gradients[k * width..(k + 1) * width];
            let along = |k: usize| component(k)[..used].iter().zip(amplitudes).map(|(g, a)| g * a).sum::<f64>();
            let h = Matrix2::new(along(0), along(1), along(2), along(3));
            if (Matrix2::identity() + h).determinant() <= 0.0 {
                return false;
            }
            let mut stress = [0.0; 4];
            let mut stiffness = [[0.0; 4]; 4];
            for (material, factor) in self.tissue.parts(point.cell) {
                let scale = point.weight * factor;
                let p = material.respond(&h).pk1_stress;
                for (k, s) in stress.iter_mut().enumerate() {
                    *s += scale * p[(k / 2, k % 2)];
                }
                if tangent.is_some() {
                    let a = material.tangent(&h);
                    for (k, row) in stiffness.iter_mut().enumerate() {
                        for (l, entry) in row.iter_mut().enumerate() {
                            *entry += scale * a[k / 2][k % 2][l / 2][l % 2];
                        }
                    }
                }
            }
            for (k, s) in stress.iter().enumerate() {
                for (r, g) in residual.iter_mut().zip(&component(k)[self.controls..]) {
                    *r += s * g;
                }
            }
            if let Some(matrix) = tangent.as_deref_mut() {
                let mode = |k: usize| &component(k)[self.controls..used];
                for (row, out) in stiffness.iter().zip(response.chunks_exact_mut(self.modes)) {
                    for (n, o) in out.iter_mut().enumerate() {
                        *o = (0..4).map(|l| row[l] * mode(l)[n]).sum();
                    }
                }
                for n in 0..self.modes {
                    for m in n..self.modes {
                        matrix[(m, n)] += (0..4).map(|k| mode(k)[m] * response[k * self.modes + n]).sum::<f64>();
                    }
                }
            }
        }
        residual.iter().all(|r| r.is_finite())
    }
}

/// The reduced model in equilibrium with the needle at some depth and the paddle somewhere.
#[derive(Debug, Clone)]
pub struct ReducedBody {
    model: Arc<ReducedModel>,
    /// Controls, then modes.
    amplitudes: Vec<f64>,
    residual: Vec<f64>,
    factor: Option<Cholesky<f64, Dyn>>,
    estimate: f64,
}

impl ReducedBody {
    /// Takes needle and paddle there.
    ///
    /// # Errors
    /// [`Invalid`]; the body is then where it was before.
    pub fn drive(&mut self, depth: f64, paddle: Vector2<f64>) -> Result<(), Invalid> {
        let model = Arc::clone(&self.model);
        if !model.domain.contains(depth, paddle) {
            let Domain { depth: max_depth, paddle: most } = model.domain;
            let (max_x, max_y) = (most.x, most.y);
            return Err(Invalid::OutsideDomain { depth, x: paddle.x, y: paddle.y, max_depth, max_x, max_y });
        }
        let before = self.amplitudes.clone();
        self.set_controls(depth, paddle);
        let outcome = if self.converge() || self.converge_from_rest(depth, paddle) {
            self.check(depth)
        } else {
            Err(Invalid::NoEquilibrium { depth })
        };
        if outcome.is_err() {
            self.amplitudes = before;
            self.factor = None;
        }
        outcome
    }

    fn set_controls(&mut self, depth: f64, paddle: Vector2<f64>) {
        let controls = self.model.controls;
        self.amplitudes[..controls].copy_from_slice(&super::lifting::control_values(depth, paddle)[..controls]);
    }

    /// Newton's method on the modes, with the last tangent as long as it serves.
    fn converge(&mut self) -> bool {
        let model = Arc::clone(&self.model);
        let mut last = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            let renewed = self.factor.is_none();
            if renewed {
                let mut tangent = DMatrix::zeros(model.modes, model.modes);
                if !model.evaluate(&model.sample, &self.amplitudes, &mut self.residual, Some(&mut tangent)) {
                    return false;
                }
                self.factor = Cholesky::new(tangent);
            } else if !model.evaluate(&model.sample, &self.amplitudes, &mut self.residual, None) {
                return false;
            }
            let Some(factor) = &self.factor else {
                return false;
            };
            let mut step = DVector::from_column_slice(&self.residual[..model.modes]);
            factor.solve_mut(&mut step);
            for (a, s) in self.amplitudes[model.controls..].iter_mut().zip(step.iter()) {
                *a -= s;
            }
            let length = step.norm();
            if length <= STEP_TOLERANCE * model.amplitude {
                return true;
            }
            if !renewed && length > CONTRACTION * last {
                self.factor = None;
            }
            last = length;
        }
        false
    }

    /// After a long way the last amplitudes are a bad start, and the response at rest is a better one; or, where that is
    /// too far as well, the way from rest in pieces.
    fn converge_from_rest(&mut self, depth: f64, paddle: Vector2<f64>) -> bool {
        let restart = |body: &mut Self| {
            body.amplitudes[body.model.controls..].fill(0.0);
            body.factor = None;
        };
        restart(self);
        if self.converge() {
            return true;
        }
        restart(self);
        let (mut done, mut piece) = (0.0, PIECE);
        while done < 1.0 {
            let (before, share) = (self.amplitudes.clone(), f64::min(done + piece, 1.0));
            self.set_controls(share * depth, paddle * share);
            if self.converge() {
                done = share;
                continue;
            }
            self.amplitudes = before;
            self.factor = None;
            piece *= 0.5;
            if piece < SHORTEST_PIECE {
                return false;
            }
        }
        true
    }

    fn check(&mut self, depth: f64) -> Result<(), Invalid> {
        let model = Arc::clone(&self.model);
        let raw = self.raw_estimate().ok_or(Invalid::NoEquilibrium { depth })?;
        self.estimate = model.scale * (raw + model.floor);
        if self.estimate > model.tolerance {
            return Err(Invalid::TooInaccurate { estimate: self.estimate, tolerance: model.tolerance });
        }
        Ok(())
    }

    /// Target displacement of what the second sample has left over, length; none where it is not admissible.
    fn raw_estimate(&mut self) -> Option<f64> {
        let model = Arc::clone(&self.model);
        if !model.evaluate(&model.control, &self.amplitudes, &mut self.residual, None) {
            return None;
        }
        Some((&model.residual_response * DVector::from_column_slice(&self.residual)).norm())
    }

    /// Target displacement.
    pub fn target_displacement(&self) -> Vector2<f64> {
        self.amplitudes.iter().zip(&self.model.target).fold(Vector2::zeros(), |sum, (a, t)| sum + t * *a)
    }

    /// Estimated error of the target displacement, length.
    pub fn error_estimate(&self) -> f64 {
        self.estimate
    }

    /// Nodal coefficients of the full model.
    pub fn coefficients(&self) -> Vec<f64> {
        let mut sum = vec![0.0; self.model.columns[0].len()];
        for (column, amplitude) in self.model.columns.iter().zip(&self.amplitudes) {
            for (s, c) in sum.iter_mut().zip(column) {
                *s += amplitude * c;
            }
        }
        sum
    }
}
