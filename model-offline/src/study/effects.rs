//! Which effects a scene needs: what each adds to the simplest model of an insertion, and the smallest model that has all
//! that count.
//!
//! The simplest model is a contact that moves with the needle in elastic tissue at rest otherwise. Every effect is added
//! alone, with the scene's own numbers where it has them; what stays below the tolerance is left out, and the model of the
//! rest is held against the one with everything.

use crate::model::{ModelError, TissueModel};
use crate::needle::{Course, NeedleError};
use crate::number::{decimals, length};
use crate::output::chart::{Axis, Bars, Colour, Dash, Figure, Panel, Place, ReferenceLine};
use crate::output::csv;
use crate::parallel;
use crate::placement::controllability::best_direction;
use crate::placement::discretise;
use crate::placement::study::best_dynamic;
use crate::scene::{Effect, Scene};
use nalgebra::{Matrix2, Vector2};
use serde::Serialize;
use std::fmt::Write as _;
use strum::VariantArray as _;

/// Increments of an insertion.
const STEPS: usize = 60;

/// Why effects cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EffectsError {
    /// The scene cannot be modelled.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The simplest model cannot be taken along the insertion.
    #[error(transparent)]
    Needle(#[from] NeedleError),
}

/// What a model has besides the simplest one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variation {
    /// A linear law in place of the scene's: cheaper, not richer.
    LinearLaw,
    /// One effect.
    #[serde(untagged)]
    Effect(Effect),
}

impl Variation {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::LinearLaw => "linear-law",
            Self::Effect(effect) => effect.name(),
        }
    }
}

/// What an effect adds, over what the simplest model has.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Added {
    /// Largest change of the target's displacement across the needle on the way, length.
    pub orthogonal: f64,
    /// The same along it, length.
    pub axial: f64,
    /// Change of the force at the needle's base at full depth, over the simplest model's.
    pub base_force: f64,
    /// Change of the actuation Jacobian at full depth, over the simplest model's norm.
    pub jacobian: f64,
    /// Change of the controllability measure there, over the simplest model's.
    pub controllability: f64,
}

/// An effect, tried.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tried {
    /// What it is.
    pub variation: Variation,
    /// What it adds; none where its insertion fails.
    pub added: Option<Added>,
    /// Why it fails.
    pub failure: Option<String>,
    /// Whether what it adds is above the tolerance, or not known.
    pub is_needed: bool,
}

/// All effects of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effects {
    /// The scene.
    pub scene: String,
    /// Unit of its lengths.
    pub length_unit: String,
    /// Paddle that is attached, and stays where it rests.
    pub paddle: u32,
    /// What counts: relative to the largest target displacement of the simplest model, and to its controllability measure.
    pub tolerance: f64,
    /// Largest target displacement of the simplest model, length.
    pub target_displacement: f64,
    /// The effects.
    pub effects: Vec<Tried>,
    /// What the effects that are left out add together to those that are kept; none where one of the two fails.
    pub left_out: Option<Added>,
}

/// One insertion, as far as it is compared.
#[derive(Debug, Clone)]
pub(super) struct Followed {
    targets: Vec<Vector2<f64>>,
    base_force: f64,
    jacobian: Matrix2<f64>,
}

/// Tries every effect on a scene; what changes less than `tolerance` is not needed.
///
/// # Errors
/// [`EffectsError`] where the simplest model fails. An effect that fails is a result.
pub fn compare(scene: &Scene, tolerance: f64, threads: usize) -> Result<Effects, EffectsError> {
    let simplest = scene.without_a_past();
    let (model, _) = discretise(&simplest)?;
    let paddle = best_dynamic(&model)?;
    let base = follow(&model, paddle)?;
    let variations: Vec<Variation> =
        [Variation::LinearLaw].into_iter().chain(Effect::VARIANTS.iter().map(|e| Variation::Effect(*e))).collect();
    let with = |variation: &Variation| match variation {
        Variation::LinearLaw => with_linear_laws(&simplest),
        Variation::Effect(effect) => scene.with_only(&[*effect]),
    };
    let tried = parallel::map(variations.len(), threads, |k| {
        let added = followed(&with(&variations[k]), paddle).map(|found| found.over(&base, scene));
        let counts = |added: &Added| base.counts(added, tolerance);
        Tried {
            variation: variations[k],
            is_needed: added.as_ref().map_or(true, counts),
            failure: added.as_ref().err().map(ToString::to_string),
            added: added.ok(),
        }
    });
    let kept: Vec<Effect> = tried
        .iter()
        .filter(|tried| tried.is_needed)
        .filter_map(|tried| if let Variation::Effect(effect) = tried.variation { Some(effect) } else { None })
        .collect();
    let together = parallel::map(2, threads, |k| {
        followed(&scene.with_only(if k == 0 { &kept } else { Effect::VARIANTS }), paddle).ok()
    });
    let left_out = match &together[..] {
        [Some(kept), Some(all)] => Some(all.over(kept, scene)),
        _ => None,
    };
    Ok(Effects {
        scene: scene.name.clone(),
        length_unit: scene.length_unit.clone(),
        paddle,
        tolerance,
        target_displacement: base.largest(),
        effects: tried,
        left_out,
    })
}

/// The scene with the small-strain limit of every law that has one.
pub(super) fn with_linear_laws(scene: &Scene) -> Scene {
    let mut linear = Scene { material: scene.material.linearised(), ..scene.clone() };
    for law in linear.inclusions.iter_mut().filter_map(|inclusion| inclusion.material.as_mut()) {
        *law = law.linearised();
    }
    linear
}

/// The same of a scene that is discretised as it says.
pub(super) fn followed(scene: &Scene, paddle: u32) -> Result<Followed, EffectsError> {
    let (model, _) = discretise(scene)?;
    follow(&model, paddle)
}

/// The insertion of the model's scene, this paddle attached and held where it rests.
pub(super) fn follow(model: &TissueModel, paddle: u32) -> Result<Followed, EffectsError> {
    let scene = model.scene();
    let position = scene.paddle_position(paddle).map_err(ModelError::from)?;
    let mut course = Course::at_rest(model, Some(position))?;
    let seconds = scene.needle.depth / scene.needle.speed;
    let mut targets = Vec::with_capacity(STEPS);
    for step in 1..=STEPS {
        let share = step as f64 / STEPS as f64;
        course.take_in(model.pose_at(seconds * share, scene.needle.depth * share), seconds / STEPS as f64)?;
        targets.push(course.target_displacement());
    }
    Ok(Followed { targets, base_force: course.base_force(), jacobian: course.actuation_jacobian()? })
}

impl Followed {
    /// Largest target displacement on the way, length.
    pub(super) fn largest(&self) -> f64 {
        self.targets.iter().map(Vector2::norm).fold(0.0, f64::max)
    }

    /// What this one has that another one, the base, has not.
    pub(super) fn over(&self, base: &Self, scene: &Scene) -> Added {
        let (axis, normal) = (scene.needle.axis, scene.needle.orthogonal());
        let largest = |along: Vector2<f64>| {
            let changes = self.targets.iter().zip(&base.targets).map(|(own, base)| along.dot(&(own - base)).abs());
            changes.fold(0.0, f64::max)
        };
        let measure = |of: &Self| best_direction(&of.jacobian, normal).map_or(f64::INFINITY, |best| best.norm());
        let (own, before) = (measure(self), measure(base));
        Added {
            orthogonal: largest(normal),
            axial: largest(axis),
            base_force: (self.base_force - base.base_force) / base.base_force.abs(),
            jacobian: (self.jacobian - base.jacobian).norm() / base.jacobian.norm(),
            controllability: if own == before { 0.0 } else { (own - before) / before },
        }
    }

    /// Whether a change of this one counts.
    fn counts(&self, added: &Added, tolerance: f64) -> bool {
        let moved = added.orthogonal.max(added.axial) > tolerance * self.largest();
        // What is not a number is not known to be small.
        moved || added.controllability.is_nan() || added.controllability.abs() > tolerance
    }
}

impl Effects {
    /// What each adds, and what a model of this scene needs.
    pub fn table(&self) -> String {
        let unit = match self.length_unit.as_str() {
            "1" => String::new(),
            unit => format!(" [{unit}]"),
        };
        let mut out = format!(
            "{}: what each effect changes, against a contact that moves with the needle in elastic tissue; paddle {} held, \
             target moved by up to {}{unit}\n\n{:<12} {:>13} {:>13} {:>11} {:>10} {:>16}\n",
            self.scene,
            self.paddle,
            length(self.target_displacement),
            "effect",
            format!("across{unit}"),
            format!("along{unit}"),
            "base force",
            "Jacobian",
            "controllability"
        );
        let places = decimals(10.0 * self.target_displacement, 5);
        for tried in &self.effects {
            let name = tried.variation.name();
            let _ = match (&tried.added, &tried.failure) {
                (Some(added), _) => writeln!(
                    out,
                    "{name:<12} {:>13.places$} {:>13.places$} {:>9.1} % {:>8.1} % {:>14.1} %",
                    added.orthogonal,
                    added.axial,
                    100.0 * added.base_force,
                    100.0 * added.jacobian,
                    100.0 * added.controllability
                ),
                (None, failure) => writeln!(out, "{name:<12} fails: {}", failure.as_deref().unwrap_or("unknown")),
            };
        }
        let named = |needed: bool| -> Vec<&str> {
            let effects = self.effects.iter().filter(|tried| tried.variation != Variation::LinearLaw);
            effects.filter(|tried| tried.is_needed == needed).map(|tried| tried.variation.name()).collect()
        };
        let linear = self.effects.iter().any(|tried| tried.variation == Variation::LinearLaw && !tried.is_needed);
        let law = if linear { "a linear law will do" } else { "a nonlinear law" };
        let list = |names: Vec<&str>| if names.is_empty() { "nothing else".to_owned() } else { names.join(", ") };
        let _ = write!(
            out,
            "\nAt a tolerance of {} % this scene needs: {law}, {}.",
            100.0 * self.tolerance,
            list(named(true))
        );
        let left = named(false);
        let _ = match (&self.left_out, left.is_empty()) {
            (_, true) => writeln!(out),
            (Some(added), false) => writeln!(
                out,
                " Left out: {}; together they would add {:.places$} across and {:.places$} along{unit}, {:.1} % of controllability.",
                left.join(", "),
                added.orthogonal,
                added.axial,
                100.0 * added.controllability
            ),
            (None, false) => {
                writeln!(out, " Left out: {}; what they add together is not known: it fails.", left.join(", "))
            }
        };
        out
    }

    /// What each adds, a line per effect.
    pub fn csv(&self) -> Vec<u8> {
        const COLUMNS: [&str; 8] = [
            "effect",
            "across [length]",
            "along [length]",
            "base_force [1]",
            "jacobian [1]",
            "controllability [1]",
            "needed [bool]",
            "failure [text]",
        ];
        csv::table(COLUMNS, self.effects.iter(), |tried| {
            let number =
                |of: fn(&Added) -> f64| tried.added.as_ref().map_or_else(String::new, |a| format!("{:.9e}", of(a)));
            [
                tried.variation.name().to_owned(),
                number(|a| a.orthogonal),
                number(|a| a.axial),
                number(|a| a.base_force),
                number(|a| a.jacobian),
                number(|a| a.controllability),
                tried.is_needed.to_string(),
                tried.failure.clone().unwrap_or_default(),
            ]
        })
    }

    /// A bar per effect, in per cent: target across and along the needle, base force, Jacobian.
    pub fn svg(&self) -> String {
        let scale = self.target_displacement;
        let names = || self.effects.iter().map(|tried| tried.variation.name().to_owned()).collect();
        let limit = 100.0 * self.tolerance;
        let panel = |title: &str, of: &dyn Fn(&Added) -> f64| {
            let bar = |(k, tried): (usize, &Tried)| Some((k, 100.0 * of(tried.added.as_ref()?).abs()));
            let bars: Vec<(usize, f64)> = self.effects.iter().enumerate().filter_map(bar).collect();
            let heights = bars.iter().map(|(_, height)| *height).chain([0.0, limit]);
            let change = Axis::linear("change", "%").enclosing(heights);
            let mut panel = Panel::new(title, Axis::categories("", names()), change);
            panel.bars.extend(bars.iter().map(|&(k, height)| Bars {
                label: String::new(),
                colour: Colour::CYCLE[k % Colour::CYCLE.len()],
                bars: vec![[k as f64 - 0.35, k as f64 + 0.35, height]],
            }));
            panel.lines.push(ReferenceLine::new("tolerance", Place::Y(limit), Dash::Dashed));
            panel
        };
        let needed: Vec<&str> =
            self.effects.iter().filter(|tried| tried.is_needed).map(|tried| tried.variation.name()).collect();
        let title = match needed.is_empty() {
            true => format!("{}: no effect counts at {} %", self.scene, 100.0 * self.tolerance),
            false => format!("{}: {} count at {} %", self.scene, needed.join(", "), 100.0 * self.tolerance),
        };
        Figure {
            title,
            caption: format!(
                "Largest change along the insertion against a contact that moves with the needle in elastic tissue, paddle {} \
                 held; target in parts of its largest displacement.",
                self.paddle
            ),
            panels: vec![
                panel("target across the needle", &|a| a.orthogonal / scale),
                panel("target along the needle", &|a| a.axial / scale),
                panel("force at the needle's base, full depth", &|a| a.base_force),
                panel("actuation Jacobian, full depth", &|a| a.jacobian),
            ],
            columns: 2,
        }
        .svg()
    }
}
