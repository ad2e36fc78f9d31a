//! Materials of scene files: a law written out, or a preset with keys of the scene's own in place of the preset's.

use super::error::MaterialError;
use super::law::{Law, MaterialModel, MaterialSection};
use super::material::Material;
use super::preset::Preset;
use super::section::{RelaxationSection, unused};
use super::stress::{UnknownStress, kilopascals};
use serde::Serialize;

impl MaterialSection {
    /// The law that it describes, in a scene with this unit of stress. Keys beside a preset replace the preset's one by one, in
    /// the scene's unit; another `model` takes the preset's λ and μ at rest; a relaxation without terms takes the preset's away.
    ///
    /// # Errors
    /// Neither a model nor a preset; moduli that are missing, meaningless, or make no law that is stable at rest; a preset in a
    /// scene whose unit of stress is not known.
    ///
    /// # Example
    /// ```
    /// use model_offline::material::{Material, MaterialSection};
    ///
    /// let section: MaterialSection = toml::from_str("preset = \"liver\"").unwrap();
    /// let law = section.law("Pa")?;
    /// assert!((Material::<2>::rest_shear_modulus(&law) - 2000.0).abs() < 1e-9);
    /// assert!(section.law("1").is_err());
    /// # Ok::<(), model_offline::material::MaterialError>(())
    /// ```
    pub fn law(&self, stress_unit: &str) -> Result<Law, MaterialError> {
        match self.preset {
            None => Law::read(self),
            Some(preset) => Law::read(&self.over(preset, stress_unit)?),
        }
    }

    /// The preset with this section's keys in place of the preset's.
    fn over(&self, preset: Preset, stress_unit: &str) -> Result<Self, MaterialError> {
        let Self { preset: _, model, lambda, mu, c, lambda_c, mu_c, a, c_tensor, barrier, relaxation } = self;
        unused(&[("A beside a preset", a.is_some()), ("C beside a preset", c_tensor.is_some())])?;
        let named = preset.section(*model, stress_unit).map_err(MaterialError::UnknownStress)?;
        let relaxation = relaxation.clone().or(named.relaxation);
        Ok(Self {
            preset: None,
            model: named.model,
            lambda: lambda.or(named.lambda),
            mu: mu.or(named.mu),
            c: c.or(named.c),
            lambda_c: lambda_c.or(named.lambda_c),
            mu_c: mu_c.or(named.mu_c),
            a: None,
            c_tensor: None,
            barrier: *barrier,
            relaxation: relaxation.filter(|RelaxationSection { g, tau }| !(g.is_empty() && tau.is_empty())),
        })
    }
}

impl Preset {
    /// Its law, where no other is asked for.
    fn model(self) -> MaterialModel {
        if self.fung().is_some() { MaterialModel::Fung } else { MaterialModel::NeoHookean }
    }

    /// What a scene file would write in its place, with its own law or another.
    ///
    /// # Errors
    /// [`UnknownStress`].
    pub fn section(self, model: Option<MaterialModel>, stress_unit: &str) -> Result<MaterialSection, UnknownStress> {
        let Some(unit_kpa) = kilopascals(stress_unit) else {
            return Err(UnknownStress { preset: self, unit: stress_unit.to_owned() });
        };
        let fung = self.fung().filter(|_| model.is_none_or(|model| model == self.model()));
        let moduli = fung.map_or_else(|| self.at_rest(), |fung| fung.linear);
        let terms = self.relaxation();
        Ok(MaterialSection {
            preset: None,
            model: Some(model.unwrap_or(self.model())),
            lambda: Some(moduli.lambda / unit_kpa),
            mu: Some(moduli.mu / unit_kpa),
            c: fung.map(|fung| fung.c / unit_kpa),
            lambda_c: fung.map(|fung| fung.exponent.lambda),
            mu_c: fung.map(|fung| fung.exponent.mu),
            a: None,
            c_tensor: None,
            barrier: None,
            relaxation: (!terms.is_empty()).then(|| RelaxationSection {
                g: terms.iter().map(|(share, _)| *share).collect(),
                tau: terms.iter().map(|(_, time)| *time).collect(),
            }),
        })
    }
}

/// All that is known of a preset; stresses in kPa.
#[derive(Debug, Clone, Serialize)]
pub struct NamedMaterial {
    /// Its name.
    pub preset: Preset,
    /// Shear modulus at rest, of a fast deformation, kPa.
    pub shear_modulus_kpa: f64,
    /// Poisson's ratio at rest.
    pub poisson_ratio: f64,
    /// What a scene in kPa would write in its place.
    pub material: MaterialSection,
    /// Who measured what.
    pub source: &'static str,
    /// What of it is a judgement.
    pub judgement: &'static str,
}

impl NamedMaterial {
    /// All that is known of this preset.
    ///
    /// # Errors
    /// None for the presets there are.
    pub fn of(preset: Preset) -> Result<Self, MaterialError> {
        let material = preset.section(None, "kPa").map_err(MaterialError::UnknownStress)?;
        let law = material.law("kPa")?;
        let moduli = preset.at_rest();
        Ok(Self {
            preset,
            shear_modulus_kpa: Material::<2>::rest_shear_modulus(&law),
            poisson_ratio: 0.5 * moduli.lambda / (moduli.lambda + moduli.mu),
            material,
            source: preset.source(),
            judgement: preset.judgement(),
        })
    }
}
