//! The discretizations that are worth comparing on a scene, and what one of them costs and misses.

use crate::discretization::lattice::lattice_nodes;
use crate::discretization::{Basis, Integration};
use crate::discretization::{Method, Planar};
use crate::model::graded_model;
use crate::model::{ModelError, TissueModel};
use crate::placement::adaptive::Reference;
use crate::placement::rest::{RestResponse, rest_responses};
use crate::scene::{Resolution, Scene};
use std::time::Instant;

/// Every integration rule there is.
pub const RULES: [Integration; 6] = [
    Integration::Dni,
    Integration::Scni,
    Integration::Nsni,
    Integration::Gauss,
    Integration::FemT3,
    Integration::FemT6,
];

/// Where the nodes are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Nodes {
    /// Evenly spaced, length units.
    Uniform(f64),
    /// Gathered where the solution is singular, at a refinement level.
    Graded(i32),
}

/// A discretization to try.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Integration rule.
    pub integration: Integration,
    /// Basis of the shape functions.
    pub basis: Basis,
    /// Kernel support over local spacing.
    pub support: f64,
    /// Where the nodes are.
    pub nodes: Nodes,
}

/// What a candidate turned out to be.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Number of nodes.
    pub nodes: usize,
    /// Finest node spacing, length units.
    pub spacing: f64,
    /// Time for nodes, shape functions and all paddles' Jacobians and displacements per depth, s: best of several.
    pub wall_s: f64,
    /// The same two errors as [`Reference::distance`].
    pub errors: (f64, f64),
    /// The responses themselves.
    pub responses: Vec<RestResponse>,
}

impl Candidate {
    /// Whether the integration rule is a finite-element one: basis and support do not apply.
    pub fn is_element(&self) -> bool {
        matches!(self.integration, Integration::FemT3 | Integration::FemT6)
    }

    fn method(&self) -> Method {
        Method { integration: self.integration, basis: self.basis, support: self.support, consistent: true }
    }

    /// The scene with this discretization.
    pub fn scene(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        let spec = &mut scene.discretization;
        (spec.integration, spec.basis, spec.support) = (self.integration, self.basis, self.support);
        spec.resolution = match self.nodes {
            Nodes::Uniform(spacing) => Resolution::Spacing(spacing),
            Nodes::Graded(level) => Resolution::Level(level),
        };
        scene
    }

    /// Discretises the scene.
    ///
    /// # Errors
    /// [`ModelError`]: the candidate does not work on this scene.
    pub fn build(&self, scene: &Scene) -> Result<TissueModel, ModelError> {
        let scene = self.scene(scene);
        match self.nodes {
            Nodes::Uniform(spacing) => {
                let nodes = lattice_nodes(&scene.features(), spacing);
                let planar =
                    Planar::new(&scene.outline, &scene.inclusion_outlines(), nodes, Some(spacing), self.method())?;
                TissueModel::on(&scene, planar, spacing)
            }
            Nodes::Graded(level) => graded_model(&scene, self.method(), level),
        }
    }

    /// Builds and solves it, `repeats` times while that is quick.
    ///
    /// # Errors
    /// [`ModelError`]: the candidate does not work on this scene.
    pub fn measure(&self, scene: &Scene, reference: &Reference, repeats: u32) -> Result<Outcome, ModelError> {
        let mut best: Option<Outcome> = None;
        for _ in 0..repeats.max(1) {
            let start = Instant::now();
            let model = self.build(scene)?;
            let responses = rest_responses(&model)?;
            let wall_s = start.elapsed().as_secs_f64();
            if best.as_ref().is_none_or(|b| wall_s < b.wall_s) {
                let errors = reference.distance(&responses);
                best = Some(Outcome { nodes: model.nodes(), spacing: model.spacing(), wall_s, errors, responses });
            }
            if wall_s > QUICK_S {
                break;
            }
        }
        best.ok_or_else(|| ModelError::Unsupported("nothing was measured".into()))
    }

    /// Support and basis where they apply, nodes: the settings in a few words.
    pub fn settings(&self) -> String {
        let nodes = match self.nodes {
            Nodes::Uniform(h) => format!("uniform {h:.4}"),
            Nodes::Graded(level) => format!("graded level {level}"),
        };
        if self.is_element() {
            return nodes;
        }
        let basis = match self.basis {
            Basis::Linear => "linear",
            Basis::Quadratic => "quadratic",
        };
        format!("{basis} basis, support {}, {nodes}", self.support)
    }
}

/// Longer than this is not measured again: noise is small beside it.
const QUICK_S: f64 = 0.5;

/// Families of candidates that differ in the nodes only, each from coarse to fine.
pub fn families(scene: &Scene, quick: bool) -> Vec<Vec<Candidate>> {
    let base = match scene.discretization.resolution {
        Resolution::Spacing(h) => h,
        // As many nodes across as the paper's body has.
        Resolution::Tolerance(_) | Resolution::Level(_) => 0.1 * scene.outline.area().sqrt(),
    };
    let uniform: Vec<Nodes> =
        [1.0, 0.5, 0.25, 0.125].iter().take(if quick { 2 } else { 4 }).map(|s| Nodes::Uniform(base * s)).collect();
    let graded: Vec<Nodes> = (-2..=if quick { 1 } else { 4 }).map(Nodes::Graded).collect();
    let mut families = Vec::new();
    for integration in RULES {
        let element = matches!(integration, Integration::FemT3 | Integration::FemT6);
        let shapes: &[(Basis, f64)] = match (element, quick) {
            (true, _) => &[(Basis::Linear, 2.0)],
            (false, true) => &[(Basis::Linear, 1.5), (Basis::Linear, 2.0)],
            // Two nodes either way are not enough for a quadratic basis everywhere: shown, not left out.
            (false, false) => &[
                (Basis::Linear, 1.2),
                (Basis::Linear, 1.5),
                (Basis::Linear, 2.0),
                (Basis::Linear, 3.0),
                (Basis::Quadratic, 2.0),
                (Basis::Quadratic, 3.0),
            ],
        };
        for &(basis, support) in shapes {
            for nodes in [&uniform, &graded] {
                families.push(nodes.iter().map(|&nodes| Candidate { integration, basis, support, nodes }).collect());
            }
        }
    }
    families
}

/// The name of a rule as scene files have it.
pub fn rule_name(integration: Integration) -> &'static str {
    match integration {
        Integration::Dni => "dni",
        Integration::Scni => "scni",
        Integration::Nsni => "nsni",
        Integration::Gauss => "gauss",
        Integration::FemT3 => "fem-t3",
        Integration::FemT6 => "fem-t6",
    }
}
