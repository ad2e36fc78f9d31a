//! `model-offline check` of a scene in space: its numbers and its mesh, without solving.

use super::common::warned;
use super::error::CliError;
use super::json::write_json;
use model_offline::discretization::Resolution;
use model_offline::material::{Law, Material};
use model_offline::model::ModelError;
use model_offline::model::space::meshing::{MeshSize, even_mesh, mesh};
use model_offline::model::space::survey::{InclusionSurvey, PatchSurvey, Survey};
use model_offline::number::{area, coordinate, in_unit, short};
use model_offline::scene::space::SpaceScene;
use model_offline::tell;
use serde_json::json;
use std::fmt::Write as _;
use std::path::Path;

/// Lengths below this part of the body's size are rounding.
const ROUNDING: f64 = 1e-9;
/// Elements with smaller angles than this make the answers worse, degrees.
const FLAT: f64 = 3.0;
/// An inclusion of which more than this share is outside of the body reaches out of it; less may be the sampling.
const OUTSIDE: f64 = 0.02;
/// Elements that have less than this share of an inclusion have less than all; more may be the sampling.
const LESS: f64 = 0.95;
/// An inclusion of this share of the body is all of it.
const ALL: f64 = 0.999;
/// Where less than this share of the surface is immobile, the body is hardly held.
const BARELY: f64 = 0.002;

pub(super) fn run(scene: &SpaceScene, file: Option<&Path>) -> Result<(), CliError> {
    check(scene, file).map_err(|error| error.reported_of(file, &scene.name, scene.tissue()))
}

fn check(scene: &SpaceScene, file: Option<&Path>) -> Result<(), CliError> {
    let survey = survey(scene)?;
    if let Some(error) = &survey.refused {
        return Err(error.clone().into());
    }
    let warnings = warnings(scene, &survey);
    let mut document = json!(survey);
    document["scene"] = json!(scene.name);
    document["dimension"] = json!(3);
    document["tissue"] = json!(scene.tissue());
    document["units"] = json!({ "length": scene.length_unit, "stress": scene.stress_unit });
    document["integration"] = json!(scene.for_placement().discretization.method.integration);
    document["notes"] = json!(scene.notes);
    document["warnings"] = json!(warnings);
    write_json(file, &document)?;
    tell!("{}", text(&Told { scene, survey: &survey }, &warnings));
    Ok(())
}

/// What is there without solving, on the mesh that the scene asks for.
pub(super) fn survey(scene: &SpaceScene) -> Result<Survey, ModelError> {
    let at_level = |level: i32| Survey::of(scene, &mesh(scene, &MeshSize::level(level))?);
    match scene.discretization.resolution {
        Resolution::Spacing(spacing) => Survey::of(scene, &even_mesh(scene, spacing)?),
        Resolution::Level(level) => at_level(level),
        // Where refinement begins: at the coarsest mesh that sees every patch.
        Resolution::Tolerance(_) => at_level(0).or_else(|_| at_level(1)),
    }
}

/// What is seldom meant, in words.
pub(super) fn warnings(scene: &SpaceScene, survey: &Survey) -> Vec<String> {
    let told = Told { scene, survey };
    let mut all: Vec<String> = survey.warnings.iter().map(|warning| warning.told(&scene.length_unit)).collect();
    let overlap = |[a, b]: &[u32; 2]| {
        format!(
            "paddles {a} and {b} overlap, and cannot be attached together; move one, or leave the pair out in [pairs]"
        )
    };
    all.extend(survey.overlapping.iter().map(overlap));
    let empty = survey.inclusions.iter().filter(|inclusion| inclusion.elements == 0);
    all.extend(empty.map(|inclusion| {
        format!(
            "inclusion {} has no element of its own: others cover it, or it is smaller than an element; leave it out, or \
             change their order",
            inclusion.number
        )
    }));
    let is_all = |inclusion: &&InclusionSurvey| inclusion.volume > ALL * survey.volume;
    let outside = survey.inclusions.iter().filter(|inclusion| inclusion.outside > OUTSIDE && !is_all(inclusion));
    all.extend(outside.map(|inclusion| {
        let share = 100.0 * inclusion.outside;
        format!(
            "inclusion {} is partly outside the body: {share:.0} % of its volume; the part outside does nothing: move it, or cut it off",
            inclusion.number
        )
    }));
    all.extend(survey.inclusions.iter().filter(is_all).map(|inclusion| {
        format!("inclusion {} is all of the body; make the body of its tissue, or make it smaller", inclusion.number)
    }));
    let share = survey.immobile.area / survey.surface;
    all.extend((share < BARELY).then(|| {
        format!(
            "hardly anything holds the body: {} of its surface of {} is immobile; look whether [immobile] catches what it is meant to",
            area(survey.immobile.area, &scene.length_unit),
            area(survey.surface, &scene.length_unit)
        )
    }));
    all.extend((survey.parts > 1).then(|| {
        let paddles: Vec<String> = survey.apart.iter().map(ToString::to_string).collect();
        let mut on: Vec<String> = survey.needle_apart.then(|| "the needle enters".to_owned()).into_iter().collect();
        on.extend(match paddles.len() {
            0 => None,
            1 => Some(format!("paddle {} is on", paddles[0])),
            _ => Some(format!("paddles {} are on", paddles.join(", "))),
        });
        let told = if on.is_empty() { String::new() } else { format!(" ({} another than the target)", on.join(", ")) };
        format!(
            "the body is in {} parts that no face joins{told}; join them, or leave out what is not meant",
            survey.parts
        )
    }));
    let flat = survey.mesh.worst.first().filter(|worst| worst.dihedral < FLAT);
    all.extend(flat.map(|worst| {
        let (angle, at) = (worst.dihedral, told.point(worst.at));
        format!(
            "an element at {at} is nearly flat: {angle:.1}°; look for rims, edges or surfaces that nearly meet there"
        )
    }));
    all
}

fn text(told: &Told<'_>, warnings: &[String]) -> String {
    let Told { scene, survey } = told;
    let mut out = format!("{} · {} tissue · a valid scene\n\n", scene.name, scene.tissue());
    let mut row = |name: &str, what: String| {
        let _ = writeln!(out, "{name:<13}{what}");
    };
    row("body", told.body());
    row("material", told.law(&scene.material));
    let share = 100.0 * survey.immobile.area / survey.surface;
    row("immobile", format!("{}, {share:.0} % of the surface", told.patch(&survey.immobile)));
    row("needle", told.needle());
    row("target", told.target());
    for inclusion in &survey.inclusions {
        let (stuff, volume) = (told.stuff(inclusion.number, inclusion.stiffness), told.volume(inclusion.volume));
        let held = inclusion.sampled_volume.map(|own| inclusion.volume / own).filter(|held| *held < LESS);
        let of_it = held.map_or_else(String::new, |held| format!(" ({:.0} % of its own)", 100.0 * held));
        let what = format!("{stuff}; volume {volume}{of_it}, {} elements", inclusion.elements);
        row(&format!("inclusion {}", inclusion.number), what);
    }
    for paddle in &survey.paddles {
        let what = format!("{}, around {}", told.patch(&paddle.patch), told.point(paddle.patch.middle));
        row(&format!("paddle {}", paddle.index), what);
    }
    row("mesh", told.mesh());
    let worst = survey.mesh.worst.iter().map(|worst| format!("{:.1}° at {}", worst.dihedral, told.point(worst.at)));
    row("worst", worst.collect::<Vec<_>>().join(", "));
    row("method", told.method());
    out.push('\n');
    scene.notes.iter().for_each(|note| {
        let _ = writeln!(out, "note: {note}");
    });
    out.push_str(&warned(warnings));
    if warnings.is_empty() {
        out.push_str("no warnings\n");
    }
    out
}

/// The survey in words.
struct Told<'a> {
    scene: &'a SpaceScene,
    survey: &'a Survey,
}

impl Told<'_> {
    fn long(&self, length: f64) -> String {
        in_unit(length, &self.scene.length_unit)
    }

    fn law(&self, law: &Law) -> String {
        let modulus = <Law as Material<3>>::rest_shear_modulus(law);
        format!("shear modulus {} at rest", in_unit(modulus, &self.scene.stress_unit))
    }

    /// What an inclusion is made of. A factor of one says nothing of a material of its own.
    fn stuff(&self, number: usize, stiffness: f64) -> String {
        let times = format!("stiffness times {}", short(stiffness));
        let own = self.scene.inclusions.get(number - 1).and_then(|inclusion| inclusion.material.as_ref());
        match own.map(|own| format!("own material, {}", self.law(own))) {
            None => times,
            Some(own) if stiffness == 1.0 => own,
            Some(own) => format!("{own}, {times}"),
        }
    }

    fn volume(&self, volume: f64) -> String {
        match self.scene.length_unit.as_str() {
            "1" | "" => short(volume),
            unit => format!("{} {unit}³", short(volume)),
        }
    }

    fn point(&self, p: [f64; 3]) -> String {
        let size = self.scene.size();
        let [x, y, z] = p.map(|v| coordinate(v, size));
        format!("({x}, {y}, {z})")
    }

    fn patch(&self, patch: &PatchSurvey) -> String {
        format!("area {} in {} triangles", area(patch.area, &self.scene.length_unit), patch.triangles)
    }

    fn body(&self) -> String {
        let Survey { low, high, volume, surface, .. } = self.survey;
        let [x, y, z] = [0, 1, 2].map(|k| high[k] - low[k]);
        format!(
            "{} by {} by {}, from {}; volume {}, surface {}",
            short(x),
            short(y),
            self.long(z),
            self.point(*low),
            self.volume(*volume),
            area(*surface, &self.scene.length_unit)
        )
    }

    fn needle(&self) -> String {
        let needle = &self.survey.needle;
        let [x, y, z] = needle.axis.map(|v| format!("{v:.4}"));
        format!(
            "enters at {} in direction ({x}, {y}, {z}); depth {}; contact {}",
            self.point(needle.contact.middle),
            self.long(needle.depth),
            self.patch(&needle.contact)
        )
    }

    fn target(&self) -> String {
        let target = &self.survey.target;
        format!(
            "{}: {} along the needle's line, {} off it; {} from the surface",
            self.point(target.position),
            self.long(target.along_needle),
            self.long(target.off_needle),
            self.long(target.from_boundary)
        )
    }

    fn mesh(&self) -> String {
        let mesh = &self.survey.mesh;
        format!(
            "{} corners, {} tetrahedra; dihedral angles {:.1}° to {:.1}°; volumes {} to {}; its surface {}",
            mesh.nodes,
            mesh.tetrahedra,
            mesh.dihedral[0],
            mesh.dihedral[1],
            short(mesh.volume[0]),
            self.volume(mesh.volume[1]),
            self.off_surface(mesh.off_surface)
        )
    }

    fn off_surface(&self, length: f64) -> String {
        if length < ROUNDING * self.scene.size() {
            return "on the body's".to_string();
        }
        format!("within {} of the body's", self.long(length))
    }

    fn method(&self) -> String {
        let method = |scene: &SpaceScene| scene.discretization.method.integration;
        let (own, placement) = (method(self.scene), method(&self.scene.for_placement()));
        let followed = if own == placement { String::new() } else { format!(" for placement, {own} for insertions") };
        match self.scene.discretization.resolution {
            Resolution::Tolerance(tolerance) => {
                format!("{placement}{followed}; refined from here to {} %", short(100.0 * tolerance))
            }
            _ => placement.to_string(),
        }
    }
}
