//! The comparison as a figure and as a table for the terminal.

use super::looks::look;
use super::measurement::{Job, Linearity, Measurement, ModelKind, Peer};
use super::pareto::Pareto;
use crate::output::chart::{Axis, Colour, Dash, Figure, Marker, Note, Panel, Series};
use crate::scene::TissueVariant;
use std::fmt::Write as _;

/// What a panel shows: one error of one job.
struct View {
    job: Job,
    title: &'static str,
    quantity: &'static str,
    error: fn(&Measurement) -> f64,
    /// What filled and open markers tell apart; nothing where all are alike.
    filled: Option<Filling>,
    /// Whether what others took is of the same work.
    told_by_peers: bool,
}

/// What others took, one series for linear elements and one for quadratic ones.
fn peers(all: &[Peer]) -> impl Iterator<Item = Series> {
    [(false, "DOLFINx + MUMPS, linear, singles alone"), (true, "DOLFINx + MUMPS, quadratic, singles alone")]
        .into_iter()
        .filter_map(|(quadratic, label)| {
            let of_kind: Vec<&Peer> = all.iter().filter(|peer| peer.quadratic == quadratic).collect();
            let points = of_kind.iter().map(|peer| (peer.wall_s, peer.error)).collect();
            let titles = of_kind
                .iter()
                .map(|p| format!("{label}, {} unknowns: {} in {:.3e} s", p.dofs, percent(p.error), p.wall_s));
            let series = Series {
                titles: titles.collect(),
                ..Series::scatter(label, Colour::Purple, PEER[usize::from(quadratic)], points)
            };
            (!of_kind.is_empty()).then(|| series.open())
        })
}

/// Their markers.
const PEER: [Marker; 2] = [Marker::TriangleRight, Marker::Pentagon];

/// A second property, told by filled and open markers.
#[derive(Clone, Copy)]
struct Filling {
    /// What a filled and an open marker stand for.
    names: [&'static str; 2],
    of: fn(&Measurement) -> bool,
}

const GRADED: Filling =
    Filling { names: ["filled: graded nodes", "open: uniform nodes"], of: |p| p.discretization.resolution.is_graded() };
const NONLINEAR: Filling =
    Filling { names: ["filled: nonlinear law", "open: linear law"], of: |p| p.law == Linearity::Nonlinear };

const VIEWS: [View; 4] = [
    View {
        job: Job::Placement,
        title: "All Jacobians",
        quantity: "error of the controllability measure, over itself",
        error: |p| p.error_cm,
        filled: Some(GRADED),
        told_by_peers: true,
    },
    View {
        job: Job::Placement,
        title: "Small-depth displacement",
        quantity: "error of the target displacement, over the largest",
        error: |p| p.error_static,
        filled: Some(GRADED),
        told_by_peers: false,
    },
    View {
        job: Job::Insertion,
        title: "Whole insertion, all paddles",
        quantity: "error of the target displacement, over the largest",
        error: |p| p.error_static,
        filled: Some(NONLINEAR),
        told_by_peers: false,
    },
    View {
        job: Job::Step,
        title: "One step of a simulator",
        quantity: "error of the target displacement, over the largest",
        error: |p| p.error_static,
        filled: None,
        told_by_peers: false,
    },
];

/// Name, colour and marker of a point: of the rule, or of the plant where the job compares plants.
fn appearance(point: &Measurement) -> (&'static str, Colour, Marker) {
    match (point.job, point.model_kind) {
        // Colours are the rules', and all these have the same one.
        (Job::Step, ModelKind::Reduced) => ("reduced", Colour::Ink, Marker::Square),
        (Job::Step, ModelKind::Condensed) => ("condensed", Colour::Ink, Marker::Diamond),
        (Job::Step, _) => ("full", Colour::Ink, Marker::Circle),
        _ => {
            let integration = point.discretization.method.integration;
            let (colour, marker) = look(integration);
            (integration.name(), colour, marker)
        }
    }
}

/// An error in per cent, with two digits.
fn percent(error: f64) -> String {
    let percent = 100.0 * error;
    let decimals = if percent >= 10.0 { 0 } else { (1.0 - percent.log10().floor()).clamp(0.0, 6.0) as usize };
    format!("{percent:.decimals$} %")
}

impl View {
    /// The points that no other beats in both time and this panel's error, fastest first.
    fn front<'a>(&self, pareto: &'a Pareto) -> Vec<&'a Measurement> {
        let usable = |p: &&Measurement| p.job == self.job && p.failure.is_none() && p.wall_s.is_finite();
        let mut front: Vec<&Measurement> =
            pareto.points.iter().filter(usable).filter(|p| (self.error)(p).is_finite()).collect();
        front.sort_by(|a, b| a.wall_s.total_cmp(&b.wall_s));
        let mut best = f64::INFINITY;
        front.retain(|p| {
            let better = (self.error)(p) < best;
            best = best.min((self.error)(p));
            better
        });
        front
    }

    /// Method with its second property, as the conclusion names it.
    fn kind(&self, point: &Measurement) -> String {
        let name = appearance(point).0;
        match (self.job, self.filled.is_some_and(|filling| (filling.of)(point))) {
            (Job::Placement, true) => format!("{name} on graded nodes"),
            (Job::Placement, false) => format!("{name} on uniform nodes"),
            (Job::Insertion, true) => format!("{name} with the nonlinear law"),
            (Job::Insertion, false) => format!("{name} with the linear law"),
            (Job::Step, _) => format!("the {name} model"),
        }
    }

    /// Who holds the widest stretch of the front, and from which error to which.
    fn conclusion(&self, front: &[&Measurement]) -> Option<String> {
        let stretches = front.chunk_by(|a, b| self.kind(a) == self.kind(b));
        let width = |stretch: &[&Measurement]| (self.error)(stretch[0]) / (self.error)(stretch[stretch.len() - 1]);
        let widest = stretches.max_by(|a, b| width(a).total_cmp(&width(b)))?;
        let (first, last) = (widest.first()?, widest.last()?);
        let ends = [first, last].map(|p| percent((self.error)(p)));
        let range =
            if ends[0] == ends[1] { format!("at {}", ends[0]) } else { format!("from {} to {}", ends[0], ends[1]) };
        Some(format!("{} is fastest {range}", self.kind(first)))
    }

    fn panel(&self, pareto: &Pareto) -> Panel {
        let front = self.front(pareto);
        let what = if self.job == Job::Step { "time of one step" } else { "time on one thread, best of several" };
        let title = self.conclusion(&front).map_or_else(|| self.title.to_owned(), |c| format!("{}: {c}", self.title));
        let mut panel = Panel::new(&title, Axis::log(what, "s"), Axis::log(self.quantity, "1"));
        let front_line = front.iter().map(|p| (p.wall_s, (self.error)(p))).collect();
        panel.series.push(Series::curve("Pareto front", Colour::Ink, Dash::Solid, front_line));
        let all: Vec<&Measurement> = pareto.points.iter().filter(|p| p.job == self.job).collect();
        // Dominated points first: the front lies above them.
        let on_front = |p: &Measurement| front.iter().any(|f| std::ptr::eq(*f, p));
        for bright in [false, true] {
            for point in all.iter().filter(|p| on_front(p) == bright) {
                self.add(&mut panel.series, point, bright);
            }
        }
        self.explain(&mut panel.series, &all);
        panel.notes = front
            .iter()
            .map(|p| Note { at: (p.wall_s, (self.error)(p)), text: format!("{}, {}", appearance(p).0, p.nodes) })
            .collect();
        if self.told_by_peers {
            panel.series.extend(peers(&pareto.peers));
        }
        panel
    }

    /// Adds a point to the series of its look.
    fn add(&self, series: &mut Vec<Series>, point: &Measurement, bright: bool) {
        let (name, colour, marker) = appearance(point);
        let colour = if bright { colour } else { Colour::Faint };
        let filled = self.filled.is_none_or(|filling| (filling.of)(point));
        let alike = |s: &Series| (s.marker, s.filled, s.colour) == (Some(marker), filled, colour);
        let place = series.iter().position(alike).unwrap_or_else(|| {
            series.push(Series { filled, ..Series::scatter("", colour, marker, Vec::new()) });
            series.len() - 1
        });
        let at = (point.wall_s, (self.error)(point));
        if point.failure.is_some() {
            series[place].failures.push(at);
        } else {
            let (settings, error) = (point.discretization.settings(), percent(at.1));
            series[place].titles.push(format!("{name}, {settings}, {} nodes: {error} in {:.3e} s", point.nodes, at.0));
            series[place].points.push(at);
        }
    }

    /// What shapes and fillings mean, for the legend alone.
    fn explain(&self, series: &mut Vec<Series>, all: &[&Measurement]) {
        let mut sample = |label: &str, colour, marker| {
            series.push(Series::scatter(label, colour, marker, Vec::new()));
            series.len() - 1
        };
        let mut seen: Vec<&str> = Vec::new();
        for point in all {
            let (name, colour, marker) = appearance(point);
            if !seen.contains(&name) {
                seen.push(name);
                sample(name, colour, marker);
            }
        }
        sample("dominated, shape by method", Colour::Faint, Marker::Circle);
        if let Some(Filling { names: [filled, open], .. }) = self.filled {
            sample(filled, Colour::Ink, Marker::Circle);
            let open = sample(open, Colour::Ink, Marker::Circle);
            series[open].filled = false;
        }
    }
}

impl Pareto {
    /// The views that have points.
    fn views(&self) -> impl Iterator<Item = &'static View> {
        VIEWS.iter().filter(|view| self.points.iter().any(|p| p.job == view.job))
    }

    /// The comparison as one SVG.
    pub fn svg(&self, scene: &str, tissue: TissueVariant) -> String {
        let barrier = self.barrier.map_or(String::new(), |b| format!(", barrier {b:.0} added for finite depth"));
        let references = match self.dimension {
            2 => format!(
                "References good to {} (small depth) and {} (finite depth)",
                percent(self.open.0),
                percent(self.open.1)
            ),
            _ => format!(
                "All single paddles and pairs, mesh included; the reference, {} nodes, claims {}",
                self.reference_nodes.0,
                percent(self.open.0)
            ),
        };
        let peers = if self.peers.is_empty() { "" } else { " DOLFINx was timed once, in a run of its own." };
        let conclusion = VIEWS[0].conclusion(&VIEWS[0].front(self));
        let title = conclusion.unwrap_or_else(|| "No method has a point on the front".to_owned());
        Figure {
            title: format!("{title}: error against time, scene {scene}, {tissue} tissue"),
            caption: format!(
                "{references}{barrier}. Points of the front are named with method and number of nodes.{peers}"
            ),
            panels: self.views().map(|view| view.panel(self)).collect(),
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
            if all.clone().next().is_none() {
                continue;
            }
            let failed = all.clone().filter(|p| p.failure.is_some()).count();
            let _ = writeln!(out, "{what}: {} settings, {failed} failed; the front", all.count());
            let _ = writeln!(out, "  {:>11} {:>9} {:>10}  {:<10} settings", "time", "error cm", "static", "method");
            for p in self.front(job) {
                let name = match p.model_kind {
                    ModelKind::Reduced | ModelKind::Condensed => p.model_kind.to_string(),
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
