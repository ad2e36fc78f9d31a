//! The scene file in three dimensions. All numbers are in the scene's own consistent units.

use crate::discretization::{Basis, Integration};
use crate::geometry::{Point, Solid};
use crate::material::MaterialSection;
use crate::scene::exactly::{Coordinates, Exactly};
use crate::scene::schema::{ActuatorSection, Located, SceneSection};
use schemars::{JsonSchema, Schema};
use serde::Deserialize;

/// A scene in space: a solid body, a needle, a target and the paddle positions to choose from, alone or in pairs.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Stillpoint scene in space")]
pub struct SpaceSceneFile {
    /// Name, dimension and unit labels.
    pub scene: SceneSection,
    /// The body.
    pub domain: Located<DomainSection>,
    /// What the body is made of.
    pub material: Located<MaterialSection>,
    /// Regions of another stiffness or material.
    #[serde(default)]
    pub inclusion: Vec<Located<InclusionSection>>,
    /// The part of the surface that cannot move.
    pub immobile: ImmobileSection,
    /// The needle: which part of the surface moves with it, where to, and how far.
    pub needle: NeedleSection,
    /// The point to hold still.
    pub target: TargetSection,
    /// The paddle positions to choose from.
    #[serde(default)]
    pub paddle: Vec<Located<PaddleSection>>,
    /// Which pairs of paddles are looked at (default: all).
    #[serde(default)]
    pub pairs: PairsSection,
    /// Limits of the paddles' actuators.
    #[serde(default)]
    pub actuator: ActuatorSection,
    /// How fine and by which method the tissue is modelled.
    pub discretization: Located<DiscretizationSection>,
    /// Planar only: refused by name.
    #[schemars(skip)]
    pub sensor: Option<Located<toml::Table>>,
    /// Planar only: refused by name.
    #[schemars(skip)]
    pub motion: Option<Located<toml::Table>>,
    /// Planar only: refused by name.
    #[schemars(skip)]
    pub fit: Option<Located<toml::Table>>,
}

/// A region of space.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SolidSection {
    /// A box along the axes. One that is flat in a coordinate is, as a region, the part of a face.
    Box {
        /// Lowest corner.
        min: Coordinates<3>,
        /// Highest corner.
        max: Coordinates<3>,
    },
    /// A ball.
    Sphere {
        /// Its centre.
        centre: Coordinates<3>,
        /// Its radius.
        radius: f64,
    },
    /// An ellipsoid along the axes.
    Ellipsoid {
        /// Its centre.
        centre: Coordinates<3>,
        /// Half its extents.
        semi_axes: Coordinates<3>,
    },
    /// All that lies opposite to the normal.
    HalfSpace {
        /// A point of the boundary.
        point: Coordinates<3>,
        /// Normal, outwards, of any length.
        normal: Coordinates<3>,
    },
    /// A circular cylinder with flat ends.
    Cylinder {
        /// Centre of one end.
        from: Coordinates<3>,
        /// Centre of the other end.
        to: Coordinates<3>,
        /// Its radius.
        radius: f64,
    },
    /// All that lies in any of these.
    Union(Vec<SolidSection>),
    /// All that lies in each of these.
    Intersection(Vec<SolidSection>),
    /// All that lies in the first and in none of the rest.
    Difference(Vec<SolidSection>),
}

impl SolidSection {
    /// The solid, and whether all its numbers are finite, its lengths positive and its Booleans of something.
    pub(super) fn solid(&self) -> Result<Solid, &'static str> {
        let point = |p: &[f64; 3]| Point::<3>::from(*p);
        let finite = |p: &[f64; 3]| p.iter().all(|v| v.is_finite());
        let check = |good: bool, what: &'static str| if good { Ok(()) } else { Err(what) };
        let all = |members: &[Self]| -> Result<Vec<Solid>, &'static str> {
            check(!members.is_empty(), "a union, intersection or difference needs members")?;
            members.iter().map(Self::solid).collect()
        };
        Ok(match self {
            Self::Box { min, max } => {
                check(finite(min) && finite(max), "coordinates must be finite numbers")?;
                check((0..3).all(|k| min[k] <= max[k]), "min of a box must not be above its max")?;
                let flat = (0..3).filter(|&k| min[k] == max[k]).count();
                check(flat <= 1, "a box may be flat in one coordinate at most")?;
                Solid::Box { min: point(min), max: point(max) }
            }
            Self::Sphere { centre, radius } => {
                check(finite(centre), "coordinates must be finite numbers")?;
                check(radius.is_finite() && *radius > 0.0, "a radius must be positive and finite")?;
                Solid::Sphere { centre: point(centre), radius: *radius }
            }
            Self::Ellipsoid { centre, semi_axes } => {
                check(finite(centre), "coordinates must be finite numbers")?;
                check(
                    finite(semi_axes) && semi_axes.iter().all(|a| *a > 0.0),
                    "semi_axes must be positive and finite",
                )?;
                Solid::Ellipsoid { centre: point(centre), semi_axes: point(semi_axes) }
            }
            Self::HalfSpace { point: at, normal } => {
                check(finite(at) && finite(normal), "coordinates must be finite numbers")?;
                check(point(normal).norm() > 0.0, "the normal of a half space needs a direction")?;
                Solid::HalfSpace { point: point(at), normal: point(normal) }
            }
            Self::Cylinder { from, to, radius } => {
                check(finite(from) && finite(to), "coordinates must be finite numbers")?;
                check(from != to, "the ends of a cylinder must differ")?;
                check(radius.is_finite() && *radius > 0.0, "a radius must be positive and finite")?;
                Solid::Cylinder { from: point(from), to: point(to), radius: *radius }
            }
            Self::Union(members) => Solid::union(all(members)?),
            Self::Intersection(members) => Solid::Intersection(all(members)?),
            Self::Difference(members) => Solid::Difference(all(members)?),
        })
    }
}

/// Corners of a box.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxSection {
    /// Lowest corner.
    pub min: Coordinates<3>,
    /// Highest corner.
    pub max: Coordinates<3>,
}

/// The body: one of these.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DomainSection {
    /// A box along the axes.
    #[serde(rename = "box")]
    pub cuboid: Option<BoxSection>,
    /// A solid made of simple ones.
    pub solid: Option<SolidSection>,
    /// A closed surface in an STL, OBJ or PLY file, relative to the scene's folder. Where neighbouring triangles meet at
    /// more than 40° the body has a sharp edge.
    pub surface: Option<Located<String>>,
    /// A mesh of tetrahedra in a Gmsh (.msh, version 2.2 or 4.1) or VTK (.vtu) file, relative to the scene's folder. The
    /// body is what they fill; it is meshed anew. Physical volumes (in VTK an array of cells) are parts that inclusions
    /// name.
    pub mesh: Option<Located<String>>,
    /// Labels of a segmentation.
    pub labels: Option<Located<LabelsSection>>,
}

/// A body that is where labels of a segmentation are. The stairs of voxels are smoothed.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LabelsSection {
    /// A NIfTI (.nii, .nii.gz) or NRRD (.nrrd) file, relative to the scene's folder. Its coordinates are taken as
    /// millimetres to the right, to the front and upwards (RAS).
    pub file: Located<String>,
    /// The label of the body, or a list of all labels that belong to it, those of inclusions among them.
    pub body: Located<LabelSet>,
}

/// One label, or several.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a label, or a list of labels: whole numbers from 0 to 65535")]
pub enum LabelSet {
    /// One label.
    One(u16),
    /// All of these.
    Several(Vec<u16>),
}

/// A region of another stiffness or material: one of box, sphere, ellipsoid, solid, surface, label and name.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InclusionSection {
    /// A box along the axes.
    #[serde(rename = "box")]
    pub cuboid: Option<BoxSection>,
    /// A ball.
    pub sphere: Option<SphereSection>,
    /// An ellipsoid along the axes.
    pub ellipsoid: Option<EllipsoidSection>,
    /// A solid made of simple ones.
    pub solid: Option<SolidSection>,
    /// A closed surface in an STL, OBJ or PLY file, relative to the scene's folder.
    pub surface: Option<Located<String>>,
    /// A label of the domain's segmentation, one of those that belong to the body, or the number of a physical volume of
    /// the domain's mesh.
    pub label: Option<Located<u16>>,
    /// The name of a physical volume of the domain's mesh, or of a label of its segmentation.
    pub name: Option<Located<String>>,
    /// Factor on the energy (default 1).
    #[serde(default = "one")]
    pub stiffness: f64,
    /// A material of its own; the body's when absent.
    pub material: Option<Located<MaterialSection>>,
}

/// A ball.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereSection {
    /// Its centre.
    pub centre: Coordinates<3>,
    /// Its radius.
    pub radius: f64,
}

/// An ellipsoid along the axes.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EllipsoidSection {
    /// Its centre.
    pub centre: Coordinates<3>,
    /// Half its extents.
    pub semi_axes: Coordinates<3>,
}

fn one() -> f64 {
    1.0
}

/// The part of the surface that cannot move.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImmobileSection {
    /// Regions: what of the surface lies inside of any of them.
    pub regions: Vec<Located<SolidSection>>,
}

/// The needle.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NeedleSection {
    /// What of the surface lies inside moves with the needle.
    pub region: Located<SolidSection>,
    /// Direction of insertion; normalised on reading.
    pub axis: Located<Coordinates<3>>,
    /// How far the needle goes, length units.
    pub depth: Located<f64>,
    /// Into how many increments the insertion is divided (default 10).
    pub increments: Option<Located<u32>>,
    /// Speed of the insertion, length units per second (default: the depth in five seconds).
    pub speed: Option<Located<f64>>,
    /// Planar only: refused by name.
    #[schemars(skip)]
    pub mechanics: Option<Located<String>>,
}

/// The point to hold still.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TargetSection {
    /// Where it is before the insertion.
    pub position: Located<Coordinates<3>>,
}

/// A paddle position.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PaddleSection {
    /// Its name in tables and reports.
    pub index: u32,
    /// What of the surface lies inside moves with the paddle.
    pub region: Located<SolidSection>,
}

/// Which pairs of paddles are looked at.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PairsSection {
    /// "all" (the default), "none", or a list of pairs of indices.
    pub of: Option<Located<PairsOf>>,
}

/// All pairs, none, or some.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected \"all\", \"none\", or a list of pairs of paddle indices like [[1, 4], [2, 6]]")]
pub enum PairsOf {
    /// "all" or "none".
    Word(String),
    /// Pairs of paddle indices.
    List(Vec<Exactly<u32, 2>>),
}

/// How fine and by which method the tissue is modelled.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DiscretizationSection {
    /// Length of the edges where nothing asks for shorter ones. One of this, `tolerance` and `level`.
    pub spacing: Option<Located<f64>>,
    /// Relative error of the controllability measures to refine down to.
    pub tolerance: Option<Located<f64>>,
    /// Refinement level of graded meshes.
    pub level: Option<Located<i32>>,
    /// Kernel support over local spacing (default: 1.2 for scni-stabilised and mscni, 2 for the others).
    pub support: Option<Located<f64>>,
    /// Integration rule (default: scni-stabilised; placement to a tolerance takes fem-t10).
    pub integration: Option<Located<Integration>>,
    /// Basis of the shape functions (default linear).
    pub basis: Option<Basis>,
}

impl DiscretizationSection {
    /// Whether anything of the method is said.
    pub fn names_method(&self) -> bool {
        self.integration.is_some() || self.support.is_some() || self.basis.is_some()
    }
}

/// The JSON Schema of the scene file in space.
pub fn json_schema() -> Schema {
    schemars::schema_for!(SpaceSceneFile)
}
