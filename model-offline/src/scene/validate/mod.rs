//! From the file's text to a [`Scene`]: every rule a scene must obey, each with its own message.

mod boundary;
mod motion;
mod sensor;
mod shaft;

use self::boundary::Boundary;
use super::error::{SceneError, Source};
use super::exactly::Coordinates;
use super::limits::{self, LimitError};
use super::schema::{DiscretizationSection, InclusionSection, Located, SceneFile, dimension_of};
use super::{Actuator, Inclusion, Needle, PaddlePosition, Scene, Shaft};
use crate::discretization::{Discretization, Method, Resolution};
use crate::geometry::{Point2, Polygon, distance_to_polyline, distance_to_segment};
use crate::material::{Law, MaterialSection};
use std::ops::Range;

/// Outlines of more vertices than this are refused: nothing a needle scene needs, and memory stays bounded.
const MAX_VERTICES: usize = 20_000;

type Checked<T> = Result<T, SceneError>;

pub(super) fn parse(source: Source<'_>) -> Checked<Scene> {
    if source.text.trim().is_empty() {
        return Err(source.error(
            0..0,
            "the scene file is empty",
            "start from a bundled scene: model-offline/scenes/paper.toml",
        ));
    }
    if let Some(dimension) = dimension_of(source.text).filter(|dimension| *dimension.get() != 2) {
        return Err(source.error(
            dimension.span(),
            format!("dimension {} is not available here", dimension.get()),
            "use dimension = 2 (plane strain); scenes with dimension = 3 are for all commands but `sweep` and `compare`",
        ));
    }
    let file: SceneFile =
        toml::from_str(source.text).map_err(|error| source.refused(&error, "model-offline schema"))?;
    Validator { source, file: &file }.scene()
}

/// What targets and paddles must keep clear of.
struct Surroundings<'a> {
    boundary: &'a Boundary<'a>,
    immobile: &'a [Vec<Point2>],
    needle: &'a Needle,
}

struct Validator<'a> {
    source: Source<'a>,
    file: &'a SceneFile,
}

impl Validator<'_> {
    fn scene(&self) -> Checked<Scene> {
        let file = self.file;
        let outline = self.polygon(&file.domain.outline, "outline")?;
        let boundary = Boundary::new(&outline, file.domain.outline.get(), &file.scene.units.length);
        let immobile = self.immobile(&boundary)?;
        let mut needle = self.needle(&boundary, &immobile)?;
        needle.shaft = self.shaft(&needle, &boundary)?;
        let target = self.point(file.target.position.get(), file.target.position.span(), "target")?;
        let around = Surroundings { boundary: &boundary, immobile: &immobile, needle: &needle };
        self.target(target, &around)?;
        let paddles = self.paddles(&around)?;
        let inclusions = file
            .inclusion
            .iter()
            .map(|i| self.inclusion(i, &outline, needle.shaft.as_ref()))
            .collect::<Checked<_>>()?;
        let scene = Scene {
            clockwise: outline.vertices()[0] != Point2::from(file.domain.outline.get()[0].0),
            name: file.scene.name.clone(),
            length_unit: file.scene.units.length.clone(),
            stress_unit: file.scene.units.stress.clone(),
            material: self.material(&file.material)?,
            inclusions,
            immobile,
            target,
            paddles,
            actuator: self.actuator(&needle)?,
            discretization: self.discretization(&file.discretization, &outline)?,
            sensor: self.sensor(needle.depth)?,
            snapped: boundary.moved(),
            motion: self.motion()?,
            fit: file.fit.as_ref().map(|fit| fit.get().clone()),
            needle,
            outline,
        };
        self.fitted_effects(&scene)?;
        Ok(scene)
    }

    /// What a fit says that the scene needs is something that the scene has.
    fn fitted_effects(&self, scene: &Scene) -> Checked<()> {
        let Some((section, effects)) = self.file.fit.as_ref().and_then(|fit| Some((fit, fit.get().effects.as_ref()?)))
        else {
            return Ok(());
        };
        let own = scene.own_effects();
        for (place, effect) in effects.iter().enumerate() {
            let message = if effects[..place].contains(effect) {
                format!("[fit] effects names {effect} twice")
            } else if !own.contains(effect) {
                format!("[fit] effects names {effect}, and the scene has no such effect")
            } else {
                continue;
            };
            return Err(self.error(section.span(), message, "take it out, or fit the scene again: model-offline fit"));
        }
        Ok(())
    }

    fn error(&self, span: Range<usize>, message: impl Into<String>, help: impl Into<String>) -> SceneError {
        self.source.error(span, message, help)
    }

    fn point(&self, p: &[f64; 2], span: Range<usize>, what: &str) -> Checked<Point2> {
        if p.iter().all(|v| v.is_finite()) {
            Ok(Point2::new(p[0], p[1]))
        } else {
            Err(self.error(span, format!("{what}: coordinates must be finite numbers"), "replace nan and inf"))
        }
    }

    fn polyline(&self, points: &[Coordinates<2>], span: Range<usize>, what: &str) -> Checked<Vec<Point2>> {
        let path: Vec<Point2> = points.iter().map(|p| self.point(p, span.clone(), what)).collect::<Checked<_>>()?;
        if path.len() < 2 || path.windows(2).any(|s| s[0] == s[1]) {
            return Err(self.error(
                span,
                format!("{what}: needs at least two points, no two successive ones equal"),
                "give the points of a polyline: [[x, y], [x, y], ...]",
            ));
        }
        Ok(path)
    }

    fn polygon(&self, points: &Located<Vec<Coordinates<2>>>, what: &str) -> Checked<Polygon> {
        let count = points.get().len();
        if count > MAX_VERTICES {
            return Err(self.error(
                points.span(),
                format!("{what}: {count} vertices, at most {MAX_VERTICES} are accepted"),
                "simplify the polygon: details far below the node spacing change nothing",
            ));
        }
        let vertices = points.get().iter().map(|p| self.point(p, points.span(), what)).collect::<Checked<_>>()?;
        Polygon::new(vertices).map_err(|error| {
            self.error(
                points.span(),
                format!("{what}: {error}"),
                "a simple polygon has at least three different vertices, encloses an area and never meets itself",
            )
        })
    }

    fn positive(&self, value: &Located<f64>, what: &str) -> Checked<f64> {
        let v = *value.get();
        if v.is_finite() && v > 0.0 {
            Ok(v)
        } else {
            Err(self.error(value.span(), format!("{what} is {v}"), format!("{what} must be a positive finite number")))
        }
    }

    fn not_negative(&self, value: &Located<f64>, what: &str) -> Checked<f64> {
        let v = *value.get();
        if v.is_finite() && v >= 0.0 {
            Ok(v)
        } else {
            Err(self.error(
                value.span(),
                format!("{what} is {v}"),
                format!("{what} must be a finite number, not negative"),
            ))
        }
    }

    fn immobile(&self, boundary: &Boundary<'_>) -> Checked<Vec<Vec<Point2>>> {
        let paths = &self.file.immobile.paths;
        if paths.is_empty() {
            return Err(self.error(
                self.file.domain.outline.span(),
                "no part of the boundary is immobile, so nothing holds the body in place",
                "give at least one polyline in [immobile] paths",
            ));
        }
        paths
            .iter()
            .map(|located| {
                let path = self.points_on(located, boundary, "immobile path")?;
                self.stays_on(
                    &path,
                    located.span(),
                    boundary,
                    "this immobile path leaves the boundary of the outline",
                )?;
                Ok(path)
            })
            .collect()
    }

    fn needle(&self, boundary: &Boundary<'_>, immobile: &[Vec<Point2>]) -> Checked<Needle> {
        let Boundary { outline, tolerance, .. } = *boundary;
        let section = &self.file.needle;
        let contact = self.contact(boundary)?;
        if contact.windows(2).any(|s| polyline_near(immobile, s, tolerance)) {
            return Err(self.error(
                section.contact.span(),
                "the needle contact touches the immobile part",
                "tissue cannot move with the needle and be immobile: shorten one of them",
            ));
        }
        let axis = self.point(section.axis.get(), section.axis.span(), "needle axis")?;
        let Some(axis) = direction_of(axis) else {
            return Err(self.error(section.axis.span(), "the needle axis has no direction", "e.g. axis = [0.0, -1.0]"));
        };
        let increments = *section.increments.get();
        if !(1..=10_000).contains(&increments) {
            return Err(self.error(
                section.increments.span(),
                format!("increments is {increments}"),
                "divide the insertion into 1 to 10000 increments",
            ));
        }
        let depth = self.positive(&section.depth, "depth")?;
        if depth > outline.size() {
            return Err(self.error(
                section.depth.span(),
                format!("depth {depth} is larger than the whole body ({:.4})", outline.size()),
                "check the units of the depth",
            ));
        }
        let speed = section.speed.as_ref().map_or(Ok(0.2 * depth), |speed| self.positive(speed, "speed"))?;
        let deflection = section.deflection.as_ref().map_or(Ok(0.0), |located| match *located.get() {
            value if value.abs() <= depth => Ok(value),
            value => Err(self.error(
                located.span(),
                format!("deflection is {value}"),
                "give a length, positive or negative, no more than the depth",
            )),
        })?;
        Ok(Needle { contact, axis, depth, increments, deflection, speed, shaft: None })
    }

    fn target(&self, target: Point2, around: &Surroundings<'_>) -> Checked<()> {
        let Surroundings { boundary, immobile, needle } = *around;
        let tolerance = boundary.tolerance;
        let span = self.file.target.position.span();
        if !boundary.holds(target) {
            let message = format!("the target is outside the outline: {}", boundary.off(target));
            return Err(self.error(span, message, "move the target into the body"));
        }
        if immobile.iter().any(|path| distance_to_polyline(target, path) <= tolerance) {
            return Err(self.error(
                span,
                "the target is on the immobile part, so it cannot move",
                "move the target away from the immobile boundary",
            ));
        }
        if distance_to_polyline(target, &needle.contact) <= tolerance {
            return Err(self.error(
                span,
                "the target is on the needle contact, so no paddle can move it",
                "move the target away from the needle contact",
            ));
        }
        Ok(())
    }

    fn paddles(&self, around: &Surroundings<'_>) -> Checked<Vec<PaddlePosition>> {
        let Surroundings { boundary, immobile, needle } = *around;
        let tolerance = boundary.tolerance;
        if self.file.paddle.is_empty() {
            return Err(self.error(
                self.file.domain.outline.span(),
                "the scene has no paddle position",
                "add at least one [[paddle]] with an index and a segment on the boundary",
            ));
        }
        let mut paddles: Vec<PaddlePosition> = Vec::new();
        for located in &self.file.paddle {
            let section = located.get();
            let span = section.segment.span();
            let name = format!("paddle {}", section.index);
            if paddles.iter().any(|p| p.index == section.index) {
                return Err(self.error(located.span(), format!("{name} is given twice"), "number the paddles"));
            }
            let ends = self.points_on(&section.segment, boundary, &name)?;
            let segment = [ends[0], ends[1]];
            if (segment[1] - segment[0]).norm() <= tolerance {
                return Err(self.error(span, format!("{name} has no length"), "give two different end points"));
            }
            self.stays_on(&segment, span.clone(), boundary, &format!("{name} is off the boundary"))?;
            if polyline_near(immobile, &segment, tolerance) {
                return Err(self.error(
                    span,
                    format!("{name} is on the immobile part"),
                    "a paddle must be on boundary that can move, and may not touch the immobile part",
                ));
            }
            if needle.contact.windows(2).any(|s| touch(s, &segment, tolerance)) {
                return Err(self.error(
                    span,
                    format!("{name} touches the needle contact"),
                    "tissue cannot follow both: move the paddle or the contact",
                ));
            }
            paddles.push(PaddlePosition { index: section.index, segment });
        }
        Ok(paddles)
    }

    fn inclusion(
        &self,
        located: &Located<InclusionSection>,
        outline: &Polygon,
        shaft: Option<&Shaft>,
    ) -> Checked<Inclusion> {
        let section = located.get();
        let region = self.polygon(&section.outline, "inclusion")?;
        if overlap(&region, outline) <= 1e-12 * region.area().min(outline.area()) {
            return Err(self.error(
                section.outline.span(),
                "this inclusion covers nothing of the body",
                "move it inside the outline or remove it",
            ));
        }
        Ok(Inclusion {
            outline: region,
            stiffness: self.positive(&section.stiffness, "stiffness")?,
            material: section.material.as_ref().map(|m| self.material(m)).transpose()?,
            resistance: self.inclusion_resistance(section, shaft)?,
        })
    }

    fn material(&self, located: &Located<MaterialSection>) -> Checked<Law> {
        let law = located.get().law(&self.file.scene.units.stress);
        law.map_err(|error| self.error(located.span(), format!("material: {error}"), error.help()))
    }

    fn actuator(&self, needle: &Needle) -> Checked<Actuator> {
        let section = &self.file.actuator;
        let or = |value: &Option<Located<f64>>, what: &'static str, default: f64| {
            let Some(given) = value else { return Ok(default) };
            let value = self.positive(given, what)?;
            limits::check_actuator(what, value, needle.depth)
                .map_err(|error| self.error(given.span(), error.to_string(), error.help()))
        };
        Ok(Actuator {
            max_displacement: or(&section.max_displacement, "max_displacement", needle.depth)?,
            max_rate: or(&section.max_rate, "max_rate", needle.depth)?,
            max_needle_speed: or(&section.max_needle_speed, "max_needle_speed", 2.0 * needle.depth)?,
        })
    }

    fn limit(&self, span: Range<usize>, error: LimitError) -> SceneError {
        self.error(span, error.to_string(), error.help())
    }

    fn resolution(&self, resolution: Resolution, span: Range<usize>, outline: &Polygon) -> Checked<Resolution> {
        limits::check_resolution(resolution, outline).map_err(|error| self.limit(span, error))?;
        Ok(resolution)
    }

    fn two_resolutions(&self, second: Range<usize>) -> SceneError {
        self.error(
            second,
            "both spacing and tolerance are given",
            "give the spacing, the tolerance to reach, or the level of a fit, never two of them",
        )
    }

    fn discretization(&self, located: &Located<DiscretizationSection>, outline: &Polygon) -> Checked<Discretization> {
        let section = located.get();
        let resolution = match (&section.spacing, &section.tolerance, &section.level) {
            (Some(_), Some(second), _) => return Err(self.two_resolutions(second.span())),
            (Some(_), None, Some(second)) | (None, Some(_), Some(second)) => {
                return Err(self.two_resolutions(second.span()));
            }
            (None, None, None) => {
                return Err(self.error(
                    located.span(),
                    "neither spacing nor tolerance is given",
                    "add spacing = (node spacing) or tolerance = (relative error) to [discretization]",
                ));
            }
            (Some(spacing), None, None) => {
                let h = self.positive(spacing, "spacing")?;
                self.resolution(Resolution::Spacing(h), spacing.span(), outline)?
            }
            (None, Some(tolerance), None) => {
                let t = self.positive(tolerance, "tolerance")?;
                self.resolution(Resolution::Tolerance(t), tolerance.span(), outline)?
            }
            (None, None, Some(level)) => self.resolution(Resolution::Level(*level.get()), level.span(), outline)?,
        };
        let integration = section.integration.unwrap_or_default();
        limits::check_planar(integration).map_err(|error| self.limit(located.span(), error))?;
        let support = match &section.support {
            Some(located) => {
                let support = self.positive(located, "support")?;
                limits::check_support(support).map_err(|error| self.limit(located.span(), error))?;
                support
            }
            None => integration.default_support(),
        };
        Ok(Discretization {
            resolution,
            method: Method { support, basis: section.basis, ..Method::new(integration) },
            essential: section.essential,
        })
    }
}

/// The unit vector along another; none along one without a length. The square of a very long or short vector is no number.
fn direction_of(vector: Point2) -> Option<Point2> {
    let longest = vector.amax();
    let unit = vector.normalize();
    let is_unit = (unit.norm() - 1.0).abs() < 1e-9;
    (longest > 0.0).then(|| if is_unit { unit } else { (vector / longest).normalize() })
}

fn touch(a: &[Point2], b: &[Point2; 2], tolerance: f64) -> bool {
    crate::geometry::segments_meet(a[0], a[1], b[0], b[1], tolerance)
}

fn polyline_near(paths: &[Vec<Point2>], segment: &[Point2], tolerance: f64) -> bool {
    paths.iter().flat_map(|p| p.windows(2)).any(|s| {
        crate::geometry::segments_meet(s[0], s[1], segment[0], segment[1], tolerance)
            || distance_to_segment(0.5 * (segment[0] + segment[1]), s[0], s[1]) <= tolerance
    })
}

/// Area that two simple polygons share: one is cut into a fan of signed triangles, which are convex.
fn overlap(a: &Polygon, b: &Polygon) -> f64 {
    let v = a.vertices();
    (1..v.len() - 1)
        .map(|i| {
            let signed = crate::geometry::cross(v[i] - v[0], v[i + 1] - v[0]);
            let triangle = if signed >= 0.0 { [v[0], v[i], v[i + 1]] } else { [v[0], v[i + 1], v[i]] };
            if signed == 0.0 { 0.0 } else { signed.signum() * crate::geometry::overlap_area(b, &triangle) }
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_of_any_length_have_a_direction_but_for_none() {
        for scale in [1.0, 1e-13, 1e-200, 1e200, 1e300, f64::MIN_POSITIVE] {
            let found = direction_of(Point2::new(3.0, -4.0) * (0.25 * scale)).unwrap();
            assert!((found - Point2::new(0.6, -0.8)).norm() < 1e-15, "{scale}: {found}");
        }
        assert_eq!(direction_of(Point2::new(1e200, 0.0)), Some(Point2::x()));
        assert_eq!(direction_of(Point2::zeros()), None);
    }
}
