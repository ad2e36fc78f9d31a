//! Tables with a time column, for PlotJuggler and spreadsheets.

use firmware::contract::frames::{MAX_DIMENSION, MAX_PADDLES};
use firmware::{Faults, Mode};
use model_offline::output::csv::table;
use nalgebra::SMatrix;

use crate::record::recording::{Record, Recording};
use crate::runtime::accounting::tick::ControllerTick;
use crate::world::truth::{NeedleMoment, Truth};

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

/// Time series of runs and recordings in D dimensions, N of them orthogonal to the needle. Columns are empty where there is
/// nothing: samples that have not arrived, a truth that nobody told, commands before the paddles' places are known.
#[derive(Clone, Copy, Debug)]
pub struct Series<'s, const D: usize = 2, const N: usize = 1> {
    /// Directions orthogonal to the needle: orthonormal columns.
    pub orthogonal: &'s SMatrix<f64, D, N>,
    /// Paddles, of which there are columns.
    pub paddles: usize,
    /// Unit of lengths.
    pub length: &'s str,
}

/// What comes before the name of a quantity that both paddles have.
const PLACES: [&str; MAX_PADDLES] = ["", "second_"];

impl<const D: usize, const N: usize> Series<'_, D, N> {
    /// Names of the columns.
    fn columns(&self) -> Vec<String> {
        let length = self.length;
        let vector = |name: &str| -> Vec<String> {
            ["x", "y", "z"].iter().take(D).map(|axis| format!("{name}_{axis} [{length}]")).collect()
        };
        let of_paddles = |before: &str, name: &str| -> Vec<String> {
            let places = PLACES.iter().take(self.paddles);
            places.flat_map(|place| -> Vec<String> { vector(&format!("{before}{place}{name}")) }).collect()
        };
        [
            vec!["time [s]".to_owned(), "tick [1]".to_owned(), format!("true_depth [{length}]")],
            vector("true_target"),
            vec![format!("true_orthogonal_error [{length}]")],
            of_paddles("true_", "paddle"),
            vec![format!("measured_depth [{length}]"), format!("measured_needle_velocity [{length}/s]")],
            vector("measured_target"),
            of_paddles("measured_", "paddle"),
            of_paddles("", "command"),
            vec!["state [name]".to_owned(), "faults [names]".to_owned()],
        ]
        .concat()
    }

    /// A line at a time since the first tick, s.
    fn line(&self, time_s: f64, number: u64, truth: Option<&Truth>, tick: Option<&ControllerTick>) -> Vec<String> {
        let inputs = tick.map(|tick| &tick.inputs);
        let command = tick.map(|tick| &tick.command);
        let needle = inputs.and_then(|inputs| inputs.needle);
        let vector = |components: Option<[f64; MAX_DIMENSION]>| -> Vec<String> {
            (0..D).map(|k| components.map(|components| text(components[k])).unwrap_or_default()).collect()
        };
        let of_paddles = |at: &dyn Fn(usize) -> Option<[f64; MAX_DIMENSION]>| -> Vec<String> {
            (0..self.paddles.min(MAX_PADDLES)).flat_map(|place| vector(at(place))).collect()
        };
        let told = command.filter(|command| command.is_valid());
        [
            vec![format!("{time_s:.6}"), text(number), truth.map(|truth| text(truth.depth)).unwrap_or_default()],
            vector(truth.map(|truth| truth.target)),
            vec![truth.map(|truth| text(self.error(truth))).unwrap_or_default()],
            of_paddles(&|place| truth.map(|truth| truth.paddles[place])),
            vec![
                needle.map(|sample| text(sample.depth)).unwrap_or_default(),
                needle.map(|sample| text(sample.velocity)).unwrap_or_default(),
            ],
            vector(inputs.and_then(|inputs| inputs.target).map(|sample| sample.displacement)),
            of_paddles(&|place| inputs.and_then(|inputs| inputs.paddles[place]).map(|sample| sample.displacement)),
            of_paddles(&|place| told.map(|command| command.displacement[place])),
            command.map_or_else(|| vec![String::new(); 2], |command| verdict(command.state, command.faults).into()),
        ]
        .concat()
    }

    /// How far the target is off the needle's line, length: to which side in the plane, in space how far alone.
    pub(super) fn error(&self, truth: &Truth) -> f64 {
        let target = truth.target::<D>();
        match N {
            1 => target.dot(&self.orthogonal.column(0)),
            _ => self.orthogonal.tr_mul(&target).norm(),
        }
    }

    /// One line per tick of the plant, with what the controller saw and said where there was one.
    pub fn insertion(&self, truths: &[Truth], records: &[Record]) -> Vec<u8> {
        let start_ns = truths.first().map_or(0, |truth| truth.time_ns);
        table(self.columns(), truths, |truth| {
            let tick = records.binary_search_by_key(&truth.tick, |record| record.tick.inputs.tick).ok();
            let tick = tick.and_then(|found| records.get(found)).map(|record| &record.tick);
            self.line(seconds_since(truth.time_ns, start_ns), truth.tick, Some(truth), tick)
        })
    }

    /// One line per tick of the controller.
    pub fn recording(&self, recording: &Recording) -> Vec<u8> {
        let start_ns = zero_ns(&recording.records);
        table(self.columns(), &recording.records, |record| {
            let inputs = &record.tick.inputs;
            let time_s = seconds_since(inputs.time_ns, start_ns);
            self.line(time_s, inputs.tick, record.truth.as_ref(), Some(&record.tick))
        })
    }
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

/// Forces on a needle that slips, moment by moment; time zero is the start of the run's first tick, as in [`Series::insertion`],
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

/// State and fault codes of a command.
fn verdict(state: u32, faults: u64) -> [String; 2] {
    let state = Mode::from_wire(state).map_or("?", Mode::name);
    [state.to_owned(), Faults::from_bits(faults).to_string()]
}

#[cfg(test)]
mod tests {
    use firmware::Settings;
    use nalgebra::ArrayStorage;

    use super::*;
    use crate::record::recording::RecordingHeader;
    use crate::runtime::time::mode::RunMode;

    const X: SMatrix<f64, 2, 1> = SMatrix::from_array_storage(ArrayStorage([[1.0, 0.0]]));
    const SERIES: Series<'_> = Series { orthogonal: &X, paddles: 1, length: "mm" };

    fn record(tick: u64, time_ns: u64, truth_ns: Option<u64>) -> Record {
        let inputs = firmware::Inputs { tick, time_ns, ..Default::default() };
        let (target, paddles) = ([1.0, 2.0, 3.5], [[3.0, 4.0, 6.5], [7.0, 8.0, 9.0]]);
        let truth = truth_ns.map(|time_ns| Truth { tick, time_ns, depth: 0.5, target, paddles });
        Record { tick: ControllerTick { inputs, ..Default::default() }, truth }
    }

    fn lines(bytes: &[u8]) -> Vec<Vec<String>> {
        let text = std::str::from_utf8(bytes).unwrap();
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
    }

    fn recorded(records: Vec<Record>) -> Vec<Vec<String>> {
        let settings = Settings::new(1_000_000, 20_000_000, 0);
        let header = RecordingHeader { mode: RunMode::Lockstep, seed: 1, scene_hash: [0; 32], settings, table: vec![] };
        lines(&SERIES.recording(&Recording { header, records }))
    }

    #[test]
    fn both_tables_of_a_run_have_one_time_and_one_name_for_one_thing() {
        let at = |tick| 200 + tick * 1_000_000;
        let records: Vec<_> = (0..5).map(|tick| record(tick, at(tick), Some(at(tick)))).collect();
        let truths: Vec<_> = records.iter().filter_map(|record| record.truth).collect();
        let plant = lines(&SERIES.insertion(&truths, &records));
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

    /// Every component of every paddle has a column of its own, in the plane those that were always there.
    #[test]
    fn the_plane_has_two_components_and_space_three_of_each_paddle() {
        let mut whole = record(0, 0, Some(0));
        whole.tick.command.displacement = [[10.0, 11.0, 12.0], [13.0, 14.0, 15.0]];
        whole.tick.command.flags = firmware::contract::frames::COMMAND_VALID;
        let truth = whole.truth.unwrap();
        let said = |bytes: Vec<u8>| {
            let lines = lines(&bytes);
            let there = lines[0].iter().zip(&lines[1]).filter(|(_, value)| !value.is_empty());
            there.map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>()
        };
        let plane = said(SERIES.insertion(&[truth], &[whole]));
        let expected = "time [s] 0.000000;tick [1] 0;true_depth [mm] 0.5;true_target_x [mm] 1;true_target_y [mm] 2;\
            true_orthogonal_error [mm] 1;true_paddle_x [mm] 3;true_paddle_y [mm] 4;command_x [mm] 10;command_y [mm] 11;\
            state [name] ?;faults [names] NONE";
        assert_eq!(plane.join(";"), expected);
        // Across a needle along z what is off its line is the hypotenuse of x and y.
        let across = SMatrix::<f64, 3, 2>::identity();
        let space = Series { orthogonal: &across, paddles: 2, length: "mm" };
        let found = said(space.insertion(&[truth], &[whole])).join(";");
        let expected = format!(
            "true_target_z [mm] 3.5;true_orthogonal_error [mm] {};true_paddle_x [mm] 3;true_paddle_y [mm] 4;true_paddle_z [mm] 6.5;\
             true_second_paddle_x [mm] 7;true_second_paddle_y [mm] 8;true_second_paddle_z [mm] 9;command_x [mm] 10;\
             command_y [mm] 11;command_z [mm] 12;second_command_x [mm] 13;second_command_y [mm] 14;second_command_z [mm] 15;state",
            5.0_f64.sqrt()
        );
        assert!(found.contains(&expected), "{found}");
    }

    #[test]
    fn time_that_runs_backwards_is_negative() {
        let found = recorded(vec![record(0, u64::MAX, None), record(1, 0, None), record(2, 5, Some(1))]);
        assert_eq!(found[1][0], "0.000000");
        assert!(found[2][0].starts_with("-18446744073"), "{}", found[2][0]);
    }
}
