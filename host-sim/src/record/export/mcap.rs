//! A recording as [MCAP](https://mcap.dev): twelve topics of JSON messages, each with its JSON Schema, compressed.
//!
//! | topic | one message per | log time |
//! |---|---|---|
//! | `/needle`, `/target`, `/paddle`, `/second_paddle` | sample that the controller used, with the time of its measurement | arrival |
//! | `/command` | tick of the controller | tick |
//! | `/truth` | tick of the plant | tick |
//! | `/needle_forces` | moment of a needle that slips; of a run, not of a recording alone | that moment |
//! | `/scene/rest`, `/scene`, `/tf` | what is to be seen, in [Foxglove's schemas](super::foxglove): at rest once, what moves 30 times a second; where the scene is known | tick of the plant |
//! | `/scene/body` | in space the deformed body, at some ticks | tick of the plant |
//! | `/log` | change of the controller's mode or faults, in Foxglove's schema | tick |
//!
//! Times are those of the recording: nanoseconds since the start of the run in lockstep, of the machine's steady clock in
//! free-run. A metadata record `stillpoint` says which, with seed and hashes.

use firmware::contract::PaddleSample;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::Arc;

use ::mcap::records::Metadata;
use ::mcap::{Channel, McapError, Message, Schema, Writer};
use firmware::{Faults, Mode};
use model_offline::needle::{NeedleReading, StationState};
use model_offline::output::table_text::hex;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::csv::Series;
use super::foxglove::{self, FrameTransform, Log, SceneUpdate, Scenery};
use crate::record::recording::Recording;
use crate::runtime::accounting::tick::ControllerTick;
use crate::runtime::time::mode::RunMode;
use crate::world::truth::{NeedleMoment, Truth};

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

/// What is known of a run, and not of its recording alone.
#[derive(Clone, Copy, Debug, Default)]
pub struct Known<'k> {
    /// What its needle met on its way.
    pub needle: NeedleForces<'k>,
    /// Its scene.
    pub stage: Option<&'k dyn Scenery>,
}

/// What a needle met on its way.
#[derive(Clone, Copy, Debug, Default)]
pub struct NeedleForces<'n> {
    /// When the needle started, ns.
    pub started_ns: u64,
    /// Its moments, in order of time.
    pub moments: &'n [NeedleMoment],
}

impl NeedleForces<'_> {
    fn time_ns(&self, moment: &NeedleMoment) -> u64 {
        self.started_ns + (moment.since_start_s * 1e9).round() as u64
    }
}

/// A schema as Foxglove and Lichtblick read them: nothing defined elsewhere, one type for everything, and every item described.
fn schema_of<T: JsonSchema>() -> schemars::Schema {
    fn plain(value: &mut serde_json::Value) {
        if let serde_json::Value::Object(object) = value {
            // What may be missing has the type that it has when it is there.
            if let Some(serde_json::Value::Array(types)) = object.get("type") {
                let there = types.iter().find(|name| *name != "null").cloned();
                object.extend(there.map(|name| ("type".to_owned(), name)));
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
pub fn schemas() -> [(&'static str, &'static str, schemars::Schema); 12] {
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
        ("/tf", "foxglove.FrameTransform", schema_of::<FrameTransform>()),
        ("/log", "foxglove.Log", schema_of::<Log>()),
        ("/scene/body", "foxglove.SceneUpdate", schema_of::<SceneUpdate>()),
    ]
}

/// From one picture of what moves to the next, ns.
const PICTURES_EVERY_NS: u64 = 1_000_000_000 / 30;

fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1e-9
}

/// The file in memory.
type Output = Writer<Cursor<Vec<u8>>>;

/// Channels by topic, with a running number each.
struct Topics(BTreeMap<&'static str, (Arc<Channel<'static>>, u32)>);

impl Topics {
    fn new() -> Self {
        let channels = schemas().into_iter().enumerate().map(|(i, (topic, name, schema))| {
            let schema = Schema {
                id: i as u16 + 1,
                name: name.to_owned(),
                encoding: "jsonschema".to_owned(),
                data: Cow::Owned(schema.as_value().to_string().into_bytes()),
            };
            let channel = Channel {
                id: i as u16 + 1,
                topic: topic.to_owned(),
                schema: Some(Arc::new(schema)),
                message_encoding: "json".to_owned(),
                metadata: BTreeMap::new(),
            };
            (topic, (Arc::new(channel), 0))
        });
        Self(channels.collect())
    }

    fn write(
        &mut self,
        writer: &mut Output,
        topic: &str,
        [log_time, publish_time]: [u64; 2],
        message: &impl Serialize,
    ) -> Result<(), McapError> {
        let Some((channel, sequence)) = self.0.get_mut(topic) else { return Ok(()) };
        *sequence += 1;
        let data = serde_json::to_vec(message).unwrap_or_default();
        writer.write(&Message {
            channel: Arc::clone(channel),
            sequence: *sequence,
            log_time,
            publish_time,
            data: Cow::Owned(data),
        })
    }

    /// What the controller used and answered in a tick.
    fn write_tick<const D: usize, const N: usize>(
        &mut self,
        writer: &mut Output,
        tick: &ControllerTick,
        series: &Series<'_, D, N>,
    ) -> Result<(), McapError> {
        let third = |z: f64| (D > 2).then_some(z);
        let (inputs, command) = (&tick.inputs, &tick.command);
        let now = inputs.time_ns;
        if let Some(s) = &inputs.needle {
            let measured_s = seconds(s.time_ns);
            let message = NeedleMessage { sequence: s.sequence, measured_s, depth: s.depth, velocity: s.velocity };
            self.write(writer, "/needle", [now, s.time_ns], &message)?;
        }
        if let Some(s) = &inputs.target {
            let ([x, y, z], measured_s) = (s.displacement, seconds(s.time_ns));
            let message = TargetMessage { sequence: s.sequence, measured_s, x, y, z: third(z) };
            self.write(writer, "/target", [now, s.time_ns], &message)?;
        }
        for (topic, sample) in ["/paddle", "/second_paddle"].into_iter().zip(&inputs.paddles) {
            let Some(s) = sample else { continue };
            let ([x, y, z], measured_s) = (s.displacement, seconds(s.time_ns));
            let PaddleSample { sequence, paddle_index, .. } = *s;
            let message = PaddleMessage { sequence, measured_s, paddle_index, x, y, z: third(z) };
            self.write(writer, topic, [now, s.time_ns], &message)?;
        }
        let [place, second] = command.displacement.map(|place| command.is_valid().then_some(place));
        let second = second.filter(|_| series.paddles > 1);
        let message = CommandMessage {
            tick: inputs.tick,
            state: Mode::from_wire(command.state).map_or("?", Mode::name).to_owned(),
            faults: Faults::from_bits(command.faults).to_string(),
            x: place.map(|place| place[0]),
            y: place.map(|place| place[1]),
            z: place.and_then(|place| third(place[2])),
            second_x: second.map(|place| place[0]),
            second_y: second.map(|place| place[1]),
            second_z: second.and_then(|place| third(place[2])),
        };
        self.write(writer, "/command", [now, now], &message)
    }

    /// What the needle met at a moment.
    fn write_forces(&mut self, writer: &mut Output, time_ns: u64, reading: &NeedleReading) -> Result<(), McapError> {
        let message = NeedleForcesMessage {
            depth: reading.depth,
            base_force: reading.base_force,
            tip_force: reading.tip_force,
            friction: reading.friction(),
            cut_length: reading.cut_length,
            shaft: reading.shaft.clone(),
        };
        self.write(writer, "/needle_forces", [time_ns; 2], &message)
    }

    /// What really happened at a tick.
    fn write_truth<const D: usize, const N: usize>(
        &mut self,
        writer: &mut Output,
        truth: &Truth,
        series: &Series<'_, D, N>,
    ) -> Result<(), McapError> {
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
        self.write(writer, "/truth", [truth.time_ns; 2], &message)
    }
}

/// What the controller said last: mode and faults.
type Said = Option<(u32, u64)>;

impl Topics {
    /// A line where the controller's mode or faults are others than before.
    fn write_change(&mut self, writer: &mut Output, said: &mut Said, tick: &ControllerTick) -> Result<(), McapError> {
        let (command, time_ns) = (&tick.command, tick.inputs.time_ns);
        let now = (command.state, command.faults);
        if said.replace(now) == Some(now) {
            return Ok(());
        }
        let mode = Mode::from_wire(command.state);
        let level = match mode {
            Some(Mode::Safe) | None => 4,
            Some(Mode::Hold) if command.faults != 0 => 3,
            Some(_) => 2,
        };
        let faults = Faults::from_bits(command.faults).to_string();
        let line = format!("{}: {faults}", mode.map_or("?", Mode::name));
        self.write(writer, "/log", [time_ns; 2], &Log::of_controller(time_ns, level, line))
    }

    /// What is to be seen at a tick; `shown` is the time of the last picture.
    fn write_picture(
        &mut self,
        writer: &mut Output,
        stage: &dyn Scenery,
        shown: &mut Option<u64>,
        truth: &Truth,
    ) -> Result<(), McapError> {
        let time_ns = truth.time_ns;
        if let Some(body) = stage.body_at(truth) {
            self.write(writer, "/scene/body", [time_ns; 2], &body)?;
        }
        match *shown {
            None => {
                self.write(writer, "/tf", [time_ns; 2], &foxglove::frame(time_ns))?;
                self.write(writer, "/scene/rest", [time_ns; 2], &stage.at_rest(time_ns))?;
            }
            Some(shown) if time_ns < shown + PICTURES_EVERY_NS => return Ok(()),
            Some(_) => {}
        }
        *shown = Some(time_ns);
        self.write(writer, "/scene", [time_ns; 2], &stage.at_tick(truth))
    }
}

/// The recording as an MCAP file.
///
/// # Errors
/// [`McapError`] of the writer.
pub fn encode<const D: usize, const N: usize>(
    recording: &Recording,
    series: &Series<'_, D, N>,
    known: Known<'_>,
) -> Result<Vec<u8>, McapError> {
    let needle = known.needle;
    let compression = Some(::mcap::Compression::Lz4);
    let options = ::mcap::WriteOptions::new().compression(compression).profile("").library("host-sim");
    let mut writer = options.create(Cursor::new(Vec::new()))?;
    let mut topics = Topics::new();
    let (mut said, mut shown) = (None, None);
    let mut moments = needle.moments.iter().map(|moment| (needle.time_ns(moment), &moment.reading)).peekable();
    for record in &recording.records {
        while let Some((time_ns, reading)) = moments.next_if(|(time_ns, _)| *time_ns <= record.tick.inputs.time_ns) {
            topics.write_forces(&mut writer, time_ns, reading)?;
        }
        topics.write_tick(&mut writer, &record.tick, series)?;
        topics.write_change(&mut writer, &mut said, &record.tick)?;
        if let Some(truth) = &record.truth {
            topics.write_truth(&mut writer, truth, series)?;
            if let Some(stage) = known.stage {
                topics.write_picture(&mut writer, stage, &mut shown, truth)?;
            }
        }
    }
    for (time_ns, reading) in moments {
        topics.write_forces(&mut writer, time_ns, reading)?;
    }
    writer.write_metadata(&Metadata { name: "stillpoint".to_owned(), metadata: facts(recording) })?;
    writer.finish()?;
    Ok(writer.into_inner().into_inner())
}

fn facts(recording: &Recording) -> BTreeMap<String, String> {
    let header = &recording.header;
    let clock = match header.mode {
        RunMode::Lockstep => "messages: ns since the start of the run",
        RunMode::FreeRun => "steady clock of the machine, ns",
    };
    [
        ("mode", header.mode.to_string()),
        ("clock", clock.to_owned()),
        ("seed", header.seed.to_string()),
        ("scene_sha256", hex(&header.scene_hash)),
        ("table_sha256", hex(&Sha256::digest(&header.table))),
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    /// What their readers throw at: references, several types, items of no type (lichtblick-suite/lichtblick,
    /// packages/mcap-support/src/parseJsonSchema.ts).
    fn assert_readable(schema: &Value, what: &str) {
        let object = schema.as_object().unwrap_or_else(|| panic!("{what}: {schema}"));
        assert!(!object.contains_key("$ref") && !object.contains_key("$defs"), "{what}: {schema}");
        match object.get("type").and_then(Value::as_str) {
            Some("object") => {
                let properties = object.get("properties").and_then(Value::as_object).into_iter().flatten();
                properties.for_each(|(name, schema)| assert_readable(schema, &format!("{what}.{name}")));
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
