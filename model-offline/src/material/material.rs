//! What a hyperelastic law answers.

use super::error::MaterialError;
use super::kinematics::{Matrix, Tensor4, determinant, inverse_transpose};
use nalgebra::DMatrix;

/// What a law answers at one displacement gradient.
#[derive(Debug, Clone, Copy)]
pub struct Response<const D: usize> {
    /// Strain energy W per reference volume, stress units.
    pub energy: f64,
    /// First Piola–Kirchhoff stress P_iJ = ∂W/∂F_iJ, stress units.
    pub pk1_stress: Matrix<D>,
}

/// A hyperelastic law in D dimensions; D = 2 is plane strain.
///
/// All functions take the displacement gradient H = F − I instead of F: at small strain, forming F loses digits.
///
/// # Example
/// ```
/// use model_offline::material::{Law, Material, Matrix};
///
/// let law = Law::neo_hookean(4.0, 1.0)?;
/// let sheared = Matrix::<2>::new(0.0, 0.1, 0.0, 0.0);
/// // Simple shear γ of an isochoric law costs μ γ² / 2 and takes the shear stress μ γ.
/// assert!((law.respond(&sheared).energy - 0.5 * 0.1 * 0.1).abs() < 1e-15);
/// assert!((law.respond(&sheared).pk1_stress[(0, 1)] - 0.1).abs() < 1e-3);
/// # Ok::<(), model_offline::material::MaterialError>(())
/// ```
pub trait Material<const D: usize>: std::fmt::Debug {
    /// Energy and first Piola–Kirchhoff stress at displacement gradient `h`. Values may be infinite or NaN where the
    /// law is not defined (J ≤ 0, overflow of an exponential): callers check.
    fn respond(&self, h: &Matrix<D>) -> Response<D>;

    /// Tangent A_iJkL = ∂P_iJ/∂F_kL at displacement gradient `h`, indexed `[i][j][k][l]`, stress units.
    fn tangent(&self, h: &Matrix<D>) -> Tensor4<D>;

    /// Second Piola–Kirchhoff stress S = F⁻¹ P.
    fn pk2_stress(&self, h: &Matrix<D>) -> Matrix<D> {
        let f = Matrix::<D>::identity() + h;
        inverse_transpose(&f, determinant(&f)).transpose() * self.respond(h).pk1_stress
    }

    /// Cauchy stress σ = P Fᵀ / J.
    fn cauchy_stress(&self, h: &Matrix<D>) -> Matrix<D> {
        let f = Matrix::<D>::identity() + h;
        self.respond(h).pk1_stress * f.transpose() / determinant(&f)
    }

    /// A stiffness to scale by: the largest A_ijij at rest, stress units.
    fn rest_stiffness(&self) -> f64 {
        let a = self.tangent(&Matrix::zeros());
        (0..D).flat_map(|i| (0..D).map(move |j| (i, j))).map(|(i, j)| a[i][j][i][j]).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Shear modulus at rest, stress units; for a law that is not isotropic, that of the shear 12.
    fn rest_shear_modulus(&self) -> f64 {
        match D {
            1 => self.rest_stiffness(),
            _ => self.tangent(&Matrix::zeros())[0][1][0][1],
        }
    }

    /// Whether every small strain costs energy: the tangent at rest, as a matrix on symmetric strains, is positive
    /// definite. For isotropic laws that is μ > 0 with λ + μ > 0 in the plane, λ + 2μ/3 > 0 in space.
    ///
    /// # Errors
    /// [`MaterialError::Unstable`] with the lowest eigenvalue; [`MaterialError::TooFarApart`] where rounding decides;
    /// [`MaterialError::NotFinite`].
    fn check_stable_at_rest(&self) -> Result<(), MaterialError> {
        stable_at_rest(&self.tangent(&Matrix::zeros()))
    }
}

/// A tensor with both minor symmetries as a matrix on symmetric strains.
fn on_strains<const D: usize>(a: &Tensor4<D>) -> DMatrix<f64> {
    // Mandel's notation: strains (ε_ii, √2 ε_ij), so that the matrix has the tensor's own eigenvalues.
    let pairs: Vec<(usize, usize)> = (0..D).flat_map(|i| (i..D).map(move |j| (i, j))).collect();
    let weight = |(i, j): (usize, usize)| if i == j { 1.0 } else { std::f64::consts::SQRT_2 };
    DMatrix::from_fn(pairs.len(), pairs.len(), |r, c| {
        let ((i, j), (k, l)) = (pairs[r], pairs[c]);
        weight(pairs[r]) * weight(pairs[c]) * a[i][j][k][l]
    })
}

/// Whether `E:C:E` is negative for some strain E, by more than rounding.
pub(super) fn is_negative_somewhere<const D: usize>(c: &Tensor4<D>) -> bool {
    let form = on_strains(c);
    form.symmetric_eigenvalues().min() < -1e-12 * form.norm()
}

/// Eigenvalues of a tangent smaller than this, over its norm, are what rounding leaves.
const FAINTEST: f64 = 1e-12;

/// Whether a tangent at rest is positive definite on symmetric strains.
pub(super) fn stable_at_rest<const D: usize>(a: &Tensor4<D>) -> Result<(), MaterialError> {
    let mandel = on_strains(a);
    if !mandel.iter().all(|v| v.is_finite()) {
        return Err(MaterialError::NotFinite("a modulus"));
    }
    let (lowest, norm) = (mandel.symmetric_eigenvalues().min(), mandel.norm());
    if !norm.is_finite() {
        return Err(MaterialError::NotFinite("the square of a modulus"));
    }
    if lowest > FAINTEST * norm {
        Ok(())
    } else if lowest >= -FAINTEST * norm && mandel.diagonal().min() > 0.0 {
        Err(MaterialError::TooFarApart)
    } else {
        Err(MaterialError::Unstable(lowest))
    }
}
