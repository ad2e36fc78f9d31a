//! The messages of runs, as files and live connections have them: JSON, each kind with its JSON Schema.
//!
//! | topic | message |
//! |---|---|
//! | `/needle`, `/target`, `/paddle`, `/second_paddle` | a sample, with the time of its measurement |
//! | `/command` | a command of the controller |
//! | `/truth` | what really happened at a tick of the plant |
//! | `/needle_forces` | what a needle that slips met at a moment |
//! | `/scene/rest`, `/scene`, `/tf` | what is to be seen, in [Foxglove's schemas](super::foxglove) |
//! | `/pose/needle`, `/pose/target` | where the needle's contact is, x along the insertion, and where the target is |
//! | `/scene/body` | in space the deformed body |
//! | `/log` | a change of the controller's mode or faults, in Foxglove's schema |

use firmware::contract::{PaddleCommand, PaddleSample};
use firmware::{Faults, Inputs, Mode};
use model_offline::needle::{NeedleReading, StationState};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;

use super::csv::Series;
use super::foxglove::{self, FrameTransform, Log, PoseInFrame, SceneUpdate, Scenery};
use crate::world::truth::Truth;

/// A sample of the needle's encoder.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct NeedleMessage {
    /// Number of the sample.
    pub sequence: u32,
    /// Time of the measurement, s.
    pub measured_s: f64,
    /// Depth, length.
    pub depth: f64,
    /// Velocity, length/s.
    pub velocity: f64,
}

/// A sample of the target sensor.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct TargetMessage {
    /// Number of the sample.
    pub sequence: u32,
    /// Time of the measurement, s.
    pub measured_s: f64,
    /// Measured displacement along x, length.
    pub x: f64,
    /// Measured displacement along y, length.
    pub y: f64,
    /// Measured displacement along z, length; in space.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z: Option<f64>,
}

/// A sample of the paddle's encoder.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct PaddleMessage {
    /// Number of the sample.
    pub sequence: u32,
    /// Time of the measurement, s.
    pub measured_s: f64,
    /// Index of the attached paddle.
    pub paddle_index: u32,
    /// Displacement along x, length.
    pub x: f64,
    /// Displacement along y, length.
    pub y: f64,
    /// Displacement along z, length; in space.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z: Option<f64>,
}

/// A command of the controller.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct CommandMessage {
    /// Tick.
    pub tick: u64,
    /// RUN, HOLD or SAFE.
    pub state: String,
    /// Faults present, by name.
    pub faults: String,
    /// Commanded displacement along x, length; missing before the paddle's place is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x: Option<f64>,
    /// Commanded displacement along y, length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y: Option<f64>,
    /// Commanded displacement along z, length; in space.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z: Option<f64>,
    /// Commanded displacement of the second paddle along x, length; where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_x: Option<f64>,
    /// The same along y, length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_y: Option<f64>,
    /// The same along z, length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_z: Option<f64>,
}

/// What really happened, which the controller does not see.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct TruthMessage {
    /// Tick.
    pub tick: u64,
    /// Needle depth, length.
    pub depth: f64,
    /// Target displacement along x, length.
    pub target_x: f64,
    /// Target displacement along y, length.
    pub target_y: f64,
    /// Target displacement along z, length; in space.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_z: Option<f64>,
    /// Target displacement orthogonal to the needle, length: with a sign in the plane, its norm in space.
    pub orthogonal_error: f64,
    /// Paddle displacement along x, length.
    pub paddle_x: f64,
    /// Paddle displacement along y, length.
    pub paddle_y: f64,
    /// Paddle displacement along z, length; in space.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paddle_z: Option<f64>,
    /// Displacement of the second paddle along x, length; where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_paddle_x: Option<f64>,
    /// The same along y, length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_paddle_y: Option<f64>,
    /// The same along z, length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_paddle_z: Option<f64>,
}

/// Forces on a needle that slips, by the full model, per unit thickness: positive where they push it in.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct NeedleForcesMessage {
    /// Needle depth, length.
    pub depth: f64,
    /// Force at the base: that of the tip and of the shaft.
    pub base_force: f64,
    /// Force of the tip.
    pub tip_force: f64,
    /// Friction all along the shaft.
    pub friction: f64,
    /// Length of tissue that the tip has passed, length; missing while the skin holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut_length: Option<f64>,
    /// The shaft from the entry to the tip: arc length, slip, friction and normal force per length.
    pub shaft: Vec<StationState>,
}

/// A schema as Foxglove and Lichtblick read them: nothing defined elsewhere, one type for everything, every item described, and
/// of every object what it has, be it nothing.
fn schema_of<T: JsonSchema>() -> schemars::Schema {
    fn plain(value: &mut serde_json::Value) {
        if let serde_json::Value::Object(object) = value {
            // What may be missing has the type that it has when it is there.
            if let Some(serde_json::Value::Array(types)) = object.get("type") {
                let there = types.iter().find(|name| *name != "null").cloned();
                object.extend(there.map(|name| ("type".to_owned(), name)));
            }
            if object.get("type").is_some_and(|name| name == "object") {
                object.entry("properties").or_insert_with(|| serde_json::json!({}));
            }
            object.values_mut().for_each(plain);
        } else if let serde_json::Value::Array(items) = value {
            items.iter_mut().for_each(plain);
        }
    }
    let generator = SchemaSettings::default().with(|settings| settings.inline_subschemas = true).into_generator();
    let mut schema = generator.into_root_schema_for::<T>().to_value();
    plain(&mut schema);
    schemars::Schema::try_from(schema).unwrap_or_default()
}

/// Topic, name of the schema and schema of every kind of message.
pub fn schemas() -> [(&'static str, &'static str, schemars::Schema); 14] {
    [
        ("/needle", "stillpoint.NeedleMessage", schema_of::<NeedleMessage>()),
        ("/target", "stillpoint.TargetMessage", schema_of::<TargetMessage>()),
        ("/paddle", "stillpoint.PaddleMessage", schema_of::<PaddleMessage>()),
        ("/second_paddle", "stillpoint.PaddleMessage", schema_of::<PaddleMessage>()),
        ("/command", "stillpoint.CommandMessage", schema_of::<CommandMessage>()),
        ("/truth", "stillpoint.TruthMessage", schema_of::<TruthMessage>()),
        ("/needle_forces", "stillpoint.NeedleForcesMessage", schema_of::<NeedleForcesMessage>()),
        ("/scene/rest", "foxglove.SceneUpdate", schema_of::<SceneUpdate>()),
        ("/scene", "foxglove.SceneUpdate", schema_of::<SceneUpdate>()),
        ("/pose/needle", "foxglove.PoseInFrame", schema_of::<PoseInFrame>()),
        ("/pose/target", "foxglove.PoseInFrame", schema_of::<PoseInFrame>()),
        ("/tf", "foxglove.FrameTransform", schema_of::<FrameTransform>()),
        ("/log", "foxglove.Log", schema_of::<Log>()),
        ("/scene/body", "foxglove.SceneUpdate", schema_of::<SceneUpdate>()),
    ]
}

fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1e-9
}

/// Where messages go.
pub trait MessageSink {
    /// Why one cannot go there.
    type Refusal;

    /// Takes a message of this topic with its log time and its publish time, ns.
    ///
    /// # Errors
    /// As the sink has them.
    fn take(&mut self, topic: &'static str, times_ns: [u64; 2], message: &impl Serialize) -> Result<(), Self::Refusal>;
}

/// The samples that a controller of D dimensions was given in a tick.
///
/// # Errors
/// Those of the sink, here and below.
pub fn samples<S: MessageSink, const D: usize>(sink: &mut S, inputs: &Inputs) -> Result<(), S::Refusal> {
    let third = |z: f64| (D > 2).then_some(z);
    let now = inputs.time_ns;
    if let Some(s) = &inputs.needle {
        let measured_s = seconds(s.time_ns);
        let message = NeedleMessage { sequence: s.sequence, measured_s, depth: s.depth, velocity: s.velocity };
        sink.take("/needle", [now, s.time_ns], &message)?;
    }
    if let Some(s) = &inputs.target {
        let ([x, y, z], measured_s) = (s.displacement, seconds(s.time_ns));
        let message = TargetMessage { sequence: s.sequence, measured_s, x, y, z: third(z) };
        sink.take("/target", [now, s.time_ns], &message)?;
    }
    for (topic, sample) in ["/paddle", "/second_paddle"].into_iter().zip(&inputs.paddles) {
        let Some(s) = sample else { continue };
        let ([x, y, z], measured_s) = (s.displacement, seconds(s.time_ns));
        let PaddleSample { sequence, paddle_index, .. } = *s;
        let message = PaddleMessage { sequence, measured_s, paddle_index, x, y, z: third(z) };
        sink.take(topic, [now, s.time_ns], &message)?;
    }
    Ok(())
}

/// The command of a tick at this time, ns.
///
/// # Errors
/// Those of the sink.
pub fn command<S: MessageSink, const D: usize, const N: usize>(
    sink: &mut S,
    (tick, time_ns): (u64, u64),
    command: &PaddleCommand,
    series: &Series<'_, D, N>,
) -> Result<(), S::Refusal> {
    let third = |z: f64| (D > 2).then_some(z);
    let [place, second] = command.displacement.map(|place| command.is_valid().then_some(place));
    let second = second.filter(|_| series.paddles > 1);
    let message = CommandMessage {
        tick,
        state: Mode::from_wire(command.state).map_or("?", Mode::name).to_owned(),
        faults: Faults::from_bits(command.faults).to_string(),
        x: place.map(|place| place[0]),
        y: place.map(|place| place[1]),
        z: place.and_then(|place| third(place[2])),
        second_x: second.map(|place| place[0]),
        second_y: second.map(|place| place[1]),
        second_z: second.and_then(|place| third(place[2])),
    };
    sink.take("/command", [time_ns; 2], &message)
}

/// What the needle met at a moment, ns.
///
/// # Errors
/// Those of the sink.
pub fn forces<S: MessageSink>(sink: &mut S, time_ns: u64, reading: &NeedleReading) -> Result<(), S::Refusal> {
    let message = NeedleForcesMessage {
        depth: reading.depth,
        base_force: reading.base_force,
        tip_force: reading.tip_force,
        friction: reading.friction(),
        cut_length: reading.cut_length,
        shaft: reading.shaft.clone(),
    };
    sink.take("/needle_forces", [time_ns; 2], &message)
}

/// What really happened at a tick.
///
/// # Errors
/// Those of the sink.
pub fn truth<S: MessageSink, const D: usize, const N: usize>(
    sink: &mut S,
    truth: &Truth,
    series: &Series<'_, D, N>,
) -> Result<(), S::Refusal> {
    let third = |z: f64| (D > 2).then_some(z);
    let [paddle, second] = truth.paddles;
    let second = Some(second).filter(|_| series.paddles > 1);
    let message = TruthMessage {
        tick: truth.tick,
        depth: truth.depth,
        target_x: truth.target[0],
        target_y: truth.target[1],
        target_z: third(truth.target[2]),
        orthogonal_error: series.error(truth),
        paddle_x: paddle[0],
        paddle_y: paddle[1],
        paddle_z: third(paddle[2]),
        second_paddle_x: second.map(|place| place[0]),
        second_paddle_y: second.map(|place| place[1]),
        second_paddle_z: second.and_then(|place| third(place[2])),
    };
    sink.take("/truth", [truth.time_ns; 2], &message)
}

/// What a controller says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Said {
    /// Its mode, as commands have it.
    pub mode: u32,
    /// Bit set of its faults.
    pub faults: u64,
}

impl From<&PaddleCommand> for Said {
    fn from(command: &PaddleCommand) -> Self {
        Self { mode: command.state, faults: command.faults }
    }
}

/// A line of what the controller says from this time on, ns.
///
/// # Errors
/// Those of the sink.
pub fn log<S: MessageSink>(sink: &mut S, time_ns: u64, said: Said) -> Result<(), S::Refusal> {
    let mode = Mode::from_wire(said.mode);
    let level = match mode {
        Some(Mode::Safe) | None => 4,
        Some(Mode::Hold) if said.faults != 0 => 3,
        Some(_) => 2,
    };
    let faults = Faults::from_bits(said.faults).to_string();
    let line = format!("{}: {faults}", mode.map_or("?", Mode::name));
    sink.take("/log", [time_ns; 2], &Log::of_controller(time_ns, level, line))
}

/// What does not move, from this time on, ns: the frame of reference and the scene at rest.
///
/// # Errors
/// Those of the sink.
pub fn at_rest<S: MessageSink>(sink: &mut S, time_ns: u64, stage: &dyn Scenery) -> Result<(), S::Refusal> {
    sink.take("/tf", [time_ns; 2], &foxglove::frame(time_ns))?;
    sink.take("/scene/rest", [time_ns; 2], &stage.at_rest(time_ns))
}

/// What moves at a tick, by these topics.
pub const MOVING: [&str; 3] = ["/scene", "/pose/needle", "/pose/target"];

/// What moves, at a tick: the messages of [`MOVING`].
///
/// # Errors
/// Those of the sink.
pub fn at_tick<S: MessageSink>(sink: &mut S, truth: &Truth, stage: &dyn Scenery) -> Result<(), S::Refusal> {
    let [scene, needle, target] = MOVING;
    let [needle_pose, target_pose] = stage.poses(truth);
    sink.take(scene, [truth.time_ns; 2], &stage.at_tick(truth))?;
    sink.take(needle, [truth.time_ns; 2], &needle_pose)?;
    sink.take(target, [truth.time_ns; 2], &target_pose)
}

/// The deformed body at this time, ns.
///
/// # Errors
/// Those of the sink.
pub fn body<S: MessageSink>(sink: &mut S, time_ns: u64, body: &SceneUpdate) -> Result<(), S::Refusal> {
    sink.take("/scene/body", [time_ns; 2], body)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    /// What their readers throw at: references, several types, items of no type, objects without properties
    /// (lichtblick-suite/lichtblick, packages/mcap-support/src/parseJsonSchema.ts).
    fn assert_readable(schema: &Value, what: &str) {
        let object = schema.as_object().unwrap_or_else(|| panic!("{what}: {schema}"));
        assert!(!object.contains_key("$ref") && !object.contains_key("$defs"), "{what}: {schema}");
        match object.get("type").and_then(Value::as_str) {
            Some("object") => {
                let properties = object.get("properties").and_then(Value::as_object);
                let properties = properties.unwrap_or_else(|| panic!("{what} has no properties: {schema}"));
                properties.iter().for_each(|(name, schema)| assert_readable(schema, &format!("{what}.{name}")));
            }
            Some("array") => assert_readable(&object["items"], &format!("{what}[]")),
            Some("boolean" | "string" | "number" | "integer") => {}
            other => panic!("{what} is {other:?}"),
        }
    }

    #[test]
    fn schemas_are_read_by_those_who_show_them() {
        for (topic, name, schema) in schemas() {
            assert_readable(schema.as_value(), topic);
            assert!(name.starts_with("stillpoint.") || name.starts_with("foxglove."));
        }
    }
}
