//! Axes: where a value lies, and where the ticks are.

use super::number::{exponent, minus, power_of_ten};

/// Ticks aimed at on a linear axis.
const TICKS: f64 = 5.0;

/// How values are spread along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// Decades evenly; what is not above zero has no place.
    Log,
}

/// One axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What it shows.
    pub quantity: String,
    /// In what; empty or `1`: a number without unit. Shown in brackets, after the power of ten taken out of the ticks.
    pub unit: String,
    /// Scale.
    pub scale: Scale,
    /// Ends; found from the values when absent.
    pub range: Option<[f64; 2]>,
    /// Names of the places 0, 1, 2 …; where absent, ticks are numbers. A name may have a second line after `\n`.
    pub names: Option<Vec<String>>,
}

impl Axis {
    /// A linear axis.
    pub fn linear(quantity: &str, unit: &str) -> Self {
        Self { quantity: quantity.to_owned(), unit: unit.to_owned(), scale: Scale::Linear, range: None, names: None }
    }

    /// A logarithmic axis.
    pub fn log(quantity: &str, unit: &str) -> Self {
        Self { scale: Scale::Log, ..Self::linear(quantity, unit) }
    }

    /// Equally spaced places 0, 1, 2 … with names.
    pub fn categories(quantity: &str, names: Vec<String>) -> Self {
        let range = Some([-0.5, names.len().max(1) as f64 - 0.5]);
        Self { range, names: Some(names), ..Self::linear(quantity, "") }
    }

    /// The same axis with these ends.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some([low, high]);
        self
    }

    /// The same axis with ends that enclose these values, for panels on one scale.
    #[must_use]
    pub fn enclosing(mut self, values: impl IntoIterator<Item = f64>) -> Self {
        self.range = Some(self.settle(values.into_iter()).range);
        self
    }

    /// The axis with ends and ticks settled for these values.
    pub(super) fn settle(&self, values: impl Iterator<Item = f64>) -> Settled {
        let usable = |v: &f64| v.is_finite() && (self.scale == Scale::Linear || *v > 0.0);
        let given = self.range.filter(|[low, high]| usable(low) && usable(high) && low < high);
        let start = [f64::INFINITY, f64::NEG_INFINITY];
        let found = values.filter(usable).fold(start, |[low, high], v| [low.min(v), high.max(v)]);
        let found = if found[0] > found[1] { [1.0, 1.0] } else { found };
        let mut label = self.quantity.clone();
        let mut unit = if self.unit == "1" { String::new() } else { self.unit.clone() };
        let (range, ticks, shift) = match (&self.names, self.scale) {
            (Some(names), _) => {
                let ticks = names.iter().enumerate().map(|(i, name)| (i as f64, name.clone())).collect();
                (given.unwrap_or([-0.5, 0.5]), ticks, 0)
            }
            (None, Scale::Linear) => linear(given, found),
            (None, Scale::Log) => {
                let room = (found[1] / found[0]).powf(0.05).max(1.2);
                // Doubles end where the room would pass their largest and least.
                let ends = [(found[0] / room).max(f64::MIN_POSITIVE), (found[1] * room).min(f64::MAX)];
                let range = given.unwrap_or(ends);
                let (ticks, shift) = log_ticks(range);
                (range, ticks, shift)
            }
        };
        if shift != 0 {
            unit = format!("{} {unit}", power_of_ten(shift)).trim_end().to_owned();
        }
        if !unit.is_empty() {
            label = format!("{label} [{unit}]");
        }
        let grid = self.names.is_none();
        let mut settled = Settled { label, ticks: Vec::new(), grid, range, scale: self.scale };
        settled.ticks =
            ticks.into_iter().filter(|(v, _)| (-1e-9..=1.0 + 1e-9).contains(&settled.fraction(*v))).collect();
        settled
    }
}

/// An axis whose ends are known.
#[derive(Clone, Debug)]
pub(super) struct Settled {
    /// Quantity and unit.
    pub(super) label: String,
    /// Places of ticks and their labels.
    pub(super) ticks: Vec<(f64, String)>,
    /// Whether lines across the chart mark the ticks.
    pub(super) grid: bool,
    /// Ends.
    pub(super) range: [f64; 2],
    scale: Scale,
}

impl Settled {
    /// Ends and scale in words that a script can read.
    pub(super) fn span(&self) -> String {
        let [low, high] = self.range;
        let scale = match self.scale {
            Scale::Linear => "linear",
            Scale::Log => "log",
        };
        format!("{low:e} {high:e} {scale}")
    }

    /// Place between the ends, 0 to 1; not finite where there is none.
    pub(super) fn fraction(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        match self.scale {
            Scale::Linear => (value - low) / (high - low),
            Scale::Log if value > 0.0 => (value.ln() - low.ln()) / (high.ln() - low.ln()),
            Scale::Log => f64::NAN,
        }
    }
}

/// 1, 2 or 5 times a power of ten, at least `rough`.
fn nice_step(rough: f64) -> f64 {
    let power = 10f64.powi(exponent(rough));
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|factor| factor * power).find(|step| *step >= rough * 0.999).unwrap_or(rough)
}

/// Ends, ticks, and the power of ten taken out of their labels. Ends that are not given lie at ticks, or halfway between
/// two, and enclose all values.
fn linear(given: Option<[f64; 2]>, found: [f64; 2]) -> ([f64; 2], Vec<(f64, String)>, i32) {
    let [mut low, mut high] = given.unwrap_or(found);
    let size = low.abs().max(high.abs());
    if high - low <= size * 1e-9 {
        let half = if size > 0.0 { 0.5 * size } else { 0.5 };
        (low, high) = (low - half, high + half);
    }
    let step = nice_step((high - low) / TICKS);
    // Half a step is near enough: less empty paper.
    let enclosing = || [(2.0 * low / step + 1e-6).floor(), (2.0 * high / step - 1e-6).ceil()].map(|h| 0.5 * h * step);
    let range = given.unwrap_or_else(enclosing);
    let (first, last) = ((range[0] / step - 1e-6).ceil(), (range[1] / step + 1e-6).floor());
    let largest = first.abs().max(last.abs()) * step;
    let shift = if (-2..4).contains(&exponent(largest)) { 0 } else { exponent(largest) };
    let decimals = usize::try_from(shift - exponent(step * 1.000_001)).unwrap_or(0);
    let count = (last - first).round().clamp(0.0, 50.0) as u32;
    let ticks = (0..=count)
        .map(|i| {
            let value = (first + f64::from(i)) * step;
            // Adding zero makes −0 a 0.
            let shown = value / 10f64.powi(shift) + 0.0;
            (value, minus(format!("{shown:.decimals$}")))
        })
        .collect();
    (range, ticks, shift)
}

/// Ticks, and the power of ten taken out of their labels: powers of ten; with less than two decades also 2 and 5 times
/// them, or all between. Long axes keep every second, third … power.
fn log_ticks([low, high]: [f64; 2]) -> (Vec<(f64, String)>, i32) {
    let powers = (low.log10() - 1e-9).floor() as i32..=(high.log10() + 1e-9).ceil() as i32;
    let decades = high.log10() - low.log10();
    let stride = ((decades / 7.0).ceil() as i32).max(1);
    let with = |factors: &[u32]| -> Vec<(f64, String)> {
        let at = |power: i32| factors.iter().map(move |f| (f64::from(*f) * 10f64.powi(power), log_label(*f, power)));
        let ticks = powers.clone().filter(|p| p.rem_euclid(stride) == 0).flat_map(at);
        ticks.filter(|(v, _)| (low * 0.999_999..=high * 1.000_001).contains(v)).collect()
    };
    let few: &[u32] = if decades < 2.2 { &[1, 2, 5] } else { &[1] };
    let all = [1, 2, 3, 4, 5, 6, 7, 8, 9];
    let ticks = if with(few).len() < 3 { with(&all) } else { with(few) };
    // So short that it may as well be linear.
    if ticks.len() >= 2 {
        return (ticks, 0);
    }
    let (_, ticks, shift) = linear(Some([low, high]), [low, high]);
    (ticks, shift)
}

fn log_label(factor: u32, power: i32) -> String {
    if (-3..=4).contains(&power) {
        let decimals = usize::try_from(-power).unwrap_or(0);
        return format!("{:.decimals$}", f64::from(factor) * 10f64.powi(power));
    }
    if factor == 1 { power_of_ten(power) } else { format!("{factor}·{}", power_of_ten(power)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settled(axis: &Axis, values: &[f64]) -> Settled {
        axis.settle(values.iter().copied())
    }

    fn labels(axis: &Axis, values: &[f64]) -> Vec<String> {
        settled(axis, values).ticks.into_iter().map(|tick| tick.1).collect()
    }

    #[test]
    fn ticks_are_round_and_enclose_the_values() {
        let error = Axis::linear("error", "mm");
        let axis = settled(&error, &[-0.0027, f64::NAN, 0.0023]);
        assert_eq!(axis.label, "error [10⁻³ mm]");
        assert_eq!(labels(&error, &[-0.0027, 0.0023]), ["−3", "−2", "−1", "0", "1", "2"]);
        assert!((axis.fraction(0.0) - 3.0 / 5.5).abs() < 1e-12);
        let depth = Axis::linear("depth", "1");
        assert_eq!(settled(&depth, &[0.0, 0.1]).label, "depth");
        assert_eq!(labels(&depth, &[0.0, 0.1]), ["0.00", "0.02", "0.04", "0.06", "0.08", "0.10"]);
        let axis = settled(&depth, &[-1.04e-5, 0.8e-5]);
        assert_eq!(axis.label, "depth [10⁻⁵]");
        assert!((axis.range[0] + 1.25e-5).abs() < 1e-12);
        assert_eq!(labels(&depth.range(-1.0, 1.0), &[]), ["−1.0", "−0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(labels(&Axis::categories("", vec!["a".into(), "b".into()]), &[]), ["a", "b"]);
    }

    #[test]
    fn log_ticks_are_powers_and_short_axes_get_more() {
        let log = |low, high| Axis::log("", "").range(low, high);
        assert_eq!(labels(&log(1.0, 1e6), &[]), ["1", "10", "100", "1000", "10000", "10⁵", "10⁶"]);
        assert_eq!(labels(&log(0.02, 0.2), &[]), ["0.02", "0.05", "0.1", "0.2"]);
        assert_eq!(labels(&log(1e-16, 1.0), &[]), ["10⁻¹⁵", "10⁻¹²", "10⁻⁹", "10⁻⁶", "0.001", "1"]);
        assert_eq!(labels(&log(0.95e-6, 3.5e-6), &[]), ["10⁻⁶", "2·10⁻⁶", "3·10⁻⁶"]);
        assert_eq!(labels(&log(1.11, 1.19), &[]), ["1.12", "1.14", "1.16", "1.18"]);
        let short = Axis::log("error", "mm").range(1.6e-6, 1.9e-6);
        assert_eq!(settled(&short, &[]).label, "error [10⁻⁶ mm]");
        assert_eq!(labels(&short, &[])[0], "1.6");
        assert!((settled(&log(1.0, 1000.0), &[]).fraction(10.0) - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn odd_values_give_an_axis_all_the_same() {
        let all = [vec![], vec![0.0], vec![5.0, 5.0], vec![f64::NAN], vec![-1.0], vec![1e-300], vec![-1e300, 1e300]];
        for values in all {
            for axis in [Axis::linear("", ""), Axis::log("", ""), Axis::linear("", "").range(1.0, 1.0)] {
                let on = settled(&axis, &values);
                let [low, high] = on.range;
                assert!(low < high && low.is_finite() && high.is_finite(), "{values:?}: {on:?}");
                assert!(!on.ticks.is_empty(), "{values:?}: {on:?}");
            }
        }
        assert!(!settled(&Axis::log("", ""), &[1.0, 2.0]).fraction(0.0).is_finite());
    }
}
