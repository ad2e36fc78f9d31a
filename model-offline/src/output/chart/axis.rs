//! Axes: where a value lies, and where the ticks are.

/// How values are spread along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// Decades evenly; what is not above zero has no place.
    Log,
}

/// One axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// What it shows, with the unit.
    pub label: String,
    /// Scale.
    pub scale: Scale,
    /// Ends; found from the points when absent.
    pub range: Option<[f64; 2]>,
    /// Ticks with their labels, such as names of categories; found when absent.
    pub ticks: Option<Vec<(f64, String)>>,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: &str) -> Self {
        Self { label: label.to_owned(), scale: Scale::Linear, range: None, ticks: None }
    }

    /// A logarithmic axis.
    pub fn log(label: &str) -> Self {
        Self { scale: Scale::Log, ..Self::linear(label) }
    }

    /// Equally spaced places 0, 1, 2 … with names.
    pub fn categories(label: &str, names: &[&str]) -> Self {
        let ticks = names.iter().enumerate().map(|(i, name)| (i as f64, (*name).to_owned())).collect();
        let range = Some([-0.5, names.len().max(1) as f64 - 0.5]);
        Self { range, ticks: Some(ticks), ..Self::linear(label) }
    }

    /// The same axis with these ends.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some([low, high]);
        self
    }

    /// The axis with its ends settled for these values.
    pub(super) fn settle(&self, values: impl Iterator<Item = f64>) -> Settled {
        let usable = |v: &f64| v.is_finite() && (self.scale == Scale::Linear || *v > 0.0);
        let given = self.range.filter(|[low, high]| usable(low) && usable(high) && low < high);
        let [low, high] = given.unwrap_or_else(|| {
            let start = [f64::INFINITY, f64::NEG_INFINITY];
            let [low, high] = values.filter(usable).fold(start, |[l, h], v| [l.min(v), h.max(v)]);
            match self.scale {
                _ if low > high => [[0.0, 1.0], [1.0, 10.0]][usize::from(self.scale == Scale::Log)],
                Scale::Linear => {
                    // Nothing spread: half its size to either side.
                    let spread = if high > low { high - low } else { low.abs().max(1.0) };
                    let room = 0.06 * spread;
                    // Zero stays the end where values only touch it: depths, counts, shares.
                    [if low >= 0.0 && low < 0.4 * high { 0.0 } else { low - room }, high + room]
                }
                Scale::Log => [low / (high / low).powf(0.05).max(1.2), high * (high / low).powf(0.05).max(1.2)],
            }
        });
        Settled { scale: self.scale, low, high }
    }

    /// Ticks within the settled ends.
    pub(super) fn ticks_on(&self, on: &Settled) -> Vec<(f64, String)> {
        let all = match (&self.ticks, self.scale) {
            (Some(ticks), _) => ticks.clone(),
            (None, Scale::Linear) => linear_ticks(on.low, on.high),
            (None, Scale::Log) => log_ticks(on.low, on.high),
        };
        all.into_iter().filter(|(v, _)| (-1e-9..=1.0 + 1e-9).contains(&on.fraction(*v))).collect()
    }
}

/// An axis whose ends are known.
#[derive(Debug, Clone, Copy)]
pub(super) struct Settled {
    scale: Scale,
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Settled {
    /// Place between the ends, 0 to 1; not finite where there is none.
    pub(super) fn fraction(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log if value > 0.0 => (value / self.low).ln() / (self.high / self.low).ln(),
            Scale::Log => f64::NAN,
        }
    }
}

fn linear_ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let rough = (high - low) / 5.0;
    let power = 10f64.powi(rough.log10().floor() as i32);
    let step = [1.0, 2.0, 5.0, 10.0].map(|f| f * power).into_iter().find(|s| *s >= 0.999 * rough).unwrap_or(rough);
    let decimals = (-(step * 1.001).log10().floor()).max(0.0) as usize;
    let (first, last) = ((low / step - 1e-6).ceil(), (high / step + 1e-6).floor());
    let count = (last - first).clamp(0.0, 40.0) as u32;
    (0..=count)
        .map(|i| {
            let value = (first + f64::from(i)) * step;
            // Adding zero makes −0 a 0.
            (value, minus(&format!("{:.decimals$}", value + 0.0)))
        })
        .collect()
}

/// Powers of ten; with less than two decades also 2 and 5 times them. Long axes keep every second, third … power.
fn log_ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let powers = (low.log10() - 1e-9).floor() as i32..=(high.log10() + 1e-9).ceil() as i32;
    let decades = (high / low).log10();
    let stride = ((decades / 7.0).ceil() as i32).max(1);
    let factors: &[f64] = if decades < 2.2 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    powers
        .filter(|p| p.rem_euclid(stride) == 0)
        .flat_map(|p| factors.iter().map(move |f| (f * 10f64.powi(p), power_label(*f, p))))
        .collect()
}

fn power_label(factor: f64, power: i32) -> String {
    if (-3..=4).contains(&power) {
        let decimals = usize::try_from(-power).unwrap_or(0);
        return format!("{:.decimals$}", factor * 10f64.powi(power));
    }
    let digits: String = power
        .to_string()
        .chars()
        .map(|c| c.to_digit(10).map_or('⁻', |d| ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][d as usize]))
        .collect();
    if factor == 1.0 { format!("10{digits}") } else { format!("{factor:.0}·10{digits}") }
}

fn minus(text: &str) -> String {
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, values: &[f64]) -> Vec<String> {
        let on = axis.settle(values.iter().copied());
        axis.ticks_on(&on).into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(labels(&Axis::linear(""), &[0.0, 0.2]), ["0.00", "0.05", "0.10", "0.15", "0.20"]);
        assert_eq!(labels(&Axis::linear("").range(-1.0, 1.0), &[]), ["−1.0", "−0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(labels(&Axis::categories("", &["a", "b"]), &[]), ["a", "b"]);
    }

    #[test]
    fn log_ticks_are_powers_and_short_axes_get_more() {
        assert_eq!(labels(&Axis::log("").range(1.0, 1e6), &[]), ["1", "10", "100", "1000", "10000", "10⁵", "10⁶"]);
        assert_eq!(labels(&Axis::log("").range(0.02, 0.2), &[]), ["0.02", "0.05", "0.1", "0.2"]);
        assert_eq!(labels(&Axis::log("").range(1e-16, 1.0), &[]), ["10⁻¹⁵", "10⁻¹²", "10⁻⁹", "10⁻⁶", "0.001", "1"]);
    }

    #[test]
    fn odd_values_give_an_axis_all_the_same() {
        for values in [vec![], vec![0.0], vec![5.0, 5.0], vec![f64::NAN], vec![-1.0], vec![1e-300], vec![-1e9, 1e9]] {
            for axis in [Axis::linear(""), Axis::log(""), Axis::linear("").range(1.0, 1.0)] {
                let on = axis.settle(values.iter().copied());
                assert!(on.low < on.high && on.low.is_finite() && on.high.is_finite(), "{values:?}: {on:?}");
            }
        }
        assert!(!Axis::log("").settle([1.0, 2.0].into_iter()).fraction(0.0).is_finite());
    }
}
