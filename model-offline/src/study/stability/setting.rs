//! What the study knows of a scene, in whichever dimension.

use crate::discretization::{Discretization, Integration, Method};
use crate::material::Law;
use crate::scene::Scene;
use crate::scene::space::SpaceScene;

/// A scene as the study needs it.
#[derive(Debug, Clone)]
pub struct Setting {
    /// Name.
    pub name: String,
    /// 2 or 3.
    pub dimension: u32,
    /// Label of the length unit.
    pub length_unit: String,
    /// The scene's depth, length units.
    pub depth: f64,
    /// Increments over it.
    pub increments: u32,
    /// What the body is made of.
    pub material: Law,
    /// Whether there are inclusions whose stiffness can be varied.
    pub has_inclusions: bool,
    /// The scene's own method and spacing.
    pub discretization: Discretization,
    /// Kernel support over spacing of every meshfree rule; in space none is each rule's own, and the scene's for its rule.
    pub support: Option<f64>,
}

impl From<&Scene> for Setting {
    fn from(scene: &Scene) -> Self {
        Self {
            name: scene.name.clone(),
            dimension: 2,
            length_unit: scene.length_unit.clone(),
            depth: scene.needle.depth,
            increments: scene.needle.increments,
            material: scene.material.clone(),
            has_inclusions: !scene.inclusions.is_empty(),
            discretization: scene.discretization,
            support: Some(scene.discretization.method.support),
        }
    }
}

impl Setting {
    /// A scene in space, and the kernel support of all its meshfree rules, where it is not each rule's own.
    pub fn in_space(scene: &SpaceScene, support: Option<f64>) -> Self {
        Self {
            name: scene.name.clone(),
            dimension: 3,
            length_unit: scene.length_unit.clone(),
            depth: scene.needle.depth,
            increments: scene.needle.increments,
            material: scene.material.clone(),
            has_inclusions: !scene.inclusions.is_empty(),
            discretization: scene.discretization,
            support,
        }
    }

    /// The rules that are compared.
    pub fn rules(&self) -> &'static [Integration] {
        if self.dimension == 3 { Integration::SPATIAL } else { Integration::PLANAR }
    }

    /// Linear and quadratic finite elements.
    pub fn elements(&self) -> [Integration; 2] {
        if self.dimension == 3 {
            [Integration::FemT4, Integration::FemT10]
        } else {
            [Integration::FemT3, Integration::FemT6]
        }
    }

    /// A rule with the rest of the scene's method.
    pub(super) fn method(&self, integration: Integration) -> Method {
        let own = self.discretization.method;
        if integration == own.integration && self.support.is_none() {
            return own;
        }
        let support = self.support.unwrap_or_else(|| integration.default_support_in_space());
        Method { integration, support, ..own }
    }
}
