//! The same law with one number changed: for studies of what that number does.

use super::{Law, Material, MaterialError};

impl Material {
    /// The law with another factor c of Fung's exponential term; none where the law has no such term.
    ///
    /// # Errors
    /// `c` that is negative or not finite.
    pub fn with_exponential_factor(&self, c: f64) -> Option<Result<Self, MaterialError>> {
        let law = match &self.law {
            Law::Fung { lambda, mu, lambda_c, mu_c, .. } => Material::fung(*lambda, *mu, c, *lambda_c, *mu_c),
            Law::FungGeneral(tensors) => {
                let mut tensors = tensors.as_ref().clone();
                tensors.c = c;
                Material::fung_general(tensors)
            }
            Law::NeoHookean { .. } | Law::Linear { .. } => return None,
        };
        Some(law.and_then(|law| law.with_barrier(self.barrier)))
    }

    /// The law with λ = 2μν/(1 − 2ν) for another Poisson ratio ν, the shear modulus μ kept (and Fung's exponential term as it
    /// is); none where the law is not given by λ and μ.
    ///
    /// # Errors
    /// ν outside (−1, ½), where no law is stable at rest.
    pub fn with_poisson_ratio(&self, poisson: f64) -> Option<Result<Self, MaterialError>> {
        let lambda = |mu: f64| 2.0 * mu * poisson / (1.0 - 2.0 * poisson);
        let law = match &self.law {
            Law::Fung { mu, c, lambda_c, mu_c, .. } => Material::fung(lambda(*mu), *mu, *c, *lambda_c, *mu_c),
            Law::NeoHookean { mu, .. } => Material::neo_hookean(lambda(*mu), *mu),
            Law::Linear { mu, .. } => Material::linear(lambda(*mu), *mu),
            Law::FungGeneral(_) => return None,
        };
        Some(law.and_then(|law| law.with_barrier(self.barrier)))
    }

    /// Factor β of the volumetric barrier, stress units.
    pub fn barrier(&self) -> f64 {
        self.barrier
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_changes_and_the_rest_stays() {
        let law = Material::fung(383.0, 318.5, 0.779, 1.5, 1.0).unwrap().with_barrier(3.0).unwrap();
        assert_eq!(law.with_exponential_factor(0.779).unwrap().unwrap(), law);
        let other = law.with_exponential_factor(100.0).unwrap().unwrap();
        assert_eq!(other, Material::fung(383.0, 318.5, 100.0, 1.5, 1.0).unwrap().with_barrier(3.0).unwrap());
        let soft = law.with_poisson_ratio(0.25).unwrap().unwrap();
        // ν = ¼: λ = μ.
        assert_eq!(soft, Material::fung(318.5, 318.5, 0.779, 1.5, 1.0).unwrap().with_barrier(3.0).unwrap());
        assert!(law.with_poisson_ratio(0.5).unwrap().is_err());
        assert!(law.with_exponential_factor(-1.0).unwrap().is_err());
        assert!(Material::linear(1.0, 1.0).unwrap().with_exponential_factor(1.0).is_none());
    }
}
