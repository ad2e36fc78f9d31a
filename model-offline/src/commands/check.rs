//! `model-offline check`: a scene's numbers, and what of it is seldom meant, without solving.

use super::check_space;
use super::common::{DiscretizationArgs, SceneArgs, warned};
use super::error::CliError;
use super::json::write_json;
use model_offline::number::{area, coordinate, in_unit, short};
use model_offline::output::check_outputs;
use model_offline::scene::{MaterialFacts, Scene, SceneFacts};
use model_offline::tell;
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Options of `check`.
#[derive(Debug, clap::Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Write numbers and warnings as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    discretization: DiscretizationArgs,
}

pub(super) fn run(args: &CheckArgs) -> Result<(), CliError> {
    if let Some(scene) = args.scene.read_in_space()? {
        let scene = args.discretization.over_space(scene)?;
        check_outputs(&args.scene.files(&scene), &[("--json", args.json.as_deref())])?;
        return check_space::run(&scene, args.json.as_deref());
    }
    let scene = args.discretization.over(args.scene.read_any()?)?;
    check_outputs(&[&args.scene.scene], &[("--json", args.json.as_deref())])?;
    let (facts, warnings) = (scene.facts(), scene.told_warnings());
    let mut document = json!(facts);
    document["integration"] = json!(scene.discretization.method.integration);
    document["effects"] = json!(scene.effects());
    document["warnings"] = json!(warnings);
    write_json(args.json.as_deref(), &document)?;
    tell!("{}", text(&scene, &facts, &warnings));
    Ok(())
}

fn text(scene: &Scene, facts: &SceneFacts, warnings: &[String]) -> String {
    let told = Told { facts };
    let mut out = format!("{} · {} tissue · a valid scene\n\n", facts.scene, facts.tissue);
    let mut row = |name: &str, what: String| {
        let _ = writeln!(out, "{name:<13}{what}");
    };
    row("body", told.body());
    row("material", told.material(&facts.material));
    row("immobile", told.immobile());
    row("needle", told.needle());
    row("target", told.target());
    for (i, inclusion) in facts.inclusions.iter().enumerate() {
        row(&format!("inclusion {}", inclusion.number), told.inclusion(i));
    }
    for (i, paddle) in facts.paddles.iter().enumerate() {
        row(&format!("paddle {}", paddle.index), told.paddle(i));
    }
    if !facts.snapped.is_empty() {
        row("snapped", told.snapped());
    }
    row("nodes", told.nodes(scene));
    if !scene.effects().is_empty() {
        row("effects", scene.effects().join(", "));
    }
    out.push('\n');
    out.push_str(&warned(warnings));
    if warnings.is_empty() {
        out.push_str("no warnings\n");
    }
    out
}

/// Distances below this are 0 but for rounding, part of the body's size.
const ROUNDING: f64 = 1e-12;

/// The facts in words.
struct Told<'a> {
    facts: &'a SceneFacts,
}

impl Told<'_> {
    fn long(&self, length: f64) -> String {
        in_unit(length, &self.facts.units.length)
    }

    /// A distance of two things in the body: next to its size, rounding is nothing.
    fn beside(&self, distance: f64) -> String {
        let is_rounding = distance.abs() < ROUNDING * self.facts.body.size;
        self.long(if is_rounding { 0.0 } else { distance })
    }

    fn snapped(&self) -> String {
        let told = self.facts.snapped.iter().map(|snapped| format!("{} by {}", snapped.what, self.long(snapped.by)));
        format!("{}: put onto the outline", told.collect::<Vec<_>>().join(", "))
    }

    fn point(&self, p: [f64; 2]) -> String {
        let [x, y] = p.map(|v| coordinate(v, self.facts.body.size));
        format!("({x}, {y})")
    }

    fn body(&self) -> String {
        let body = &self.facts.body;
        format!(
            "{} by {}, from {}; area {}; {} corners",
            short(body.high[0] - body.low[0]),
            self.long(body.high[1] - body.low[1]),
            self.point(body.low),
            area(body.area, &self.facts.units.length),
            body.vertices
        )
    }

    fn material(&self, material: &MaterialFacts) -> String {
        format!("shear modulus {} at rest", in_unit(material.shear_modulus, &self.facts.units.stress))
    }

    fn immobile(&self) -> String {
        let body = &self.facts.body;
        let share = 100.0 * body.immobile_length / body.perimeter;
        format!("{} of {} of boundary ({share:.0} %)", self.long(body.immobile_length), self.long(body.perimeter))
    }

    fn needle(&self) -> String {
        let needle = &self.facts.needle;
        let [x, y] = needle.axis.map(|v| format!("{v:.4}"));
        format!(
            "{}, enters at {} in direction ({x}, {y}); depth {}, contact {} long",
            needle.mechanics,
            self.point(needle.entry),
            self.long(needle.depth),
            self.long(needle.contact_length)
        )
    }

    fn target(&self) -> String {
        let target = &self.facts.target;
        format!(
            "{}, {} from the entry: {} along the needle's line, {} off it; {} from the boundary",
            self.point(target.position),
            self.long(target.from_entry),
            self.long(target.along_needle),
            self.beside(target.off_needle),
            self.long(target.from_boundary)
        )
    }

    fn inclusion(&self, place: usize) -> String {
        let inclusion = &self.facts.inclusions[place];
        let times = format!("stiffness times {}", short(inclusion.stiffness));
        let what = match inclusion.material.as_ref().map(|own| format!("own material, {}", self.material(own))) {
            None => times,
            // A factor that says nothing of a material of its own.
            Some(own) if inclusion.stiffness == 1.0 => own,
            Some(own) => format!("{own}, {times}"),
        };
        format!(
            "{what}; area {} around {}, {} wide",
            area(inclusion.area, &self.facts.units.length),
            self.point(inclusion.centroid),
            self.long(inclusion.width)
        )
    }

    fn paddle(&self, place: usize) -> String {
        let paddle = &self.facts.paddles[place];
        format!(
            "{} long; {} from the needle contact, {} from the immobile part",
            self.long(paddle.length),
            self.long(paddle.from_contact),
            self.long(paddle.from_immobile)
        )
    }

    fn nodes(&self, scene: &Scene) -> String {
        let integration = scene.discretization.method.integration;
        match (self.facts.nodes, self.facts.spacing) {
            (Some(nodes), Some(spacing)) => format!("{nodes}, {} apart; {integration}", self.long(spacing)),
            (None, Some(spacing)) => format!("{} apart; {integration}", self.long(spacing)),
            (_, None) => format!("as many as its tolerance or level takes; {integration}"),
        }
    }
}
