//! The scene file as it is written: the public contract, field for field. Validation turns it into a
//! [`Scene`](super::Scene).

use super::boundary::{BoundaryPath, BoundarySegment};
use super::effect::Effect;
use super::exactly::{Coordinates, Exactly};
use super::sensor::SensorPreset;
use super::shaft::Mechanics;
use crate::choice::choice;
use crate::discretization::{Basis, Essential, Integration};
use crate::material::MaterialSection;
use firmware::scalar::ScalarKind;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::ops::Range;

/// A value together with where it stands in the file, so that an error can point at it.
#[derive(Debug, Clone, Deserialize)]
#[serde(transparent)]
pub struct Located<T: serde::de::DeserializeOwned>(#[serde(deserialize_with = "deserialize_spanned")] toml::Spanned<T>);

fn deserialize_spanned<'de, D, T>(deserializer: D) -> Result<toml::Spanned<T>, D::Error>
where
    D: serde::Deserializer<'de>,
    T: serde::de::DeserializeOwned,
{
    toml::Spanned::<T>::deserialize(deserializer)
}

impl<T: serde::de::DeserializeOwned> Located<T> {
    /// Bytes of the file that the value was read from.
    pub fn span(&self) -> Range<usize> {
        self.0.span()
    }

    /// The value.
    pub fn get(&self) -> &T {
        self.0.get_ref()
    }
}

impl<T: serde::de::DeserializeOwned + JsonSchema> JsonSchema for Located<T> {
    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }
    // What tells types of one name apart.
    fn schema_id() -> Cow<'static, str> {
        T::schema_id()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::json_schema(generator)
    }
    fn inline_schema() -> bool {
        T::inline_schema()
    }
}

/// A scene: a body of soft tissue, a needle, a target and the paddle positions to choose from. All numbers are in
/// the scene's own consistent units.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Stillpoint scene")]
pub struct SceneFile {
    /// Name, dimension and unit labels.
    pub scene: SceneSection,
    /// The body.
    pub domain: DomainSection,
    /// What the body is made of.
    pub material: Located<MaterialSection>,
    /// Regions of another stiffness or material.
    #[serde(default)]
    pub inclusion: Vec<Located<InclusionSection>>,
    /// The part of the boundary that cannot move.
    pub immobile: ImmobileSection,
    /// The needle: which tissue moves with it, where to, and how far.
    pub needle: NeedleSection,
    /// The point to hold still.
    pub target: TargetSection,
    /// The paddle positions to choose from.
    #[serde(default)]
    pub paddle: Vec<Located<PaddleSection>>,
    /// Limits of the paddle's actuator.
    #[serde(default)]
    pub actuator: ActuatorSection,
    /// What sees the target in a simulation (default: ultrasound where the unit of length is known, else ideal).
    #[serde(default)]
    pub sensor: SensorSection,
    /// What moves the immobile part in a simulation (default: nothing).
    #[serde(default)]
    pub motion: MotionSection,
    /// How fine and by which method the tissue is modelled.
    pub discretization: Located<DiscretizationSection>,
    /// What else a fit to a tolerance has chosen.
    pub fit: Option<Located<FitSection>>,
}

/// The dimension that a scene's text says, and where, if it says one: what else may stand there depends on it.
pub(super) fn dimension_of(text: &str) -> Option<Located<u32>> {
    #[derive(Deserialize)]
    struct Peek {
        scene: Dimension,
    }
    #[derive(Deserialize)]
    struct Dimension {
        dimension: Located<u32>,
    }
    toml::from_str::<Peek>(text).ok().map(|peek| peek.scene.dimension)
}

/// Name, dimension and unit labels.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneSection {
    /// Name used in reports and in the table.
    #[serde(deserialize_with = "label")]
    pub name: String,
    /// 2 = plane strain; 3 = solid, whose scenes have another schema (`model-offline schema --dimension 3`).
    pub dimension: Located<u32>,
    /// Labels for reports; presets of sensors and materials are converted to them, no other number is.
    #[serde(default)]
    pub units: UnitsSection,
}

/// Unit labels: what presets are converted to; no other number is.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct UnitsSection {
    /// Length unit, e.g. "mm".
    #[serde(default = "one", deserialize_with = "label")]
    pub length: String,
    /// Stress unit, e.g. "kPa".
    #[serde(default = "one", deserialize_with = "label")]
    pub stress: String,
}

/// A text that is shown as it is: without characters that a terminal obeys.
fn label<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    let text = String::deserialize(deserializer)?;
    if text.chars().any(char::is_control) {
        return Err(serde::de::Error::custom(
            "a control character is in it, which a terminal would obey; leave it out",
        ));
    }
    Ok(text)
}

fn one() -> String {
    "1".to_owned()
}

impl Default for UnitsSection {
    fn default() -> Self {
        Self { length: one(), stress: one() }
    }
}

/// The body.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DomainSection {
    /// Simple polygon, either orientation.
    pub outline: Located<Vec<Coordinates<2>>>,
}

/// A region of another stiffness or material.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InclusionSection {
    /// Simple polygon, either orientation.
    pub outline: Located<Vec<Coordinates<2>>>,
    /// Factor on the energy (default 1).
    #[serde(default = "unit_stiffness")]
    pub stiffness: Located<f64>,
    /// A material of its own; the body's when absent.
    pub material: Option<Located<MaterialSection>>,
    /// Force at which the tip of a shaft cuts (default, like the others: the needle's).
    pub cutting_force: Option<Located<f64>>,
    /// Friction per length up to which tissue sticks to a shaft.
    pub static_friction: Option<Located<f64>>,
    /// Friction per length of a shaft that slides infinitely slowly.
    pub kinetic_friction: Option<Located<f64>>,
    /// What a sliding shaft adds per length and speed.
    pub viscous_friction: Option<Located<f64>>,
}

fn unit_stiffness() -> Located<f64> {
    Located(toml::Spanned::new(0..0, 1.0))
}

/// The part of the boundary that cannot move.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImmobileSection {
    /// Polylines on the boundary, or edges of the outline.
    pub paths: Vec<Located<BoundaryPath>>,
}

/// The needle.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NeedleSection {
    /// Polyline of tissue that moves with the needle, on the boundary or inside, or a part of an edge of the outline.
    pub contact: Located<BoundaryPath>,
    /// Direction of insertion; normalised on reading.
    pub axis: Located<Coordinates<2>>,
    /// How far the needle goes, length units.
    pub depth: Located<f64>,
    /// Into how many increments the insertion is divided (default 10).
    #[serde(default = "ten")]
    pub increments: Located<u32>,
    /// How it meets the tissue (default patch: the tissue of the contact moves with it).
    #[serde(default)]
    pub mechanics: Mechanics,
    /// Where a shaft enters the body (default: the middle of the contact).
    pub entry: Option<Located<Coordinates<2>>>,
    /// Radius of a shaft, length units (default: a hundredth of the depth).
    pub radius: Option<Located<f64>>,
    /// Length behind the tip that the cutting force is spread over, length units (default: twice the radius).
    pub tip_length: Option<Located<f64>>,
    /// Force on the contact at which a shaft punctures the skin, force (per unit thickness in the plane; default 0; inf: never).
    pub puncture_force: Option<Located<f64>>,
    /// Force at which a shaft's tip cuts (default 0).
    pub cutting_force: Option<Located<f64>>,
    /// Friction per length up to which tissue sticks to a shaft (default: what sliding takes).
    pub static_friction: Option<Located<f64>>,
    /// Friction per length of a shaft that slides infinitely slowly (default 0).
    pub kinetic_friction: Option<Located<f64>>,
    /// What a sliding shaft adds per length and speed (default 0).
    pub viscous_friction: Option<Located<f64>>,
    /// How far off its line the needle is at its depth, length units: it bends with the square of the depth, to the side of
    /// larger coordinates, in a simulation whose tables do not know it (default 0).
    pub deflection: Option<Located<f64>>,
    /// Speed of the insertion, length units per second, where that matters: to friction along a shaft, and to tissue that
    /// relaxes (default: the depth in five seconds).
    pub speed: Option<Located<f64>>,
}

/// What moves the immobile part in a simulation, from the start of the needle on.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MotionSection {
    /// Breathing, from the end of an exhalation on.
    pub breathing: Option<BreathingSection>,
    /// A cough, or a jerk: there and back once.
    pub surge: Option<SurgeSection>,
    /// A recorded motion: rows of time in s and displacement x, y, linear between them, its ends held.
    pub recorded: Option<Located<Vec<Exactly<f64, 3>>>>,
}

/// Breathing: `amplitude · (1 − cos⁴(π t / period))`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BreathingSection {
    /// Seconds per breath.
    pub period: Located<f64>,
    /// From exhaled to inhaled, length units.
    pub amplitude: Located<f64>,
    /// Where the body goes with the breath; normalised on reading.
    pub direction: Located<Coordinates<2>>,
    /// Each breath takes up to this part longer or shorter, 0 (the default) to 0.5.
    pub period_variation: Option<Located<f64>>,
    /// Each breath is up to this part larger or smaller, 0 (the default) to 0.5.
    pub amplitude_variation: Option<Located<f64>>,
}

/// A cough, or a jerk: `amplitude · sin²(π (t − at) / last)` while it lasts.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurgeSection {
    /// Seconds after the start of the needle.
    pub at: Located<f64>,
    /// Seconds that it lasts.
    pub last: Located<f64>,
    /// Its largest displacement, length units.
    pub amplitude: Located<f64>,
    /// Where the body goes; normalised on reading.
    pub direction: Located<Coordinates<2>>,
}

fn ten() -> Located<u32> {
    Located(toml::Spanned::new(0..0, 10))
}

/// The point to hold still.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TargetSection {
    /// Where it is before the insertion.
    pub position: Located<Coordinates<2>>,
}

/// A paddle position.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PaddleSection {
    /// Its name in tables and reports.
    pub index: u32,
    /// The two ends, both on the boundary, or a part of an edge of the outline.
    pub segment: Located<BoundarySegment>,
}

/// Limits of the paddle's actuator.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ActuatorSection {
    /// Largest paddle displacement, length units (default: the insertion depth).
    pub max_displacement: Option<Located<f64>>,
    /// Largest paddle speed, length units per second (default: the insertion depth per second).
    pub max_rate: Option<Located<f64>>,
    /// Fastest needle the controller keeps compensating, length units per second (default: twice the depth per second).
    pub max_needle_speed: Option<Located<f64>>,
}

/// What sees the target in a simulation: a preset, and numbers of its own in place of the preset's.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorSection {
    /// Where the numbers come from that are not given (default: ultrasound where the unit of length is known, else ideal).
    pub preset: Option<Located<SensorPreset>>,
    /// Measurements per second.
    pub rate: Option<Located<f64>>,
    /// Time from a measurement to its arrival, s.
    pub latency: Option<Located<f64>>,
    /// Standard deviation of each component, length units.
    pub noise: Option<Located<f64>>,
    /// Step of what it reports, length units.
    pub quantisation: Option<Located<f64>>,
    /// Added to every measurement, length units.
    pub bias: Option<Located<Coordinates<2>>>,
    /// Times without measurements, which begin at random.
    pub outages: Option<Located<OutagesSection>>,
}

/// Times without measurements.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OutagesSection {
    /// Mean time from the end of one to the beginning of the next, s.
    pub every: Located<f64>,
    /// How long each lasts, s.
    pub last: Located<f64>,
}

/// How fine and by which method the tissue is modelled.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DiscretizationSection {
    /// Node spacing, length units. Either this or `tolerance`.
    pub spacing: Option<Located<f64>>,
    /// Relative error of the controllability measures to refine down to. Either this or `spacing`. In the plane, paddles that no
    /// table can be made of are left out where their measures are not known to a tenth or the tolerance is not reached with them.
    pub tolerance: Option<Located<f64>>,
    /// Refinement level of graded nodes, in place of both: what a fit to a tolerance has found.
    pub level: Option<Located<i32>>,
    /// Kernel support over local spacing (default: 1.49 for scni-stabilised and mscni, 2 for the others).
    pub support: Option<Located<f64>>,
    /// Integration rule (default scni-stabilised).
    pub integration: Option<Integration>,
    /// Basis of the shape functions (default linear).
    #[serde(default)]
    pub basis: Basis,
    /// How essential boundary conditions are imposed (default transformation).
    #[serde(default)]
    pub essential: Essential,
}

choice! {
    /// What stands in for the tissue in a simulation.
    pub enum PlantModel {
        /// The full nonlinear model, solved anew at every step.
        Full,
        /// The reduced nonlinear model, with the full one where it does not hold.
        Reduced,
        /// The linear model, statically condensed.
        Condensed,
    }
}

choice! {
    /// Number type of a table's payload, and of the controller that reads it.
    #[derive(Default)]
    pub enum TableScalar {
        /// Single precision.
        F32,
        /// Double precision.
        #[default]
        F64,
    }
}

impl TableScalar {
    /// As tables name it.
    pub const fn kind(self) -> ScalarKind {
        match self {
            Self::F32 => ScalarKind::F32,
            Self::F64 => ScalarKind::F64,
        }
    }
}

/// What a fit to a tolerance has chosen besides the discretization.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitSection {
    /// What the simulator solves.
    pub plant: PlantModel,
    /// Largest error of the target displacement that a reduced plant may have, over its largest value (default: as without
    /// a fit).
    #[serde(default, deserialize_with = "relative_error", skip_serializing_if = "Option::is_none")]
    pub plant_tolerance: Option<f64>,
    /// Depth knots of the controller's table.
    pub table_knots: u32,
    /// Number type that the controller needs.
    pub table_scalar: TableScalar,
    /// Those of the scene's effects that a model of it needs at the tolerance; none where the scene has none. Simulations
    /// take all that the scene has, whatever stands here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effects: Option<Vec<Effect>>,
}

fn relative_error<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    let value = f64::deserialize(deserializer)?;
    if value > 0.0 && value < 1.0 {
        Ok(Some(value))
    } else {
        Err(serde::de::Error::custom(format!("{value} is no relative error: give a number between 0 and 1")))
    }
}

/// The JSON Schema of the scene file.
pub fn json_schema() -> Schema {
    schemars::schema_for!(SceneFile)
}
