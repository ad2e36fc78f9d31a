//! The few numbers that make a block of tissue somebody's own, asked for on a terminal.

use model_offline::geometry::{Point2, Polygon};
use model_offline::material::Preset;
use model_offline::scene::import::{Imported, ImportedInclusion, ImportedNeedle};
use model_offline::scene::starter::{StarterNames, depth_for};
use std::f64::consts::TAU;
use std::io::{self, BufRead, Write};
use strum::VariantArray as _;

/// Corners of a round inclusion.
const CORNERS: u32 = 16;

/// Why there is no scene.
#[derive(Debug, thiserror::Error)]
pub(super) enum Unanswered {
    /// The input ended.
    #[error("the answers ended at \"{0}\"")]
    Ended(String),
    /// The terminal is gone.
    #[error(transparent)]
    Terminal(#[from] io::Error),
}

/// Asks for the size of a block, what it is made of, what is to be held still in it, and the needle's depth. An empty answer
/// takes what is suggested; one that cannot be is told why, and asked for again.
///
/// # Errors
/// [`Unanswered`].
pub(super) fn ask(input: impl BufRead, screen: impl Write, names: &StarterNames) -> Result<Imported, Unanswered> {
    let mut asked = Questions { input, screen };
    let unit = &names.length;
    writeln!(
        asked.screen,
        "A block of tissue, held at its lower side; the needle enters in the middle of the upper one.\n\
         Lengths in {unit}, from the lower left corner. Enter takes what stands in brackets."
    )?;
    let above_zero = |value: f64| (value <= 0.0).then(|| "it must be above 0".to_owned());
    let width = asked.number("width of the block", names.block(), above_zero)?;
    let height = asked.number("height of the block", rounded(0.6 * width), above_zero)?;
    let outline = rectangle(width, height);
    let material = asked.material(&names.stress)?;
    let within = |most: f64| {
        move |value: f64| {
            (!(value > 0.0 && value < most)).then(|| format!("it must be between 0 and {most}, within the block"))
        }
    };
    let target = Point2::new(
        asked.number("x of the target, off the needle's line", rounded(0.65 * width), within(width))?,
        asked.number("y of the target", rounded(0.58 * height), within(height))?,
    );
    let room = outline.distance_to_boundary(target);
    let fits = |radius: f64| {
        (!(radius >= 0.0 && radius < room))
            .then(|| format!("it must be from 0 (none) to below {room}, the way to the boundary"))
    };
    let radius = asked.number("radius of a stiffer inclusion around it, 0 for none", rounded(0.5 * room), fits)?;
    let depth = asked.number(
        "depth of the needle",
        rounded(depth_for(width.hypot(height), width.min(height))),
        within(0.5 * height),
    )?;
    let inclusions = if radius > 0.0 { vec![circle(target, radius)] } else { Vec::new() };
    let inclusions = inclusions.into_iter().map(|outline| ImportedInclusion { outline, material: None }).collect();
    Ok(Imported {
        inclusions,
        material,
        needle: Some(ImportedNeedle::into_block(width, height)),
        target: Some(target),
        depth: Some(depth),
        ..Imported::of(outline, Vec::new())
    })
}

struct Questions<R, W> {
    input: R,
    screen: W,
}

impl<R: BufRead, W: Write> Questions<R, W> {
    /// An answer without blanks around it; empty for what is suggested.
    fn answer(&mut self, question: &str, suggested: &str) -> Result<String, Unanswered> {
        write!(self.screen, "{question} [{suggested}]: ")?;
        self.screen.flush()?;
        let mut line = String::new();
        match self.input.read_line(&mut line)? {
            0 => Err(Unanswered::Ended(question.to_owned())),
            _ => Ok(line.trim().to_owned()),
        }
    }

    /// A number; `refused` says what is wrong with one.
    fn number(
        &mut self,
        question: &str,
        suggested: f64,
        refused: impl Fn(f64) -> Option<String>,
    ) -> Result<f64, Unanswered> {
        loop {
            let answer = self.answer(question, &suggested.to_string())?;
            let said = if answer.is_empty() { Ok(suggested) } else { answer.parse() };
            let why = match said {
                Ok(value) if value.is_finite() => match refused(value) {
                    None => return Ok(value),
                    Some(why) => why,
                },
                _ => "a number is needed, like 12.5".to_owned(),
            };
            writeln!(self.screen, "  {answer}: {why}")?;
        }
    }

    /// A material by name, where its numbers can be had in the scene's unit of stress.
    fn material(&mut self, stress: &str) -> Result<Option<Preset>, Unanswered> {
        let known: Vec<Preset> =
            Preset::VARIANTS.iter().copied().filter(|preset| preset.section(None, stress).is_ok()).collect();
        if known.is_empty() {
            return Ok(None);
        }
        let names: Vec<String> = known.iter().map(Preset::to_string).collect();
        writeln!(self.screen, "Materials of the literature: {}.", names.join(", "))?;
        loop {
            let answer = self.answer("material of the block", "soft tissue")?;
            if answer.is_empty() || answer == "soft tissue" {
                return Ok(None);
            }
            match known.iter().find(|preset| preset.to_string() == answer) {
                Some(preset) => return Ok(Some(*preset)),
                None => writeln!(self.screen, "  {answer}: none of them; Enter takes a neo-Hookean law")?,
            }
        }
    }
}

/// Two significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

/// With its lower left corner at the origin.
fn rectangle(width: f64, height: f64) -> Polygon {
    let corners = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]].map(Point2::from);
    Polygon::new(corners.to_vec()).expect("sides above zero")
}

fn circle(centre: Point2, radius: f64) -> Polygon {
    let corner = |k: u32| {
        let angle = TAU * f64::from(k) / f64::from(CORNERS);
        centre + Point2::new(angle.cos(), angle.sin()) * radius
    };
    Polygon::new((0..CORNERS).map(corner).collect()).expect("a radius above zero")
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_offline::material::{Material, Matrix};
    use model_offline::scene::Scene;
    use model_offline::scene::starter::starter;

    fn scene(answers: &str, length: &str, stress: &str) -> (Scene, String) {
        let names = StarterNames { name: "mine".into(), length: length.into(), stress: stress.into() };
        let mut screen = Vec::new();
        let imported = ask(answers.as_bytes(), &mut screen, &names).unwrap();
        let text = starter(&names, Some(&imported));
        let scene = Scene::parse(&text, "mine").unwrap_or_else(|error| panic!("{error}\n{text}"));
        (scene, String::from_utf8(screen).unwrap())
    }

    #[test]
    fn what_is_suggested_is_a_scene_without_warnings() {
        for (unit, stress) in [("mm", "kPa"), ("1", "1")] {
            let (scene, _) = scene(&"\n".repeat(12), unit, stress);
            assert!(scene.warnings().is_empty(), "{:?}", scene.told_warnings());
            assert_eq!((scene.inclusions.len(), scene.needle.depth), (1, 4.1));
        }
    }

    #[test]
    fn what_is_answered_is_in_the_scene_and_what_cannot_be_is_asked_again() {
        let answers = "-3\nwide\n2\n1\nbutter\nliver\n1.5\n3\n0.4\n0.9\n0.2\ninf\n0.11\n";
        let (scene, screen) = scene(answers, "in", "psi");
        let (low, high) = scene.outline.bounds();
        assert_eq!((low.x, low.y, high.x, high.y), (0.0, 0.0, 2.0, 1.0));
        assert_eq!((scene.target.x, scene.target.y, scene.needle.depth), (1.5, 0.4, 0.11));
        let inclusion = scene.inclusions[0].outline.bounds();
        assert!((inclusion.1.x - 1.7).abs() < 1e-12);
        // 2 kPa of shear in psi.
        let shear = Material::<2>::tangent(&scene.material, &Matrix::zeros())[0][1][0][1];
        assert!((shear - 2.0 / 6.894757).abs() < 1e-6, "{shear}");
        for told in [
            "-3: it must be above 0",
            "wide: a number",
            "butter: none of them",
            "3: it must be between 0 and 1",
            "0.9: it must be from 0",
            "inf: a number",
        ] {
            assert!(screen.contains(told), "{told} is not in\n{screen}");
        }
    }

    #[test]
    fn nothing_and_no_inclusion_and_an_end() {
        let (scene, _) = scene("\n\n\n\n\n0\n\n", "mm", "kPa");
        assert!(scene.inclusions.is_empty());
        let names = StarterNames { name: "mine".into(), length: "mm".into(), stress: "kPa".into() };
        let ended = ask("50\n".as_bytes(), io::sink(), &names).unwrap_err();
        assert_eq!(ended.to_string(), "the answers ended at \"height of the block\"");
    }
}
