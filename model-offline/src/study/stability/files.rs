//! The study as CSV and as a chart.

use super::plan::{Entry, Parameter, SOLVERS};
use super::{Outcome, Stability};
use crate::discretization::Integration;
use crate::output::chart::{Axis, Dash, Figure, Marker, Panel, Place, ReferenceLine, Series};
use std::fmt::Write as _;
use strum::VariantArray as _;

fn family(integration: Integration) -> &'static str {
    if !integration.is_element() { "rkpm" } else { "fem" }
}

/// A field of a CSV file (RFC 4180).
fn field(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// One row per setting.
pub fn csv(study: &Stability) -> String {
    let mut out = String::from(
        "method,integration,parameter,value,spacing,nodes,depth_reached,reason,support,seed,increments,min_stretch,law_limit_stretch,ellipticity,energy,detail\n",
    );
    for (entry, o) in &study.rows {
        let s = &entry.setting;
        let support = if !s.method.integration.is_element() { s.method.support.to_string() } else { String::new() };
        let limit = super::verdict::limit_of(study, s).map_or_else(String::new, |l| format!("{l:.6}"));
        let _ = writeln!(
            out,
            "{},{},{},{},{},{},{:.6},{},{support},{},{},{:.6},{limit},{:.6},{:.6e},{}",
            family(s.method.integration),
            s.method.integration.name(),
            entry.parameter.name(),
            entry.value_text(),
            s.spacing,
            o.nodes,
            o.depth,
            o.reason,
            s.seed,
            s.increments,
            o.min_stretch,
            o.ellipticity,
            o.energy,
            field(&o.detail)
        );
    }
    out
}

/// One row per method.
pub fn zero_energy_csv(study: &Stability) -> String {
    let mut out = String::from(
        "method,integration,spacing,jitter_percent,nodes,zero_modes,checkerboard_over_smooth,checkerboard_felt,interior_felt,least_felt\n",
    );
    for z in &study.zero_energy {
        let _ = writeln!(
            out,
            "{},{},{},{:.0},{},{},{:.6e},{:.6e},{:.6e},{:.6e}",
            family(z.integration),
            z.integration.name(),
            study.spacing,
            100.0 * z.jitter,
            z.nodes,
            z.zero_modes,
            z.checkerboard_over_smooth,
            z.checkerboard_energy_ratio,
            z.interior_energy_ratio,
            z.least_energy_ratio
        );
    }
    out
}

fn look(integration: Integration) -> Series {
    let (marker, filled, dash) = match integration {
        Integration::Dni => (Marker::Circle, false, Dash::Dotted),
        Integration::Scni => (Marker::Circle, true, Dash::Solid),
        Integration::ScniStabilised => (Marker::Square, true, Dash::Solid),
        Integration::Mscni => (Marker::Square, false, Dash::Dashed),
        Integration::Nsni => (Marker::Diamond, false, Dash::Dashed),
        Integration::Gauss => (Marker::Diamond, true, Dash::DashDot),
        Integration::FemT3 => (Marker::Triangle, false, Dash::Dashed),
        Integration::FemT6 => (Marker::TriangleDown, true, Dash::Solid),
    };
    let label = match integration {
        Integration::FemT3 => "linear triangles",
        Integration::FemT6 => "quadratic triangles",
        meshfree => meshfree.name(),
    };
    Series { line: Some(dash), ..Series::scatter(label, marker, filled, Vec::new()) }
}

/// One series per method of the rows that `place` puts on the x axis; several rows at one x become their median. A run
/// without a model is a failure at depth 0.
fn by_method(
    study: &Stability,
    place: &dyn Fn(&Entry, &Outcome) -> Option<f64>,
    height: &dyn Fn(&Outcome) -> f64,
) -> Vec<Series> {
    Integration::VARIANTS
        .iter()
        .map(|&method| {
            let mut groups: Vec<(f64, Vec<f64>)> = Vec::new();
            let mut series = look(method);
            for (entry, outcome) in study.rows.iter().filter(|r| r.0.setting.method.integration == method) {
                let Some(x) = place(entry, outcome) else { continue };
                if outcome.depth == 0.0 {
                    series.failures.push((x, 0.0));
                    continue;
                }
                match groups.iter_mut().find(|g| g.0 == x) {
                    Some(group) => group.1.push(height(outcome)),
                    None => groups.push((x, vec![height(outcome)])),
                }
            }
            groups.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (x, mut values) in groups {
                values.sort_by(f64::total_cmp);
                series.points.push((x, values[values.len() / 2]));
            }
            series
        })
        .collect()
}

/// Shares of energy below this are shown as this.
const LEAST_SHOWN: f64 = 1e-4;

/// Every sweep, the law's limit, and the zero-energy modes.
pub fn figure(study: &Stability) -> Figure {
    let scene = &study.scene;
    let deepest = f64::from(super::probe::BEYOND) * scene.needle.depth;
    let unit = if scene.length_unit == "1" { String::new() } else { format!(" [{}]", scene.length_unit) };
    let depth_axis = || Axis::linear(&format!("depth reached{unit}")).range(0.0, 1.06 * deepest);
    let wanted = ReferenceLine { label: "scene's depth".into(), at: Place::Y(scene.needle.depth), dash: Dash::Dotted };
    let panel = |title: &str, x: Axis, place: &dyn Fn(&Entry, &Outcome) -> Option<f64>| Panel {
        series: by_method(study, place, &|o| o.depth),
        lines: vec![wanted.clone()],
        ..Panel::new(title, x, depth_axis())
    };
    let sweep = |title: &str, x: Axis, parameter: Parameter, at: &dyn Fn(f64) -> f64| {
        panel(title, x, &|e: &Entry, _: &Outcome| {
            (e.parameter == parameter && e.setting.spacing == study.spacing).then(|| at(e.value))
        })
    };
    let same = |v: f64| v;
    let spacing = |e: &Entry, o: &Outcome, equal_nodes: bool| {
        (e.parameter == Parameter::Spacing).then_some(if equal_nodes { o.nodes as f64 } else { e.value })
    };
    let names = |parameter: Parameter| {
        let mut values: Vec<f64> =
            study.rows.iter().filter(|r| r.0.parameter == parameter).map(|r| r.0.value).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    };
    let categories = |title: &str, label: &str, parameter: Parameter, height: Option<&dyn Fn(&Outcome) -> f64>| {
        let values = names(parameter);
        let texts: Vec<String> = values.iter().map(f64::to_string).collect();
        let axis = Axis::categories(label, &texts.iter().map(String::as_str).collect::<Vec<_>>());
        let place = |e: &Entry, _: &Outcome| {
            let here = e.parameter == parameter && e.setting.spacing == study.spacing;
            here.then(|| values.iter().position(|v| *v == e.value).map(|i| i as f64)).flatten()
        };
        match height {
            None => panel(title, axis, &place),
            Some(height) => Panel {
                series: by_method(study, &place, height),
                ..Panel::new(title, axis, Axis::linear("smallest principal stretch").range(0.0, 1.0))
            },
        }
    };

    let mut stretch = categories(
        "Compression at the last equilibrium",
        "factor c of the exponential term",
        Parameter::C,
        Some(&|o| o.min_stretch),
    );
    let limit: Vec<(f64, f64)> = study
        .limits
        .iter()
        .filter_map(|l| l.confined.filter(|_| l.c.is_some()))
        .enumerate()
        .map(|(i, l)| (i as f64, l))
        .collect();
    stretch.series.push(Series {
        line: Some(Dash::Solid),
        ..Series::scatter("limit of the law (stress peaks)", Marker::Plus, false, limit)
    });

    let means: Vec<&str> = SOLVERS.iter().map(|s| if *s == "line-search" { "search" } else { s }).collect();
    let methods: Vec<&str> = Integration::VARIANTS.iter().map(|m| m.name()).collect();
    let energies = |label: &str, marker, filled, of: &dyn Fn(&super::ZeroEnergy) -> f64| {
        let regular = study.zero_energy.iter().filter(|z| z.jitter == 0.0).enumerate();
        // Exactly nothing has no place on a log axis: it goes to the lower edge.
        Series::scatter(label, marker, filled, regular.map(|(i, z)| (i as f64, of(z).max(LEAST_SHOWN))).collect())
    };
    let zero = Panel {
        series: vec![
            energies("checkerboard in the interior", Marker::Square, true, &|z| z.interior_energy_ratio),
            energies("mode felt least", Marker::Square, false, &|z| z.least_energy_ratio),
        ],
        ..Panel::new(
            "Energy felt over true energy",
            Axis::categories("method, regular nodes", &methods),
            Axis::log("share of the energy").range(0.5 * LEAST_SHOWN, 10.0),
        )
    };
    let mut panels = vec![
        panel("Node spacing", Axis::log(&format!("spacing{unit}")), &|e, o| spacing(e, o, false)),
        panel("Degrees of freedom", Axis::log("nodes"), &|e, o| spacing(e, o, true)),
        stretch,
        sweep("Support", Axis::linear("support over spacing"), Parameter::Support, &same),
        sweep("Node jitter (median of seeds)", Axis::linear("jitter, % of the spacing"), Parameter::Jitter, &same),
        sweep("Stiffness contrast", Axis::log("inclusion over body"), Parameter::Contrast, &same),
        // Poisson ratios crowd towards ½: bulk over shear modulus spreads them.
        sweep("Poisson ratio", Axis::log("1 / (1 − 2ν)"), Parameter::Poisson, &|nu| 1.0 / (1.0 - 2.0 * nu)),
        categories("Exponential term", "factor c", Parameter::C, None),
        categories("Volumetric barrier", "β over shear modulus", Parameter::Barrier, None),
        sweep(
            "Increments, plain Newton",
            Axis::log("increments over the scene's depth"),
            Parameter::IncrementsPlain,
            &same,
        ),
        sweep("Means of the solver", Axis::categories("", &means), Parameter::Solver, &same),
        zero,
    ];
    // What the scene's law or tissue does not have is not varied.
    panels.retain(|p| p.series.iter().any(|s| !s.points.is_empty() || !s.failures.is_empty()));
    Figure {
        title: format!("Where methods stop: {}", scene.name),
        caption: format!(
            "paddle {} as a fixture, spacing {}; the needle is driven to {deepest}, twice the scene's depth",
            study.paddle, study.spacing
        ),
        panels,
        columns: 3,
    }
}
