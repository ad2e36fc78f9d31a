//! Axes: where a value lies, and where the ticks are.

use super::number::{exponent, minus, power_of_ten};

/// Ticks aimed at on a linear axis.
const TICKS: f64 = 5.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scale {
    Linear,
    Logarithmic,
}

/// One axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// What it shows, with the unit and the power of ten taken out of the ticks.
    pub(super) label: String,
    /// Places of ticks and their labels.
    pub(super) ticks: Vec<(f64, String)>,
    /// Whether lines across the chart mark the ticks.
    pub(super) grid: bool,
    /// Ends.
    pub(super) range: [f64; 2],
    scale: Scale,
}

/// Smallest and largest of the finite ones.
fn extent(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let [low, high] = values
        .into_iter()
        .filter(|value| value.is_finite())
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
    if low > high { [0.0, 1.0] } else { [low, high] }
}

/// 1, 2 or 5 times a power of ten, at least `rough`.
fn nice_step(rough: f64) -> f64 {
    let power = 10f64.powi(exponent(rough));
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|factor| factor * power).find(|step| *step >= rough * 0.999).unwrap_or(rough)
}

impl Axis {
    /// Ends at ticks, or halfway between two, that enclose all values. `what` gets the power of ten, then the unit.
    pub(super) fn linear(what: &str, unit: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let [mut low, mut high] = extent(values);
        let size = low.abs().max(high.abs());
        if high - low <= size * 1e-9 {
            let half = if size > 0.0 { 0.5 * size } else { 0.5 };
            (low, high) = (low - half, high + half);
        }
        let step = nice_step((high - low) / TICKS);
        // Half a step is near enough: less empty paper.
        let range =
            [(2.0 * low / step + 1e-6).floor(), (2.0 * high / step - 1e-6).ceil()].map(|half| 0.5 * half * step);
        let (first, last) = ((range[0] / step - 1e-6).ceil(), (range[1] / step + 1e-6).floor());
        let largest = first.abs().max(last.abs()) * step;
        let shift = if (-2..4).contains(&exponent(largest)) { 0 } else { exponent(largest) };
        let decimals = usize::try_from(shift - exponent(step * 1.000_001)).unwrap_or(0);
        let count = (last - first).round().clamp(0.0, 50.0) as u32;
        let ticks = (0..=count)
            .map(|i| {
                let value = (first + f64::from(i)) * step;
                let shown = value / 10f64.powi(shift) + 0.0;
                (value, minus(format!("{shown:.decimals$}")))
            })
            .collect();
        let unit = if unit == "1" { "" } else { unit };
        let unit = match (shift, unit) {
            (0, "") => String::new(),
            (0, unit) => format!(" [{unit}]"),
            (shift, "") => format!(" [{}]", power_of_ten(shift)),
            (shift, unit) => format!(" [{} {unit}]", power_of_ten(shift)),
        };
        Self { label: format!("{what}{unit}"), ticks, grid: true, range, scale: Scale::Linear }
    }

    /// From `low` to at least `high` with ticks at powers of ten.
    pub(super) fn logarithmic(label: &str, low: f64, high: f64) -> Self {
        let high = 10f64.powi((high.max(low * 2.0) * 0.999_999).log10().ceil() as i32);
        let ticks = (exponent(low)..=exponent(high))
            .map(|power| 10f64.powi(power))
            .filter(|tick| (low..=high * 1.000_001).contains(tick))
            .map(|tick| (tick, if tick < 9e4 { format!("{tick}") } else { power_of_ten(exponent(tick * 1.000_001)) }))
            .collect();
        Self { label: label.to_owned(), ticks, grid: true, range: [low, high], scale: Scale::Logarithmic }
    }

    /// Equally spaced places 0, 1, 2 … with these names.
    pub(super) fn places(label: &str, names: impl IntoIterator<Item = String>) -> Self {
        let ticks: Vec<(f64, String)> = names.into_iter().enumerate().map(|(i, name)| (i as f64, name)).collect();
        let last = ticks.len() as f64 - 0.5;
        Self { label: label.to_owned(), ticks, grid: false, range: [-0.5, last.max(0.5)], scale: Scale::Linear }
    }

    /// Place between the ends, 0 to 1; not a number where there is none.
    pub(super) fn fraction(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        match self.scale {
            Scale::Linear => (value - low) / (high - low),
            Scale::Logarithmic => (value / low).log10() / (high / low).log10(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|tick| tick.1.as_str()).collect()
    }

    #[test]
    fn ticks_are_round_and_enclose_the_values() {
        let axis = Axis::linear("error", "mm", [-0.0027, f64::NAN, 0.0023]);
        assert_eq!(axis.label, "error [10⁻³ mm]");
        assert_eq!(labels(&axis), ["−3", "−2", "−1", "0", "1", "2"]);
        assert!((axis.fraction(0.0) - 3.0 / 5.5).abs() < 1e-12);
        let axis = Axis::linear("depth", "1", [0.0, 0.1]);
        assert_eq!(axis.label, "depth");
        assert_eq!(labels(&axis), ["0.00", "0.02", "0.04", "0.06", "0.08", "0.10"]);
        let axis = Axis::linear("error", "1", [-1.04e-5, 0.8e-5]);
        assert_eq!(axis.label, "error [10⁻⁵]");
        assert_eq!(labels(&axis), ["−1.0", "−0.5", "0.0", "0.5", "1.0"]);
        assert!((axis.range[0] + 1.25e-5).abs() < 1e-12);
    }

    #[test]
    fn odd_ranges_give_an_axis_all_the_same() {
        for values in [vec![], vec![0.0], vec![5.0, 5.0], vec![f64::NAN], vec![-1e300, 1e300], vec![1e-300]] {
            let axis = Axis::linear("x", "1", values.clone());
            assert!(axis.ticks.len() >= 2, "{values:?}");
            assert!(axis.range[0] < axis.range[1], "{values:?}");
        }
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten() {
        let axis = Axis::logarithmic("µs", 1.0, 964.0);
        assert_eq!(labels(&axis), ["1", "10", "100", "1000"]);
        assert!((axis.fraction(10.0) - 1.0 / 3.0).abs() < 1e-12);
        assert!(!axis.fraction(0.0).is_finite());
    }
}
