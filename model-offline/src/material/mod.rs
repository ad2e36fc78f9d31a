//! Hyperelastic laws: strain energy W, first Piola–Kirchhoff stress P = ∂W/∂F and tangent A = ∂P/∂F.
//!
//! All functions take the displacement gradient H = F − I instead of F: at small strain, forming F loses digits.
//! Laws written in the Green–Lagrange strain E = ½ (H + Hᵀ + HᵀH) give the second Piola–Kirchhoff stress
//! S = ∂W/∂E and the material tangent C = ∂S/∂E; then P = F S and A_iJkL = δ_ik S_JL + F_iM C_MJNL F_kN.
//! In two dimensions the state is plane strain.

mod variants;

use nalgebra::SMatrix;
use serde::Serialize;

/// A D × D matrix.
pub type Matrix<const D: usize> = SMatrix<f64, D, D>;

/// A fourth-order tensor, indexed `[i][j][k][l]`.
pub type Tensor4<const D: usize> = [[[[f64; D]; D]; D]; D];

/// What a law answers at one displacement gradient.
#[derive(Debug, Clone, Copy)]
pub struct Response<const D: usize> {
    /// Strain energy W per reference volume, stress units.
    pub energy: f64,
    /// First Piola–Kirchhoff stress P_iJ, stress units.
    pub pk1_stress: Matrix<D>,
}

/// Why moduli do not make a law.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// Not a finite number.
    #[error("{0} is not a finite number")]
    NotFinite(&'static str),
    /// The law is unstable at rest.
    #[error("the law is not stable at rest: its small-strain tangent has eigenvalue {0:.3e}")]
    Unstable(f64),
    /// A modulus is negative where none may be.
    #[error("{0} must not be negative")]
    Negative(&'static str),
    /// A tensor index beyond the dimension.
    #[error("tensor entry [{0}, {1}, {2}, {3}] has an index beyond 1 (indices count from 0)")]
    Index(u32, u32, u32, u32),
    /// The general form holds for the plane only.
    #[error("the general (A, C) form is planar")]
    PlanarOnly,
}

/// The general form of Fung's law in the plane: symmetrised tensors A (stress units) and C, and the factor c.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FungTensors {
    a: Tensor4<2>,
    c_tensor: Tensor4<2>,
    c: f64,
}

impl FungTensors {
    /// Builds the tensors from entries `(i, j, k, l, value)`, symmetrised over both minor index pairs and the major
    /// one: E is symmetric and W quadratic in it, so only that part of A and C acts, and only it is frame-invariant
    /// when read as a Voigt matrix.
    ///
    /// # Errors
    /// An index above 1, or a value that is not finite.
    pub fn from_entries(
        a: &[(u32, u32, u32, u32, f64)],
        c_tensor: &[(u32, u32, u32, u32, f64)],
        c: f64,
    ) -> Result<Self, MaterialError> {
        let gather = |entries: &[(u32, u32, u32, u32, f64)]| {
            let mut t: Tensor4<2> = Default::default();
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
        };
        Ok(Self { a: gather(a)?, c_tensor: gather(c_tensor)?, c })
    }
}

/// Averages a tensor over ij ↔ ji, kl ↔ lk and ij ↔ kl.
fn symmetrised(t: &Tensor4<2>) -> Tensor4<2> {
    let mut out: Tensor4<2> = Default::default();
    for (i, j, k, l) in indices::<2>() {
        let minor =
            |a: usize, b: usize, c: usize, d: usize| t[a][b][c][d] + t[b][a][c][d] + t[a][b][d][c] + t[b][a][d][c];
        out[i][j][k][l] = (minor(i, j, k, l) + minor(k, l, i, j)) / 8.0;
    }
    out
}

fn indices<const D: usize>() -> impl Iterator<Item = (usize, usize, usize, usize)> {
    (0..D * D * D * D).map(|n| (n / (D * D * D), n / (D * D) % D, n / D % D, n % D))
}

#[derive(Debug, Clone, PartialEq, Serialize)]
enum Law {
    Fung { lambda: f64, mu: f64, c: f64, lambda_c: f64, mu_c: f64 },
    FungGeneral(Box<FungTensors>),
    NeoHookean { kappa: f64, mu: f64 },
    Linear { lambda: f64, mu: f64 },
}

/// A hyperelastic law with an optional volumetric barrier.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Material {
    law: Law,
    barrier: f64,
}

impl Material {
    /// Fung's law in isotropic form (the paper's equation 6, its Table I summed over a symmetric strain):
    /// `W = ½ [λ (tr E)² + 2μ E:E] + (c/2) exp[λc (tr E)² + 2μc E:E]`.
    ///
    /// # Errors
    /// Moduli that are not finite, negative exponents, or a law unstable at rest.
    pub fn fung(lambda: f64, mu: f64, c: f64, lambda_c: f64, mu_c: f64) -> Result<Self, MaterialError> {
        for (value, name) in [(lambda, "lambda"), (mu, "mu"), (c, "c"), (lambda_c, "lambda_c"), (mu_c, "mu_c")] {
            finite(value, name)?;
        }
        if c < 0.0 {
            return Err(MaterialError::Negative("c"));
        }
        Self { law: Law::Fung { lambda, mu, c, lambda_c, mu_c }, barrier: 0.0 }.stable()
    }

    /// Fung's law with general tensors: `W = ½ E:A:E + (c/2) exp(E:C:E)`. Planar.
    ///
    /// # Errors
    /// `c` that is negative or not finite, or a law unstable at rest.
    pub fn fung_general(tensors: FungTensors) -> Result<Self, MaterialError> {
        finite(tensors.c, "c")?;
        if tensors.c < 0.0 {
            return Err(MaterialError::Negative("c"));
        }
        Self { law: Law::FungGeneral(Box::new(tensors)), barrier: 0.0 }.stable()
    }

    /// St. Venant–Kirchhoff: `W = ½ λ (tr E)² + μ E:E`.
    ///
    /// # Errors
    /// Moduli that are not finite, or a law unstable at rest.
    pub fn saint_venant_kirchhoff(lambda: f64, mu: f64) -> Result<Self, MaterialError> {
        Self::fung(lambda, mu, 0.0, 0.0, 0.0)
    }

    /// Compressible neo-Hookean: `W = μ/2 (Ī₁ − 3) + κ/4 (J² − 1 − 2 ln J)`, Ī₁ = J^(−2/3) tr C in three
    /// dimensions (plane strain: C₃₃ = 1), κ = λ + 2μ/3.
    ///
    /// # Errors
    /// Moduli that are not finite, or a law unstable at rest.
    pub fn neo_hookean(lambda: f64, mu: f64) -> Result<Self, MaterialError> {
        finite(lambda, "lambda")?;
        finite(mu, "mu")?;
        Self { law: Law::NeoHookean { kappa: lambda + 2.0 * mu / 3.0, mu }, barrier: 0.0 }.stable()
    }

    /// Linear elasticity: `W = ½ λ (tr ε)² + μ ε:ε`, ε = ½ (H + Hᵀ). In the plane this is plane strain; give
    /// λ* = 2λμ/(λ + 2μ) for plane stress.
    ///
    /// # Errors
    /// Moduli that are not finite, or a law unstable at rest.
    pub fn linear(lambda: f64, mu: f64) -> Result<Self, MaterialError> {
        finite(lambda, "lambda")?;
        finite(mu, "mu")?;
        Self { law: Law::Linear { lambda, mu }, barrier: 0.0 }.stable()
    }

    /// Adds the volumetric barrier `β/4 (ln J)⁴`: zero value, slope and curvature at J = 1, so that small strains do
    /// not feel it, and unbounded as J → 0, so that compression meets a growing resistance.
    ///
    /// # Errors
    /// `beta` that is negative or not finite.
    pub fn with_barrier(mut self, beta: f64) -> Result<Self, MaterialError> {
        finite(beta, "barrier")?;
        if beta < 0.0 {
            return Err(MaterialError::Negative("barrier"));
        }
        self.barrier = beta;
        Ok(self)
    }

    /// Whether stress is proportional to the displacement gradient, so that one tangent serves every state.
    pub fn is_linear(&self) -> bool {
        matches!(self.law, Law::Linear { .. }) && self.barrier == 0.0
    }

    /// Whether equilibria at finite depth have a limit when the nodes are refined. Laws that soften in compression
    /// without end (Fung's, St. Venant–Kirchhoff's) have none under a needle's edge.
    pub fn has_mesh_limit(&self) -> bool {
        self.barrier > 0.0 || matches!(self.law, Law::NeoHookean { .. } | Law::Linear { .. })
    }

    /// The law of small strains with the same tangent at rest: what a linear model of this tissue would use.
    ///
    /// # Errors
    /// Never for the laws there are: their moduli were checked when they were made.
    pub fn linearised(&self) -> Result<Self, MaterialError> {
        match &self.law {
            Law::Fung { lambda, mu, c, lambda_c, mu_c } => Self::linear(lambda + c * lambda_c, mu + c * mu_c),
            Law::NeoHookean { kappa, mu } => Self::linear(kappa - 2.0 * mu / 3.0, *mu),
            Law::Linear { .. } => Ok(Self { law: self.law.clone(), barrier: 0.0 }),
            // Anisotropic in general: keep the law and let the strain be small.
            Law::FungGeneral(_) => Ok(self.clone()),
        }
    }

    /// Energy and first Piola–Kirchhoff stress at displacement gradient `h`. Values may be infinite or NaN where the
    /// law is not defined (J ≤ 0, overflow of the exponential): callers check.
    pub fn respond<const D: usize>(&self, h: &Matrix<D>) -> Response<D> {
        let f = Matrix::<D>::identity() + h;
        let mut response = match &self.law {
            Law::Fung { lambda, mu, c, lambda_c, mu_c } => {
                let e = green_lagrange(h);
                let (trace, square) = (e.trace(), e.norm_squared());
                let exponential = c * (lambda_c * trace * trace + 2.0 * mu_c * square).exp();
                let pk2 = Matrix::<D>::identity() * (trace * (lambda + exponential * lambda_c))
                    + e * (2.0 * (mu + exponential * mu_c));
                // The energy is counted from rest: (c/2)(e^Q − 1), so that it is exactly 0 there.
                let energy = 0.5 * lambda * trace * trace + mu * square + 0.5 * (exponential - c);
                Response { energy, pk1_stress: f * pk2 }
            }
            Law::FungGeneral(t) => {
                let e = green_lagrange(h);
                let (ae, ce) = (contract(&t.a, &e), contract(&t.c_tensor, &e));
                let exponential = t.c * ce.dot(&e).exp();
                Response {
                    energy: 0.5 * ae.dot(&e) + 0.5 * (exponential - t.c),
                    pk1_stress: f * (ae + ce * exponential),
                }
            }
            Law::NeoHookean { kappa, mu } => {
                let j = determinant(&f);
                let inverse_t = inverse_transpose(&f, j);
                let trace = f.norm_squared() + (3 - D) as f64;
                let factor = j.powf(-2.0 / 3.0);
                // From ∇u, never as a difference of numbers near 1: at strains of 1e-6, as at the start of an
                // insertion, the energy would be nothing but rounding, and the line search with it.
                let dilation = dilation(h);
                let stretch = 2.0 * h.trace() + h.norm_squared();
                let log = dilation.ln_1p();
                let distortion = factor * stretch + 3.0 * (-2.0 / 3.0 * log).exp_m1();
                Response {
                    energy: 0.5 * mu * distortion + 0.25 * kappa * (dilation * dilation + 2.0 * (dilation - log)),
                    pk1_stress: (f - inverse_t * (trace / 3.0)) * (mu * factor)
                        + inverse_t * (0.5 * kappa * (j * j - 1.0)),
                }
            }
            Law::Linear { lambda, mu } => {
                let strain = (h + h.transpose()) * 0.5;
                let trace = strain.trace();
                let stress = Matrix::<D>::identity() * (lambda * trace) + strain * (2.0 * mu);
                Response { energy: 0.5 * stress.dot(&strain), pk1_stress: stress }
            }
        };
        if self.barrier > 0.0 {
            let j = determinant(&f);
            let log = j.ln();
            response.energy += 0.25 * self.barrier * log.powi(4);
            response.pk1_stress += inverse_transpose(&f, j) * (self.barrier * log.powi(3));
        }
        response
    }

    /// Tangent A_iJkL = ∂P_iJ/∂F_kL at displacement gradient `h`, indexed `[i][j][k][l]`, stress units.
    pub fn tangent<const D: usize>(&self, h: &Matrix<D>) -> Tensor4<D> {
        let f = Matrix::<D>::identity() + h;
        let mut tangent = match &self.law {
            Law::Fung { lambda, mu, c, lambda_c, mu_c } => {
                let e = green_lagrange(h);
                let (trace, square) = (e.trace(), e.norm_squared());
                let exponential = c * (lambda_c * trace * trace + 2.0 * mu_c * square).exp();
                let (l, m) = (lambda + exponential * lambda_c, mu + exponential * mu_c);
                let identity = Matrix::<D>::identity();
                // ∂Q/∂E = 2 g, and the exponential's own growth adds 2 g ⊗ g.
                let g = identity * (lambda_c * trace) + e * (2.0 * mu_c);
                let pk2 = identity * (l * trace) + e * (2.0 * m);
                // F C F for C = l I⊗I + 2m 𝕀 + 2 e^Q g⊗g, written out: no fourth-order product.
                let (fg, ff) = (f * g, f * f.transpose());
                let mut a = zero4::<D>();
                for (i, j, k, n) in indices::<D>() {
                    let geometric = if i == k { pk2[(j, n)] } else { 0.0 };
                    let shear = if j == n { ff[(i, k)] } else { 0.0 };
                    a[i][j][k][n] = geometric
                        + l * f[(i, j)] * f[(k, n)]
                        + m * (shear + f[(i, n)] * f[(k, j)])
                        + 2.0 * exponential * fg[(i, j)] * fg[(k, n)];
                }
                a
            }
            Law::FungGeneral(t) => {
                let e = green_lagrange(h);
                let (ae, ce) = (contract(&t.a, &e), contract(&t.c_tensor, &e));
                let exponential = t.c * ce.dot(&e).exp();
                let mut c = zero4::<D>();
                for (i, j, k, l) in indices::<D>() {
                    c[i][j][k][l] =
                        t.a[i][j][k][l] + exponential * (t.c_tensor[i][j][k][l] + 2.0 * ce[(i, j)] * ce[(k, l)]);
                }
                push_forward(&f, &(ae + ce * exponential), &c)
            }
            Law::NeoHookean { kappa, mu } => {
                let j = determinant(&f);
                let g = inverse_transpose(&f, j);
                let trace = f.norm_squared() + (3 - D) as f64;
                let factor = mu * j.powf(-2.0 / 3.0);
                let pressure = 0.5 * kappa * (j * j - 1.0);
                let mut a = zero4::<D>();
                for (i, jj, k, l) in indices::<D>() {
                    let identity = if i == k && jj == l { 1.0 } else { 0.0 };
                    let swap = g[(i, l)] * g[(k, jj)];
                    a[i][jj][k][l] = factor
                        * (identity - 2.0 / 3.0 * (f[(i, jj)] * g[(k, l)] + g[(i, jj)] * f[(k, l)])
                            + trace / 3.0 * (swap + 2.0 / 3.0 * g[(i, jj)] * g[(k, l)]))
                        + kappa * j * j * g[(i, jj)] * g[(k, l)]
                        - pressure * swap;
                }
                a
            }
            Law::Linear { lambda, mu } => {
                let mut a = zero4::<D>();
                for (i, j, k, l) in indices::<D>() {
                    let delta = |p: usize, q: usize| if p == q { 1.0 } else { 0.0 };
                    a[i][j][k][l] = lambda * delta(i, j) * delta(k, l)
                        + mu * (delta(i, k) * delta(j, l) + delta(i, l) * delta(j, k));
                }
                a
            }
        };
        if self.barrier > 0.0 {
            let j = determinant(&f);
            let log = j.ln();
            let g = inverse_transpose(&f, j);
            for (i, jj, k, l) in indices::<D>() {
                tangent[i][jj][k][l] +=
                    self.barrier * (3.0 * log * log * g[(i, jj)] * g[(k, l)] - log.powi(3) * g[(i, l)] * g[(k, jj)]);
            }
        }
        tangent
    }

    /// Second Piola–Kirchhoff stress S = F⁻¹ P.
    pub fn pk2_stress<const D: usize>(&self, h: &Matrix<D>) -> Matrix<D> {
        let f = Matrix::<D>::identity() + h;
        inverse_transpose(&f, determinant(&f)).transpose() * self.respond(h).pk1_stress
    }

    /// Cauchy stress σ = P Fᵀ / J.
    pub fn cauchy_stress<const D: usize>(&self, h: &Matrix<D>) -> Matrix<D> {
        let f = Matrix::<D>::identity() + h;
        self.respond(h).pk1_stress * f.transpose() / determinant(&f)
    }

    /// A stiffness to scale by: the largest diagonal entry of the tangent at rest, stress units.
    pub fn rest_stiffness(&self) -> f64 {
        let a = self.tangent(&Matrix::<2>::zeros());
        a[0][0][0][0].max(a[1][1][1][1]).max(a[0][1][0][1])
    }

    fn stable(self) -> Result<Self, MaterialError> {
        let a = self.tangent(&Matrix::<2>::zeros());
        // On symmetric strains (ε11, ε22, √2 ε12) the tangent is a symmetric 3 × 3 matrix.
        let s = std::f64::consts::SQRT_2;
        let voigt = nalgebra::Matrix3::new(
            a[0][0][0][0],
            a[0][0][1][1],
            s * a[0][0][0][1],
            a[1][1][0][0],
            a[1][1][1][1],
            s * a[1][1][0][1],
            s * a[0][1][0][0],
            s * a[0][1][1][1],
            a[0][1][0][1] + a[0][1][1][0],
        );
        if !voigt.iter().all(|v| v.is_finite()) {
            return Err(MaterialError::NotFinite("a modulus"));
        }
        let lowest = voigt.symmetric_eigenvalues().min();
        if lowest > 1e-12 * voigt.norm() { Ok(self) } else { Err(MaterialError::Unstable(lowest)) }
    }
}

fn finite(value: f64, name: &'static str) -> Result<(), MaterialError> {
    if value.is_finite() { Ok(()) } else { Err(MaterialError::NotFinite(name)) }
}

/// E = ½ (H + Hᵀ + HᵀH).
#[inline]
pub fn green_lagrange<const D: usize>(h: &Matrix<D>) -> Matrix<D> {
    (h + h.transpose() + h.transpose() * h) * 0.5
}

fn zero4<const D: usize>() -> Tensor4<D> {
    [[[[0.0; D]; D]; D]; D]
}

fn contract<const D: usize>(t: &Tensor4<2>, e: &Matrix<D>) -> Matrix<D> {
    debug_assert_eq!(D, 2, "the general (A, C) form is planar");
    Matrix::from_fn(|i, j| {
        (0..D).flat_map(|k| (0..D).map(move |l| (k, l))).map(|(k, l)| t[i][j][k][l] * e[(k, l)]).sum()
    })
}

/// Cofactors of F: J F⁻ᵀ, defined for every F.
fn cofactors<const D: usize>(f: &Matrix<D>) -> Matrix<D> {
    match D {
        1 => Matrix::identity(),
        2 => Matrix::from_fn(|r, c| if r == c { f[(1 - r, 1 - c)] } else { -f[(1 - r, 1 - c)] }),
        3 => Matrix::from_fn(|r, c| {
            let next = |x: usize, by: usize| (x + by) % 3;
            f[(next(r, 1), next(c, 1))] * f[(next(r, 2), next(c, 2))]
                - f[(next(r, 1), next(c, 2))] * f[(next(r, 2), next(c, 1))]
        }),
        _ => unreachable!("space has at most three dimensions"),
    }
}

/// det F for one to three dimensions.
#[inline]
pub fn determinant<const D: usize>(f: &Matrix<D>) -> f64 {
    f.row(0).dot(&cofactors(f).row(0))
}

/// J − 1 = det(I + ∇u) − 1 from ∇u itself, exact also where J is 1 to within rounding.
fn dilation<const D: usize>(h: &Matrix<D>) -> f64 {
    let trace = h.trace();
    let minors = 0.5 * (trace * trace - (h * h).trace());
    match D {
        1 => trace,
        2 => trace + determinant(h),
        _ => trace + minors + determinant(h),
    }
}

/// F⁻ᵀ; not finite when J is 0.
fn inverse_transpose<const D: usize>(f: &Matrix<D>, j: f64) -> Matrix<D> {
    cofactors(f) / j
}

fn push_forward<const D: usize>(f: &Matrix<D>, pk2: &Matrix<D>, c: &Tensor4<D>) -> Tensor4<D> {
    let mut a = zero4::<D>();
    for (i, j, k, l) in indices::<D>() {
        let mut sum = if i == k { pk2[(j, l)] } else { 0.0 };
        for m in 0..D {
            for n in 0..D {
                sum += f[(i, m)] * c[m][j][n][l] * f[(k, n)];
            }
        }
        a[i][j][k][l] = sum;
    }
    a
}
