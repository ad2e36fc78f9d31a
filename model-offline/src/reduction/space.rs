//! The space that a reduced model lives in: modes of the snapshots, what the full model says about them, and the points
//! that stand for all.

use super::error::TrainingError;
use super::lifting::{flat, tangent_at_rest};
use super::nnls::{Columns, NonNegativeFit};
use super::online::{Domain, ReducedModel, Sample, SampledPoint};
use super::snapshots::Snapshot;

use crate::material::Material as _;
use crate::mechanics::assembly::displacement_gradient;
use crate::model::TissueModel;
use nalgebra::{DMatrix, DVector, Matrix2, SymmetricEigen, Vector2};

/// Numbers of modes that are tried, until the trial is passed.
pub(super) const MODES: [usize; 7] = [2, 4, 6, 8, 12, 16, 20];
/// Modes beyond those used that the error estimate looks at.
pub(super) const GUARDS: usize = 4;
/// Modes below this singular value, over the largest, are rounding.
const NEGLIGIBLE: f64 = 1e-7;
/// Misfit of the second sample over that of the first, which it judges: it is summed once per step, not once per iteration.
const CONTROL_SHARE: f64 = 0.4;
/// Numbers in the matrix that the sample is chosen by, at most.
const LARGEST_FIT: usize = 8_000_000;

/// Where on the way from the response at rest to equilibrium forces are looked at, over the way: the first that does not
/// squeeze any point to less than this part of its volume at the most squeezed one in equilibrium. Beyond, a few points near
/// the ends of the paddle would have forces next to which those of all others are rounding.
const WAY: [f64; 4] = [0.0, 0.5, 0.75, 0.9];
const SQUEEZE: f64 = 0.5;

/// How large a reduced model is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Size {
    pub modes: usize,
    /// Modes behind them that only the error estimate sees.
    pub guards: usize,
}

/// Points with their weights.
type Weights = Vec<(usize, f64)>;

/// Points that give the same sums as all, in two samples that have none in common, better and better.
pub(super) struct Sampling {
    /// Forces of every point, which are to be added up to those of all.
    forces: Columns,
    /// What the first sample has so far.
    taken: Weights,
}

impl Sampling {
    /// Samples within a misfit, the second made of points that the first does not have.
    pub(super) fn next(&mut self, misfit: f64) -> [Weights; 2] {
        let mut first = NonNegativeFit::new(&mut self.forces, std::iter::empty());
        first.start_from(&self.taken);
        first.improve(misfit);
        self.taken = first.weights();
        let mut second = NonNegativeFit::new(&mut self.forces, self.taken.iter().map(|(q, _)| *q));
        second.improve(CONTROL_SHARE * misfit);
        [self.taken.clone(), second.weights()]
    }
}

/// Modes of the snapshots, with what the full model says about them.
pub(super) struct ModalSpace {
    lifts: Vec<Vec<f64>>,
    modes: Vec<Vec<f64>>,
    /// Displacement gradients: column by column (lifts, then modes), point by point.
    gradients: Vec<Vec<Matrix2<f64>>>,
    target: Vec<Vector2<f64>>,
    /// Controls and mode amplitudes of the snapshots.
    states: Vec<(Vec<f64>, DVector<f64>)>,
}

impl ModalSpace {
    /// Proper orthogonal decomposition of what the responses at rest leave of the snapshots.
    pub(super) fn new(model: &TissueModel, lifts: &[Vec<f64>], snapshots: &[Snapshot]) -> Self {
        let rest: Vec<DVector<f64>> = snapshots
            .iter()
            .map(|s| {
                let mut rest = DVector::from_column_slice(&s.coefficients);
                for (lift, control) in lifts.iter().zip(s.controls) {
                    rest.axpy(-control, &DVector::from_column_slice(lift), 1.0);
                }
                rest
            })
            .collect();
        let gram = DMatrix::from_fn(rest.len(), rest.len(), |i, j| rest[i].dot(&rest[j]));
        let decomposition = SymmetricEigen::new(gram);
        let mut order: Vec<usize> = (0..rest.len()).collect();
        order.sort_by(|&i, &j| decomposition.eigenvalues[j].total_cmp(&decomposition.eigenvalues[i]));
        let largest = decomposition.eigenvalues[order[0]];
        let modes: Vec<Vec<f64>> = order
            .into_iter()
            .take(MODES[MODES.len() - 1] + GUARDS)
            .filter(|&k| decomposition.eigenvalues[k] > NEGLIGIBLE * NEGLIGIBLE * largest)
            .map(|k| {
                let shares = decomposition.eigenvectors.column(k);
                let mut mode = DVector::zeros(rest[0].len());
                for (share, snapshot) in shares.iter().zip(&rest) {
                    mode.axpy(*share, snapshot, 1.0);
                }
                (mode / decomposition.eigenvalues[k].sqrt()).as_slice().to_vec()
            })
            .collect();
        let columns = || lifts.iter().chain(&modes);
        let rule = model.rule();
        let gradients =
            columns().map(|c| (0..rule.len()).map(|q| displacement_gradient(rule, q, c)).collect()).collect();
        let target = columns().map(|c| model.target_row().interpolate(c)).collect();
        let amplitudes = |r: &DVector<f64>| {
            DVector::from_iterator(modes.len(), modes.iter().map(|m| r.dot(&DVector::from_column_slice(m))))
        };
        let states =
            snapshots.iter().zip(&rest).map(|(s, r)| (s.controls[..lifts.len()].to_vec(), amplitudes(r))).collect();
        Self { lifts: lifts.to_vec(), gradients, target, states, modes }
    }

    /// Modes above rounding.
    pub(super) fn available(&self) -> usize {
        self.modes.len()
    }

    /// Worst distance of the target displacement when states are projected onto the first modes, length.
    pub(super) fn projection_error(&self, states: &[Snapshot], modes: usize) -> f64 {
        let error = |state: &Snapshot| {
            let mut left = DVector::from_column_slice(&state.coefficients);
            let mut target = state.target;
            for (c, (lift, control)) in self.lifts.iter().zip(state.controls).enumerate() {
                left.axpy(-control, &DVector::from_column_slice(lift), 1.0);
                target -= self.target[c] * control;
            }
            for (m, mode) in self.modes[..modes].iter().enumerate() {
                target -= self.target[self.lifts.len() + m] * left.dot(&DVector::from_column_slice(mode));
            }
            target.norm()
        };
        states.iter().map(error).fold(0.0, f64::max)
    }

    /// The reduced model on the first modes, with guards behind them, on these samples.
    ///
    /// # Errors
    /// [`TrainingError::Singular`].
    pub(super) fn reduce(
        &self,
        model: &TissueModel,
        size: Size,
        samples: [Weights; 2],
        domain: Domain,
    ) -> Result<ReducedModel, TrainingError> {
        let Size { modes, guards } = size;
        let (controls, seen) = (self.lifts.len(), modes + guards);
        let stabilisation = self.stabilisation(model, seen);
        let tangent_at_rest =
            self.tangent_at_rest(model, seen) + stabilisation.view((controls, controls), (seen, seen));
        // What residuals do to the target: T K⁻¹.
        let inverse = tangent_at_rest.try_inverse().ok_or(TrainingError::Singular { modes: seen })?;
        let target = DMatrix::from_fn(2, seen, |i, m| self.target[controls + m][i]);
        let [sample, control] = samples.map(|weights| self.gather(model, &weights, controls + seen));
        Ok(ReducedModel {
            controls,
            modes,
            guards,
            tissue: model.tissue().clone(),
            sample,
            control,
            stabilisation,
            target: self.target[..controls + modes].to_vec(),
            residual_response: target * inverse,
            scale: 1.0,
            floor: 0.0,
            tolerance: f64::INFINITY,
            amplitude: self.states.iter().map(|s| s.1.norm()).fold(f64::MIN_POSITIVE, f64::max),
            domain,
            columns: self.lifts.iter().chain(&self.modes[..modes]).cloned().collect(),
        })
    }

    /// The points with the gradients of the first `width` columns.
    fn gather(&self, model: &TissueModel, weights: &Weights, width: usize) -> Sample {
        let rule = model.rule();
        let point = |&(q, factor): &(usize, f64)| SampledPoint {
            weight: factor * rule.point(q).weight,
            cell: rule.point(q).cell,
        };
        let gradients = |&(q, _): &(usize, f64)| {
            (0..4).flat_map(move |k| (0..width).map(move |c| self.gradients[c][q][(k / 2, k % 2)]))
        };
        Sample { points: weights.iter().map(point).collect(), gradients: weights.iter().flat_map(gradients).collect() }
    }

    /// The constant stabilisation between lifts and modes; it is projected once, and not part of the sample.
    fn stabilisation(&self, model: &TissueModel, modes: usize) -> DMatrix<f64> {
        let columns: Vec<&[f64]> = self.lifts.iter().chain(&self.modes[..modes]).map(Vec::as_slice).collect();
        model.analysis().stabilisation(model.rule(), model.tissue()).project::<2>(&columns)
    }

    /// `K_mn = Σ_q w_q H_m · A(0) · H_n` over all points.
    fn tangent_at_rest(&self, model: &TissueModel, modes: usize) -> DMatrix<f64> {
        let mut k = DMatrix::zeros(modes, modes);
        for (q, point) in model.rule().points().enumerate() {
            let a = tangent_at_rest(model.tissue(), point.cell, point.weight);
            for n in 0..modes {
                let stress = a * flat(&self.mode_gradient(n, q));
                for m in 0..modes {
                    k[(m, n)] += flat(&self.mode_gradient(m, q)).dot(&stress);
                }
            }
        }
        k
    }

    fn mode_gradient(&self, mode: usize, q: usize) -> Matrix2<f64> {
        self.gradients[self.lifts.len() + mode][q]
    }

    /// What points and weights must give: the forces on the modes, on the way from the response at rest to equilibrium at
    /// every snapshot, as all points together do; and the mode stiffness at rest. (At equilibrium alone these forces
    /// vanish, and any sample would do.)
    pub(super) fn sampling(&self, model: &TissueModel, size: Size) -> Sampling {
        let Size { modes, guards } = size;
        let rule = model.rule();
        let seen = modes + guards;
        let all = 2 * self.states.len() * seen;
        let stride = (all * rule.len()).div_ceil(LARGEST_FIT).max(1);
        let mut rows: Vec<DVector<f64>> = Vec::new();
        for (controls, amplitudes) in self.states.iter().step_by(stride) {
            let at = |share: f64| amplitudes.rows(0, modes) * share;
            let squeezed = self.smallest_volume_ratio(controls, &at(1.0));
            let usable = |share: &f64| self.smallest_volume_ratio(controls, &at(*share)) >= SQUEEZE * squeezed;
            for share in WAY.into_iter().find(usable).into_iter().chain([1.0]) {
                let forces = self.point_forces(model, controls, &at(share), seen);
                rows.extend(forces.into_iter().filter(|row| row.iter().all(|x| x.is_finite())));
            }
        }
        let typical =
            self.states.iter().map(|s| s.1.rows(0, modes).abs()).fold(DVector::zeros(modes), |m, a| m.sup(&a));
        let tangents: Vec<_> =
            rule.points().map(|point| tangent_at_rest(model.tissue(), point.cell, point.weight)).collect();
        for n in 0..modes {
            let stresses: Vec<_> =
                tangents.iter().enumerate().map(|(q, a)| a * flat(&self.mode_gradient(n, q)) * typical[n]).collect();
            for m in 0..=n {
                let work = |(q, stress): (usize, &nalgebra::Vector4<f64>)| flat(&self.mode_gradient(m, q)).dot(stress);
                rows.push(DVector::from_iterator(rule.len(), stresses.iter().enumerate().map(work)));
            }
        }
        let sums = DVector::from_iterator(rows.len(), rows.iter().map(|row| row.sum()));
        let forces = DMatrix::from_fn(rows.len(), rule.len(), |i, q| rows[i][q]);
        Sampling { forces: Columns::new(forces, sums), taken: Vec::new() }
    }

    /// The smallest det F of all points.
    fn smallest_volume_ratio(&self, controls: &[f64], amplitudes: &DVector<f64>) -> f64 {
        let values: Vec<f64> = controls.iter().chain(amplitudes.iter()).copied().collect();
        let gradient = |q: usize| self.gradients.iter().zip(&values).map(|(g, a)| g[q] * *a).sum::<Matrix2<f64>>();
        let points = 0..self.gradients.first().map_or(0, Vec::len);
        points.map(|q| (Matrix2::identity() + gradient(q)).determinant()).fold(f64::INFINITY, f64::min)
    }

    /// Every point's part of the force on each of the first `seen` modes.
    fn point_forces(
        &self,
        model: &TissueModel,
        controls: &[f64],
        amplitudes: &DVector<f64>,
        seen: usize,
    ) -> Vec<DVector<f64>> {
        let rule = model.rule();
        let mut forces = vec![DVector::zeros(rule.len()); seen];
        let values: Vec<f64> = controls.iter().chain(amplitudes.iter()).copied().collect();
        for (q, point) in rule.points().enumerate() {
            let h: Matrix2<f64> = self.gradients.iter().zip(&values).map(|(g, a)| g[q] * *a).sum();
            let mut p = Matrix2::zeros();
            for (material, factor) in model.tissue().parts(point.cell) {
                p += material.respond(&h).pk1_stress * (factor * point.weight);
            }
            for (m, force) in forces.iter_mut().enumerate() {
                force[q] = self.mode_gradient(m, q).dot(&p);
            }
        }
        forces
    }
}
