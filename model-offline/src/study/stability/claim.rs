//! The claim that meshfree methods are more stable than finite elements under large deformation, counted.

use super::plan::{Experiment, Parameter, Safeguards, Value};
use super::zero_energy::Unmeasured;
use super::{ExperimentResult, Stability};
use crate::discretization::{Integration, Method};
use crate::number::median;
use std::fmt::Write as _;

/// Depths within this share of the larger one count as the same.
const SAME: f64 = 0.05;
/// Models within this share of nodes count as equally large.
const EQUAL_NODES: f64 = 0.1;

/// Pairs of one meshfree and one finite-element run that differ in nothing else.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pairs {
    /// Meshfree reached deeper, by more than 5 %.
    pub meshfree_deeper: usize,
    /// Within 5 % of each other.
    pub same: usize,
    /// Finite elements reached deeper, by more than 5 %.
    pub elements_deeper: usize,
    /// Median of meshfree over finite-element depth; not a number without pairs.
    pub median_ratio: f64,
}

impl Pairs {
    fn count(depths: &[(f64, f64)]) -> Self {
        let mut pairs = Self { median_ratio: f64::NAN, ..Self::default() };
        let mut ratios: Vec<f64> = Vec::new();
        for &(meshfree, elements) in depths {
            let margin = SAME * meshfree.max(elements);
            if (meshfree - elements).abs() <= margin {
                pairs.same += 1;
            } else if meshfree > elements {
                pairs.meshfree_deeper += 1;
            } else {
                pairs.elements_deeper += 1;
            }
            if elements > 0.0 {
                ratios.push(meshfree / elements);
            }
        }
        pairs.median_ratio = median(ratios).unwrap_or(pairs.median_ratio);
        pairs
    }

    /// Number of pairs.
    pub fn total(&self) -> usize {
        self.meshfree_deeper + self.same + self.elements_deeper
    }
}

/// The claim's answer by element.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimCounts {
    /// Against linear elements, which have the same nodes: equal spacing and equal degrees of freedom.
    pub linear: Pairs,
    /// Against quadratic elements of the same spacing, which have about four times the nodes, in space eight.
    pub quadratic_equal_spacing: Pairs,
    /// Against quadratic elements with as many nodes.
    pub quadratic_equal_nodes: Pairs,
    /// Runs whose law has a limit in compression, and those of them whose last state is compressed beyond it somewhere.
    pub beyond_limit: (usize, usize),
    /// Runs that had a model, and those of them whose last state has lost strong ellipticity somewhere.
    pub not_elliptic: (usize, usize),
}

/// An experiment with what came of it.
type Run<'a, 's> = &'a (Experiment, &'s ExperimentResult);

/// Counts every pair of runs that differ in the method only (and, for equal degrees of freedom, in the spacing).
/// Meshfree runs of every support are compared; a run counts once, however many sweeps it is part of.
pub fn claim_counts(study: &Stability) -> ClaimCounts {
    let distinct = study.distinct();
    let alike = |m: &Experiment, e: &Experiment| {
        let stripped = |s: &Experiment| Experiment { method: Method::new(Integration::Dni), spacing: 0.0, ..*s };
        stripped(m) == stripped(e)
    };
    let pairs = |element, matches: &dyn Fn(Run<'_, '_>, Run<'_, '_>) -> bool| {
        let mut depths = Vec::new();
        for m in distinct.iter().filter(|d| !d.0.method.integration.is_element()) {
            for e in distinct.iter().filter(|d| d.0.method.integration == element && alike(&m.0, &d.0)) {
                if matches(m, e) {
                    depths.push((m.1.depth, e.1.depth));
                }
            }
        }
        Pairs::count(&depths)
    };
    let equal_spacing = |m: Run<'_, '_>, e: Run<'_, '_>| m.0.spacing == e.0.spacing;
    let equal_nodes = |m: Run<'_, '_>, e: Run<'_, '_>| {
        let (m, e) = (m.1.nodes as f64, e.1.nodes as f64);
        (m - e).abs() <= EQUAL_NODES * m.max(e)
    };
    let [linear, quadratic] = study.setting.elements();
    let started: Vec<Run<'_, '_>> = distinct.iter().filter(|d| d.1.depth > 0.0).collect();
    let limited: Vec<(f64, &ExperimentResult)> =
        started.iter().filter_map(|(experiment, outcome)| Some((limit_of(study, experiment)?, *outcome))).collect();
    ClaimCounts {
        linear: pairs(linear, &equal_spacing),
        quadratic_equal_spacing: pairs(quadratic, &equal_spacing),
        quadratic_equal_nodes: pairs(quadratic, &equal_nodes),
        beyond_limit: (limited.len(), limited.iter().filter(|(limit, o)| o.min_stretch < *limit).count()),
        not_elliptic: (started.len(), started.iter().filter(|d| d.1.ellipticity <= 0.0).count()),
    }
}

/// The law's limit in an experiment; none where a barrier or another Poisson ratio makes it another law.
pub(super) fn limit_of(study: &Stability, experiment: &Experiment) -> Option<f64> {
    if experiment.barrier.is_some_and(|b| b > 0.0) || experiment.poisson.is_some() {
        return None;
    }
    study.limits.iter().find(|l| l.c == experiment.c)?.confined
}

/// One screen: depths by integration rule and parameter, and the claim's answer.
pub fn summary(study: &Stability) -> String {
    let setting = &study.setting;
    let mut out = format!(
        "{} · paddle {} static · needle driven to {} at most, twice the scene's depth · {} runs in {} rows\n\n",
        setting.name,
        study.paddle,
        f64::from(super::probe::BEYOND) * setting.depth,
        study.distinct().len(),
        study.rows.len()
    );
    write_depths(study, &mut out);
    write_claim(study, &mut out);
    if !study.zero_energy.is_empty() {
        write_zero_energy(study, &mut out);
    }
    out
}

/// Depths by integration rule and parameter.
fn write_depths(study: &Stability, out: &mut String) {
    let _ = write!(out, "{:<26}", "depth reached");
    for &integration in study.setting.rules() {
        let _ = write!(out, "{:>9}", integration.name());
    }
    out.push('\n');
    let mut line = |label: &str, pick: &dyn Fn(&super::Entry) -> bool| {
        let _ = write!(out, "{label:<26}");
        for &integration in study.setting.rules() {
            let depths: Vec<f64> = study
                .rows
                .iter()
                .filter(|(e, _)| e.experiment.method.integration == integration && pick(e))
                .map(|(_, o)| o.depth)
                .collect();
            let low = depths.iter().copied().fold(f64::INFINITY, f64::min);
            let _ = if depths.is_empty() { write!(out, "{:>9}", "–") } else { write!(out, "{low:>9.3}") };
        }
        out.push('\n');
    };
    let mut seen: Vec<(Parameter, Value)> = Vec::new();
    for (entry, _) in &study.rows {
        let key = (entry.parameter, entry.value);
        let shown = match entry.parameter {
            Parameter::Spacing => true,
            Parameter::Jitter => entry.value.is(40.0),
            Parameter::Contrast => entry.value.is(1e6),
            Parameter::Poisson => entry.value >= Value::Number(0.49),
            Parameter::C => !entry.value.is(0.779),
            Parameter::Support => [1.2, 3.0, 4.0].iter().any(|&support| entry.value.is(support)),
            Parameter::Safeguards => entry.value == Value::Safeguards(Safeguards::Plain),
            Parameter::Barrier => entry.value.is(1.0),
            Parameter::Increments | Parameter::IncrementsPlain => false,
        };
        if shown && !seen.contains(&key) {
            let label = match entry.parameter {
                Parameter::Jitter => "jitter 40 %, worst seed".to_owned(),
                p => format!("{} {}", p.name().replace('_', " "), key.1),
            };
            let sweep = entry.parameter != Parameter::Spacing;
            line(&label, &|e| {
                e.parameter == key.0 && e.value == key.1 && (!sweep || e.experiment.spacing == study.spacing)
            });
            seen.push(key);
        }
    }
}

/// The claim's answer, and what the law itself does.
fn write_claim(study: &Stability, out: &mut String) {
    let v = claim_counts(study);
    out.push_str(
        "\n\"Meshfree is more stable than finite elements under large deformation\" (5 % counts as the same):\n",
    );
    for (what, p) in [
        ("linear elements, same nodes", v.linear),
        ("quadratic, same spacing", v.quadratic_equal_spacing),
        ("quadratic, as many nodes", v.quadratic_equal_nodes),
    ] {
        let _ = writeln!(
            out,
            "  against {what:<30} deeper in {:>3} of {:>3} pairs, the same in {:>3}, less deep in {:>3}; median ratio {:.2}",
            p.meshfree_deeper,
            p.total(),
            p.same,
            p.elements_deeper,
            p.median_ratio
        );
    }
    if let Some(limit) = study.limits.first().and_then(|l| l.confined) {
        let _ = writeln!(
            out,
            "the law's own limit: nominal stress peaks at stretch {limit:.4}; {} of {} last states are beyond it somewhere, \
             {} of {} have lost strong ellipticity somewhere",
            v.beyond_limit.1, v.beyond_limit.0, v.not_elliptic.1, v.not_elliptic.0
        );
    }
}

/// What each rule does not feel.
fn write_zero_energy(study: &Stability, out: &mut String) {
    out.push_str(
        "zero modes (3 is right) | share felt of the checkerboard's energy, in the interior | of any mode at least | of any \
         wave on an unbounded lattice at least\n",
    );
    for z in study.zero_energy.iter().filter(|z| z.jitter == 0.0) {
        let _ = writeln!(
            out,
            "  {:<15} {} | {:.1e}, {:.1e} | {:.1e} | {:.2}",
            z.integration.name(),
            z.zero_modes,
            z.checkerboard_energy_ratio,
            z.interior_energy_ratio,
            z.least_energy_ratio,
            z.bloch_share.max(0.0)
        );
    }
    for Unmeasured { integration, jitter, error } in &study.unmeasured {
        let _ = writeln!(out, "  {:<15} is not measured on nodes jittered by {jitter}: {error}", integration.name());
    }
    out.push_str(
        "  0 in the last column is a ghost mode: a second body of nodes that alternate, which no inner cell holds and the \
         boundary alone moves.\n  A stabilised rule may go on past the depth at which the law itself loses stability: its \
         constant stiffness is the method, not tissue; mscni has the law alone.\n",
    );
}
