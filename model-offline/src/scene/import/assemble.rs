//! From named shapes to the parts of a scene; whatever is not taken is left out with a reason.

use super::along::Along;
use super::flatten::{Flattened, under_paddles};
use super::role::{ROLES, Role};
use super::shape::{DETAIL, Shape};
use super::{ImportError, ImportOptions, Imported, ImportedInclusion, Summary, parts};
use crate::geometry::{Location, Point2, Polygon, bounds, shared_area, simplified_loop};
use crate::material::Preset;
use crate::number::{in_unit, short};
use std::collections::BTreeSet;

/// Points of all shapes together: more are nothing that a person draws, and would take long to compare.
const MAX_POINTS: usize = 200_000;

/// Sorts shapes into a scene's parts. `per_unit` is the scene's length per unit of the file, where the file says it.
///
/// # Errors
/// [`ImportError::NoOutline`] where nothing can be the body.
pub(super) fn assemble(
    shapes: Vec<Shape>,
    per_unit: Option<f64>,
    options: &ImportOptions<'_>,
    mut summary: Summary,
) -> Result<Imported, ImportError> {
    let count: usize = shapes.iter().map(|shape| shape.points.len()).sum();
    if count > MAX_POINTS {
        return Err(ImportError::Unsupported(format!(
            "{count} points, at most {MAX_POINTS} are read: simplify the paths"
        )));
    }
    let mut kept = Vec::new();
    for shape in shapes {
        if shape.is_finite() {
            kept.push(shape);
        } else {
            summary.leave(&shape.told, "its coordinates are too large, or no numbers");
        }
    }
    let body = kept.remove(body(&kept, &summary)?);
    let frame = Frame::new(&body.points, per_unit, options, &mut summary)?;
    let outline = frame.polygon(&body.points).map_err(|error| {
        ImportError::NoOutline(format!("{} would be the body, and is no outline: {error}", body.told))
    })?;
    let note = match body.role {
        Some(_) => (!body.closed).then(|| "it is open, and closed by a straight line".to_owned()),
        None => Some("the largest closed shape without a role in its name".to_owned()),
    };
    summary.take(Role::Body, &body.told, note);
    let drawn: Vec<Point2> = body.points.iter().map(|p| frame.apply(*p)).collect();
    if let Some(told) = fewer_corners(&outline, &drawn, options.length) {
        summary.note(format!("outline: {told}"));
    }
    kept.iter_mut().for_each(|shape| shape.points.iter_mut().for_each(|p| *p = frame.apply(*p)));
    let Flattened { outline, under } = under_paddles(outline, &kept, |p| frame.rounded(p));
    for (shape, by) in under {
        let by = in_unit(by, options.length);
        summary.note(format!("outline: straight under {}, which is stiff; the curve was up to {by} off", shape.told));
    }
    let mut sorter = Sorter {
        frame,
        length: options.length,
        stress: options.stress,
        has_named: false,
        imported: Imported::of(outline.clone(), Vec::new()),
    };
    sorter.imported.summary = summary;
    sorter.imported.material = sorter.preset(body.preset, &body.told);
    sorter.sort(&Along::new(&outline), kept);
    Ok(sorter.imported)
}

/// What a region has lost of its drawing (scene units): details that are smaller than nodes could show. Points between
/// others on a line are nothing that is lost.
fn fewer_corners(region: &Polygon, drawn: &[Point2], length: &str) -> Option<String> {
    let (low, high) = bounds(drawn);
    let off = drawn.iter().map(|p| region.distance_to_boundary(*p)).fold(0.0, f64::max);
    let (corners, points) = (region.vertices().len(), drawn.len());
    let is_less = corners < points && off > 1e-2 * DETAIL * (high - low).max();
    is_less.then(|| format!("{corners} corners for {points} points of the drawing, up to {} off", in_unit(off, length)))
}

/// Which shape is the body.
fn body(shapes: &[Shape], summary: &Summary) -> Result<usize, ImportError> {
    let largest = |of: &dyn Fn(&Shape) -> bool| {
        let candidates = (0..shapes.len()).filter(|i| of(&shapes[*i]) && shapes[*i].area() > 0.0);
        candidates.max_by(|a, b| shapes[*a].area().total_cmp(&shapes[*b].area()))
    };
    if let Some(named) = shapes.iter().find(|shape| shape.role == Some(Role::Body)) {
        let none = || ImportError::NoOutline(format!("{} is to be the body, and encloses no area", named.told));
        return largest(&|shape| shape.role == Some(Role::Body)).ok_or_else(none);
    }
    largest(&|shape| shape.role.is_none() && shape.closed).ok_or_else(|| {
        let first = summary.left_out.first();
        let left = first.map_or_else(String::new, |left| format!(" ({} is left out: {})", left.what, left.why));
        let open = shapes.iter().find(|shape| shape.role.is_none() && !shape.closed);
        let open = open.map_or_else(String::new, |shape| format!(" ({} is not closed)", shape.told));
        ImportError::NoOutline(format!("draw a closed shape around the body, best with the name `body`{open}{left}"))
    })
}

/// Why a shape that is named as the body is not the body.
fn no_body(along: &Along<'_>, shape: &Shape) -> String {
    let is_within = |p: &Point2| along.outline.locate(*p, DETAIL * along.size) != Location::Outside;
    match () {
        () if !shape.closed => "the body is a closed shape, and this is a line".to_owned(),
        () if shape.points.iter().all(is_within) => {
            "the body is a larger shape; holes in it have no place in a scene".to_owned()
        }
        () => "the body is another, larger shape, and a scene has one".to_owned(),
    }
}

/// How the file's coordinates become the scene's.
struct Frame {
    origin: Point2,
    scale: f64,
    /// The body's longer side, scene units.
    longer: f64,
    /// What coordinates are rounded to: files that people can read.
    step: f64,
}

impl Frame {
    fn new(
        body: &[Point2],
        per_unit: Option<f64>,
        options: &ImportOptions<'_>,
        summary: &mut Summary,
    ) -> Result<Self, ImportError> {
        let (low, high) = bounds(body);
        let drawn = (high - low).max();
        let scale = options.size.map(|size| size / drawn).or(per_unit);
        let longer = drawn * scale.unwrap_or(1.0);
        // A thousandth of the detail that is kept.
        let step = 10f64.powf((1e-3 * DETAIL * longer).log10().floor());
        if ![longer, step, 1.0 / step, scale.unwrap_or(1.0)].iter().all(|x| x.is_normal() && *x > 0.0) {
            let what = "the body is too large or too small for its coordinates";
            return Err(ImportError::NoOutline(what.to_owned()));
        }
        let [width, height] = [0, 1].map(|i| short((high - low)[i] * scale.unwrap_or(1.0)));
        let unit = in_unit(0.0, options.length).replace('0', "");
        match scale {
            Some(_) => summary.note(format!("size: {width} × {height}{unit}, origin at the lower left of the body")),
            None => summary.note(format!("size: {width} × {height}{unit}, coordinates as in the file")),
        }
        let origin = if scale.is_some() { low } else { Point2::zeros() };
        Ok(Self { origin, scale: scale.unwrap_or(1.0), longer, step })
    }

    fn apply(&self, p: Point2) -> Point2 {
        (p - self.origin) * self.scale
    }

    fn rounded(&self, p: Point2) -> Point2 {
        p.map(|v| (v / self.step).round() * self.step)
    }

    /// Points of the file as a polygon of the scene.
    fn polygon(&self, points: &[Point2]) -> Result<Polygon, String> {
        self.region(&points.iter().map(|p| self.apply(*p)).collect::<Vec<_>>())
    }

    /// The same of points in the scene's units. Small regions keep details of their own size.
    fn region(&self, points: &[Point2]) -> Result<Polygon, String> {
        let (low, high) = bounds(points);
        let own = (high - low).max();
        if own < 1e3 * self.step {
            return Err("it encloses no area".to_owned());
        }
        let mut rounded = simplified_loop(points, DETAIL * self.longer.min(4.0 * own));
        rounded.iter_mut().for_each(|p| *p = self.rounded(*p));
        if rounded.len() < 3 {
            return Err("it encloses no area".to_owned());
        }
        Polygon::new(rounded).map_err(|error| error.to_string())
    }
}

struct Sorter<'a> {
    frame: Frame,
    length: &'a str,
    stress: &'a str,
    /// Whether some shape is an inclusion by its name.
    has_named: bool,
    imported: Imported,
}

impl Sorter<'_> {
    fn sort(&mut self, along: &Along<'_>, shapes: Vec<Shape>) {
        self.has_named = shapes.iter().any(|shape| shape.role == Some(Role::Inclusion));
        // Paddles with numbers first: the others take what is left.
        let (numbered, others): (Vec<Shape>, Vec<Shape>) =
            shapes.into_iter().partition(|shape| matches!(shape.role, Some(Role::Paddle(Some(_)))));
        for shape in numbered.iter().chain(&others) {
            let left = match shape.role {
                Some(Role::Body) => Err(no_body(along, shape)),
                Some(Role::Inclusion) => self.inclusion(along, shape),
                None => self.unnamed(along, shape),
                Some(Role::Needle) => self.needle(along, shape),
                Some(Role::Target) => self.target(along, shape),
                Some(Role::Paddle(index)) => self.paddle(along, shape, index),
                Some(Role::Fixed) => self.fixed(along, shape),
            };
            if let Err(why) = left {
                self.imported.summary.leave(&shape.told, why);
            }
        }
        self.imported.paddles.sort_by_key(|paddle| paddle.0);
    }

    fn take(&mut self, role: Role, shape: &Shape, note: Option<String>) {
        self.imported.summary.take(role, &shape.told, note);
    }

    /// The material of a name, where the unit of stress is known.
    fn preset(&mut self, preset: Option<Preset>, told: &str) -> Option<Preset> {
        let preset = preset?;
        match preset.section(None, self.stress) {
            Ok(_) => {
                self.imported.summary.note(format!("material: {} ← {told}", preset.name()));
                Some(preset)
            }
            Err(error) => {
                self.imported.summary.leave(&format!("material {} of {told}", preset.name()), error.to_string());
                None
            }
        }
    }

    fn unnamed(&mut self, along: &Along<'_>, shape: &Shape) -> Result<(), String> {
        if !shape.closed {
            return Err(format!("it is not closed, and its name begins with no role ({ROLES})"));
        }
        if self.has_named {
            return Err(format!("inclusions are those with names, and its name begins with no role ({ROLES})"));
        }
        self.inclusion(along, shape)
    }

    fn inclusion(&mut self, along: &Along<'_>, shape: &Shape) -> Result<(), String> {
        let named = shape.role.is_some();
        let region = self.frame.region(&shape.points).map_err(|error| match error.as_str() {
            "it encloses no area" => error,
            _ => format!("it is no region: {error}"),
        })?;
        let outside = |v: &Point2| along.outline.locate(*v, DETAIL * along.size) == Location::Outside;
        let out = region.vertices().iter().filter(|v| outside(v)).count();
        let shared = shared_area(&[along.outline], region.vertices());
        if shared <= 1e-9 * region.area() {
            return Err("it is outside the body".to_owned());
        }
        if out > 0 && !named {
            return Err("it reaches out of the body; named inclusion-… it would be taken".to_owned());
        }
        let mut notes = Vec::new();
        if out > 0 {
            notes.push(format!("{} % of it are in the body", short((100.0 * shared / region.area()).round())));
        }
        if !shape.closed {
            notes.push("it is open, and closed by a straight line".to_owned());
        }
        notes.extend(fewer_corners(&region, &shape.points, self.length));
        let material = self.preset(shape.preset, &shape.told);
        self.take(Role::Inclusion, shape, (!notes.is_empty()).then(|| notes.join("; ")));
        self.imported.inclusions.push(ImportedInclusion { outline: region, material });
        Ok(())
    }

    fn needle(&mut self, along: &Along<'_>, shape: &Shape) -> Result<(), String> {
        if self.imported.needle.is_some() {
            return Err("there is a needle already, by its line or by its contact, and a scene has one".to_owned());
        }
        let (mut needle, note) = parts::needle(along, shape)?;
        self.on_outline(along, &mut needle.contact);
        self.imported.needle = Some(needle);
        self.take(Role::Needle, shape, note);
        Ok(())
    }

    fn target(&mut self, along: &Along<'_>, shape: &Shape) -> Result<(), String> {
        if self.imported.target.is_some() {
            return Err("there is a target already, and a scene has one".to_owned());
        }
        let target = parts::target(along, shape)?;
        self.imported.target = Some(self.frame.rounded(target));
        self.take(Role::Target, shape, None);
        Ok(())
    }

    fn paddle(&mut self, along: &Along<'_>, shape: &Shape, index: Option<u32>) -> Result<(), String> {
        let used: BTreeSet<u32> = self.imported.paddles.iter().map(|paddle| paddle.0).collect();
        let index = match index {
            Some(index) if used.contains(&index) => {
                return Err(format!("there is a paddle {index} already, and one is one straight piece"));
            }
            Some(index) => index,
            None => (1..).find(|index| !used.contains(index)).unwrap_or(u32::MAX),
        };
        let (mut segment, note) = parts::paddle(along, shape)?;
        self.on_outline(along, &mut segment);
        self.imported.paddles.push((index, segment));
        self.take(Role::Paddle(Some(index)), shape, note);
        Ok(())
    }

    fn fixed(&mut self, along: &Along<'_>, shape: &Shape) -> Result<(), String> {
        for mut path in parts::fixed(along, shape)? {
            self.on_outline(along, &mut path);
            self.imported.immobile.push(path);
        }
        self.take(Role::Fixed, shape, None);
        Ok(())
    }

    /// Rounds points that are no corners of the outline; scenes put them back onto it.
    fn on_outline(&self, along: &Along<'_>, path: &mut [Point2]) {
        for p in path {
            let corner = along.outline.vertices().iter().find(|v| (**v - *p).norm() <= self.frame.step);
            *p = corner.copied().unwrap_or_else(|| self.frame.rounded(*p));
        }
    }
}
