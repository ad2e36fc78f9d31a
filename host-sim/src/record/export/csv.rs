//! Tables with a time column, for PlotJuggler and spreadsheets.

use firmware::{Faults, Mode};
use model_offline::output::csv::table;
use nalgebra::Vector2;

use crate::record::recording::{Record, Recording};
use crate::world::truth::{NeedleMoment, Truth};

/// What the plant saw of an insertion: one line per tick of the plant. `{}` is the unit of length.
const INSERTION: [&str; 16] = [
    "time [s]",
    "tick [1]",
    "true_depth [{}]",
    "true_target_x [{}]",
    "true_target_y [{}]",
    "true_orthogonal_error [{}]",
    "true_paddle_x [{}]",
    "true_paddle_y [{}]",
    "command_x [{}]",
    "command_y [{}]",
    "measured_target_x [{}]",
    "measured_target_y [{}]",
    "measured_paddle_x [{}]",
    "measured_paddle_y [{}]",
    "state [name]",
    "faults [names]",
];

/// What is in a recording: one line per tick of the controller.
const RECORDING: [&str; 18] = [
    "time [s]",
    "tick [1]",
    "measured_depth [{}]",
    "measured_needle_velocity [{}/s]",
    "measured_target_x [{}]",
    "measured_target_y [{}]",
    "measured_paddle_x [{}]",
    "measured_paddle_y [{}]",
    "command_x [{}]",
    "command_y [{}]",
    "state [name]",
    "faults [names]",
    "true_depth [{}]",
    "true_target_x [{}]",
    "true_target_y [{}]",
    "true_orthogonal_error [{}]",
    "true_paddle_x [{}]",
    "true_paddle_y [{}]",
];

/// What a needle that slips met: one line per moment. `{}` is the unit of length, `{f}` that of force per thickness.
const NEEDLE: [&str; 7] = [
    "time [s]",
    "true_depth [{}]",
    "base_force [{f}]",
    "tip_force [{f}]",
    "shaft_friction [{f}]",
    "cut_length [{}]",
    "largest_slip [{}]",
];

/// Its shaft: one line per moment and place. `{s}` is the unit of stress.
const SHAFT: [&str; 6] = [
    "time [s]",
    "true_depth [{}]",
    "arc_length [{}]",
    "slip [{}]",
    "friction_per_length [{s}]",
    "normal_force_per_length [{s}]",
];

/// Moments of a shaft that are written: a profile every now and then.
const SHAFT_MOMENTS: usize = 50;

/// Time from `start_ns`, s; negative before.
pub fn seconds_since(time_ns: u64, start_ns: u64) -> f64 {
    (i128::from(time_ns) - i128::from(start_ns)) as f64 * 1e-9
}

/// Time zero of every exported table of a run, ns: its first tick, the plant's where that is known. In lockstep that is
/// also the zero of the samples' own times.
fn zero_ns(records: &[Record]) -> u64 {
    let first = records.first();
    first.map_or(0, |record| record.truth.map_or(record.tick.inputs.time_ns, |truth| truth.time_ns))
}

/// The columns with this unit of length.
fn columns<const N: usize>(columns: [&str; N], length: &str) -> [String; N] {
    columns.map(|column| column.replace("{}", length))
}

/// The truth along an insertion, with what the controller saw and said where there was one. `orthogonal` is n, `length`
/// the unit of lengths.
pub fn insertion(truths: &[Truth], records: &[Record], orthogonal: &Vector2<f64>, length: &str) -> Vec<u8> {
    let start_ns = truths.first().map_or(0, |truth| truth.time_ns);
    table(columns(INSERTION, length), truths, |truth| {
        let tick = records
            .binary_search_by_key(&truth.tick, |record| record.tick.inputs.tick)
            .ok()
            .map(|found| &records[found].tick);
        let [x, y] = truth.target.map(text);
        let [px, py] = truth.paddle.map(text);
        let [cx, cy] = pair(tick.map(|tick| tick.command).filter(|c| c.is_valid()).map(|c| c.displacement));
        let [mx, my] = pair(tick.and_then(|tick| tick.inputs.target).map(|target| target.displacement));
        let [mpx, mpy] = pair(tick.and_then(|tick| tick.inputs.paddle).map(|paddle| paddle.displacement));
        let [state, faults] =
            tick.map_or_else(Default::default, |tick| verdict(tick.command.state, tick.command.faults));
        let error = text(Vector2::from(truth.target).dot(orthogonal));
        let time = format!("{:.6}", seconds_since(truth.time_ns, start_ns));
        let (tick, depth) = (text(truth.tick), text(truth.depth));
        [time, tick, depth, x, y, error, px, py, cx, cy, mx, my, mpx, mpy, state, faults]
    })
}

/// One line per tick of the controller; empty where nothing arrived. `orthogonal` is n, `length` the unit of lengths.
pub fn recording(recording: &Recording, orthogonal: &Vector2<f64>, length: &str) -> Vec<u8> {
    let start_ns = zero_ns(&recording.records);
    table(columns(RECORDING, length), &recording.records, |record| {
        let (inputs, command) = (&record.tick.inputs, &record.tick.command);
        let [depth, velocity] = pair(inputs.needle.map(|sample| [sample.depth, sample.velocity]));
        let [tx, ty] = pair(inputs.target.map(|sample| sample.displacement));
        let [px, py] = pair(inputs.paddle.map(|sample| sample.displacement));
        let [cx, cy] = pair(command.is_valid().then_some(command.displacement));
        let [state, faults] = verdict(command.state, command.faults);
        let true_depth = record.truth.map(|truth| text(truth.depth)).unwrap_or_default();
        let [true_x, true_y] = pair(record.truth.map(|truth| truth.target));
        let error = record.truth.map(|truth| text(Vector2::from(truth.target).dot(orthogonal))).unwrap_or_default();
        let [true_px, true_py] = pair(record.truth.map(|truth| truth.paddle));
        let time = format!("{:.6}", seconds_since(inputs.time_ns, start_ns));
        [
            time,
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
            true_depth,
            true_x,
            true_y,
            error,
            true_px,
            true_py,
        ]
    })
}

/// Labels of the units of length and stress.
#[derive(Clone, Copy, Debug)]
pub struct Units<'u> {
    /// Of length.
    pub length: &'u str,
    /// Of stress, which is force per length and unit thickness.
    pub stress: &'u str,
}

impl Units<'_> {
    /// Of force per unit thickness: "kPa·mm".
    pub fn force(&self) -> String {
        match (self.stress, self.length) {
            ("1", length) => length.to_owned(),
            (stress, "1") => stress.to_owned(),
            (stress, length) => format!("{stress}·{length}"),
        }
    }

    fn columns<const N: usize>(&self, columns: [&str; N]) -> [String; N] {
        let force = self.force();
        columns.map(|name| name.replace("{}", self.length).replace("{s}", self.stress).replace("{f}", &force))
    }
}

/// Forces on a needle that slips, moment by moment; time zero is the start of the run's first tick, as in [`insertion`],
/// `started_s` the start of the needle.
pub fn needle(moments: &[NeedleMoment], started_s: f64, units: Units<'_>) -> Vec<u8> {
    table(units.columns(NEEDLE), moments, |NeedleMoment { since_start_s, reading }| {
        [
            format!("{:.6}", started_s + since_start_s),
            text(reading.depth),
            text(reading.base_force),
            text(reading.tip_force),
            text(reading.friction()),
            reading.cut_length.map(text).unwrap_or_default(),
            text(reading.largest_slip()),
        ]
    })
}

/// The shaft from entry to tip at some of these moments, its last one included.
pub fn shaft(moments: &[NeedleMoment], started_s: f64, units: Units<'_>) -> Vec<u8> {
    let within: Vec<&NeedleMoment> = moments.iter().filter(|moment| !moment.reading.shaft.is_empty()).collect();
    let stride = within.len().div_ceil(SHAFT_MOMENTS).max(1);
    let kept = within.iter().rev().step_by(stride).rev();
    let lines = kept.flat_map(|moment| moment.reading.shaft.iter().map(move |station| (moment, station)));
    table(units.columns(SHAFT), lines, |(moment, station)| {
        [
            format!("{:.6}", started_s + moment.since_start_s),
            text(moment.reading.depth),
            text(station.arc_length),
            text(station.slip),
            text(station.friction),
            text(station.normal),
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

#[cfg(test)]
mod tests {
    use firmware::Settings;

    use super::*;
    use crate::record::recording::RecordingHeader;
    use crate::runtime::accounting::tick::ControllerTick;
    use crate::runtime::time::mode::RunMode;

    fn record(tick: u64, time_ns: u64, truth_ns: Option<u64>) -> Record {
        let inputs = firmware::Inputs { tick, time_ns, ..Default::default() };
        let truth = truth_ns.map(|time_ns| Truth { tick, time_ns, depth: 0.5, target: [1.0, 2.0], paddle: [3.0, 4.0] });
        Record { tick: ControllerTick { inputs, ..Default::default() }, truth }
    }

    fn lines(bytes: &[u8]) -> Vec<Vec<String>> {
        let text = std::str::from_utf8(bytes).unwrap();
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
    }

    fn recorded(records: Vec<Record>) -> Vec<Vec<String>> {
        let settings = Settings::new(1_000_000, 20_000_000, 0);
        let header = RecordingHeader { mode: RunMode::Lockstep, seed: 1, scene_hash: [0; 32], settings, table: vec![] };
        lines(&recording(&Recording { header, records }, &Vector2::x(), "mm"))
    }

    #[test]
    fn both_tables_of_a_run_have_one_time_and_one_name_for_one_thing() {
        let at = |tick| 200 + tick * 1_000_000;
        let records: Vec<_> = (0..5).map(|tick| record(tick, at(tick), Some(at(tick)))).collect();
        let truths: Vec<_> = records.iter().filter_map(|record| record.truth).collect();
        let plant = lines(&insertion(&truths, &records, &Vector2::x(), "mm"));
        let controller = recorded(records);
        for (column, name) in plant[0].iter().enumerate() {
            assert!(name.contains('[') && name.ends_with(']'), "{name} has no unit");
            let same = controller[0].iter().position(|other| other == name).unwrap();
            for line in 1..plant.len() {
                assert_eq!(plant[line][column], controller[line][same], "{name}");
            }
        }
        // In free-run the controller's tick comes half a period after the plant's: same zero.
        let later = recorded(vec![record(0, at(0) + 500_000, Some(at(0)))]);
        assert_eq!(later[1][0], "0.000500");
        let shared = plant[0].iter().filter(|name| controller[0].contains(name)).count();
        assert_eq!(shared, 16, "{:?} {:?}", plant[0], controller[0]);
        assert!(controller[0].iter().all(|name| name.contains('[')));
    }

    #[test]
    fn time_that_runs_backwards_is_negative() {
        let found = recorded(vec![record(0, u64::MAX, None), record(1, 0, None), record(2, 5, Some(1))]);
        assert_eq!(found[1][0], "0.000000");
        assert!(found[2][0].starts_with("-18446744073"), "{}", found[2][0]);
    }
}
