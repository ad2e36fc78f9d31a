//! Tables with a time column, for PlotJuggler and spreadsheets.

use firmware::contract::frames::to_plane;
use firmware::{Faults, Mode};
use model_offline::output::csv::table;
use nalgebra::Vector2;

use crate::record::recording::{Record, Recording};
use crate::runtime::accounting::tick::ControllerTick;
use crate::world::truth::{NeedleMoment, Truth};

/// Columns of the time series of a run and of a recording; `{}` is the unit of length. Empty where there is nothing: samples that
/// have not arrived, a truth that nobody told, commands before the paddle's place is known.
const SERIES: [&str; 18] = [
    "time [s]",
    "tick [1]",
    "true_depth [{}]",
    "true_target_x [{}]",
    "true_target_y [{}]",
    "true_orthogonal_error [{}]",
    "true_paddle_x [{}]",
    "true_paddle_y [{}]",
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

/// A line of [`SERIES`] at a time since the first tick, s; `orthogonal` is n.
fn line(
    time_s: f64,
    number: u64,
    truth: Option<&Truth>,
    tick: Option<&ControllerTick>,
    orthogonal: &Vector2<f64>,
) -> [String; 18] {
    let inputs = tick.map(|tick| &tick.inputs);
    let command = tick.map(|tick| &tick.command);
    let [tx, ty] = pair(truth.map(|truth| truth.target));
    let [tpx, tpy] = pair(truth.map(|truth| truth.paddle));
    let error = truth.map(|truth| text(Vector2::from(truth.target).dot(orthogonal))).unwrap_or_default();
    let true_depth = truth.map(|truth| text(truth.depth)).unwrap_or_default();
    let needle = inputs.and_then(|inputs| inputs.needle);
    let [depth, velocity] = pair(needle.map(|sample| [sample.depth, sample.velocity]));
    let [mx, my] = pair(inputs.and_then(|inputs| inputs.target).map(|sample| to_plane(sample.displacement)));
    let [mpx, mpy] = pair(inputs.and_then(|inputs| inputs.paddles[0]).map(|sample| to_plane(sample.displacement)));
    let [cx, cy] = pair(command.filter(|command| command.is_valid()).map(|command| to_plane(command.displacement[0])));
    let [state, faults] = command.map_or_else(Default::default, |command| verdict(command.state, command.faults));
    let time = format!("{time_s:.6}");
    let number = text(number);
    [time, number, true_depth, tx, ty, error, tpx, tpy, depth, velocity, mx, my, mpx, mpy, cx, cy, state, faults]
}

/// One line per tick of the plant, with what the controller saw and said where there was one. `orthogonal` is n, `length` the
/// unit of lengths.
pub fn insertion(truths: &[Truth], records: &[Record], orthogonal: &Vector2<f64>, length: &str) -> Vec<u8> {
    let start_ns = truths.first().map_or(0, |truth| truth.time_ns);
    table(columns(SERIES, length), truths, |truth| {
        let tick = records.binary_search_by_key(&truth.tick, |record| record.tick.inputs.tick).ok();
        let tick = tick.and_then(|found| records.get(found)).map(|record| &record.tick);
        line(seconds_since(truth.time_ns, start_ns), truth.tick, Some(truth), tick, orthogonal)
    })
}

/// One line per tick of the controller. `orthogonal` is n, `length` the unit of lengths.
pub fn recording(recording: &Recording, orthogonal: &Vector2<f64>, length: &str) -> Vec<u8> {
    let start_ns = zero_ns(&recording.records);
    table(columns(SERIES, length), &recording.records, |record| {
        let inputs = &record.tick.inputs;
        let time_s = seconds_since(inputs.time_ns, start_ns);
        line(time_s, inputs.tick, record.truth.as_ref(), Some(&record.tick), orthogonal)
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
        assert_eq!(plant, controller, "in lockstep one is the other");
        assert!(plant[0].iter().all(|name| name.contains('[') && name.ends_with(']')), "{:?}", plant[0]);
        // In free-run the controller's tick comes half a period after the plant's: same zero.
        let later = recorded(vec![record(0, at(0) + 500_000, Some(at(0)))]);
        assert_eq!(later[1][0], "0.000500");
        assert_eq!(later[0], plant[0]);
    }

    /// Every column has what its name says, and what is not there is empty.
    #[test]
    fn columns_are_what_they_are_called() {
        use firmware::contract::{NeedleSample, PaddleSample, TargetSample};
        let mut whole = record(7, 1_000_000, Some(1_000_000));
        whole.tick.inputs.needle = Some(NeedleSample { depth: 0.51, velocity: 0.2, ..NeedleSample::default() });
        whole.tick.inputs.target = Some(TargetSample { displacement: [1.1, 2.1, 0.0], ..TargetSample::default() });
        whole.tick.inputs.paddles[0] = Some(PaddleSample { displacement: [3.1, 4.1, 0.0], ..PaddleSample::default() });
        whole.tick.command.displacement[0] = [5.0, 6.0, 0.0];
        whole.tick.command.flags = firmware::contract::frames::COMMAND_VALID;
        let said = recorded(vec![record(6, 0, None), whole]);
        let value = |line: usize, name: &str| {
            let column = said[0].iter().position(|column| column.split(' ').next() == Some(name)).unwrap();
            said[line][column].as_str()
        };
        for (name, expected) in [
            ("time", "0.001000"),
            ("tick", "7"),
            ("true_depth", "0.5"),
            ("true_target_y", "2"),
            ("true_orthogonal_error", "1"),
            ("true_paddle_x", "3"),
            ("measured_depth", "0.51"),
            ("measured_needle_velocity", "0.2"),
            ("measured_target_x", "1.1"),
            ("measured_paddle_y", "4.1"),
            ("command_x", "5"),
            ("command_y", "6"),
        ] {
            assert_eq!(value(2, name), expected, "{name}");
            let known = ["time", "tick"].contains(&name);
            assert_eq!(value(1, name).is_empty(), !known, "{name}");
        }
    }

    #[test]
    fn time_that_runs_backwards_is_negative() {
        let found = recorded(vec![record(0, u64::MAX, None), record(1, 0, None), record(2, 5, Some(1))]);
        assert_eq!(found[1][0], "0.000000");
        assert!(found[2][0].starts_with("-18446744073"), "{}", found[2][0]);
    }
}
