//! What a step costs on the board, as a figure.

use model_offline::output::chart::number::count;
use model_offline::output::chart::{Axis, Bars, Colour, Dash, Figure, Marker, Panel, Series};

use crate::bench::board::measure::{Branch, Budget, Figures};

/// Branches in the order in which a run meets them.
const BRANCHES: [(Branch, &str); 5] = [
    (Branch::Hold, "HOLD"),
    (Branch::Run, "RUN"),
    (Branch::Saturated, "RUN,\nat a limit"),
    (Branch::TableEdge, "RUN,\ntable's end"),
    (Branch::Safe, "SAFE"),
];
const MARKERS: [Marker; 5] = [Marker::Circle, Marker::Square, Marker::Triangle, Marker::Diamond, Marker::TriangleDown];
/// The image that the others are measured by: what runs without being asked for.
const DEFAULT: &str = "f64-double";
/// Bytes of a KiB.
const KIB: f64 = 1024.0;

/// Instructions by branch and image, and what each image takes of flash, statics and stack.
pub fn figure(measured: &Budget) -> Figure {
    let title = match measured.get(DEFAULT).and_then(|figures| figures.instructions.get(&Branch::Run)) {
        Some(run) => format!(
            "A step in RUN takes {} instructions in the median and {} at most ({DEFAULT})",
            count(u64::from(run.median)),
            count(u64::from(run.max))
        ),
        None => format!("{DEFAULT} made no step in RUN"),
    };
    Figure {
        title,
        caption: "Instructions of one step, counted by QEMU: the same in every run, no cycles, no worst case. Filled: median; stems \
                  from the fewest to the most, which is where a sample of the target is taken in."
            .to_owned(),
        panels: vec![instructions(measured), memory(measured)],
        columns: 1,
    }
}

fn instructions(measured: &Budget) -> Panel {
    let places = Axis::categories("", BRANCHES.map(|(_, name)| name.to_owned()).to_vec());
    let counts = measured.values().flat_map(|figures| figures.instructions.values());
    let all: Vec<f64> = counts.flat_map(|count| [f64::from(count.min), f64::from(count.max)]).collect();
    let mut panel = Panel::new(
        "Without double precision in hardware a step in f64 takes several times as many",
        places,
        Axis::log("instructions of a step", "").enclosing(all),
    );
    if let Some(ratio) = hardware(measured) {
        panel.title =
            format!("Without double precision in hardware a step of RUN in f64 takes {ratio:.0} times as many");
    }
    let apart = 0.8 / measured.len().max(1) as f64;
    for (k, (name, figures)) in measured.iter().enumerate() {
        let (colour, marker) = (Colour::CYCLE[k % Colour::CYCLE.len()], MARKERS[k % MARKERS.len()]);
        let place = |i: usize| i as f64 - 0.4 + apart * (k as f64 + 0.5);
        let mut medians = Vec::new();
        for (i, (branch, _)) in BRANCHES.iter().enumerate() {
            let Some(count) = figures.instructions.get(branch) else { continue };
            let [low, median, high] = [count.min, count.median, count.max].map(f64::from);
            panel.series.push(Series::curve("", colour, Dash::Solid, vec![(place(i), low), (place(i), high)]));
            medians.push((place(i), median));
        }
        panel.series.push(Series::scatter(name, colour, marker, medians));
    }
    panel
}

/// Median of RUN in `f64` with single precision in hardware over that with double.
fn hardware(measured: &Budget) -> Option<f64> {
    let median = |name: &str| Some(f64::from(measured.get(name)?.instructions.get(&Branch::Run)?.median));
    Some(median("f64-single")? / median(DEFAULT)?)
}

fn memory(measured: &Budget) -> Panel {
    let places = Axis::categories("", measured.keys().cloned().collect());
    type Part = (&'static str, Colour, fn(&Figures) -> u32);
    let parts: [Part; 3] = [
        ("flash without a table", Colour::Blue, |figures| figures.flash),
        ("statics, the table among them", Colour::Orange, |figures| figures.ram),
        ("stack, deepest", Colour::Green, |figures| figures.stack),
    ];
    let title = match measured.values().map(|figures| figures.stack).max() {
        Some(stack) => format!("No stack is deeper than {:.1} KiB", f64::from(stack) / KIB),
        None => "Memory".to_owned(),
    };
    let mut panel = Panel::new(&title, places, Axis::log("memory", "KiB"));
    for (k, (label, colour, of)) in parts.into_iter().enumerate() {
        let left = |i: usize| i as f64 - 0.39 + 0.26 * k as f64;
        let bars =
            measured.values().enumerate().map(|(i, figures)| [left(i), left(i) + 0.26, f64::from(of(figures)) / KIB]);
        panel.bars.push(Bars { label: label.to_owned(), colour, bars: bars.collect() });
    }
    panel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::board::measure::Instructions;

    #[test]
    fn the_title_tells_the_default_image_and_what_hardware_is_worth() {
        let figures = |median: u32| Figures {
            flash: 30_000,
            ram: 60_000,
            stack: 2_560,
            steps: 10,
            instructions: [(Branch::Run, Instructions { min: median / 2, median, max: 2 * median })].into(),
        };
        let measured: Budget = [("f64-single", 20_000), ("f64-double", 2_000)]
            .map(|(name, median)| (name.to_owned(), figures(median)))
            .into();
        let figure = figure(&measured);
        assert_eq!(figure.title, "A step in RUN takes 2000 instructions in the median and 4000 at most (f64-double)");
        assert!(figure.panels[0].title.contains("takes 10 times as many"));
        assert_eq!(figure.panels[1].title, "No stack is deeper than 2.5 KiB");
        // Every image has its median, and bars of three kinds.
        let medians =
            figure.panels[0].series.iter().filter(|series| series.marker.is_some() && !series.points.is_empty());
        assert_eq!(medians.map(|series| series.points[0].1).collect::<Vec<_>>(), [2_000.0, 20_000.0]);
        assert_eq!(figure.panels[1].bars.len(), 3);
    }
}
