//! The catalogue of laws, and a law of it with an optional volumetric barrier.

use super::barrier::Barrier;
use super::catalogue::Catalogued as _;
use super::error::MaterialError;
use super::fung::Fung;
use super::fung_general::FungTensors;
use super::kinematics::{Matrix, Tensor4};
use super::lame::LameParameters;
use super::linear::Linear;
use super::material::{Material, Response};
use super::neo_hookean::NeoHookean;
use super::relaxation::Relaxation;
use super::saint_venant_kirchhoff::SaintVenantKirchhoff;
use super::section::{self, RelaxationSection};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The registry: names in scene files, each with the laws that it stands for, the first that reads the section winning.
macro_rules! registry {
    ($($(#[$doc:meta])* $model:ident: $($law:ident($type:ty)),+;)+) => {
        /// Material models.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema, strum::Display)]
        #[serde(rename_all = "kebab-case")]
        #[strum(serialize_all = "kebab-case")]
        pub enum MaterialModel {
            $($(#[$doc])* $model,)+
        }

        #[derive(Debug, Clone, PartialEq, Serialize)]
        enum Form {
            $($($law($type),)+)+
        }

        impl Form {
            fn read(section: &MaterialSection) -> Result<Self, MaterialError> {
                match section.model.ok_or(MaterialError::NoLaw)? {
                    $(MaterialModel::$model => {
                        $(if <$type>::reads(section) {
                            return Ok(Self::$law(<$type>::read(section)?));
                        })+
                    })+
                }
                Err(MaterialError::Missing("a modulus"))
            }

            fn respond<const D: usize>(&self, h: &Matrix<D>) -> Response<D> {
                match self { $($(Self::$law(law) => law.respond(h),)+)+ }
            }

            fn tangent<const D: usize>(&self, h: &Matrix<D>) -> Tensor4<D> {
                match self { $($(Self::$law(law) => law.tangent(h),)+)+ }
            }

            fn is_linear(&self) -> bool {
                match self { $($(Self::$law(law) => law.is_linear(),)+)+ }
            }

            fn has_mesh_limit(&self) -> bool {
                match self { $($(Self::$law(law) => law.has_mesh_limit(),)+)+ }
            }

            fn linearised(&self) -> Option<LameParameters> {
                match self { $($(Self::$law(law) => law.linearised(),)+)+ }
            }

            fn with_exponential_factor(&self, c: f64) -> Option<Result<Self, MaterialError>> {
                match self { $($(Self::$law(law) => Some(law.with_exponential_factor(c)?.map(Self::$law)),)+)+ }
            }

            fn with_poisson_ratio(&self, poisson: f64) -> Option<Result<Self, MaterialError>> {
                match self { $($(Self::$law(law) => Some(law.with_poisson_ratio(poisson)?.map(Self::$law)),)+)+ }
            }
        }
    };
}

// To add a law: its file, with `Material` and `Catalogued`, and its line here.
registry! {
    /// Fung's exponential law, the paper's equation 6.
    Fung: FungGeneral(FungTensors), Fung(Fung);
    /// Compressible neo-Hookean with an isochoric-volumetric split.
    NeoHookean: NeoHookean(NeoHookean);
    /// St. Venant–Kirchhoff: linear in the Green–Lagrange strain.
    SaintVenantKirchhoff: SaintVenantKirchhoff(SaintVenantKirchhoff);
    /// Linear elasticity at small strain.
    Linear: Linear(Linear);
}

/// What tissue is made of, as a scene file gives it.
pub type MaterialSection = section::MaterialSection<MaterialModel>;

/// A law of the catalogue with an optional volumetric barrier.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Law {
    #[serde(rename = "law")]
    form: Form,
    barrier: Barrier,
    #[serde(skip_serializing_if = "Option::is_none")]
    relaxation: Option<Relaxation>,
}

impl<const D: usize> Material<D> for Law {
    fn respond(&self, h: &Matrix<D>) -> Response<D> {
        let mut response = self.form.respond(h);
        if self.barrier.acts() {
            self.barrier.add_response(h, &mut response);
        }
        response
    }

    fn tangent(&self, h: &Matrix<D>) -> Tensor4<D> {
        let mut tangent = self.form.tangent(h);
        if self.barrier.acts() {
            self.barrier.add_tangent(h, &mut tangent);
        }
        tangent
    }
}

impl Law {
    /// The law that a section without a preset describes.
    pub(super) fn read(section: &MaterialSection) -> Result<Self, MaterialError> {
        let mut law = Self::plain(Form::read(section)?);
        if let Some(beta) = section.barrier {
            law = law.with_barrier(beta)?;
        }
        if let Some(RelaxationSection { g, tau }) = &section.relaxation {
            if g.len() != tau.len() {
                return Err(MaterialError::Unpaired(g.len(), tau.len()));
            }
            if !g.is_empty() {
                law = law.relaxing(Relaxation::new(g.iter().copied().zip(tau.iter().copied()))?);
            }
        }
        Ok(law)
    }

    /// Whether it says what happens outside of the plane, too.
    pub fn holds_in_space(&self) -> bool {
        !matches!(self.form, Form::FungGeneral(_))
    }

    /// Fung's law in isotropic form (the paper's equation 6, its Table I summed over a symmetric strain):
    /// `W = ½ [λ (tr E)² + 2μ E:E] + (c/2) (exp[λc (tr E)² + 2μc E:E] − 1)`.
    ///
    /// # Errors
    /// Moduli that are not finite, a negative factor or exponent, or a law unstable at rest.
    pub fn fung(lambda: f64, mu: f64, c: f64, lambda_c: f64, mu_c: f64) -> Result<Self, MaterialError> {
        Ok(Self::plain(Form::Fung(Fung::new(lambda, mu, c, lambda_c, mu_c)?)))
    }

    /// Fung's law with general tensors: `W = ½ E:A:E + (c/2) (exp(E:C:E) − 1)`. Planar.
    ///
    /// # Errors
    /// `c` that is negative or not finite, or a law unstable at rest.
    pub fn fung_general(tensors: FungTensors) -> Result<Self, MaterialError> {
        Ok(Self::plain(Form::FungGeneral(tensors.checked()?)))
    }

    /// St. Venant–Kirchhoff: `W = ½ λ (tr E)² + μ E:E`.
    ///
    /// # Errors
    /// Moduli that are not finite, or a law unstable at rest.
    pub fn saint_venant_kirchhoff(lambda: f64, mu: f64) -> Result<Self, MaterialError> {
        Ok(Self::plain(Form::SaintVenantKirchhoff(SaintVenantKirchhoff::new(lambda, mu)?)))
    }

    /// Compressible neo-Hookean: `W = μ/2 (Ī₁ − 3) + κ/4 (J² − 1 − 2 ln J)`, Ī₁ = J^(−2/3) tr C in three
    /// dimensions (plane strain: C₃₃ = 1), κ = λ + 2μ/3.
    ///
    /// # Errors
    /// Moduli that are not finite, or a law unstable at rest.
    pub fn neo_hookean(lambda: f64, mu: f64) -> Result<Self, MaterialError> {
        Ok(Self::plain(Form::NeoHookean(NeoHookean::new(lambda, mu)?)))
    }

    /// Linear elasticity: `W = ½ λ (tr ε)² + μ ε:ε`, ε = ½ (H + Hᵀ). In the plane this is plane strain; give
    /// λ* = 2λμ/(λ + 2μ) for plane stress.
    ///
    /// # Errors
    /// Moduli that are not finite, or a law unstable at rest.
    pub fn linear(lambda: f64, mu: f64) -> Result<Self, MaterialError> {
        Ok(Self::plain(Form::Linear(Linear::new(lambda, mu)?)))
    }

    fn plain(form: Form) -> Self {
        Self { form, barrier: Barrier::default(), relaxation: None }
    }

    /// Adds the volumetric barrier `β/4 (ln J)⁴`: zero value, slope and curvature at J = 1, so that small strains do not
    /// feel it, and unbounded as J → 0, so that compression meets a growing resistance.
    ///
    /// # Errors
    /// `beta` that is negative or not finite.
    pub fn with_barrier(self, beta: f64) -> Result<Self, MaterialError> {
        Ok(Self { barrier: Barrier::new(beta)?, ..self })
    }

    /// Stress relaxation on all of its moduli.
    #[must_use]
    pub fn relaxing(self, relaxation: Relaxation) -> Self {
        Self { relaxation: Some(relaxation), ..self }
    }

    /// Stress relaxation, where there is any.
    pub fn relaxation(&self) -> Option<&Relaxation> {
        self.relaxation.as_ref()
    }

    /// The law without relaxation: its moduli are those of a fast deformation.
    #[must_use]
    pub fn elastic(&self) -> Self {
        Self { relaxation: None, ..self.clone() }
    }

    /// Factor β of the volumetric barrier, stress units.
    pub fn barrier(&self) -> f64 {
        self.barrier.beta
    }

    /// Whether stress is proportional to the displacement gradient, so that one tangent serves every state.
    pub fn is_linear(&self) -> bool {
        self.form.is_linear() && !self.barrier.acts()
    }

    /// Whether equilibria at finite depth have a limit when the nodes are refined. Laws that soften in compression
    /// without end (Fung's, St. Venant–Kirchhoff's) have none under a needle's edge.
    pub fn has_mesh_limit(&self) -> bool {
        self.barrier.acts() || self.form.has_mesh_limit()
    }

    /// The law of small strains with the same tangent at rest: what a linear model of this tissue would use. A law whose
    /// tangent at rest is not isotropic stays as it is, for small strains.
    #[must_use]
    pub fn linearised(&self) -> Self {
        let linear = |moduli: LameParameters| Self {
            relaxation: self.relaxation.clone(),
            ..Self::plain(Form::Linear(moduli.into()))
        };
        self.form.linearised().map_or_else(|| self.clone(), linear)
    }

    /// The law with another factor c of Fung's exponential term; none where the law has no such term.
    ///
    /// # Errors
    /// `c` that is negative or not finite.
    pub fn with_exponential_factor(&self, c: f64) -> Option<Result<Self, MaterialError>> {
        Some(self.form.with_exponential_factor(c)?.map(|form| Self { form, ..self.clone() }))
    }

    /// The law with λ = 2μν/(1 − 2ν) for another Poisson ratio ν, the shear modulus μ kept (and Fung's exponential term as it
    /// is); none where the law is not given by λ and μ.
    ///
    /// # Errors
    /// ν outside (−1, ½), where no law is stable at rest.
    pub fn with_poisson_ratio(&self, poisson: f64) -> Option<Result<Self, MaterialError>> {
        Some(self.form.with_poisson_ratio(poisson)?.map(|form| Self { form, ..self.clone() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_changes_and_the_rest_stays() {
        let law = Law::fung(383.0, 318.5, 0.779, 1.5, 1.0).unwrap().with_barrier(3.0).unwrap();
        assert_eq!(law.with_exponential_factor(0.779).unwrap().unwrap(), law);
        let other = law.with_exponential_factor(100.0).unwrap().unwrap();
        assert_eq!(other, Law::fung(383.0, 318.5, 100.0, 1.5, 1.0).unwrap().with_barrier(3.0).unwrap());
        let soft = law.with_poisson_ratio(0.25).unwrap().unwrap();
        // ν = ¼: λ = μ.
        assert_eq!(soft, Law::fung(318.5, 318.5, 0.779, 1.5, 1.0).unwrap().with_barrier(3.0).unwrap());
        assert!(law.with_exponential_factor(-1.0).unwrap().is_err());
        assert!(Law::linear(1.0, 1.0).unwrap().with_exponential_factor(1.0).is_none());
    }

    #[test]
    fn poisson_ratios_are_those_of_a_solid() {
        for law in [Law::linear(1.0, 1.0), Law::neo_hookean(1.0, 1.0), Law::saint_venant_kirchhoff(1.0, 1.0)] {
            let law = law.unwrap();
            let with = |poisson: f64| law.with_poisson_ratio(poisson).unwrap();
            assert!(with(-0.99).is_ok() && with(0.49).is_ok());
            // Plane strain alone would let ν = −1.5 pass: λ + μ > 0, but λ + 2μ/3 < 0.
            assert!([-1.5, -1.01, 0.5, 0.51].into_iter().all(|poisson| with(poisson).is_err()), "{law:?}");
        }
    }
}
