//! The study as a figure: a panel per parameter, the law's limit, and the zero-energy modes.

use super::super::looks::look;
use super::plan::{Entry, Parameter, Safeguards, base};
use super::{ExperimentResult, Stability};
use crate::discretization::Integration;
use crate::number::median;
use crate::output::chart::number::plain;
use crate::output::chart::{Axis, Colour, Dash, Figure, Marker, Panel, Place, ReferenceLine, Series};
use strum::VariantArray as _;

/// Shares of energy below this are shown as this.
const LEAST_SHOWN: f64 = 1e-4;

fn name(integration: Integration) -> &'static str {
    match integration {
        Integration::FemT3 => "linear triangles",
        Integration::FemT6 => "quadratic triangles",
        Integration::FemT4 => "linear tetrahedra",
        Integration::FemT10 => "quadratic tetrahedra",
        meshfree => meshfree.name(),
    }
}

fn empty_series(integration: Integration) -> Series {
    let (colour, marker) = look(integration);
    let dash = match integration {
        Integration::Dni => Dash::Dotted,
        Integration::Nsni | Integration::Mscni | Integration::FemT3 | Integration::FemT4 => Dash::Dashed,
        Integration::Gauss => Dash::DashDot,
        Integration::Scni | Integration::ScniStabilised | Integration::FemT6 | Integration::FemT10 => Dash::Solid,
    };
    Series::scatter(name(integration), colour, marker, Vec::new()).joined(dash)
}

/// Where a run stands along an abscissa; none where it is not part of the panel.
type Abscissa<'a> = &'a dyn Fn(&Entry, &ExperimentResult) -> Option<f64>;

/// One series per integration rule of the rows that `place` puts on the x axis; several rows at one x become their median. A run
/// without a model is a failure at depth 0.
fn by_integration(study: &Stability, place: Abscissa<'_>, height: fn(&ExperimentResult) -> f64) -> Vec<Series> {
    let of_rule = |&integration: &Integration| {
        let mut groups: Vec<(f64, Vec<f64>)> = Vec::new();
        let mut series = empty_series(integration);
        for (entry, outcome) in study.rows.iter().filter(|r| r.0.experiment.method.integration == integration) {
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
        series.points.extend(groups.into_iter().filter_map(|(x, values)| Some((x, median(values)?))));
        series
    };
    study.setting.rules().iter().map(of_rule).collect()
}

/// Mean over the rules of their values at the left and at the right end.
fn ends(series: &[Series]) -> Option<[f64; 2]> {
    let drawn = || series.iter().filter(|s| !s.points.is_empty());
    let count = drawn().count() as f64;
    let mean = |of: fn(&Series) -> f64| drawn().map(of).sum::<f64>() / count;
    (count > 0.0).then(|| [mean(|s| s.points[0].1), mean(|s| s.points[s.points.len() - 1].1)])
}

/// Depth reached over one parameter.
fn depth_panel(study: &Stability, title: &str, x: Axis, place: Abscissa<'_>) -> Panel {
    let setting = &study.setting;
    let series = by_integration(study, place, |o| o.depth);
    let title = ends(&series).map_or_else(
        || title.to_owned(),
        |[left, right]| {
            format!(
                "{title}: depth {}\u{a0}→\u{a0}{}",
                plain((left * 1e3).round() / 1e3),
                plain((right * 1e3).round() / 1e3)
            )
        },
    );
    let y = Axis::linear("depth reached", &setting.length_unit).range(0.0, 1.06 * deepest(study));
    let wanted = ReferenceLine::new("scene's depth", Place::Y(setting.depth), Dash::Dotted);
    Panel { series, lines: vec![wanted], ..Panel::new(&title, x, y) }
}

fn deepest(study: &Stability) -> f64 {
    f64::from(super::probe::BEYOND) * study.setting.depth
}

/// A parameter's sweep at the study's spacing, its values mapped to the axis.
fn sweep(study: &Stability, title: &str, x: Axis, parameter: Parameter, at: fn(f64) -> f64) -> Panel {
    depth_panel(study, title, x, &|e, _| {
        (e.parameter == parameter && e.experiment.spacing == study.spacing).then(|| at(e.value.abscissa()))
    })
}

/// Values of a parameter, each once, in their order.
fn values(study: &Stability, parameter: Parameter) -> Vec<f64> {
    let mut values: Vec<f64> =
        study.rows.iter().filter(|r| r.0.parameter == parameter).map(|r| r.0.value.abscissa()).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

fn named_axis(study: &Stability, quantity: &str, parameter: Parameter) -> Axis {
    Axis::categories(quantity, values(study, parameter).iter().map(f64::to_string).collect())
}

/// Where a value stands on [`named_axis`].
fn named_place(study: &Stability, parameter: Parameter) -> impl Fn(&Entry, &ExperimentResult) -> Option<f64> {
    let values = values(study, parameter);
    let spacing = study.spacing;
    move |e, _| {
        let here = e.parameter == parameter && e.experiment.spacing == spacing;
        here.then(|| values.iter().position(|v| *v == e.value.abscissa()).map(|i| i as f64)).flatten()
    }
}

fn stretch_panel(study: &Stability) -> Panel {
    let place = named_place(study, Parameter::C);
    let mut series = by_integration(study, &place, |o| o.min_stretch);
    let limits = study.limits.iter().filter_map(|l| l.confined.filter(|_| l.c.is_some())).enumerate();
    let limits: Vec<(f64, f64)> = limits.map(|(i, limit)| (i as f64, limit)).collect();
    let runs = || series.iter().flat_map(|s| &s.points);
    let beyond = runs().filter(|p| limits.iter().any(|l| l.0 == p.0 && p.1 < l.1)).count();
    let title = format!("Compression: {beyond} of {} medians beyond the law's limit", runs().count());
    series.push(
        Series::scatter("limit of the law (stress peaks)", Colour::Ink, Marker::Plus, limits).joined(Dash::Solid),
    );
    let x = named_axis(study, "factor c of the exponential term", Parameter::C);
    let y = Axis::linear("smallest principal stretch at the last equilibrium", "").range(0.0, 1.0);
    Panel { series, ..Panel::new(&title, x, y) }
}

/// Energies of the zero-energy modes, each rule by its own look.
fn energy_panel(study: &Stability) -> Panel {
    let regular: Vec<_> = study.zero_energy.iter().filter(|z| z.jitter == 0.0).collect();
    let ghosts = regular.iter().filter(|z| z.bloch_share < 0.01).map(|z| z.integration.name());
    let ghosts: Vec<&str> = ghosts.collect();
    let title = if ghosts.is_empty() {
        "Every method feels every wave".to_owned()
    } else {
        format!("Some waves cost no energy with {}: ghost modes", ghosts.join(", "))
    };
    let mut panel = Panel::new(
        &title,
        Axis::categories("method, regular nodes; colours as above", vec![String::new(); regular.len()]),
        Axis::log("energy felt over true energy; lower edge: none", "").range(0.5 * LEAST_SHOWN, 10.0),
    );
    for (i, z) in regular.iter().enumerate() {
        let (colour, marker) = look(z.integration);
        // Exactly nothing has no place on a log axis: it goes to the lower edge.
        let at = |share: f64| vec![(i as f64, share.max(LEAST_SHOWN))];
        panel.series.push(Series::scatter("", colour, marker, at(z.interior_energy_ratio)));
        let least = Series::scatter("", colour, marker, at(z.bloch_share)).open();
        panel.series.push(Series { titles: vec![format!("{}, wave felt least", z.integration)], ..least });
    }
    // What filling means, for the legend alone.
    let sample = |label: &str| Series::scatter(label, Colour::Ink, Marker::Circle, Vec::new());
    panel.series.push(sample("filled: checkerboard in the interior"));
    panel.series.push(sample("open: wave felt least, unbounded lattice").open());
    panel
}

/// Which rule goes deepest and which stops first by the scene's own setting.
fn conclusion(study: &Stability) -> Option<String> {
    let distinct = study.distinct();
    let depth = |&integration: &Integration| {
        let own = base(&study.setting, integration, study.spacing);
        distinct.iter().find(|(experiment, _)| *experiment == own).map(|(_, outcome)| (integration, outcome.depth))
    };
    let depths: Vec<(Integration, f64)> = study.setting.rules().iter().filter_map(depth).collect();
    let most = depths.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let least = depths.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    if most.1 == least.1 {
        return Some(format!("Every method goes as deep ({})", plain(most.1)));
    }
    let (most, least) = ((name(most.0), plain(most.1)), (name(least.0), plain(least.1)));
    Some(format!("Deepest goes {} ({}), least deep {} ({})", most.0, most.1, least.0, least.1))
}

/// Every sweep, the law's limit, and the zero-energy modes.
pub fn figure(study: &Stability) -> Figure {
    let unit = study.setting.length_unit.as_str();
    let same = |v: f64| v;
    let spacing = |e: &Entry, _: &ExperimentResult| (e.parameter == Parameter::Spacing).then_some(e.value.abscissa());
    let nodes = |e: &Entry, o: &ExperimentResult| (e.parameter == Parameter::Spacing).then_some(o.nodes as f64);
    let safeguards = Safeguards::VARIANTS.iter().map(|safeguards| match safeguards {
        Safeguards::LineSearch => "search".to_owned(),
        Safeguards::BothWithBarrier => "both\n+barrier".to_owned(),
        other => other.to_string(),
    });
    let mut panels = vec![
        depth_panel(study, "Node spacing", Axis::log("spacing", unit), &spacing),
        depth_panel(study, "Degrees of freedom", Axis::log("nodes", ""), &nodes),
        stretch_panel(study),
        sweep(study, "Support", Axis::linear("support over spacing", ""), Parameter::Support, same),
        sweep(
            study,
            "Node jitter",
            Axis::linear("jitter, median of seeds", "% of the spacing"),
            Parameter::Jitter,
            same,
        ),
        sweep(study, "Stiffness contrast", Axis::log("inclusion over body", ""), Parameter::Contrast, same),
        // Poisson ratios crowd towards ½: bulk over shear modulus spreads them.
        sweep(study, "Poisson ratio", Axis::log("1 / (1 − 2ν)", ""), Parameter::Poisson, |nu| {
            1.0 / (1.0 - 2.0 * nu)
        }),
        depth_panel(
            study,
            "Exponential term",
            named_axis(study, "factor c", Parameter::C),
            &named_place(study, Parameter::C),
        ),
        depth_panel(
            study,
            "Volumetric barrier",
            named_axis(study, "β over shear modulus", Parameter::Barrier),
            &named_place(study, Parameter::Barrier),
        ),
        sweep(
            study,
            "Increments",
            Axis::log("increments over the scene's depth, plain Newton", ""),
            Parameter::IncrementsPlain,
            same,
        ),
        sweep(study, "Means of the solver", Axis::categories("", safeguards.collect()), Parameter::Safeguards, same),
        energy_panel(study),
    ];
    // What the scene's law or tissue does not have is not varied.
    panels.retain(|p| p.series.iter().any(|s| !s.points.is_empty() || !s.failures.is_empty()));
    let conclusion = conclusion(study).unwrap_or_else(|| "Where methods stop".to_owned());
    Figure {
        title: format!("{conclusion}: {} at spacing {}", study.setting.name, study.spacing),
        caption: format!(
            "Paddle {} static; the needle is driven to {}, twice the scene's depth. After a title: mean depth over the \
             methods at the left → at the right end.",
            study.paddle,
            plain(deepest(study))
        ),
        panels,
        columns: 3,
    }
}
