//! Shape functions Ψ_I and their gradients from the moment matrix.

use super::kernel::{NEGLIGIBLE, product_kernel, product_kernel_value};
use crate::discretization::NodeCloud;
use crate::discretization::method::Basis;
use crate::geometry::Point;
use nalgebra::{SMatrix, SVector};

/// Above this condition number (1-norm, of the scaled moment matrix) shape functions have lost too many digits.
pub const MAX_MOMENT_CONDITION: f64 = 1e11;

/// Why shape functions do not exist somewhere.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("moment matrix singular at node {node} {position:?}: {neighbours} kernels cover it, condition {condition:.1e}; {}", self.advice())]
pub struct ShapeError {
    /// The node at which, or in whose cell, the moment matrix fails.
    pub node: usize,
    /// Where it was evaluated.
    pub position: Vec<f64>,
    /// How many kernels cover that place.
    pub neighbours: usize,
    /// How many a basis of this size needs at least.
    pub needed: usize,
    /// 1-norm condition number of the scaled moment matrix (infinite when it is not positive definite).
    pub condition: f64,
}

impl ShapeError {
    fn advice(&self) -> &'static str {
        if self.neighbours < self.needed {
            "the support is too small: increase `support`"
        } else {
            "its neighbours are collinear or coincide: increase `support` or move the nodes apart"
        }
    }
}

/// Values of the shape functions that are not zero at a point, with gradients when asked for.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stencil<const D: usize> {
    /// Nodes I, ascending.
    pub nodes: Vec<u32>,
    /// Ψ_I(x).
    pub values: Vec<f64>,
    /// ∇Ψ_I(x), per length unit; empty when only values were asked for.
    pub gradients: Vec<Point<D>>,
}

impl<const D: usize> Stencil<D> {
    /// Σ_I Ψ_I d_I for nodal coefficients stored node by node (D numbers each).
    pub fn interpolate(&self, coefficients: &[f64]) -> Point<D> {
        self.nodes.iter().zip(&self.values).fold(Point::zeros(), |sum, (&i, &value)| {
            let at = i as usize * D;
            sum + Point::from_column_slice(&coefficients[at..at + D]) * value
        })
    }

    /// The difference between what this interpolates and the value of a node after all of its own.
    pub(crate) fn ported(&self, port: u32) -> Self {
        let nodes = self.nodes.iter().copied().chain([port]).collect();
        Self { nodes, values: self.values.iter().copied().chain([-1.0]).collect(), gradients: Vec::new() }
    }
}

/// What to reproduce at a point: the field itself, or one of its first derivatives.
///
/// The second gives *implicit* gradients Ψ_I^(j): Σ_I Ψ_I^(j)(x) u(X_I) ≈ ∂u/∂x_j, exact for the basis, at no cost of
/// differentiating the moment matrix (Chen, Zhang & Belytschko 2004; used by NSNI).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reproduce {
    /// The field.
    Field,
    /// Its derivative along axis j.
    Derivative(usize),
}

/// What of the shape functions is wanted at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted {
    reproduce: Reproduce,
    gradients: bool,
}

impl Wanted {
    /// Ψ_I.
    pub const VALUES: Self = Self { reproduce: Reproduce::Field, gradients: false };
    /// Ψ_I and ∇Ψ_I.
    pub const GRADIENTS: Self = Self { reproduce: Reproduce::Field, gradients: true };

    /// The implicit gradients along axis j, and their own gradients.
    pub const fn implicit_gradient(j: usize) -> Self {
        Self { reproduce: Reproduce::Derivative(j), gradients: true }
    }
}

/// Moment matrix M(x) and its slopes ∂M/∂x_k, lower triangles; the slopes are 0 when only values are wanted.
struct Moments<const D: usize, const P: usize> {
    matrix: SMatrix<f64, P, P>,
    slopes: [SMatrix<f64, P, P>; D],
}

/// Shape functions over a cloud of nodes.
#[derive(Debug, Clone, Copy)]
pub struct ShapeFunctions<'a, const D: usize> {
    cloud: &'a NodeCloud<D>,
    basis: Basis,
}

impl<'a, const D: usize> ShapeFunctions<'a, D>
where
    [f64; D]: rstar::Point<Scalar = f64>,
{
    /// Shape functions of the given basis over a cloud.
    pub fn new(cloud: &'a NodeCloud<D>, basis: Basis) -> Self {
        Self { cloud, basis }
    }

    /// The nodes.
    pub fn cloud(&self) -> &'a NodeCloud<D> {
        self.cloud
    }

    /// Values (and gradients) at any point; searches for the covering nodes itself.
    ///
    /// # Errors
    /// [`ShapeError`], naming the node nearest to the point.
    pub fn at(&self, x: &Point<D>, wanted: Wanted) -> Result<Stencil<D>, ShapeError> {
        let mut candidates = Vec::new();
        self.cloud.covering(x, x, &mut candidates);
        let nearest = candidates
            .iter()
            .copied()
            .min_by(|&a, &b| self.distance(a, x).total_cmp(&self.distance(b, x)))
            .unwrap_or(0);
        let mut stencil = Stencil::default();
        self.evaluate(x, nearest as usize, &candidates, wanted, &mut stencil)?;
        Ok(stencil)
    }

    fn distance(&self, node: u32, x: &Point<D>) -> f64 {
        (self.cloud.positions()[node as usize] - x).norm_squared()
    }

    /// Values (and gradients) at `x`, over candidate nodes that include all those covering it. `node` is the one that
    /// an error names.
    ///
    /// # Errors
    /// [`ShapeError`] when the moment matrix is not positive definite or too ill-conditioned.
    pub fn evaluate(
        &self,
        x: &Point<D>,
        node: usize,
        candidates: &[u32],
        wanted: Wanted,
        out: &mut Stencil<D>,
    ) -> Result<(), ShapeError> {
        let evaluate = match (D, self.basis) {
            (1, Basis::Linear) => Self::evaluate_sized::<2>,
            (1, Basis::Quadratic) | (2, Basis::Linear) => Self::evaluate_sized::<3>,
            (3, Basis::Linear) => Self::evaluate_sized::<4>,
            (2, Basis::Quadratic) => Self::evaluate_sized::<6>,
            _ => Self::evaluate_sized::<10>,
        };
        evaluate(self, x, node, candidates, wanted, out)
    }

    /// Moments of the candidates that cover `x`, and their names, kernels and, where gradients are wanted, slopes of the kernels
    /// in place of the shape functions' own; offsets in units of `scale`.
    fn moments<const P: usize>(
        &self,
        x: &Point<D>,
        scale: f64,
        candidates: &[u32],
        wanted: Wanted,
        out: &mut Stencil<D>,
    ) -> Moments<D, P> {
        let mut moment = SMatrix::<f64, P, P>::zeros();
        let mut moment_slope = [SMatrix::<f64, P, P>::zeros(); D];
        for &i in candidates {
            let offset = x - self.cloud.positions()[i as usize];
            let half_width = self.cloud.half_widths()[i as usize];
            if offset.amax() >= half_width {
                continue;
            }
            let (phi, phi_slope) = match wanted.gradients {
                true => product_kernel(&offset, half_width),
                false => (product_kernel_value(&offset, half_width), Point::zeros()),
            };
            if phi <= NEGLIGIBLE || !self.cloud.sees(x, i) {
                continue;
            }
            out.nodes.push(i);
            out.values.push(phi);
            let h = monomials::<D, P>(&(offset / scale));
            for r in 0..P {
                for c in 0..=r {
                    moment[(r, c)] += phi * h[r] * h[c];
                }
            }
            if wanted.gradients {
                out.gradients.push(phi_slope);
                for k in 0..D {
                    let dh = monomial_slope::<D, P>(&(offset / scale), k) / scale;
                    for r in 0..P {
                        for c in 0..=r {
                            moment_slope[k][(r, c)] += phi_slope[k] * h[r] * h[c] + phi * (dh[r] * h[c] + h[r] * dh[c]);
                        }
                    }
                }
            }
        }
        Moments { matrix: moment, slopes: moment_slope }
    }

    /// The same for a basis of P monomials.
    fn evaluate_sized<const P: usize>(
        &self,
        x: &Point<D>,
        node: usize,
        candidates: &[u32],
        wanted: Wanted,
        out: &mut Stencil<D>,
    ) -> Result<(), ShapeError> {
        out.nodes.clear();
        out.values.clear();
        out.gradients.clear();
        // Offsets are measured in units of the local support, so that M is dimensionless and its condition number
        // says something about the nodes and not about the units.
        let scale = self.cloud.half_widths()[node];
        let Moments { matrix: mut moment, slopes: mut moment_slope } =
            self.moments::<P>(x, scale, candidates, wanted, out);
        moment.fill_upper_triangle_with_lower_triangle();
        let failure = |condition: f64| ShapeError {
            node,
            position: x.iter().copied().collect(),
            neighbours: out.nodes.len(),
            needed: P,
            condition,
        };
        if out.nodes.len() < P {
            return Err(failure(f64::INFINITY));
        }
        let factor = moment.cholesky().ok_or_else(|| failure(f64::INFINITY))?;
        let inverse = factor.inverse();
        let condition = norm1(&moment) * norm1(&inverse);
        if condition.is_nan() || condition > MAX_MOMENT_CONDITION {
            return Err(failure(condition));
        }
        let b: SVector<f64, P> = match wanted.reproduce {
            Reproduce::Field => inverse.column(0).into(),
            Reproduce::Derivative(j) => inverse.column(1 + j) * (-1.0 / scale),
        };
        // ∂b = −M⁻¹ ∂M b.
        let mut b_slope = [SVector::<f64, P>::zeros(); D];
        if wanted.gradients {
            for (slope, m) in b_slope.iter_mut().zip(&mut moment_slope) {
                m.fill_upper_triangle_with_lower_triangle();
                *slope = -(inverse * (*m * b));
            }
        }
        for (place, &i) in out.nodes.iter().enumerate() {
            let offset = x - self.cloud.positions()[i as usize];
            let h = monomials::<D, P>(&(offset / scale));
            let (correction, phi) = (b.dot(&h), out.values[place]);
            out.values[place] = correction * phi;
            if wanted.gradients {
                let phi_slope = out.gradients[place];
                out.gradients[place] = Point::from_fn(|k, _| {
                    let dh = monomial_slope::<D, P>(&(offset / scale), k) / scale;
                    (b_slope[k].dot(&h) + b.dot(&dh)) * phi + correction * phi_slope[k]
                });
            }
        }
        Ok(())
    }
}

fn norm1<const P: usize>(m: &SMatrix<f64, P, P>) -> f64 {
    m.column_iter().map(|c| c.lp_norm(1)).fold(0.0, f64::max)
}

/// H(z): 1, the coordinates, and for larger P the products of pairs of coordinates.
#[inline]
fn monomials<const D: usize, const P: usize>(z: &Point<D>) -> SVector<f64, P> {
    let mut h = SVector::<f64, P>::zeros();
    h[0] = 1.0;
    for k in 0..D {
        h[1 + k] = z[k];
    }
    if P > D + 1 {
        let mut at = D + 1;
        for a in 0..D {
            for b in a..D {
                h[at] = z[a] * z[b];
                at += 1;
            }
        }
    }
    h
}

/// ∂H/∂z_k.
#[inline]
fn monomial_slope<const D: usize, const P: usize>(z: &Point<D>, k: usize) -> SVector<f64, P> {
    let mut h = SVector::<f64, P>::zeros();
    h[1 + k] = 1.0;
    if P > D + 1 {
        let mut at = D + 1;
        for a in 0..D {
            for b in a..D {
                h[at] = if a == k { z[b] } else { 0.0 } + if b == k { z[a] } else { 0.0 };
                at += 1;
            }
        }
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jittered_lattice<const D: usize>(per_axis: usize) -> NodeCloud<D>
    where
        [f64; D]: rstar::Point<Scalar = f64>,
    {
        let mut state = 7_u64;
        let mut jitter = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5) * 0.4
        };
        let count = per_axis.pow(D as u32);
        let positions = (0..count)
            .map(|n| Point::from_fn(|k, _| (n / per_axis.pow(k as u32) % per_axis) as f64 + jitter()))
            .collect();
        NodeCloud::new(positions, vec![2.6; count])
    }

    fn reproduces<const D: usize>(basis: Basis, degree: i32)
    where
        [f64; D]: rstar::Point<Scalar = f64>,
    {
        let cloud = jittered_lattice::<D>(6);
        let shape = ShapeFunctions::new(&cloud, basis);
        let x = Point::<D>::from_fn(|k, _| 2.3 + 0.17 * k as f64);
        let stencil = shape.at(&x, Wanted::GRADIENTS).unwrap();
        for power in 0..=degree {
            for axis in 0..D {
                let field = |p: &Point<D>| (0.3 + p[axis] - 0.5 * p[D - 1]).powi(power);
                let sum: f64 = stencil
                    .nodes
                    .iter()
                    .zip(&stencil.values)
                    .map(|(&i, v)| v * field(&cloud.positions()[i as usize]))
                    .sum();
                assert!((sum - field(&x)).abs() < 1e-11 * (1.0 + field(&x).abs()), "power {power}: {sum}");
                for k in 0..D {
                    let slope: f64 = stencil
                        .nodes
                        .iter()
                        .zip(&stencil.gradients)
                        .map(|(&i, g)| g[k] * field(&cloud.positions()[i as usize]))
                        .sum();
                    let mut step = Point::<D>::zeros();
                    step[k] = 1e-6;
                    let exact = (field(&(x + step)) - field(&(x - step))) / 2e-6;
                    assert!((slope - exact).abs() < 1e-7, "power {power} axis {k}: {slope} {exact}");
                }
            }
        }
    }

    /// At a support of two spacings the nodes two spacings away lie at the very end of the kernel, where rounding of their
    /// distance must not let some in.
    #[test]
    fn stencils_do_not_depend_on_the_unit_of_length() {
        for spacing in [1.0, 0.1, 0.07, 1e-3, 3.0] {
            let positions = (0..81).map(|n| Point::<2>::new(f64::from(n % 9), f64::from(n / 9)) * spacing).collect();
            let cloud = NodeCloud::new(positions, vec![2.0 * spacing; 81]);
            let shape = ShapeFunctions::new(&cloud, Basis::Linear);
            for node in [20, 21, 22, 30, 40, 48] {
                let stencil = shape.at(&cloud.positions()[node], Wanted::VALUES).unwrap();
                assert_eq!(stencil.nodes.len(), 9, "spacing {spacing}, node {node}: {:?}", stencil.nodes);
            }
        }
    }

    #[test]
    fn linear_and_quadratic_fields_are_reproduced_in_two_and_three_dimensions() {
        reproduces::<2>(Basis::Linear, 1);
        reproduces::<2>(Basis::Quadratic, 2);
        reproduces::<3>(Basis::Linear, 1);
        reproduces::<3>(Basis::Quadratic, 2);
    }

    #[test]
    fn gradients_match_finite_differences_of_the_values() {
        let cloud = jittered_lattice::<2>(7);
        let shape = ShapeFunctions::new(&cloud, Basis::Quadratic);
        let x = Point::<2>::new(2.9, 3.2);
        let here = shape.at(&x, Wanted::GRADIENTS).unwrap();
        for k in 0..2 {
            let mut step = Point::<2>::zeros();
            step[k] = 1e-5;
            let (ahead, behind) =
                (shape.at(&(x + step), Wanted::VALUES).unwrap(), shape.at(&(x - step), Wanted::VALUES).unwrap());
            let value = |s: &Stencil<2>, i| s.nodes.binary_search(&i).map_or(0.0, |at| s.values[at]);
            for (&i, gradient) in here.nodes.iter().zip(&here.gradients) {
                let difference = (value(&ahead, i) - value(&behind, i)) / 2e-5;
                assert!((difference - gradient[k]).abs() < 1e-8, "{difference} {}", gradient[k]);
            }
        }
    }

    #[test]
    fn failures_name_the_node() {
        let shape_error = |positions: Vec<[f64; 2]>, half_width: f64| {
            let n = positions.len();
            let cloud = NodeCloud::new(positions.into_iter().map(Point::from).collect(), vec![half_width; n]);
            ShapeFunctions::new(&cloud, Basis::Linear).at(&cloud.positions()[1], Wanted::VALUES).unwrap_err()
        };
        let too_small = shape_error(vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 0.5);
        assert_eq!((too_small.node, too_small.neighbours), (1, 1));
        assert!(too_small.to_string().contains("increase `support`"));
        let collinear = shape_error(vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]], 2.5);
        assert_eq!(collinear.node, 1);
        assert!(collinear.to_string().contains("collinear"));
        let coincident = shape_error(vec![[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]], 2.5);
        assert!(coincident.to_string().contains("coincide"));
    }
}
