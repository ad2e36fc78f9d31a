//! From the file's text to a [`SpaceScene`]: every rule that a scene in space must obey, each with its own message.

use super::bodies::Bodies;
use super::import;
use super::schema::{DiscretizationSection, InclusionSection, PairsOf, SolidSection, SpaceSceneFile};
use super::{FilePlace, PartsInFile, SpaceInclusion, SpaceNeedle, SpacePaddle, SpaceScene};
use crate::discretization::{Discretization, Integration, Method, Resolution};
use crate::geometry::implicit::share;
use crate::geometry::{Implicit, Point, Solid};
use crate::material::{Law, MaterialSection};
use crate::number::{length, short};
use crate::scene::Actuator;
use crate::scene::error::{SceneError, Source};
use crate::scene::exactly::{Coordinates, Exactly};
use crate::scene::limits::{self, LimitError};
use crate::scene::schema::Located;
use sha2::{Digest, Sha256};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

type Checked<T> = Result<T, SceneError>;

/// Distances below this part of the body's size are rounding.
const ROUNDING: f64 = 1e-9;
/// Inclusions smaller than this part of the body, which elements would have to be graded down to, are slips.
const TINY: f64 = 1e-4;
/// Bodies are at least this long, and their coordinates at most so large, in units of the scene.
const SMALLEST: f64 = 1e-12;
const LARGEST: f64 = 1e12;
/// Files of bodies have digits for this part of their size: regions closer to a face are meant to be there.
const DIGITS: f64 = 1e-5;

/// A scene whose files are relative to `folder`.
pub(super) fn parse(source: Source<'_>, folder: &Path) -> Checked<SpaceScene> {
    let file: SpaceSceneFile =
        toml::from_str(source.text).map_err(|error| source.refused(&error, "model-offline schema --dimension 3"))?;
    let bodies = Bodies::new(source, folder, &file.scene.units.length);
    Validator { source, file: &file }.scene(bodies)
}

/// SHA-256 over what a scene says and what its files hold, whatever its layout and its comments.
fn content(text: &str, files: &[PathBuf]) -> [u8; 32] {
    let canonical = toml::from_str::<toml::Table>(text).map_or_else(|_| text.to_owned(), |table| table.to_string());
    let mut hash = Sha256::new().chain_update(canonical);
    for file in files {
        // A file that has just been read: should it be gone, the scene's text still tells it apart.
        hash.update(import::bytes(file).unwrap_or_default());
    }
    hash.finalize().into()
}

struct Validator<'a> {
    source: Source<'a>,
    file: &'a SpaceSceneFile,
}

impl Validator<'_> {
    fn scene(&self, mut bodies: Bodies<'_>) -> Checked<SpaceScene> {
        let file = self.file;
        self.planar_only()?;
        let body = bodies.domain(&file.domain)?;
        let (low, high) = body.bounds().ok_or_else(|| {
            self.error(
                file.domain.span(),
                "the body has no end: no part of it bounds it",
                "intersect half spaces with a box, a sphere, an ellipsoid or a cylinder",
            )
        })?;
        let size = self.size(low, high)?;
        let target = self.target(body.as_ref()).map_err(|error| bodies.explained(error))?;
        let onto = |region: Solid| region.onto(body.as_ref(), DIGITS * size);
        let mut needle = self.needle(size)?;
        needle.region = onto(needle.region);
        let mut paddles = self.paddles()?;
        paddles.iter_mut().for_each(|paddle| paddle.region = onto(paddle.region.clone()));
        let mut inclusions = Vec::with_capacity(file.inclusion.len());
        for located in &file.inclusion {
            let region = bodies.inclusion(located)?;
            inclusions.push(self.inclusion(located, region, body.as_ref())?);
        }
        Ok(SpaceScene {
            name: file.scene.name.clone(),
            length_unit: file.scene.units.length.clone(),
            stress_unit: file.scene.units.stress.clone(),
            target,
            material: self.material(&file.material)?,
            inclusions,
            notes: bodies.notes,
            content: content(self.source.text, &bodies.files),
            files: bodies.files,
            immobile: self.immobile()?.into_iter().map(onto).collect(),
            pairs: self.pairs(&paddles)?,
            actuator: self.actuator(&needle)?,
            discretization: self.discretization(&file.discretization, high - low)?,
            names_method: file.discretization.get().names_method(),
            unit_of_body: bodies.unit_of_body,
            in_file: self.parts_in_file(),
            needle,
            paddles,
            body,
        })
    }

    /// Where what is held, what moves and what is elsewhere stiffer stand: only a mesh shows whether they meet.
    fn parts_in_file(&self) -> PartsInFile {
        let place = |span: Range<usize>| FilePlace::of(self.source, span.start);
        PartsInFile {
            immobile: self.file.immobile.regions.iter().map(|region| place(region.span())).collect(),
            needle: place(self.file.needle.region.span()),
            paddles: self.file.paddle.iter().map(|p| (p.get().index, place(p.get().region.span()))).collect(),
            inclusions: self.file.inclusion.iter().map(|inclusion| place(inclusion.span())).collect(),
        }
    }

    /// The diagonal of the body's bounding box; products of three such lengths have to be numbers.
    fn size(&self, low: Point<3>, high: Point<3>) -> Checked<f64> {
        let farthest = low.amax().max(high.amax());
        let size = (high - low).amax();
        if size >= SMALLEST && farthest <= LARGEST {
            return Ok((high - low).norm());
        }
        Err(self.error(
            self.file.domain.span(),
            format!("the body is {size:e} long, its farthest coordinate {farthest:e}"),
            format!("choose a unit of length in which numbers are between {SMALLEST:e} and {LARGEST:e}"),
        ))
    }

    /// What scenes in the plane have and scenes in space have not yet is refused by name.
    fn planar_only(&self) -> Checked<()> {
        let file = self.file;
        let sections = [(&file.sensor, "[sensor]"), (&file.motion, "[motion]"), (&file.fit, "[fit]")];
        let given = sections.into_iter().find_map(|(section, name)| section.as_ref().map(|section| (section, name)));
        if let Some((section, name)) = given {
            let message = format!("{name} is read of scenes in the plane alone");
            let help = "take it out: `place`, `solve` and `table` do not need it, and `host-sim run` has options for the sensor";
            return Err(self.error(section.span(), message, help));
        }
        match &file.needle.mechanics {
            Some(mechanics) if mechanics.get() != "patch" => Err(self.error(
                mechanics.span(),
                format!("mechanics = \"{}\" is planar: in space the needle's contact moves with it", mechanics.get()),
                "use mechanics = \"patch\", or leave it out",
            )),
            _ => Ok(()),
        }
    }

    fn error(&self, span: Range<usize>, message: impl Into<String>, help: impl Into<String>) -> SceneError {
        self.source.error(span, message, help)
    }

    fn point(&self, located: &Located<Coordinates<3>>, what: &str) -> Checked<Point<3>> {
        match located.get() {
            p if p.iter().all(|v| v.is_finite()) => Ok(Point::<3>::from(p.0)),
            _ => Err(self.error(
                located.span(),
                format!("{what}: coordinates must be finite numbers"),
                "replace nan and inf",
            )),
        }
    }

    fn positive(&self, value: &Located<f64>, what: &str) -> Checked<f64> {
        match *value.get() {
            v if v.is_finite() && v > 0.0 => Ok(v),
            v => Err(self.error(
                value.span(),
                format!("{what} is {v}"),
                format!("{what} must be a positive finite number"),
            )),
        }
    }

    fn solid(&self, section: &SolidSection, span: Range<usize>, what: &str) -> Checked<Solid> {
        section.solid().map_err(|wrong| {
            self.error(span, format!("{what}: {wrong}"), "e.g. { box = { min = [0, 0, 0], max = [1, 1, 1] } }")
        })
    }

    fn region(&self, located: &Located<SolidSection>, what: &str) -> Checked<Solid> {
        self.solid(located.get(), located.span(), what)
    }

    fn needle(&self, size: f64) -> Checked<SpaceNeedle> {
        let section = &self.file.needle;
        let axis = self.point(&section.axis, "needle axis")?;
        // Divided first: the square of a very long or short axis is no number.
        let longest = axis.amax();
        if longest == 0.0 {
            let help = "e.g. axis = [0.0, 0.0, -1.0]";
            return Err(self.error(section.axis.span(), "the needle axis has no direction", help));
        }
        let increments = section.increments.as_ref().map_or(10, |increments| *increments.get());
        if !(1..=10_000).contains(&increments) {
            let span = section.increments.as_ref().map_or(0..0, Located::span);
            let help = "divide the insertion into 1 to 10000 increments";
            return Err(self.error(span, format!("increments is {increments}"), help));
        }
        let depth = self.positive(&section.depth, "depth")?;
        if depth > size {
            return Err(self.error(
                section.depth.span(),
                format!("depth {depth} is larger than the whole body ({size:.4})"),
                "check the units of the depth",
            ));
        }
        Ok(SpaceNeedle {
            region: self.region(&section.region, "needle region")?,
            axis: (axis / longest).normalize(),
            depth,
            increments,
            speed: section.speed.as_ref().map_or(Ok(0.2 * depth), |speed| self.positive(speed, "speed"))?,
        })
    }

    fn target(&self, body: &dyn Implicit) -> Checked<Point<3>> {
        let located = &self.file.target.position;
        let target = self.point(located, "target")?;
        let outside = body.level(&target);
        if outside < 0.0 {
            return Ok(target);
        }
        if !share(body, body, &|_| true) {
            return Err(self.error(
                self.file.domain.span(),
                "nothing is left of the body",
                "look at the order of a difference, and whether the parts of an intersection meet",
            ));
        }
        let size = body.bounds().map_or(1.0, |(low, high)| (high - low).norm());
        let told = if outside <= ROUNDING * size {
            "the target is on the surface of the body".to_owned()
        } else {
            format!("the target is outside the body, about {} from it", length(outside))
        };
        let extent = body.extent().map_or_else(String::new, |(low, high)| {
            let point = |p: Point<3>| format!("({}, {}, {})", short(p.x), short(p.y), short(p.z));
            format!(", which reaches from {} to {}", point(low), point(high))
        });
        Err(self.error(located.span(), told, format!("move the target into the body{extent}")))
    }

    fn immobile(&self) -> Checked<Vec<Solid>> {
        let regions = &self.file.immobile.regions;
        if regions.is_empty() {
            return Err(self.error(
                self.file.domain.span(),
                "no part of the surface is immobile, so nothing holds the body in place",
                "give at least one region in [immobile] regions",
            ));
        }
        regions.iter().map(|region| self.region(region, "immobile region")).collect()
    }

    fn paddles(&self) -> Checked<Vec<SpacePaddle>> {
        if self.file.paddle.is_empty() {
            return Err(self.error(
                self.file.domain.span(),
                "the scene has no paddle position",
                "add at least one [[paddle]] with an index and a region",
            ));
        }
        let mut paddles: Vec<SpacePaddle> = Vec::new();
        for located in &self.file.paddle {
            let section = located.get();
            let name = format!("paddle {}", section.index);
            if paddles.iter().any(|p| p.index == section.index) {
                return Err(self.error(located.span(), format!("{name} is given twice"), "number the paddles"));
            }
            let region = self.region(&section.region, &name)?;
            paddles.push(SpacePaddle { index: section.index, region });
        }
        Ok(paddles)
    }

    fn pairs(&self, paddles: &[SpacePaddle]) -> Checked<Vec<[usize; 2]>> {
        let Some(of) = &self.file.pairs.of else { return Ok(all_pairs(paddles.len())) };
        let list = match of.get() {
            PairsOf::Word(word) if word == "all" => return Ok(all_pairs(paddles.len())),
            PairsOf::Word(word) if word == "none" => return Ok(Vec::new()),
            PairsOf::Word(word) => {
                let help = "give \"all\", \"none\", or a list like [[1, 4], [2, 6]]";
                return Err(self.error(of.span(), format!("pairs of = \"{word}\" is not known"), help));
            }
            PairsOf::List(list) => list,
        };
        let place = |index: u32| {
            paddles.iter().position(|p| p.index == index).ok_or_else(|| {
                let known: Vec<String> = paddles.iter().map(|p| p.index.to_string()).collect();
                let message = format!("[pairs]: the scene has no paddle {index}");
                self.error(of.span(), message, format!("choose from {}", known.join(", ")))
            })
        };
        let mut pairs: Vec<[usize; 2]> = Vec::new();
        for &Exactly([first, second]) in list {
            let (a, b) = (place(first)?, place(second)?);
            let pair = [a.min(b), a.max(b)];
            if a == b || pairs.contains(&pair) {
                let message = format!("[pairs]: {first} and {second} are one paddle, or named twice");
                return Err(self.error(of.span(), message, "name two different paddles, and every pair once"));
            }
            pairs.push(pair);
        }
        Ok(pairs)
    }

    fn inclusion(
        &self,
        located: &Located<InclusionSection>,
        region: Arc<dyn Implicit>,
        body: &dyn Implicit,
    ) -> Checked<SpaceInclusion> {
        let section = located.get();
        if section.stiffness.is_nan() || section.stiffness <= 0.0 || section.stiffness.is_infinite() {
            let message = format!("stiffness is {}", section.stiffness);
            return Err(self.error(located.span(), message, "stiffness must be a positive finite number"));
        }
        let across = |what: &dyn Implicit| what.bounds().map_or(f64::INFINITY, |(low, high)| (high - low).norm());
        let (size, whole) = (across(region.as_ref()), across(body));
        if size < TINY * whole {
            return Err(self.error(
                located.span(),
                format!("this inclusion is {} across, in a body of {}", short(size), short(whole)),
                "check its numbers and their unit, or remove it: nothing so small shows in what is computed",
            ));
        }
        if !share(region.as_ref(), body, &|_| true) {
            return Err(self.error(
                located.span(),
                "this inclusion covers nothing of the body, or too thin a part of it",
                "move it inside of the body, make it thicker, or remove it",
            ));
        }
        Ok(SpaceInclusion {
            region,
            stiffness: section.stiffness,
            material: section.material.as_ref().map(|m| self.material(m)).transpose()?,
        })
    }

    fn material(&self, located: &Located<MaterialSection>) -> Checked<Law> {
        let law = located.get().law(&self.file.scene.units.stress);
        let law = law.map_err(|error| self.error(located.span(), format!("material: {error}"), error.help()))?;
        if !law.holds_in_space() {
            return Err(self.error(
                located.span(),
                "material: general tensors A and C are given in the plane alone",
                "give lambda and mu (and c, lambda_c, mu_c): the paper's tensors are isotropic, 383 and 318.5",
            ));
        }
        if law.relaxation().is_some() {
            return Err(self.error(
                located.span(),
                "material: tissue that relaxes is computed in the plane alone",
                "write relaxation = { g = [], tau = [] } into this material: the elastic part of the preset is left, with its moduli of a fast deformation",
            ));
        }
        Ok(law)
    }

    fn actuator(&self, needle: &SpaceNeedle) -> Checked<Actuator> {
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

    fn discretization(&self, located: &Located<DiscretizationSection>, extent: Point<3>) -> Checked<Discretization> {
        let section = located.get();
        let (resolution, span) = match (&section.spacing, &section.tolerance, &section.level) {
            (Some(spacing), None, None) => (Resolution::Spacing(*spacing.get()), spacing.span()),
            (None, Some(tolerance), None) => (Resolution::Tolerance(*tolerance.get()), tolerance.span()),
            (None, None, Some(level)) => (Resolution::Level(*level.get()), level.span()),
            _ => {
                return Err(self.error(
                    located.span(),
                    "one of spacing, tolerance and level is needed, and only one",
                    "e.g. tolerance = 0.05",
                ));
            }
        };
        let integration = section.integration.as_ref().map_or_else(Integration::default, |i| *i.get());
        let support = section.support.as_ref().map_or_else(|| integration.default_support_in_space(), |s| *s.get());
        let method = Method { support, basis: section.basis.unwrap_or_default(), ..Method::new(integration) };
        let discretization = Discretization::new(resolution, method);
        limits::check_in_space(&discretization, extent).map_err(|error| {
            let span = match error {
                LimitError::Planar(_) => section.integration.as_ref().map_or(span, Located::span),
                LimitError::Support(_) => section.support.as_ref().map_or(span, Located::span),
                _ => span,
            };
            self.error(span, error.to_string(), error.help())
        })?;
        Ok(discretization)
    }
}

fn all_pairs(paddles: usize) -> Vec<[usize; 2]> {
    (0..paddles).flat_map(|a| (a + 1..paddles).map(move |b| [a, b])).collect()
}
