//! What is varied: one parameter at a time around the scene's own setting.

use super::setting::Setting;
use crate::discretization::{Integration, Method, Resolution};
use crate::material::Material;
use crate::study::extent::Extent;
use std::fmt;
use strum::{Display, IntoStaticStr, VariantArray};

/// Everything that decides a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Experiment {
    /// Method.
    pub method: Method,
    /// Node spacing, length units.
    pub spacing: f64,
    /// Largest displacement of interior nodes over the spacing, either axis.
    pub jitter: f64,
    /// Which random displacement.
    pub seed: u64,
    /// Stiffness of the inclusions over the body's; without inclusions when absent.
    pub contrast: Option<f64>,
    /// Poisson ratio; the scene's own λ when absent.
    pub poisson: Option<f64>,
    /// Factor c of the exponential term; the scene's own when absent.
    pub c: Option<f64>,
    /// Barrier β over the shear modulus at rest; the scene's own when absent.
    pub barrier: Option<f64>,
    /// Increments over the scene's depth.
    pub increments: u32,
    /// Whether steps that raise the energy are shortened.
    pub line_search: bool,
    /// Whether an increment that fails is cut.
    pub cutback: bool,
}

/// What is varied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Parameter {
    /// Node spacing, length units.
    Spacing,
    /// Kernel support over spacing.
    Support,
    /// Displacement of interior nodes, per cent of the spacing.
    Jitter,
    /// Stiffness of the inclusions.
    Contrast,
    /// Poisson ratio.
    Poisson,
    /// Factor c of the exponential term, stress units.
    C,
    /// Increments over the scene's depth, with line search and cutback.
    Increments,
    /// Increments over the scene's depth, plain Newton.
    IncrementsPlain,
    /// Safeguards of the solver.
    Safeguards,
    /// Volumetric barrier over the shear modulus.
    Barrier,
}

impl Parameter {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Spacing => "spacing",
            Self::Support => "support",
            Self::Jitter => "jitter_percent",
            Self::Contrast => "contrast",
            Self::Poisson => "poisson",
            Self::C => "c",
            Self::Increments => "increments",
            Self::IncrementsPlain => "increments_plain",
            Self::Safeguards => "solver",
            Self::Barrier => "barrier_over_mu",
        }
    }
}

/// What keeps Newton's method from diverging.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Display, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "kebab-case")]
pub enum Safeguards {
    /// Nothing.
    Plain,
    /// Steps that raise the energy are shortened.
    LineSearch,
    /// An increment that fails is cut.
    Cutback,
    /// Both.
    Both,
    /// Both, and a law with a volumetric barrier.
    #[strum(serialize = "both+barrier")]
    BothWithBarrier,
}

impl Safeguards {
    /// The experiment with these instead of its own.
    fn of(self, base: Experiment) -> Experiment {
        let (line_search, cutback) = match self {
            Self::Plain => (false, false),
            Self::LineSearch => (true, false),
            Self::Cutback => (false, true),
            Self::Both | Self::BothWithBarrier => (true, true),
        };
        let barrier = if self == Self::BothWithBarrier { Some(1.0) } else { base.barrier };
        Experiment { line_search, cutback, barrier, ..base }
    }
}

/// A value of a [`Parameter`].
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub enum Value {
    /// A number, in the parameter's unit.
    Number(f64),
    /// Safeguards of the solver.
    Safeguards(Safeguards),
}

impl Value {
    /// Where it stands on an axis: the number, or the place among the safeguards.
    pub fn abscissa(self) -> f64 {
        match self {
            Self::Number(number) => number,
            Self::Safeguards(safeguards) => safeguards as u8 as f64,
        }
    }

    /// Whether it is this number.
    pub fn is(self, number: f64) -> bool {
        self == Self::Number(number)
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::Safeguards(safeguards) => safeguards.fmt(f),
        }
    }
}

/// One row of the study.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// What is varied.
    pub parameter: Parameter,
    /// Its value.
    pub value: Value,
    /// Everything that decides it.
    pub experiment: Experiment,
}

/// The scene's own setting with a method at a spacing.
pub fn base(setting: &Setting, integration: Integration, spacing: f64) -> Experiment {
    Experiment {
        method: setting.method(integration),
        spacing,
        jitter: 0.0,
        seed: 0,
        contrast: None,
        poisson: None,
        c: None,
        barrier: None,
        increments: setting.increments,
        line_search: true,
        cutback: true,
    }
}

/// Values of each parameter.
struct Values {
    support: Vec<f64>,
    jitter: &'static [f64],
    seeds: u64,
    contrast: &'static [f64],
    poisson: &'static [f64],
    c: &'static [f64],
    increments: &'static [u32],
    barrier: &'static [f64],
}

impl Values {
    fn full() -> Self {
        Self {
            // 1.2 to 4, exact to the last digit.
            support: (6..=20).map(|k| f64::from(k) / 5.0).collect(),
            jitter: &[0.0, 10.0, 20.0, 30.0, 40.0],
            seeds: 5,
            contrast: &[1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6],
            poisson: &[0.0, 0.2, 0.3, 0.4, 0.45, 0.49, 0.499, 0.4999],
            c: &[0.0, 0.779, 10.0, 100.0, 1000.0],
            increments: &[1, 2, 5, 10, 20, 50],
            barrier: &[0.0, 0.03, 0.1, 0.3, 1.0, 3.0],
        }
    }

    fn few() -> Self {
        Self {
            support: vec![1.2, 1.6, 2.0, 3.0, 4.0],
            jitter: &[0.0, 20.0, 40.0],
            seeds: 2,
            contrast: &[1.0, 100.0, 1e6],
            poisson: &[0.2, 0.4, 0.49, 0.4999],
            c: &[0.0, 0.779, 10.0, 100.0, 1000.0],
            increments: &[1, 5, 10, 50],
            barrier: &[0.0, 0.1, 1.0],
        }
    }

    /// In space a run takes minutes where it takes seconds in the plane.
    fn in_space(extent: Extent) -> Self {
        Self {
            support: extent.choose(vec![1.2, 1.6, 2.0, 2.4], vec![1.2, 2.0]),
            contrast: extent.choose(&[1.0, 10.0, 100.0, 1e4, 1e6], &[1.0, 1e4]),
            poisson: extent.choose(&[0.2, 0.4, 0.49, 0.4999], &[0.2, 0.49]),
            c: extent.choose(&[0.0, 0.779, 10.0, 100.0, 1000.0], &[0.0, 1000.0]),
            increments: extent.choose(&[1, 5, 10, 20], &[1, 5]),
            barrier: extent.choose(&[0.0, 0.1, 1.0], &[0.1]),
            ..Self::few()
        }
    }
}

/// Every row of the study of a scene, in the order of the files. Quick, it takes fewer values; in full it repeats in the plane
/// every sweep but that of the spacing at half the scene's spacing. In space nodes are not moved at random.
pub fn entries(setting: &Setting, extent: Extent) -> Vec<Entry> {
    let Resolution::Spacing(spacing) = setting.discretization.resolution else { return Vec::new() };
    let is_planar = setting.dimension == 2;
    let factors: &[f64] = match (is_planar, extent) {
        (true, Extent::Full) => &[2.0, 1.5, 1.0, 0.75, 0.5, 0.375, 0.25],
        (true, Extent::Quick) => &[2.0, 1.0, 0.5],
        // Lattices halve: between two of these there is no other mesh.
        (false, Extent::Full) => &[2.0, 1.0, 0.5],
        (false, Extent::Quick) => &[2.0, 1.0],
    };
    let mut entries = Vec::new();
    for &integration in setting.rules() {
        for factor in factors {
            // 0.15, not 0.15000000000000002.
            let experiment = base(setting, integration, (1e12 * spacing * factor).round() / 1e12);
            entries.push(Entry { parameter: Parameter::Spacing, value: Value::Number(experiment.spacing), experiment });
        }
        let values = if is_planar { extent.choose(Values::full(), Values::few()) } else { Values::in_space(extent) };
        sweeps(setting, base(setting, integration, spacing), &values, &mut entries);
        if is_planar && extent == Extent::Full {
            sweeps(setting, base(setting, integration, 0.5 * spacing), &Values::few(), &mut entries);
        }
    }
    let key = |e: &Entry| (e.parameter, setting.rules().iter().position(|m| *m == e.experiment.method.integration));
    entries.sort_by(|a, b| {
        key(a)
            .cmp(&key(b))
            .then(b.experiment.spacing.total_cmp(&a.experiment.spacing))
            .then(a.value.abscissa().total_cmp(&b.value.abscissa()))
            .then(a.experiment.seed.cmp(&b.experiment.seed))
    });
    entries
}

/// Shear modulus at rest of the paper's law, which the values of c are meant for.
const PAPER_SHEAR_MODULUS: f64 = 319.279;

/// What the values of c are multiplied by: c is a stress, and means nothing without the others of its law.
fn stress_scale(setting: &Setting) -> f64 {
    let scale = Material::<2>::rest_shear_modulus(&setting.material) / PAPER_SHEAR_MODULUS;
    // 1, not 0.9999999999999998.
    (1e12 * scale).round() / 1e12
}

fn sweeps(setting: &Setting, base: Experiment, values: &Values, out: &mut Vec<Entry>) {
    let mut push =
        |parameter, value, experiment| out.push(Entry { parameter, value: Value::Number(value), experiment });
    if !base.method.integration.is_element() {
        for &support in &values.support {
            push(Parameter::Support, support, Experiment { method: Method { support, ..base.method }, ..base });
        }
    }
    // What is a lattice in space is refined at patches.
    for &percent in if setting.dimension == 2 { values.jitter } else { &[] } {
        // Without jitter every seed gives the same nodes.
        for seed in 0..if percent == 0.0 { 1 } else { values.seeds } {
            push(Parameter::Jitter, percent, Experiment { jitter: 0.01 * percent, seed, ..base });
        }
    }
    if setting.has_inclusions {
        for &contrast in values.contrast {
            push(Parameter::Contrast, contrast, Experiment { contrast: Some(contrast), ..base });
        }
    }
    if setting.material.with_poisson_ratio(0.3).is_some() {
        for &poisson in values.poisson {
            push(Parameter::Poisson, poisson, Experiment { poisson: Some(poisson), ..base });
        }
    }
    if setting.material.with_exponential_factor(0.0).is_some() {
        for c in values.c.iter().map(|c| c * stress_scale(setting)) {
            push(Parameter::C, c, Experiment { c: Some(c), ..base });
        }
    }
    let plain = Safeguards::Plain.of(base);
    for &increments in values.increments {
        push(Parameter::Increments, f64::from(increments), Experiment { increments, ..base });
        push(Parameter::IncrementsPlain, f64::from(increments), Experiment { increments, ..plain });
    }
    for &barrier in values.barrier {
        push(Parameter::Barrier, barrier, Experiment { barrier: Some(barrier), ..base });
    }
    out.extend(Safeguards::VARIANTS.iter().map(|&safeguards| Entry {
        parameter: Parameter::Safeguards,
        value: Value::Safeguards(safeguards),
        experiment: safeguards.of(base),
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{BUNDLED, Scene};

    fn swept(scene: &Scene) -> Vec<f64> {
        let all = entries(&Setting::from(scene), Extent::Quick);
        let mut factors: Vec<f64> =
            all.iter().filter(|e| e.parameter == Parameter::C).filter_map(|e| e.experiment.c).collect();
        factors.sort_by(f64::total_cmp);
        factors.dedup();
        factors
    }

    #[test]
    fn the_exponential_factor_is_varied_in_the_unit_of_stress_of_the_scene() {
        let values = [0.0, 0.779, 10.0, 100.0, 1000.0];
        assert_eq!(swept(&Scene::bundled("paper").unwrap()), values);
        // The same tissue in a unit a thousand times smaller.
        let mut text = BUNDLED[0].1.to_owned();
        for (number, thousandfold) in
            [("lambda = 383.0", "lambda = 383000.0"), ("mu = 318.5", "mu = 318500.0"), ("c = 0.779", "c = 779.0")]
        {
            assert_eq!(text.matches(&format!("\n{number}")).count(), 1);
            text = text.replace(&format!("\n{number}"), &format!("\n{thousandfold}"));
        }
        let small = swept(&Scene::parse(&text, "paper in small units").unwrap());
        assert_eq!(small.len(), values.len());
        for (small, value) in small.iter().zip(values) {
            assert!((small - 1000.0 * value).abs() <= 1e-9 * small, "{small} {value}");
        }
    }
}
