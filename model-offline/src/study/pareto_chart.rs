//! The comparison as a figure and as a table for the terminal.

use super::measurement::{Job, Linearity, ModelKind, Point};
use super::pareto::Pareto;
use crate::discretization::Integration;
use crate::output::chart::{Axis, Dash, Figure, Marker, Panel, Series};
use std::fmt::Write as _;

fn marker(integration: Integration) -> Marker {
    match integration {
        Integration::Dni => Marker::Diamond,
        Integration::Scni => Marker::Circle,
        Integration::ScniStabilised => Marker::Square,
        Integration::Mscni => Marker::Dot,
        Integration::Nsni => Marker::Square,
        Integration::Gauss => Marker::Plus,
        Integration::FemT3 => Marker::Triangle,
        Integration::FemT6 => Marker::TriangleDown,
    }
}

/// Series of a job's points, told apart by a label, and the front.
fn panel(
    pareto: &Pareto,
    job: Job,
    title: &str,
    y: &str,
    error: fn(&Point) -> f64,
    look: fn(&Point) -> (String, Marker, bool),
) -> Panel {
    let x = if job == Job::Step { "time of one step, s" } else { "time, s (one thread, best of several)" };
    let mut panel = Panel::new(title, Axis::log(x), Axis::log(y));
    for point in pareto.points.iter().filter(|p| p.job == job) {
        let (label, marker, filled) = look(point);
        let at = (point.wall_s, error(point));
        let place = panel.series.iter().position(|s| s.label == label);
        let place = place.unwrap_or_else(|| {
            panel.series.push(Series::scatter(&label, marker, filled, Vec::new()));
            panel.series.len() - 1
        });
        if point.failure.is_some() {
            panel.series[place].failures.push(at);
        } else {
            panel.series[place].points.push(at);
        }
    }
    // The front of this panel's own error.
    let mut points: Vec<(f64, f64)> = pareto
        .points
        .iter()
        .filter(|p| p.job == job && p.failure.is_none())
        .map(|p| (p.wall_s, error(p)))
        .filter(|(t, e)| t.is_finite() && e.is_finite())
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best = f64::INFINITY;
    points.retain(|(_, e)| {
        let better = *e < best;
        best = best.min(*e);
        better
    });
    panel.series.push(Series::curve("Pareto front", Dash::Solid, points));
    panel
}

/// Series that differ in filling only share a name with both meanings, so that the legend stays short.
fn look(point: &Point, filled: bool) -> (String, Marker, bool) {
    let integration = point.discretization.method.integration;
    let rule = integration.name();
    let label = match (integration, filled) {
        // A cross cannot be filled.
        (Integration::Gauss, _) => rule.to_owned(),
        (_, true) => format!("{rule}: graded; nonlinear law"),
        (_, false) => format!("{rule}: uniform; linear law"),
    };
    (label, marker(integration), filled && integration != Integration::Gauss)
}

fn by_rule(point: &Point) -> (String, Marker, bool) {
    look(point, point.discretization.resolution.is_graded())
}

fn by_law(point: &Point) -> (String, Marker, bool) {
    look(point, point.law == Linearity::Nonlinear)
}

fn by_plant(point: &Point) -> (String, Marker, bool) {
    match point.method {
        ModelKind::Reduced => ("reduced model".into(), Marker::Square, true),
        ModelKind::Condensed => ("condensed linear model".into(), Marker::Diamond, false),
        _ => ("full model".into(), Marker::Circle, true),
    }
}

impl Pareto {
    /// The comparison as one SVG.
    pub fn svg(&self, scene: &str, tissue: &str) -> String {
        let barrier = self.barrier.map_or(String::new(), |b| format!(", barrier {b:.0} added for finite depth"));
        Figure {
            title: format!("Error against time: {scene}, {tissue} tissue"),
            caption: format!(
                "references good to {:.2} % (small depth) and {:.2} % (finite depth){barrier}",
                100.0 * self.open.0,
                100.0 * self.open.1
            ),
            panels: vec![
                panel(self, Job::Placement, "All Jacobians", "error of controllability", |p| p.error_cm, by_rule),
                panel(
                    self,
                    Job::Placement,
                    "Small-depth displacement",
                    "error, of the largest",
                    |p| p.error_static,
                    by_rule,
                ),
                panel(
                    self,
                    Job::Insertion,
                    "Whole insertion, all paddles",
                    "error, of the largest",
                    |p| p.error_static,
                    by_law,
                ),
                panel(
                    self,
                    Job::Step,
                    "One step of a simulator",
                    "error, of the largest",
                    |p| p.error_static,
                    by_plant,
                ),
            ],
            columns: 2,
        }
        .svg()
    }

    /// The fronts as text, one line per setting.
    pub fn table(&self) -> String {
        let mut out = String::new();
        for (job, what, unit, scale) in [
            (Job::Placement, "all Jacobians and small-depth displacements", "ms", 1e3),
            (Job::Insertion, "whole insertion, all paddles", "ms", 1e3),
            (Job::Step, "one step of a simulator", "µs", 1e6),
        ] {
            let all = self.points.iter().filter(|p| p.job == job);
            let failed = all.clone().filter(|p| p.failure.is_some()).count();
            let _ = writeln!(out, "{what}: {} settings, {failed} failed; the front", all.count());
            let _ = writeln!(out, "  {:>11} {:>9} {:>10}  {:<10} settings", "time", "error cm", "static", "method");
            for p in self.front(job) {
                let name = match p.method {
                    ModelKind::Reduced | ModelKind::Condensed => p.method.to_string(),
                    ModelKind::Rkpm | ModelKind::Fem => p.discretization.method.integration.to_string(),
                };
                let percent = |e: f64| if e.is_finite() { format!("{:.3} %", 100.0 * e) } else { "–".into() };
                let _ = writeln!(
                    out,
                    "  {:>8.3} {unit} {:>9} {:>10}  {name:<10} {}, {} nodes, {} law",
                    scale * p.wall_s,
                    percent(p.error_cm),
                    percent(p.error_static),
                    p.discretization.settings(),
                    p.nodes,
                    p.law
                );
            }
            out.push('\n');
        }
        out
    }
}
