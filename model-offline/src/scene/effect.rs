//! What a world may do that the simplest model of it does not.

use super::{Breathing, Resistance, Scene, Shaft};
use crate::choice::choice;
use crate::material::{Law, Material, Relaxation};
use strum::VariantArray as _;

choice! {
    /// An effect that a scene can be given, with numbers of the order that the literature reports where it has none of its own.
    pub enum Effect {
        /// The needle punctures, cuts and slips.
        Shaft,
        /// Stress relaxes.
        Creep,
        /// The immobile part moves with the breath.
        Breathing,
    }
}

/// Forces of the needle, over those that the tissue's own stiffness makes of its depth. Bovine liver (shear modulus about
/// 3 kPa) takes about 0.9 N to cut and 0.02 N/mm along the shaft over a depth of some 50 mm (Okamura, Simone & O'Leary, IEEE
/// Transactions on Biomedical Engineering 51, 2004), taken over the 20 mm of tissue beside a needle that it strains; friction is
/// a fifth of the work of an insertion, and three fifths are fracture (Barnett, Lee & Moore, Medical Engineering & Physics 38,
/// 2016).
const CUTTING: f64 = 0.3;
const PUNCTURE: f64 = 0.4;
/// Friction per length over the shear modulus.
const SLIDING: f64 = 0.2;
const STICKING: f64 = 0.3;

/// Breast in vivo creeps within 3.2 and 42 s, by about as much as it yields at once. How that is shared between the two is
/// a judgement.
const SHARES: [(f64, f64); 2] = [(0.3, 3.2), (0.2, 42.0)];

/// Seconds of a breath, and its amplitude over the depth of the insertion: 1.5 to 2 mm for the bundled scenes, of the 1 to 10 mm reported.
const PERIOD: f64 = 4.0;
const AMPLITUDE: f64 = 0.15;

impl Scene {
    /// The same scene with an effect, unless it has it already.
    #[must_use]
    pub fn with_effect(&self, effect: Effect) -> Self {
        let mut scene = self.clone();
        match effect {
            Effect::Shaft if self.needle.shaft.is_none() => scene.needle.shaft = Some(self.typical_shaft()),
            Effect::Creep => {
                // The numbers are good: they are constants, and a unit test makes them.
                if let Ok(relaxation) = Relaxation::new(SHARES) {
                    let own = scene.inclusions.iter_mut().filter_map(|inclusion| inclusion.material.as_mut());
                    for law in std::iter::once(&mut scene.material).chain(own) {
                        if law.relaxation().is_none() {
                            *law = law.clone().relaxing(relaxation.clone());
                        }
                    }
                }
            }
            Effect::Breathing if self.motion.breathing.is_none() => {
                let amplitude = AMPLITUDE * self.needle.depth;
                let direction = self.needle.orthogonal();
                scene.motion.breathing =
                    Some(Breathing { period: PERIOD, amplitude, direction, ..Breathing::default() });
            }
            Effect::Shaft | Effect::Breathing => {}
        }
        scene
    }

    /// The simplest model of the scene with these effects alone: with the scene's own numbers where it has them.
    #[must_use]
    pub fn with_only(&self, effects: &[Effect]) -> Self {
        effects.iter().fold(self.without_a_past(), |scene, effect| {
            let is_own = *effect == Effect::Creep && self.relaxes();
            if is_own { scene.taking(*effect, self) } else { scene.taking(*effect, &self.with_effect(*effect)) }
        })
    }

    /// The effects that the scene itself has. A needle that bends counts as a shaft, everything that moves the patient as
    /// breathing.
    pub fn own_effects(&self) -> Vec<Effect> {
        let has = |effect: &Effect| match effect {
            Effect::Shaft => self.needle.shaft.is_some() || self.needle.deflection != 0.0,
            Effect::Creep => self.relaxes(),
            Effect::Breathing => !self.motion.is_none(),
        };
        Effect::VARIANTS.iter().copied().filter(has).collect()
    }

    /// The scene without its effects but these: none is added that it does not have.
    #[must_use]
    pub fn keeping_only(&self, effects: &[Effect]) -> Self {
        effects.iter().fold(self.without_a_past(), |scene, effect| scene.taking(*effect, self))
    }

    /// The same scene with an effect as another one of the same tissue has it.
    fn taking(mut self, effect: Effect, from: &Self) -> Self {
        match effect {
            Effect::Shaft => {
                (self.needle.shaft, self.needle.deflection) = (from.needle.shaft, from.needle.deflection);
                for (own, from) in self.inclusions.iter_mut().zip(&from.inclusions) {
                    own.resistance = from.resistance;
                }
            }
            Effect::Creep => {
                self.material = from.material.clone();
                for (own, from) in self.inclusions.iter_mut().zip(&from.inclusions) {
                    own.material = from.material.clone();
                }
            }
            Effect::Breathing => self.motion = from.motion.clone(),
        }
        self
    }

    /// Has the needle go at this speed, length per second.
    pub fn set_speed(&mut self, speed: f64) {
        self.needle.speed = speed;
        if let Some(shaft) = &mut self.needle.shaft {
            shaft.speed = speed;
        }
    }

    fn typical_shaft(&self) -> Shaft {
        let modulus = <Law as Material<2>>::rest_shear_modulus(&self.material);
        let depth = self.needle.depth;
        let radius = 0.01 * depth;
        let resistance = Resistance {
            cutting_force: CUTTING * modulus * depth,
            static_friction: STICKING * modulus,
            kinetic_friction: SLIDING * modulus,
            viscous_friction: 0.0,
        };
        let puncture_force = PUNCTURE * modulus * depth;
        let entry = self.needle.entry();
        Shaft { entry, radius, tip_length: 2.0 * radius, puncture_force, speed: self.needle.speed, resistance }
    }
}
