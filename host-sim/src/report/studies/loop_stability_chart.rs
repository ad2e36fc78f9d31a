//! The closed loop's stability as a figure: theory beside simulation, tables on other tissue, and rate limits.

use firmware::loop_stability::gain_limit;
use model_offline::output::chart::number::number;
use model_offline::output::chart::{Axis, Colour, Dash, Figure, Marker, Panel, Place, ReferenceLine, Series};

use super::loop_stability::simulated_limit;
use crate::bench::loop_stability::LoopStabilityResult;
use crate::bench::loop_stability::behaviour::Behaviour;
use crate::bench::loop_stability::cells::{ANGLES, DELAYS};
use crate::bench::loop_stability::mismatch::Mismatch;
use crate::bench::loop_stability::rate_limit::{self, Integrator};
use model_offline::scene::TissueVariant;

/// Delays and paddles, one after the other.
const MARKERS: [Marker; 6] =
    [Marker::Circle, Marker::Square, Marker::Triangle, Marker::Diamond, Marker::TriangleDown, Marker::TriangleRight];

fn look(k: usize) -> (Colour, Marker) {
    (Colour::CYCLE[k % Colour::CYCLE.len()], MARKERS[k % MARKERS.len()])
}

/// Theory beside simulation, tables on other tissue, and rate limits.
pub fn figure(result: &LoopStabilityResult) -> Figure {
    let mut panels = vec![boundary_panel(result)];
    if !result.mismatches.is_empty() {
        panels.push(size_panel(result, TissueVariant::Homogeneous, "Table without the inclusion, tissue with it"));
        panels.push(size_panel(result, TissueVariant::Inclusion, "Table with the inclusion, tissue without it"));
        panels.push(margin_panel(result));
    }
    for integrator in [Integrator::Plain, Integrator::AntiWindup] {
        panels.push(rate_panel(result, integrator, rate_limit::DELAYS[1]));
    }
    let cells = result.boundaries.len() * result.gains().len();
    let disagreeing: usize = result.boundaries.iter().map(|b| b.disagreeing).sum();
    Figure {
        title: format!(
            "The closed loop is stable where theory says so: {disagreeing} of {cells} simulated cells differ ({})",
            result.scene
        ),
        caption: "Loop: e⁺ = e − g·J·Ĵ⁻¹·e(k−d). First panel: lines are theory, markers simulated, delays in samples."
            .into(),
        panels,
        columns: 3,
    }
}

/// Limit of the gain against the angle of the eigenvalues, by delay.
fn boundary_panel(result: &LoopStabilityResult) -> Panel {
    let worst = result.boundaries.iter().map(|b| b.theory_cells.abs_diff(b.simulated_cells)).max().unwrap_or(0);
    let cells = if worst == 1 { "cell" } else { "cells" };
    let largest = ANGLES.iter().copied().fold(0.0, f64::max);
    let mut panel = Panel::new(
        &format!("No boundary is off by more than {worst} {cells}"),
        Axis::linear("|arg λ|", "degrees").range(0.0, largest),
        Axis::log("largest stable g·|λ|", "").range(0.01, 3.0),
    );
    for (k, delay) in DELAYS.into_iter().enumerate() {
        let curve = (0..=89).map(|a| (f64::from(a), gain_limit(f64::from(a).to_radians(), delay))).collect();
        let (colour, marker) = look(k);
        let found = result
            .boundaries
            .iter()
            .filter(|b| b.delay == delay && b.size == 1.0 && b.simulated_cells > 0)
            .map(|b| (b.angle, simulated_limit(result, b)))
            .collect();
        panel.series.push(Series::curve("", colour, Dash::Solid, curve));
        panel.series.push(Series::scatter("", colour, marker, found));
        // The legend alone: theory and simulation in one sample.
        let name = format!("delay {delay}");
        panel.series.push(Series::scatter(&name, colour, marker, Vec::new()).joined(Dash::Solid));
    }
    panel
}

/// One line per paddle for tables of one tissue on the other.
fn by_paddle(result: &LoopStabilityResult, table: TissueVariant, height: fn(&Mismatch) -> f64) -> Vec<Series> {
    let mut paddles: Vec<u32> = result.mismatches.iter().map(|m| m.paddle).collect();
    paddles.sort_unstable();
    paddles.dedup();
    let of_paddle = |(k, &paddle): (usize, &u32)| {
        let rows = result.mismatches.iter().filter(|m| m.paddle == paddle && m.table == table);
        let (colour, marker) = look(k);
        let points = rows.map(|m| (m.depth, height(m))).collect();
        Series::scatter(&format!("paddle {paddle}"), colour, marker, points).joined(Dash::Solid)
    };
    paddles.iter().enumerate().map(of_paddle).collect()
}

fn heights(series: &[Series]) -> impl Iterator<Item = f64> {
    series.iter().flat_map(|s| &s.points).map(|p| p.1).filter(|y| y.is_finite())
}

fn size_panel(result: &LoopStabilityResult, table: TissueVariant, title: &str) -> Panel {
    let series = by_paddle(result, table, |m| m.largest);
    let largest = heights(&series).fold(0.0, f64::max);
    let top = 1.15 * largest.max(result.lambda_max);
    let allowed = ReferenceLine::new("size that the gain allows for", Place::Y(result.lambda_max), Dash::Dashed);
    Panel {
        series,
        lines: vec![allowed],
        ..Panel::new(
            &format!("{title}: at most {} of the {} allowed for", number(largest, 3), result.lambda_max),
            Axis::linear("needle depth", ""),
            Axis::linear("largest |λ| of J·Ĵ⁻¹", "").range(0.0, top),
        )
    }
}

fn margin_panel(result: &LoopStabilityResult) -> Panel {
    let series = by_paddle(result, TissueVariant::Inclusion, |m| m.simulated_margin);
    let least = heights(&series).fold(f64::INFINITY, f64::min);
    let top = 1.15 * heights(&series).fold(1.0, f64::max);
    Panel {
        series,
        lines: vec![ReferenceLine::new("unstable below", Place::Y(1.0), Dash::Dotted)],
        ..Panel::new(
            &format!("… so the gain could grow {} times", number(least, 3)),
            Axis::linear("needle depth", ""),
            Axis::linear("largest stable gain over the gain", "").range(0.0, top),
        )
    }
}

fn rate_panel(result: &LoopStabilityResult, integrator: Integrator, delay: u32) -> Panel {
    let cells = || result.cells.iter().filter(|c| c.integrator == integrator && c.delay == delay);
    let of = |behaviour| {
        let alike = cells().filter(|c| c.behaviour == behaviour);
        alike.map(|c| (c.gain_share, c.amplitude)).collect::<Vec<_>>()
    };
    let below = || cells().filter(|c| c.gain_share < 0.99);
    let bad = below().filter(|c| c.behaviour != Behaviour::Settles).count();
    let name = match integrator {
        Integrator::Plain => "Plain integral",
        Integrator::AntiWindup => "The controller's law",
    };
    Panel {
        series: vec![
            Series::scatter("settles", Colour::Quiet, Marker::Dot, of(Behaviour::Settles)),
            Series::scatter("cycles", Colour::Orange, Marker::Circle, of(Behaviour::Cycles)),
            Series::scatter("only bounded by the limits", Colour::Vermillion, Marker::Square, of(Behaviour::Diverges)),
        ],
        lines: vec![ReferenceLine::new("limit by linear theory", Place::X(1.0), Dash::Dashed)],
        ..Panel::new(
            &format!(
                "{name}, rate limit, delay {delay}: {bad} of {} cells below the limit do not settle",
                below().count()
            ),
            Axis::log("gain over its linear limit", "").range(0.07, 1.8),
            Axis::log("error over reach per sample", "").range(0.08, 130.0),
        )
    }
}
