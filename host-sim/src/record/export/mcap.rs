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
//! free-run. A metadata record `stillpoint` says which, with seed, hashes, the unit of length, and the scene where it is known.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::Arc;

use ::mcap::records::Metadata;
use ::mcap::{Channel, McapError, Message, Schema, Writer};
use model_offline::needle::NeedleReading;
use model_offline::output::table_text::hex;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::csv::Series;
use super::foxglove::Scenery;
use super::messages::{self, MessageSink, Said};
use crate::record::recording::Recording;
use crate::runtime::time::mode::RunMode;
use crate::world::truth::{NeedleMoment, Truth};

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

/// From one picture of what moves to the next, ns.
const PICTURES_EVERY_NS: u64 = 1_000_000_000 / 30;

/// The file in memory, with its channels by topic and a running number each.
struct Output {
    writer: Writer<Cursor<Vec<u8>>>,
    topics: BTreeMap<&'static str, (Arc<Channel<'static>>, u32)>,
}

impl Output {
    fn new() -> Result<Self, McapError> {
        let compression = Some(::mcap::Compression::Lz4);
        let options = ::mcap::WriteOptions::new().compression(compression).profile("").library("host-sim");
        let channels = messages::schemas().into_iter().enumerate().map(|(i, (topic, name, schema))| {
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
        Ok(Self { writer: options.create(Cursor::new(Vec::new()))?, topics: channels.collect() })
    }

    /// What is to be seen at a tick; `shown` is the time of the last picture.
    fn picture(&mut self, stage: &dyn Scenery, shown: &mut Option<u64>, truth: &Truth) -> Result<(), McapError> {
        let time_ns = truth.time_ns;
        if let Some(body) = stage.body_at(truth) {
            messages::body(self, time_ns, &body)?;
        }
        match *shown {
            None => messages::at_rest(self, time_ns, stage)?,
            Some(shown) if time_ns < shown + PICTURES_EVERY_NS => return Ok(()),
            Some(_) => {}
        }
        *shown = Some(time_ns);
        messages::at_tick(self, truth, stage)
    }
}

impl MessageSink for Output {
    type Refusal = McapError;

    fn take(
        &mut self,
        topic: &'static str,
        [log_time, publish_time]: [u64; 2],
        message: &impl Serialize,
    ) -> Result<(), McapError> {
        let Some((channel, sequence)) = self.topics.get_mut(topic) else { return Ok(()) };
        *sequence += 1;
        let data = serde_json::to_vec(message).unwrap_or_default();
        self.writer.write(&Message {
            channel: Arc::clone(channel),
            sequence: *sequence,
            log_time,
            publish_time,
            data: Cow::Owned(data),
        })
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
    let mut output = Output::new()?;
    let (mut said, mut shown) = (None, None);

    let mut moments = needle.moments.iter().map(|moment| (needle.time_ns(moment), &moment.reading)).peekable();
    let mut forces_until = |output: &mut Output, until_ns: u64| -> Result<(), McapError> {
        let next = |(time_ns, _): &(u64, &NeedleReading)| *time_ns <= until_ns;
        while let Some((time_ns, reading)) = moments.next_if(next) {
            messages::forces(output, time_ns, reading)?;
        }
        Ok(())
    };
    for record in &recording.records {
        let (inputs, command) = (&record.tick.inputs, &record.tick.command);
        forces_until(&mut output, inputs.time_ns)?;
        messages::samples::<_, D>(&mut output, inputs)?;
        messages::command(&mut output, (inputs.tick, inputs.time_ns), command, series)?;
        let now = Said::from(command);
        if said.replace(now) != Some(now) {
            messages::log(&mut output, inputs.time_ns, now)?;
        }
        if let Some(truth) = &record.truth {
            messages::truth(&mut output, truth, series)?;
            if let Some(stage) = known.stage {
                output.picture(stage, &mut shown, truth)?;
            }
        }
    }
    forces_until(&mut output, u64::MAX)?;
    let mut metadata = facts(recording);
    metadata.insert("length_unit".to_owned(), series.length.to_owned());
    metadata.extend(known.stage.map(|stage| ("scene".to_owned(), stage.scene().to_owned())));
    let mut writer = output.writer;
    writer.write_metadata(&Metadata { name: "stillpoint".to_owned(), metadata })?;
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
