//! Tables with a time column, for PlotJuggler and spreadsheets.

use csv::Writer;
use firmware::{Faults, Mode};
use nalgebra::Vector2;

use crate::record::recording::{Record, Recording};
use crate::world::truth::Truth;

/// What the plant saw of an insertion: one line per tick of the plant.
const INSERTION: [&str; 14] = [
    "time_s",
    "tick",
    "depth",
    "target_x",
    "target_y",
    "orthogonal_error",
    "paddle_x",
    "paddle_y",
    "command_x",
    "command_y",
    "measured_target_x",
    "measured_target_y",
    "state",
    "faults",
];

/// What is in a recording: one line per tick of the controller.
const RECORDING: [&str; 16] = [
    "time_s",
    "tick",
    "needle_depth",
    "needle_velocity",
    "target_x",
    "target_y",
    "paddle_x",
    "paddle_y",
    "command_x",
    "command_y",
    "state",
    "faults",
    "true_depth",
    "true_target_x",
    "true_target_y",
    "true_orthogonal_error",
];

/// Time since the start of the needle, s; negative before.
pub fn seconds_since(time_ns: u64, started_ns: u64) -> f64 {
    (time_ns as i64 - started_ns as i64) as f64 * 1e-9
}

/// The truth along an insertion, with what the controller saw and said where there was one. `orthogonal` is n.
pub fn insertion(truths: &[Truth], records: &[Record], orthogonal: &Vector2<f64>, started_ns: u64) -> Vec<u8> {
    table(INSERTION, truths, |truth| {
        let tick = records
            .binary_search_by_key(&truth.tick, |record| record.tick.inputs.tick)
            .ok()
            .map(|found| &records[found].tick);
        let [x, y] = truth.target.map(text);
        let [px, py] = truth.paddle.map(text);
        let [cx, cy] = pair(tick.map(|tick| tick.command.displacement));
        let [mx, my] = pair(tick.and_then(|tick| tick.inputs.target).map(|target| target.displacement));
        let [state, faults] =
            tick.map_or_else(Default::default, |tick| verdict(tick.command.state, tick.command.faults));
        [
            format!("{:.6}", seconds_since(truth.time_ns, started_ns)),
            text(truth.tick),
            text(truth.depth),
            x,
            y,
            text(Vector2::from(truth.target).dot(orthogonal)),
            px,
            py,
            cx,
            cy,
            mx,
            my,
            state,
            faults,
        ]
    })
}

/// One line per tick of the controller; empty where nothing arrived. `orthogonal` is n.
pub fn recording(recording: &Recording, orthogonal: &Vector2<f64>) -> Vec<u8> {
    let start_ns = recording.records.first().map_or(0, |record| record.tick.inputs.time_ns);
    table(RECORDING, &recording.records, |record| {
        let (inputs, command) = (&record.tick.inputs, &record.tick.command);
        let [depth, velocity] = pair(inputs.needle.map(|sample| [sample.depth, sample.velocity]));
        let [tx, ty] = pair(inputs.target.map(|sample| sample.displacement));
        let [px, py] = pair(inputs.paddle.map(|sample| sample.displacement));
        let [cx, cy] = pair(command.is_valid().then_some(command.displacement));
        let [state, faults] = verdict(command.state, command.faults);
        let [true_x, true_y] = pair(record.truth.map(|truth| truth.target));
        let error = record.truth.map(|truth| Vector2::from(truth.target).dot(orthogonal));
        [
            format!("{:.6}", (inputs.time_ns - start_ns) as f64 * 1e-9),
            text(inputs.tick),
            depth,
            velocity,
            tx,
            ty,
            px,
            py,
            cx,
            cy,
            state,
            faults,
            record.truth.map(|truth| text(truth.depth)).unwrap_or_default(),
            true_x,
            true_y,
            error.map(text).unwrap_or_default(),
        ]
    })
}

fn text(value: impl ToString) -> String {
    value.to_string()
}

fn pair(values: Option<[f64; 2]>) -> [String; 2] {
    values.map_or_else(Default::default, |values| values.map(text))
}

/// State and fault codes of a command.
fn verdict(state: u32, faults: u64) -> [String; 2] {
    let state = Mode::from_wire(state).map_or("?", Mode::name);
    [state.to_owned(), Faults::from_bits(faults).to_string()]
}

/// A header and a line for each of `rows`.
pub fn table<'r, R: 'r, const N: usize>(
    header: [&str; N],
    rows: impl IntoIterator<Item = &'r R>,
    line: impl Fn(&'r R) -> [String; N],
) -> Vec<u8> {
    let mut writer = Writer::from_writer(Vec::new());
    // Lines have the header's length by their type, and memory takes everything.
    let _ = writer.write_record(header);
    for row in rows {
        let _ = writer.write_record(line(row));
    }
    writer.into_inner().unwrap_or_default()
}
