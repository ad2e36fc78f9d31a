//! All worlds of a scene as a figure: who is held by what, and where it does not help.

use model_offline::output::chart::{Axis, Bars, Colour, Dash, Figure, Marker, Panel, Series};
use model_offline::scene::Effect;

use super::worlds::in_words;
use crate::bench::worlds::{Controlled, SensorRow, WorldRow, Worlds};

/// A panel per patient and sensor: peaks without a paddle, with the best static paddle, and with both tables.
pub fn figure(worlds: &Worlds) -> Figure {
    let peaks = || worlds.rows.iter().flat_map(peaks_of);
    let [mut known, mut simple, mut cells] = [0, 0, 0];
    for (row, sensor) in worlds.rows.iter().flat_map(|row| row.sensors.iter().map(move |sensor| (row, sensor))) {
        cells += 1;
        known += usize::from(sensor.known.as_ref().is_some_and(|run| run.peak.median < row.fixture.peak));
        simple += usize::from(sensor.simple.peak.median < row.fixture.peak);
    }
    let mut panels = Vec::new();
    for patient in ["still", "breathing"] {
        let rows: Vec<&WorldRow> = worlds.rows.iter().filter(|row| in_words(&row.effects)[2] == patient).collect();
        let sensors = rows.iter().map(|row| row.sensors.len()).max().unwrap_or(0);
        for k in 0..sensors {
            let found = rows.iter().filter_map(|row| Some((*row, row.sensors.get(k)?))).collect::<Vec<_>>();
            panels.push(panel(patient, &found, &worlds.length_unit, peaks().collect()));
        }
    }
    Figure {
        title: format!(
            "{}: with a table that knows the world the target is held better than by the best static paddle in {known} of {cells} worlds, \
             with one that does not in {simple}",
            worlds.scene
        ),
        caption: format!(
            "Largest displacement of the target orthogonal to the needle, medians of {} seeds; stems: nine in ten. Static: paddle \
             {}, Stillpoint: paddle {}. Logarithmic: bars begin at the lower end of the axis.",
            worlds.seeds, worlds.paddles[0], worlds.paddles[1]
        ),
        panels,
        columns: 2,
    }
}

/// Every peak that is drawn of a row, length.
fn peaks_of(row: &WorldRow) -> Vec<f64> {
    let runs = row.sensors.iter().flat_map(|sensor| sensor.known.iter().chain([&sensor.simple]));
    runs.flat_map(|run| [run.peak.low, run.peak.high]).chain([row.none.peak, row.fixture.peak]).collect()
}

/// One patient seen by one sensor.
fn panel(patient: &str, found: &[(&WorldRow, &SensorRow)], unit: &str, all: Vec<f64>) -> Panel {
    let name = |effects: &[Effect]| {
        let [needle, tissue, _] = in_words(effects);
        format!("{needle}\n{tissue}")
    };
    let sensor = found.first().map_or_else(String::new, |(_, sensor)| sensor.sensor.to_string());
    let helped = found.iter().filter(|(row, sensor)| sensor.simple.peak.median < row.none.peak).count();
    let title = match found.len() - helped {
        0 => format!("Patient {patient}, {sensor}: either table is better than no paddle"),
        1 => format!("Patient {patient}, {sensor}: in 1 world a table that does not know it is worse than no paddle"),
        hurt => format!(
            "Patient {patient}, {sensor}: in {hurt} worlds a table that does not know them is worse than no paddle"
        ),
    };
    let places = Axis::categories("", found.iter().map(|(row, _)| name(&row.effects)).collect());
    let mut panel = Panel::new(&title, places, Axis::log("peak", unit).enclosing(all));
    let places = || found.iter().enumerate().map(|(k, (row, sensor))| (k as f64, *row, *sensor));
    let mut bars = |label: &str, colour, left: f64, height: &dyn Fn(&WorldRow) -> f64| {
        let bars = places().map(|(x, row, _)| [x + left, x + left + 0.2, height(row)]).collect();
        panel.bars.push(Bars { label: label.to_owned(), colour, bars });
    };
    bars("no paddle", Colour::Quiet, -0.42, &|row| row.none.peak);
    bars("static paddle", Colour::Vermillion, -0.2, &|row| row.fixture.peak);
    let knows: Vec<(f64, &Controlled)> =
        places().filter_map(|(x, _, sensor)| Some((x + 0.14, sensor.known.as_ref()?))).collect();
    let not: Vec<(f64, &Controlled)> = places().map(|(x, _, sensor)| (x + 0.32, &sensor.simple)).collect();
    for (x, run) in knows.iter().chain(&not) {
        let stem = vec![(*x, run.peak.low), (*x, run.peak.high)];
        panel.series.push(Series::curve("", Colour::Blue, Dash::Solid, stem));
    }
    let points = |runs: &[(f64, &Controlled)]| runs.iter().map(|(x, run)| (*x, run.peak.median)).collect();
    panel.series.push(Series::scatter("Stillpoint, table knows", Colour::Blue, Marker::Circle, points(&knows)));
    panel.series.push(Series::scatter("table does not know", Colour::Blue, Marker::Circle, points(&not)).open());
    panel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::in_process::Errors;
    use crate::bench::worlds::Spread;
    use model_offline::scene::SensorPreset;

    fn run(median: f64) -> Controlled {
        let spread = Spread { low: 0.9 * median, median, high: 1.1 * median };
        Controlled { peak: spread, rms: spread, run_share: 1.0, tissue_estimate: 0.0, tissue_error: Some(0.0) }
    }

    fn row(effects: Vec<Effect>, known: f64, simple: f64) -> WorldRow {
        WorldRow {
            effects,
            none: Errors { peak: 1.0, rms: 1.0 },
            fixture: Errors { peak: 0.5, rms: 0.5 },
            sensors: vec![SensorRow { sensor: SensorPreset::Ultrasound, known: Some(run(known)), simple: run(simple) }],
            no_table: None,
        }
    }

    #[test]
    fn where_it_does_not_help_is_in_the_titles() {
        let worlds = Worlds {
            scene: "breast".to_owned(),
            length_unit: "mm".to_owned(),
            seeds: 20,
            paddles: [4, 3],
            rows: vec![
                row(vec![], 0.1, 0.1),
                row(vec![Effect::Shaft], 0.1, 1.2),
                row(vec![Effect::Breathing], 0.6, 0.7),
            ],
            waiting: vec![],
            other_tissue: None,
        };
        let figure = figure(&worlds);
        let told = "breast: with a table that knows the world the target is held better than by the best static paddle in 2 of 3 worlds, \
                    with one that does not in 1";
        assert_eq!(figure.title, told);
        let [still, breathing] = &figure.panels[..] else { panic!("{} panels", figure.panels.len()) };
        assert!(still.title.contains("in 1 world a table that does not know it is worse than no paddle"));
        assert!(breathing.title.contains("either table is better than no paddle"));
        // Both on one scale, with everything on it.
        assert_eq!(still.y.range, breathing.y.range);
        let [low, high] = still.y.range.unwrap();
        assert!(low <= 0.09 && high >= 1.32);
    }
}
