//! Scenes: the file format, its validation, and what other tools draw.

pub mod boundary;
mod effect;
mod error;
pub mod exactly;
mod facts;
pub mod import;
pub mod limits;
mod motion;
pub mod schema;
mod sensor;
mod shaft;
pub mod space;
pub mod starter;
mod tissue;
mod validate;
pub(crate) mod warning;

pub use effect::Effect;
pub use error::{NoSuchPaddle, SceneError};
pub use facts::{BodyFacts, InclusionFacts, MaterialFacts, NeedleFacts, PaddleFacts, SceneFacts, TargetFacts};
pub use limits::LimitError;
pub use motion::{Breathing, Motion, Surge};
pub use schema::{FitSection, PlantModel, TableScalar};
pub(crate) use sensor::millimetres;
pub use sensor::{IDEAL_NOISE_PER_DEPTH, Outages, Sensor, SensorPreset, UnknownLength};
pub use shaft::{Mechanics, Resistance, Shaft};
pub use tissue::TissueVariant;
pub use warning::SceneWarning;

use crate::discretization::{Discretization, Features};
use crate::geometry::{Point2, Polygon};
use crate::material::Law;
use crate::reading;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::path::Path;

/// The bundled planar scenes: name and text.
pub const BUNDLED: [(&str, &str); 7] = [
    ("paper", include_str!("../../scenes/paper.toml")),
    ("paper-hull", include_str!("../../scenes/paper-hull.toml")),
    ("breast", include_str!("../../scenes/breast.toml")),
    ("breast-world", include_str!("../../scenes/breast-world.toml")),
    ("prostate", include_str!("../../scenes/prostate.toml")),
    ("prostate-world", include_str!("../../scenes/prostate-world.toml")),
    ("tethered", include_str!("../../scenes/tethered.toml")),
];

/// The bundled scenes in space: name and text.
pub const BUNDLED_IN_SPACE: [(&str, &str); 3] = [
    ("block", include_str!("../../scenes/block.toml")),
    ("mound", include_str!("../../scenes/mound.toml")),
    ("scan", include_str!("../../scenes/scan.toml")),
];

/// All bundled scenes.
fn all_bundled() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    BUNDLED.iter().chain(&BUNDLED_IN_SPACE)
}

/// Files of a folder that are looked at for one that was meant.
const MOST_FILES: usize = 10_000;

/// A validated scene.
///
/// # Example
/// ```
/// use model_offline::Scene;
///
/// let scene = Scene::bundled("paper").expect("bundled");
/// assert_eq!(scene.paddles.len(), 5);
/// let error = Scene::parse("[scene]\nname = 1", "mine.toml").unwrap_err();
/// assert_eq!((error.line, error.column), (2, 8)); // where the text is wrong
/// ```
#[derive(Debug, Clone)]
pub struct Scene {
    /// Name used in reports and in the table.
    pub name: String,
    /// Label of the length unit.
    pub length_unit: String,
    /// Label of the stress unit.
    pub stress_unit: String,
    /// The body.
    pub outline: Polygon,
    /// Whether the file gives the outline clockwise: `outline` then runs through its vertices backwards.
    pub clockwise: bool,
    /// What the body is made of.
    pub material: Law,
    /// Regions of another stiffness or material; where several overlap, the last one counts.
    pub inclusions: Vec<Inclusion>,
    /// Polylines on the boundary that cannot move.
    pub immobile: Vec<Vec<Point2>>,
    /// The needle.
    pub needle: Needle,
    /// The point to hold still.
    pub target: Point2,
    /// The paddle positions to choose from.
    pub paddles: Vec<PaddlePosition>,
    /// Limits of the paddle's actuator.
    pub actuator: Actuator,
    /// What sees the target; not part of the tissue.
    pub sensor: Sensor,
    /// What moves the immobile part in a simulation; not part of the tissue.
    pub motion: Motion,
    /// How fine and by which method the tissue is modelled.
    pub discretization: Discretization,
    /// What else a fit to a tolerance has chosen; not part of the tissue.
    pub fit: Option<FitSection>,
    /// What the file has beside the boundary, and was put onto it.
    pub snapped: Vec<Snapped>,
}

/// Something that must lie on the boundary, and was put there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Snapped {
    /// What it is.
    pub what: String,
    /// How far it was off, length.
    pub by: f64,
}

/// A region of another stiffness or material.
#[derive(Debug, Clone)]
pub struct Inclusion {
    /// The region.
    pub outline: Polygon,
    /// Factor on the energy.
    pub stiffness: f64,
    /// A material of its own; the body's when absent.
    pub material: Option<Law>,
    /// What it resists a needle with, where that differs from the body.
    pub resistance: Option<Resistance>,
}

/// The needle.
#[derive(Debug, Clone)]
pub struct Needle {
    /// Polyline of tissue that moves with it.
    pub contact: Vec<Point2>,
    /// Unit direction of insertion.
    pub axis: Point2,
    /// How far it goes.
    pub depth: f64,
    /// Into how many increments the insertion is divided.
    pub increments: u32,
    /// How far off its line it is at its depth, length: it bends with the square of the depth. Tables do not know it.
    pub deflection: f64,
    /// How fast it goes, length per second, where that matters: to friction, and to tissue that relaxes.
    pub speed: f64,
    /// The shaft of a needle that slips; none where the tissue of the contact moves with it, as under skin that never gives
    /// way.
    pub shaft: Option<Shaft>,
}

impl Needle {
    /// Where it meets the body: the entry of a shaft, else the middle of the contact.
    pub fn entry(&self) -> Point2 {
        self.shaft.map_or_else(|| middle(&self.contact), |shaft| shaft.entry)
    }

    /// Length of the contact.
    pub fn contact_length(&self) -> f64 {
        polyline_length(&self.contact)
    }

    /// Unit vector orthogonal to the axis: the axis turned by 90°, signed so that its larger component is positive.
    pub fn orthogonal(&self) -> Point2 {
        let turned = Point2::new(-self.axis.y, self.axis.x);
        let larger = if turned.x.abs() >= turned.y.abs() { turned.x } else { turned.y };
        // Adding zero turns a negative zero into a positive one: reports show it.
        (turned * larger.signum()).map(|v| v + 0.0)
    }
}

fn polyline_length(path: &[Point2]) -> f64 {
    path.windows(2).map(|s| (s[1] - s[0]).norm()).sum()
}

/// The point half way along a polyline.
fn middle(path: &[Point2]) -> Point2 {
    let mut left = 0.5 * polyline_length(path);
    for s in path.windows(2) {
        let piece = (s[1] - s[0]).norm();
        if left <= piece {
            return s[0] + (s[1] - s[0]) * (left / piece);
        }
        left -= piece;
    }
    path[0]
}

/// A paddle position.
#[derive(Debug, Clone, PartialEq)]
pub struct PaddlePosition {
    /// Its name in tables and reports.
    pub index: u32,
    /// The two ends, both on the boundary.
    pub segment: [Point2; 2],
}

/// Limits of the paddle's actuator.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Actuator {
    /// Largest paddle displacement, length units.
    pub max_displacement: f64,
    /// Largest paddle speed, length units per second.
    pub max_rate: f64,
    /// Fastest needle the controller keeps compensating, length units per second.
    pub max_needle_speed: f64,
}

impl Scene {
    /// Reads and validates a scene file; a bundled scene's name stands for the bundled text.
    ///
    /// # Errors
    /// [`SceneError`] says what is wrong, where, and what to do.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let file = match Self::bundled_at(path) {
            Some((name, _)) => format!("<bundled {name}.toml>"),
            None => path.display().to_string(),
        };
        Self::parse(&Self::text(path)?, &file)
    }

    fn bundled_at(path: &Path) -> Option<&'static (&'static str, &'static str)> {
        if path.is_file() { None } else { all_bundled().find(|(name, _)| Path::new(name) == path) }
    }

    /// The bundled scene that a name was meant for: a letter or two differ, or it has a folder or an ending too many.
    fn nearly_bundled(path: &Path) -> Option<&'static str> {
        let word = path.file_stem()?.to_str()?.to_lowercase();
        error::nearest(&word, all_bundled().map(|(name, _)| *name))
    }

    /// The file beside it that a path was meant for.
    fn nearly_there(path: &Path) -> Option<String> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let beside = std::fs::read_dir(folder).ok()?.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        let beside: Vec<String> = beside.take(MOST_FILES).filter(|name| name.ends_with(".toml")).collect();
        let word = path.file_name()?.to_str()?;
        let meant = error::nearest(word, beside.iter().map(String::as_str))?;
        Some(path.with_file_name(meant).display().to_string())
    }

    /// The text of a scene file, or of a bundled scene, not yet parsed.
    ///
    /// # Errors
    /// [`SceneError`] when there is no such file, or it is no text.
    pub fn text(path: &Path) -> Result<String, SceneError> {
        if let Some((_, text)) = Self::bundled_at(path) {
            return Ok((*text).to_owned());
        }
        let file = path.display().to_string();
        let bytes = reading::read(path, reading::TEXT).map_err(|error| {
            let known: Vec<&str> = all_bundled().map(|b| b.0).collect();
            let meant = Self::nearly_bundled(path).map(str::to_owned).or_else(|| Self::nearly_there(path));
            let meant = meant.filter(|_| !path.exists());
            let meant = meant.map_or_else(String::new, |name| format!("did you mean `{name}`? "));
            error::Source { file: &file, text: "" }.error(
                0..0,
                format!("cannot read the scene: {error}"),
                format!("{meant}give the path of a scene file, or one of the bundled scenes: {}", known.join(", ")),
            )
        })?;
        String::from_utf8(bytes).map_err(|error| {
            let valid = error.utf8_error().valid_up_to();
            let text = String::from_utf8_lossy(&error.as_bytes()[..valid]).into_owned();
            error::Source { file: &file, text: &text }.error(
                valid..valid,
                "this is not a text file: the next byte is not valid UTF-8",
                "a scene is a TOML text file; see `model-offline schema` and the bundled scenes",
            )
        })
    }

    /// Parses and validates the text of a scene; `file` is the name that errors show.
    ///
    /// # Errors
    /// [`SceneError`] says what is wrong, where, and what to do.
    pub fn parse(text: &str, file: &str) -> Result<Self, SceneError> {
        validate::parse(error::Source { file, text })
    }

    /// The bundled scene of this name.
    pub fn bundled(name: &str) -> Option<Self> {
        let (_, text) = BUNDLED.iter().find(|(bundled, _)| *bundled == name)?;
        Self::parse(text, name).ok()
    }

    /// The same scene in homogeneous tissue.
    #[must_use]
    pub fn without_inclusions(&self) -> Self {
        Self { inclusions: Vec::new(), ..self.clone() }
    }

    /// The geometry that nodes are fitted to.
    pub fn features(&self) -> Features {
        Features {
            outline: self.outline.clone(),
            inclusions: self.inclusion_outlines(),
            immobile: self.immobile.clone(),
            contact: self.needle.contact.clone(),
            paddles: self.paddles.iter().map(|p| p.segment).collect(),
            target: self.target,
            shaft: self.needle.shaft.map(|shaft| [shaft.entry, shaft.entry + self.needle.axis * self.needle.depth]),
        }
    }

    /// What the tissue at a point resists a needle with: the last inclusion there that says so, else the body.
    pub fn resistance_at(&self, x: Point2, shaft: &Shaft) -> Resistance {
        let there = self.inclusions.iter().rev().filter(|inclusion| inclusion.outline.contains(x));
        there.filter_map(|inclusion| inclusion.resistance).next().unwrap_or(shaft.resistance)
    }

    /// The same scene, discretized otherwise.
    #[must_use]
    pub fn with_discretization(&self, discretization: Discretization) -> Self {
        Self { discretization, ..self.clone() }
    }

    /// How far along the needle the target lies from its entry, and how far off its line.
    pub fn target_from_needle(&self) -> (f64, f64) {
        let way = self.target - self.needle.entry();
        (way.dot(&self.needle.axis), way.dot(&self.needle.orthogonal()).abs())
    }

    /// The regions of the inclusions.
    pub fn inclusion_outlines(&self) -> Vec<Polygon> {
        self.inclusions.iter().map(|i| i.outline.clone()).collect()
    }

    /// Where a paddle stands in the scene's list, by its index.
    ///
    /// # Errors
    /// [`NoSuchPaddle`] names those that there are.
    pub fn paddle_position(&self, index: u32) -> Result<usize, NoSuchPaddle> {
        NoSuchPaddle::find(index, self.paddles.iter().map(|paddle| paddle.index))
    }

    /// Its tissue: whether it has inclusions.
    pub fn tissue(&self) -> TissueVariant {
        if self.inclusions.is_empty() { TissueVariant::Homogeneous } else { TissueVariant::Inclusion }
    }

    /// Whether stress relaxes anywhere in it.
    pub fn relaxes(&self) -> bool {
        let of_inclusions = self.inclusions.iter().filter_map(|inclusion| inclusion.material.as_ref());
        [&self.material].into_iter().chain(of_inclusions).any(|law| law.relaxation().is_some())
    }

    /// What it has besides a contact that moves with the needle in elastic tissue at rest, in words.
    pub fn effects(&self) -> Vec<&'static str> {
        let Motion { breathing, surge, recorded } = &self.motion;
        [
            (self.needle.shaft.is_some(), "a needle that slips"),
            (self.needle.deflection != 0.0, "a needle that bends"),
            (self.relaxes(), "tissue that creeps"),
            (breathing.is_some(), "a patient that breathes"),
            (surge.is_some(), "a cough"),
            (!recorded.is_empty(), "a recorded motion"),
        ]
        .into_iter()
        .filter_map(|(is_there, name)| is_there.then_some(name))
        .collect()
    }

    /// Whether its state in a simulation depends on what was before, or on the time, and not on needle and paddle alone.
    pub fn has_a_past(&self) -> bool {
        self.needle.shaft.is_some() || self.relaxes() || !self.motion.is_none() || self.needle.deflection != 0.0
    }

    /// The same scene as a controller's model would have it at its simplest: the contact moves with the needle, nothing relaxes,
    /// nobody breathes.
    #[must_use]
    pub fn without_a_past(&self) -> Self {
        let elastic = |inclusion: &Inclusion| Inclusion {
            material: inclusion.material.as_ref().map(Law::elastic),
            resistance: None,
            ..inclusion.clone()
        };
        Self {
            material: self.material.elastic(),
            inclusions: self.inclusions.iter().map(elastic).collect(),
            needle: Needle { shaft: None, deflection: 0.0, ..self.needle.clone() },
            motion: Motion::default(),
            ..self.clone()
        }
    }

    /// SHA-256 over everything that the model's numbers depend on, with the discretization.
    pub fn hash(&self) -> [u8; 32] {
        let point = |p: &Point2| [p.x, p.y];
        let path = |p: &[Point2]| p.iter().map(point).collect::<Vec<_>>();
        let mut content = serde_json::json!({
            "outline": path(self.outline.vertices()),
            "material": self.material,
            "inclusions": self.inclusions.iter()
                .map(|i| serde_json::json!([path(i.outline.vertices()), i.stiffness, i.material]))
                .collect::<Vec<_>>(),
            "immobile": self.immobile.iter().map(|p| path(p)).collect::<Vec<_>>(),
            "needle": [
                serde_json::json!(path(&self.needle.contact)), serde_json::json!(point(&self.needle.axis)),
                serde_json::json!(self.needle.depth), serde_json::json!(self.needle.increments)],
            "target": point(&self.target),
            "paddles": self.paddles.iter().map(|p| serde_json::json!([p.index, path(&p.segment)])).collect::<Vec<_>>(),
            "actuator": self.actuator,
            "discretization": {
                "resolution": self.discretization.resolution, "support": self.discretization.method.support,
                "integration": self.discretization.method.integration, "basis": self.discretization.method.basis,
                "essential": self.discretization.essential,
            },
        });
        // Scenes without a shaft keep the hashes that recordings and tables know.
        if self.relaxes() {
            content["speed"] = serde_json::json!(self.needle.speed);
        }
        if let Some(shaft) = &self.needle.shaft {
            let inclusions: Vec<_> = self.inclusions.iter().map(|inclusion| inclusion.resistance).collect();
            content["shaft"] = serde_json::json!([shaft, inclusions]);
        }
        Sha256::digest(content.to_string()).into()
    }
}
