//! The numbers of a scene: what can be known of it without solving.

use super::schema::UnitsSection;
use super::{Inclusion, Mechanics, Scene, Snapped, TissueVariant, polyline_length};
use crate::discretization::nodes::lattice::{lattice_nodes, lattice_nodes_on_interfaces};
use crate::discretization::{Integration, Resolution};
use crate::geometry::{Point2, distance_to_polyline, distance_to_segment, shared_area};
use crate::material::{Law, Material};
use serde::Serialize;

/// Nodes are counted where there are about so many, at most, and so many times the corners of the outlines that they are
/// fitted to: that takes no time.
const COUNTED: f64 = 20_000.0;
const FITTED: f64 = 2e7;

/// The numbers of a scene; lengths in its unit.
#[derive(Debug, Clone, Serialize)]
pub struct SceneFacts {
    /// Name.
    pub scene: String,
    /// Whether it has inclusions.
    pub tissue: TissueVariant,
    /// Unit labels.
    pub units: UnitsSection,
    /// The body.
    pub body: BodyFacts,
    /// What the body is made of.
    pub material: MaterialFacts,
    /// The needle.
    pub needle: NeedleFacts,
    /// The target.
    pub target: TargetFacts,
    /// Regions of another stiffness or material, in the order of the file.
    pub inclusions: Vec<InclusionFacts>,
    /// Paddle positions, in the order of the file.
    pub paddles: Vec<PaddleFacts>,
    /// Node spacing; none where it follows from a tolerance or a level.
    pub spacing: Option<f64>,
    /// Nodes at this spacing; none where that is not known at once.
    pub nodes: Option<usize>,
    /// What was beside the boundary in the file, and was put onto it.
    pub snapped: Vec<Snapped>,
}

/// The body.
#[derive(Debug, Clone, Serialize)]
pub struct BodyFacts {
    /// Lower left corner of its bounding box.
    pub low: [f64; 2],
    /// Upper right corner.
    pub high: [f64; 2],
    /// Diagonal of its bounding box: what tolerances are relative to.
    pub size: f64,
    /// Area.
    pub area: f64,
    /// Length of its boundary.
    pub perimeter: f64,
    /// Corners of its outline.
    pub vertices: usize,
    /// Length of its boundary that is immobile.
    pub immobile_length: f64,
}

/// A material at rest.
#[derive(Debug, Clone, Serialize)]
pub struct MaterialFacts {
    /// The law with its moduli.
    pub law: Law,
    /// Shear modulus at rest, stress units.
    pub shear_modulus: f64,
}

/// The needle.
#[derive(Debug, Clone, Serialize)]
pub struct NeedleFacts {
    /// How it meets the tissue.
    pub mechanics: Mechanics,
    /// Where it enters: the middle of the contact where no entry is given.
    pub entry: [f64; 2],
    /// Unit direction of insertion.
    pub axis: [f64; 2],
    /// How far it goes.
    pub depth: f64,
    /// Length of the tissue that moves with it.
    pub contact_length: f64,
}

/// The target.
#[derive(Debug, Clone, Serialize)]
pub struct TargetFacts {
    /// Where it is.
    pub position: [f64; 2],
    /// Distance from the needle's entry.
    pub from_entry: f64,
    /// How far along the needle's line.
    pub along_needle: f64,
    /// How far off the needle's line.
    pub off_needle: f64,
    /// Distance from the boundary.
    pub from_boundary: f64,
}

/// A region of another stiffness or material.
#[derive(Debug, Clone, Serialize)]
pub struct InclusionFacts {
    /// Counted from 1 in the order of the file.
    pub number: usize,
    /// Its area.
    pub area: f64,
    /// Part of the area that is in the body, 0 to 1.
    pub inside: f64,
    /// Its centre of mass.
    pub centroid: [f64; 2],
    /// Its smallest width.
    pub width: f64,
    /// Factor on the energy.
    pub stiffness: f64,
    /// A material of its own; the body's when absent.
    pub material: Option<MaterialFacts>,
}

/// A paddle position.
#[derive(Debug, Clone, Serialize)]
pub struct PaddleFacts {
    /// Its name in tables and reports.
    pub index: u32,
    /// Its length.
    pub length: f64,
    /// Distance from the needle contact.
    pub from_contact: f64,
    /// Distance from the immobile part.
    pub from_immobile: f64,
}

impl Scene {
    /// Its numbers.
    pub fn facts(&self) -> SceneFacts {
        let (along_needle, off_needle) = self.target_from_needle();
        let spacing = match self.discretization.resolution {
            Resolution::Spacing(spacing) => Some(spacing),
            Resolution::Tolerance(_) | Resolution::Level(_) => None,
        };
        SceneFacts {
            scene: self.name.clone(),
            tissue: self.tissue(),
            units: UnitsSection { length: self.length_unit.clone(), stress: self.stress_unit.clone() },
            body: self.body_facts(),
            material: MaterialFacts::of(&self.material),
            needle: NeedleFacts {
                mechanics: if self.needle.shaft.is_some() { Mechanics::Shaft } else { Mechanics::Patch },
                entry: self.needle.entry().into(),
                axis: self.needle.axis.into(),
                depth: self.needle.depth,
                contact_length: self.needle.contact_length(),
            },
            target: TargetFacts {
                position: self.target.into(),
                from_entry: (self.target - self.needle.entry()).norm(),
                along_needle,
                off_needle,
                from_boundary: self.outline.distance_to_boundary(self.target),
            },
            inclusions: self
                .inclusions
                .iter()
                .zip(1..)
                .map(|(one, number)| self.inclusion_facts(one, number))
                .collect(),
            paddles: (0..self.paddles.len()).map(|i| self.paddle_facts(i)).collect(),
            spacing,
            nodes: spacing.and_then(|spacing| self.nodes_at(spacing)),
            snapped: self.snapped.clone(),
        }
    }

    fn body_facts(&self) -> BodyFacts {
        let (low, high) = self.outline.bounds();
        BodyFacts {
            low: low.into(),
            high: high.into(),
            size: self.outline.size(),
            area: self.outline.area(),
            perimeter: self.outline.perimeter(),
            vertices: self.outline.vertices().len(),
            immobile_length: self.immobile.iter().map(|path| polyline_length(path)).sum(),
        }
    }

    fn inclusion_facts(&self, inclusion: &Inclusion, number: usize) -> InclusionFacts {
        let region = &inclusion.outline;
        InclusionFacts {
            number,
            area: region.area(),
            inside: (shared_area(&[&self.outline], region.vertices()) / region.area()).min(1.0),
            centroid: region.centroid().into(),
            width: region.width(),
            stiffness: inclusion.stiffness,
            material: inclusion.material.as_ref().map(MaterialFacts::of),
        }
    }

    /// Where a paddle is, by its place in the scene's list.
    pub(super) fn paddle_facts(&self, place: usize) -> PaddleFacts {
        let paddle = &self.paddles[place];
        let to = |path: &[Point2]| polyline_to_segment(path, paddle.segment);
        PaddleFacts {
            index: paddle.index,
            length: (paddle.segment[1] - paddle.segment[0]).norm(),
            from_contact: to(&self.needle.contact),
            from_immobile: self.immobile.iter().map(|path| to(path)).fold(f64::INFINITY, f64::min),
        }
    }

    /// Nodes at a spacing, where they are few enough to be counted at once.
    fn nodes_at(&self, spacing: f64) -> Option<usize> {
        let outlines = self.inclusions.iter().map(|inclusion| &inclusion.outline).chain([&self.outline]);
        let corners: usize = outlines.map(|outline| outline.vertices().len()).sum();
        let nodes = self.outline.area() / (spacing * spacing);
        let few = nodes <= COUNTED && nodes * corners as f64 <= FITTED;
        match self.discretization.method.integration {
            // Nodes on the edges are the triangulation's.
            Integration::FemT6 => None,
            rule if rule.is_element() => few.then(|| lattice_nodes_on_interfaces(&self.features(), spacing).len()),
            _ => few.then(|| lattice_nodes(&self.features(), spacing).len()),
        }
    }
}

impl MaterialFacts {
    fn of(law: &Law) -> Self {
        Self { law: law.clone(), shear_modulus: <Law as Material<2>>::rest_shear_modulus(law) }
    }
}

/// Distance between a polyline and a segment that do not cross.
fn polyline_to_segment(path: &[Point2], [a, b]: [Point2; 2]) -> f64 {
    let from_ends = distance_to_polyline(a, path).min(distance_to_polyline(b, path));
    path.iter().map(|p| distance_to_segment(*p, a, b)).fold(from_ends, f64::min)
}
