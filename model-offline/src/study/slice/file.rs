//! A slice as the text of a planar scene.

use super::{Cut, SliceError};
use crate::discretization::{Integration, Resolution};
use crate::geometry::Point2;
use crate::scene::TissueVariant;
use crate::scene::space::SpaceScene;
use std::fmt::Write as _;
use toml::{Table, Value};

/// Coordinates are written to this part of the body's size.
const DIGITS: f64 = 1e-10;

/// The text of the planar scene that has what was cut, and from the text of the scene in space what is no geometry.
pub(super) fn text(scene: &SpaceScene, text: &str, cut: &Cut) -> Result<String, SliceError> {
    let original: Table = toml::from_str(text).map_err(|error| SliceError::Text(error.to_string()))?;
    let number = Numbers::new(scene.size());
    let mut out = format!(
        "# Plane strain: {} of the scene {:?} in space. Coordinates are along {} and {}.\n",
        cut.plane.name(&scene.length_unit).replace('\u{a0}', " "),
        scene.name,
        cut.plane.axes()[0].replace('\u{a0}', " "),
        cut.plane.axes()[1].replace('\u{a0}', " "),
    );
    for left in &cut.left_out {
        let _ = writeln!(out, "# Paddle {} is left out: {}.", left.index, left.reason);
    }
    let mut section = |name: &str, value: Value| {
        let _ = write!(out, "\n{}", Table::from_iter([(name.to_owned(), value)]));
    };
    let mut about = original.get("scene").and_then(Value::as_table).cloned().unwrap_or_default();
    about.insert("name".into(), format!("{}-slice", scene.name).into());
    about.insert("dimension".into(), 2.into());
    section("scene", about.into());
    section("domain", table([("outline", number.points(&cut.outline))]));
    if let Some(material) = original.get("material") {
        section("material", material.clone());
    }
    if scene.tissue() == TissueVariant::Inclusion {
        let given = original.get("inclusion").and_then(Value::as_array);
        let inclusions = cut.inclusions.iter().map(|(place, outline)| {
            let given = given.and_then(|given| given.get(*place)).and_then(Value::as_table);
            let kept = ["stiffness", "material"].into_iter().filter_map(|key| Some((key, given?.get(key)?.clone())));
            table([("outline", number.points(outline))].into_iter().chain(kept))
        });
        let inclusions: Vec<Value> = inclusions.collect();
        if !inclusions.is_empty() {
            section("inclusion", inclusions.into());
        }
    }
    section(
        "immobile",
        table([("paths", cut.immobile.iter().map(|path| number.points(path)).collect::<Vec<_>>().into())]),
    );
    section("needle", needle(scene, cut, &number));
    section("target", table([("position", number.point(&cut.target))]));
    let paddles = cut
        .paddles
        .iter()
        .map(|(index, ends)| table([("index", i64::from(*index).into()), ("segment", number.points(ends))]));
    section("paddle", paddles.collect::<Vec<_>>().into());
    if let Some(actuator) = original.get("actuator") {
        section("actuator", actuator.clone());
    }
    section("discretization", discretization(scene));
    Ok(out)
}

fn needle(scene: &SpaceScene, cut: &Cut, number: &Numbers) -> Value {
    let direction = cut.plane.coordinates(&scene.needle.axis).map(|part| if part.abs() < DIGITS { 0.0 } else { part });
    table([
        ("contact", number.points(&cut.contact)),
        ("axis", direction.to_vec().into()),
        ("depth", scene.needle.depth.into()),
        ("increments", i64::from(scene.needle.increments).into()),
        ("speed", scene.needle.speed.into()),
    ])
}

/// The same resolution, by the same rule and support: for tetrahedra, triangles of the same order.
fn discretization(scene: &SpaceScene) -> Value {
    let method = scene.discretization.method;
    let integration = match method.integration {
        Integration::FemT4 => Integration::FemT3,
        Integration::FemT10 => Integration::FemT6,
        nodal => nodal,
    };
    let resolution = match scene.discretization.resolution {
        Resolution::Spacing(spacing) => ("spacing", spacing.into()),
        Resolution::Tolerance(tolerance) => ("tolerance", tolerance.into()),
        Resolution::Level(level) => ("level", i64::from(level).into()),
    };
    let support = (!integration.is_element()).then(|| ("support", method.support.into()));
    table([resolution, ("integration", integration.name().into())].into_iter().chain(support))
}

fn table<'k>(entries: impl IntoIterator<Item = (&'k str, Value)>) -> Value {
    Table::from_iter(entries.into_iter().map(|(key, value)| (key.to_owned(), value))).into()
}

/// Coordinates without the digits that rounding has made.
struct Numbers {
    decimals: usize,
    step: f64,
}

impl Numbers {
    fn new(size: f64) -> Self {
        let power = (DIGITS * size).log10().floor();
        Self { decimals: (-power).max(0.0) as usize, step: 10f64.powf(power) }
    }

    fn number(&self, value: f64) -> f64 {
        // Adding zero turns a negative zero into a positive one.
        let rounded = (value / self.step).round() * self.step + 0.0;
        format!("{rounded:.*}", self.decimals).parse().unwrap_or(value)
    }

    fn point(&self, point: &Point2) -> Value {
        vec![self.number(point.x), self.number(point.y)].into()
    }

    fn points(&self, points: &[Point2]) -> Value {
        points.iter().map(|point| self.point(point)).collect::<Vec<_>>().into()
    }
}
