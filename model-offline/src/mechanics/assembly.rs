//! Assembly of internal force and tangent stiffness in coefficient space, where the tangent is sparse.
//!
//! With F_q = I + Σ_I d_I ⊗ g_I(q): internal force `f_I = Σ_q w_q P(F_q) g_I` and tangent stiffness
//! `(K_IJ)_ik = Σ_q w_q g_I,j A_ijkl(F_q) g_J,l`, total Lagrangian throughout; rules with a constant
//! [`Stabilisation`] add theirs.

use super::blocks::BlockPositions;
use super::history::Prestress;
use super::stabilisation::Stabilisation;
use super::tissue::Tissue;
use crate::discretization::Quadrature;
use crate::material::{Material, Matrix, determinant};

/// A configuration that the model does not admit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inverted {
    /// Integration point.
    pub point: usize,
    /// det F there; positive when it is the law that has no finite stress there.
    pub det_f: f64,
}

impl Inverted {
    /// Whether the body is not inverted, but the law's stress not finite.
    pub fn law_overflowed(&self) -> bool {
        self.det_f > 0.0
    }
}

impl std::fmt::Display for Inverted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { point, det_f } = self;
        match self.law_overflowed() {
            true => write!(f, "the law's stress is not finite at integration point {point} (det F = {det_f:.3e})"),
            false => write!(f, "det F = {det_f:.3e} at integration point {point}"),
        }
    }
}

/// Displacement gradients of all integration points, kept from the force evaluation for the tangent.
#[derive(Debug, Clone, Default)]
pub struct AssemblyState<const D: usize> {
    gradients: Vec<Matrix<D>>,
}

impl<const D: usize> AssemblyState<D> {
    /// Displacement gradients H = F − I, per integration point.
    pub fn displacement_gradients(&self) -> &[Matrix<D>] {
        &self.gradients
    }
}

/// Displacement gradient at integration point `q` for coefficients stored node by node.
#[inline]
pub fn displacement_gradient<const D: usize>(rule: &Quadrature<D>, q: usize, coefficients: &[f64]) -> Matrix<D> {
    let point = rule.point(q);
    let mut h = Matrix::<D>::zeros();
    for (&i, g) in point.nodes.iter().zip(point.gradients) {
        let d = &coefficients[i as usize * D..i as usize * D + D];
        for r in 0..D {
            for c in 0..D {
                h[(r, c)] += d[r] * g[c];
            }
        }
    }
    h
}

/// What resists a deformation: a discretized tissue.
#[derive(Debug, Clone, Copy)]
pub struct Medium<'a, const D: usize> {
    /// The integration rule.
    pub rule: &'a Quadrature<D>,
    /// The rule's stabilisation on the tissue.
    pub stabilisation: &'a Stabilisation,
    /// Materials by cell.
    pub tissue: &'a Tissue,
    /// What its past has left in it.
    pub prestress: &'a Prestress<D>,
}

/// Internal force and energy at the given coefficients, with those of the rule's stabilisation and of what the past has left;
/// fills `state` for [`tangent`].
///
/// # Errors
/// [`Inverted`] when det F ≤ 0 or not a number, or the stress not finite, at an integration point; `force` is then not
/// meaningful.
pub fn internal_force<const D: usize>(
    medium: Medium<'_, D>,
    coefficients: &[f64],
    state: &mut AssemblyState<D>,
    force: &mut [f64],
) -> Result<f64, Inverted> {
    let Medium { rule, stabilisation, tissue, prestress } = medium;
    force.fill(0.0);
    state.gradients.clear();
    let linear = tissue.is_linear();
    let mut energy = 0.0;
    for (q, point) in rule.points().enumerate() {
        let h = displacement_gradient(rule, q, coefficients);
        state.gradients.push(h);
        let det_f = determinant(&(Matrix::<D>::identity() + h));
        if !linear && (det_f <= 0.0 || det_f.is_nan()) {
            return Err(Inverted { point: q, det_f });
        }
        let mut pk1 = Matrix::<D>::zeros();
        for (material, factor) in tissue.parts(point.cell) {
            let response = material.respond(&h);
            energy += point.weight * factor * response.energy;
            pk1 += response.pk1_stress * (point.weight * factor);
        }
        prestress.add_stress(q, &h, &mut energy, &mut pk1);
        if !pk1.iter().all(|p| p.is_finite()) {
            return Err(Inverted { point: q, det_f });
        }
        for (&i, g) in point.nodes.iter().zip(point.gradients) {
            let f = &mut force[i as usize * D..i as usize * D + D];
            for r in 0..D {
                for c in 0..D {
                    f[r] += pk1[(r, c)] * g[c];
                }
            }
        }
    }
    Ok(energy + stabilisation.add_force::<D>(coefficients, force) + prestress.add_nodal(coefficients, force))
}

/// Tangent stiffness at the state that [`internal_force`] left, added into `values` (lower triangle of blocks, laid
/// out by the pattern of `blocks`).
pub fn tangent<const D: usize>(
    medium: Medium<'_, D>,
    state: &AssemblyState<D>,
    blocks: &BlockPositions,
    values: &mut [f64],
) {
    let Medium { rule, stabilisation, tissue, prestress } = medium;
    let mut next = 0;
    for (q, (point, h)) in rule.points().zip(&state.gradients).enumerate() {
        // a[l][k][m][i] = A_imkl: what a column sums over is outermost, what an entry of a block varies over runs fastest.
        let mut a = [[[[0.0; D]; D]; D]; D];
        for (material, factor) in tissue.parts(point.cell) {
            let part = material.tangent(h);
            let scale = point.weight * factor;
            for (l, of_l) in a.iter_mut().enumerate() {
                for (k, of_k) in of_l.iter_mut().enumerate() {
                    for (m, of_m) in of_k.iter_mut().enumerate() {
                        of_m.iter_mut().zip(&part).for_each(|(sum, part)| *sum += scale * part[m][k][l]);
                    }
                }
            }
        }
        if let Some(pk2) = prestress.geometric(q) {
            for (l, of_l) in a.iter_mut().enumerate() {
                for (k, of_k) in of_l.iter_mut().enumerate() {
                    of_k.iter_mut().enumerate().for_each(|(m, of_m)| of_m[k] += pk2[(m, l)]);
                }
            }
        }
        for (column, (&j, gj)) in point.nodes.iter().zip(point.gradients).enumerate() {
            // t[k][m][i] = A_imkl g_J,l: shared by all rows of this column.
            let mut t = [[[0.0; D]; D]; D];
            for (of_l, g) in a.iter().zip(gj) {
                let (t, of_l) = (t.as_flattened_mut().as_flattened_mut(), of_l.as_flattened().as_flattened());
                t.iter_mut().zip(of_l).for_each(|(t, a)| *t += a * g);
            }
            let stride = blocks.strides[j as usize] as usize;
            let rows = &point.gradients[column..];
            for (gi, &at) in rows.iter().zip(&blocks.positions[next..next + rows.len()]) {
                for (k, t) in t.iter().enumerate() {
                    let start = at as usize + k * stride;
                    let mut block = [0.0; D];
                    for (t, g) in t.iter().zip(gi) {
                        block.iter_mut().zip(t).for_each(|(entry, t)| *entry += g * t);
                    }
                    values[start..start + D].iter_mut().zip(block).for_each(|(entry, new)| *entry += new);
                }
            }
            next += rows.len();
        }
    }
    stabilisation.add_tangent(values);
}
