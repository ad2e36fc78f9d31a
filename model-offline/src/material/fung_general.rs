//! Fung's exponential law with general tensors, in the plane.

use super::catalogue::Catalogued;
use super::error::{MaterialError, not_negative};
use super::kinematics::{Matrix, Tensor4, green_lagrange, push_forward, tensor4};
use super::lame::LameParameters;
use super::material::{Material, Response, is_negative_somewhere, stable_at_rest};
use super::section::{MaterialSection, TensorEntry, unused};
use serde::Serialize;

/// `W = ½ E:A:E + (c/2) (exp(E:C:E) − 1)` with symmetrised tensors A (stress units) and C; planar.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FungTensors {
    a: Box<Tensor4<2>>,
    c_tensor: Box<Tensor4<2>>,
    c: f64,
}

impl FungTensors {
    /// Builds the tensors from entries `(i, j, k, l, value)`, symmetrised over both minor index pairs and the major
    /// one: E is symmetric and W quadratic in it, so only that part of A and C acts, and only it is frame-invariant
    /// when read as a Voigt matrix.
    ///
    /// # Errors
    /// An index above 1, or a value that is not finite.
    pub fn from_entries(a: &[TensorEntry], c_tensor: &[TensorEntry], c: f64) -> Result<Self, MaterialError> {
        Ok(Self { a: Box::new(gather(a)?), c_tensor: Box::new(gather(c_tensor)?), c })
    }

    /// The same, checked.
    pub(super) fn checked(self) -> Result<Self, MaterialError> {
        not_negative(self.c, "c")?;
        if is_negative_somewhere(&self.c_tensor) {
            return Err(MaterialError::Negative("the quadratic form C of the exponent"));
        }
        Material::<2>::check_stable_at_rest(&self)?;
        Ok(self)
    }
}

fn gather(entries: &[TensorEntry]) -> Result<Tensor4<2>, MaterialError> {
    let mut t = [[[[0.0; 2]; 2]; 2]; 2];
    for &(i, j, k, l, value) in entries {
        if [i, j, k, l].iter().any(|&x| x > 1) {
            return Err(MaterialError::Index(i, j, k, l));
        }
        if !value.is_finite() {
            return Err(MaterialError::NotFinite("a tensor entry"));
        }
        t[i as usize][j as usize][k as usize][l as usize] = value;
    }
    Ok(symmetrised(&t))
}

/// Averages a tensor over ij ↔ ji, kl ↔ lk and ij ↔ kl.
fn symmetrised(t: &Tensor4<2>) -> Tensor4<2> {
    let minor = |a: usize, b: usize, c: usize, d: usize| t[a][b][c][d] + t[b][a][c][d] + t[a][b][d][c] + t[b][a][d][c];
    tensor4(|i, j, k, l| (minor(i, j, k, l) + minor(k, l, i, j)) / 8.0)
}

/// T:E; not a number outside the plane, where the tensors say nothing.
fn contract<const D: usize>(t: &Tensor4<2>, e: &Matrix<D>) -> Matrix<D> {
    if D != 2 {
        return Matrix::repeat(f64::NAN);
    }
    Matrix::from_fn(|i, j| {
        (0..D).flat_map(|k| (0..D).map(move |l| (k, l))).map(|(k, l)| t[i][j][k][l] * e[(k, l)]).sum()
    })
}

impl<const D: usize> Material<D> for FungTensors {
    fn respond(&self, h: &Matrix<D>) -> Response<D> {
        let f = Matrix::<D>::identity() + h;
        let e = green_lagrange(h);
        let (ae, ce) = (contract(&self.a, &e), contract(&self.c_tensor, &e));
        let exponential = self.c * ce.dot(&e).exp();
        Response { energy: 0.5 * ae.dot(&e) + 0.5 * (exponential - self.c), pk1_stress: f * (ae + ce * exponential) }
    }

    fn tangent(&self, h: &Matrix<D>) -> Tensor4<D> {
        if D != 2 {
            return [[[[f64::NAN; D]; D]; D]; D];
        }
        let f = Matrix::<D>::identity() + h;
        let e = green_lagrange(h);
        let (ae, ce) = (contract(&self.a, &e), contract(&self.c_tensor, &e));
        let exponential = self.c * ce.dot(&e).exp();
        let c = tensor4(|i, j, k, l| {
            self.a[i][j][k][l] + exponential * (self.c_tensor[i][j][k][l] + 2.0 * ce[(i, j)] * ce[(k, l)])
        });
        push_forward(&f, &(ae + ce * exponential), &c)
    }

    fn check_stable_at_rest(&self) -> Result<(), MaterialError> {
        if D == 2 { stable_at_rest(&self.tangent(&Matrix::<D>::zeros())) } else { Err(MaterialError::PlanarOnly) }
    }
}

impl Catalogued for FungTensors {
    fn reads<M>(section: &MaterialSection<M>) -> bool {
        section.a.is_some()
    }

    fn read<M>(section: &MaterialSection<M>) -> Result<Self, MaterialError> {
        unused(&[
            ("lambda beside A", section.lambda.is_some()),
            ("mu beside A", section.mu.is_some()),
            ("lambda_c beside A", section.lambda_c.is_some()),
            ("mu_c beside A", section.mu_c.is_some()),
        ])?;
        let entries = |list: &Option<Vec<TensorEntry>>| list.clone().unwrap_or_default();
        Self::from_entries(&entries(&section.a), &entries(&section.c_tensor), section.c.unwrap_or(0.0))?.checked()
    }

    /// Anisotropic in general: none.
    fn linearised(&self) -> Option<LameParameters> {
        None
    }

    fn with_exponential_factor(&self, c: f64) -> Option<Result<Self, MaterialError>> {
        Some(Self { c, ..self.clone() }.checked())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Law;

    #[test]
    fn an_exponent_that_falls_with_strain_is_refused_in_both_forms() {
        // A law that softens without end, whatever else it is at rest.
        assert!(
            Law::fung(383.0, 318.5, 0.779, 1.5, -0.1).is_err() && Law::fung(383.0, 318.5, 0.779, -1.5, 1.0).is_err()
        );
        let isotropic = |lambda: f64, mu: f64| {
            let shear = [(0, 1, 0, 1, mu), (1, 0, 1, 0, mu), (0, 1, 1, 0, mu), (1, 0, 0, 1, mu)];
            let normal = [(0, 0, 0, 0, lambda + 2.0 * mu), (1, 1, 1, 1, lambda + 2.0 * mu)];
            let mixed = [(0, 0, 1, 1, lambda), (1, 1, 0, 0, lambda)];
            [&shear[..], &normal[..], &mixed[..]].concat()
        };
        let law = |lambda_c, mu_c| {
            FungTensors::from_entries(&isotropic(383.0, 318.5), &isotropic(lambda_c, mu_c), 0.779).unwrap().checked()
        };
        assert!(law(1.5, 1.0).is_ok() && law(0.0, 0.0).is_ok());
        assert_eq!(law(1.5, -0.1), Err(MaterialError::Negative("the quadratic form C of the exponent")));
    }
}
