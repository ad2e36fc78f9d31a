//! Scenes in three dimensions: the file format, its validation, and the validated scene.

mod bodies;
pub mod import;
mod in_file;
mod parts;
pub mod schema;
pub mod starter;
mod validate;

pub use in_file::{FilePlace, PartsInFile};

use super::error::{NoSuchPaddle, SceneError, Source};
use super::limits::{self, LimitError};
use super::schema::dimension_of;
use super::{Actuator, BUNDLED, BUNDLED_IN_SPACE, Scene, TissueVariant};
use crate::discretization::{Discretization, Integration, Method, Resolution};
use crate::geometry::{Implicit, Point, Solid};
use crate::material::Law;
use nalgebra::Matrix3x2;
use sha2::{Digest as _, Sha256};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A scene of either dimension.
#[derive(Debug, Clone)]
pub enum AnyScene {
    /// Plane strain.
    Planar(Box<Scene>),
    /// A solid.
    Space(Box<SpaceScene>),
}

impl AnyScene {
    /// Reads and validates a scene file; a bundled scene's name stands for the bundled text.
    ///
    /// # Errors
    /// [`SceneError`] says what is wrong, where, and what to do.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let file = match BUNDLED.iter().chain(&BUNDLED_IN_SPACE).find(|(name, _)| Path::new(name) == path) {
            Some((name, _)) if !path.is_file() => format!("<bundled {name}.toml>"),
            _ => path.display().to_string(),
        };
        Self::parse_in(&Scene::text(path)?, &file, path.parent().unwrap_or(Path::new("")))
    }

    /// Parses and validates the text of a scene; `file` is the name that errors show. Files that the scene names are
    /// relative to the current folder.
    ///
    /// # Errors
    /// [`SceneError`] says what is wrong, where, and what to do.
    pub fn parse(text: &str, file: &str) -> Result<Self, SceneError> {
        Self::parse_in(text, file, Path::new(""))
    }

    /// The same with files relative to a folder.
    fn parse_in(text: &str, file: &str, folder: &Path) -> Result<Self, SceneError> {
        match dimension_of(text) {
            Some(dimension) if *dimension.get() == 3 => {
                Ok(Self::Space(Box::new(validate::parse(Source { file, text }, folder)?)))
            }
            _ => Ok(Self::Planar(Box::new(Scene::parse(text, file)?))),
        }
    }
}

/// A validated scene in space.
///
/// # Example
/// ```
/// use model_offline::scene::space::SpaceScene;
///
/// let scene = SpaceScene::bundled("block").expect("bundled");
/// assert_eq!((scene.paddles.len(), scene.pairs.len()), (8, 28));
/// ```
#[derive(Debug, Clone)]
pub struct SpaceScene {
    /// Name used in reports.
    pub name: String,
    /// Label of the length unit.
    pub length_unit: String,
    /// Label of the stress unit.
    pub stress_unit: String,
    /// The body.
    pub body: Arc<dyn Implicit>,
    /// What the body is made of.
    pub material: Law,
    /// Regions of another stiffness or material; where several overlap, the last one counts.
    pub inclusions: Vec<SpaceInclusion>,
    /// Regions whose surface cannot move.
    pub immobile: Vec<Solid>,
    /// The needle.
    pub needle: SpaceNeedle,
    /// The point to hold still.
    pub target: Point<3>,
    /// The paddle positions to choose from.
    pub paddles: Vec<SpacePaddle>,
    /// Pairs of paddles to look at, by their places in the list.
    pub pairs: Vec<[usize; 2]>,
    /// Limits of the paddles' actuators.
    pub actuator: Actuator,
    /// How fine and by which method the tissue is modelled.
    pub discretization: Discretization,
    /// Whether that method is asked for by name. Otherwise it is the default, and placement may take another
    /// ([`for_placement`](Self::for_placement)).
    pub names_method: bool,
    /// The unit of length of the file that the body is of, where the file says it and it is another one than the scene's.
    pub unit_of_body: Option<&'static str>,
    /// SHA-256 over what the scene's text says and its files hold.
    pub(super) content: [u8; 32],
    /// What was changed or assumed in files that the scene names, a sentence each.
    pub notes: Vec<String>,
    /// Files that the scene names.
    pub files: Vec<PathBuf>,
    /// Where its parts stand in its file.
    pub in_file: PartsInFile,
}

/// A region of another stiffness or material.
#[derive(Debug, Clone)]
pub struct SpaceInclusion {
    /// The region.
    pub region: Arc<dyn Implicit>,
    /// Factor on the energy.
    pub stiffness: f64,
    /// A material of its own; the body's when absent.
    pub material: Option<Law>,
}

/// The needle.
#[derive(Debug, Clone)]
pub struct SpaceNeedle {
    /// What of the surface lies inside moves with it.
    pub region: Solid,
    /// Unit direction of insertion.
    pub axis: Point<3>,
    /// How far it goes.
    pub depth: f64,
    /// Into how many increments the insertion is divided.
    pub increments: u32,
    /// How fast it goes, length per second.
    pub speed: f64,
}

impl SpaceNeedle {
    /// N: an orthonormal basis of the plane orthogonal to the axis.
    pub fn orthogonal(&self) -> Matrix3x2<f64> {
        let mut seed = Point::<3>::zeros();
        seed[self.axis.iamin()] = 1.0;
        let first = (seed - self.axis * self.axis.dot(&seed)).normalize();
        Matrix3x2::from_columns(&[first, self.axis.cross(&first)])
    }
}

/// A paddle position.
#[derive(Debug, Clone)]
pub struct SpacePaddle {
    /// Its name in tables and reports.
    pub index: u32,
    /// What of the surface lies inside moves with it.
    pub region: Solid,
}

impl SpaceScene {
    /// The bundled scene of this name, if it is one in space.
    pub fn bundled(name: &str) -> Option<Self> {
        let (_, text) = BUNDLED_IN_SPACE.iter().find(|(bundled, _)| *bundled == name)?;
        match AnyScene::parse(text, name).ok()? {
            AnyScene::Space(scene) => Some(*scene),
            AnyScene::Planar(_) => None,
        }
    }

    /// The same scene in homogeneous tissue.
    #[must_use]
    pub fn without_inclusions(&self) -> Self {
        Self { inclusions: Vec::new(), ..self.clone() }
    }

    /// The same scene by another method.
    #[must_use]
    pub fn with_method(&self, method: Method) -> Self {
        Self { discretization: Discretization { method, ..self.discretization }, names_method: true, ..self.clone() }
    }

    /// The scene by the method that placement takes. Jacobians at rest are linear, and quadratic tetrahedra keep a tolerance of them on
    /// the cheapest models: where a tolerance is all that is asked for they are taken, as tables do and `fit`. What follows the
    /// needle keeps the default, whose nodal cells bear deformations that invert quadratic elements.
    #[must_use]
    pub fn for_placement(&self) -> Cow<'_, Self> {
        match self.discretization.resolution {
            Resolution::Tolerance(_) if !self.names_method => {
                Cow::Owned(self.with_method(Method::new(Integration::FemT10)))
            }
            _ => Cow::Borrowed(self),
        }
    }

    /// Its tissue: whether it has inclusions.
    pub fn tissue(&self) -> TissueVariant {
        if self.inclusions.is_empty() { TissueVariant::Homogeneous } else { TissueVariant::Inclusion }
    }

    /// Whether the body can be discretized as the scene says.
    ///
    /// # Errors
    /// [`LimitError`], the first number that is out of its range.
    pub fn check_discretization(&self) -> Result<(), LimitError> {
        let extent = self.body.bounds().map_or_else(|| Point::repeat(f64::INFINITY), |(low, high)| high - low);
        limits::check_in_space(&self.discretization, extent)
    }

    /// Where a paddle stands in the scene's list, by its index.
    ///
    /// # Errors
    /// [`NoSuchPaddle`] names those that there are.
    pub fn paddle_position(&self, index: u32) -> Result<usize, NoSuchPaddle> {
        NoSuchPaddle::find(index, self.paddles.iter().map(|paddle| paddle.index))
    }

    /// SHA-256 over everything that the model's numbers depend on: what the scene says and its files hold, whether its inclusions are
    /// there, and how it is discretised.
    pub fn hash(&self) -> [u8; 32] {
        let Discretization { resolution, method, .. } = self.discretization;
        let content = serde_json::json!([self.content, self.tissue(), resolution, method.integration, method.support]);
        Sha256::digest(content.to_string()).into()
    }

    /// Length of the diagonal of the body's bounding box.
    pub fn size(&self) -> f64 {
        self.body.bounds().map_or(f64::INFINITY, |(low, high)| (high - low).norm())
    }
}
