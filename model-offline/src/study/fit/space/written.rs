//! A fit of dimension and paddles on one screen, and as a scene file.

use super::verdict::fails_alone;
use super::{FittedModel, PaddleSet, SliceInBody, SpaceAlternative, SpaceFit};
use crate::discretization::Discretization;
use crate::number::{in_unit, short};
use crate::scene::TissueVariant;
use crate::scene::space::SpaceScene;
use std::fmt::Write as _;

/// What stands where there is no number.
const NONE: &str = "–";

impl SpaceFit {
    /// The scene file of what is needed: the slice's, or the text of the scene in space with the body's discretization
    /// in it, and without pairs where one paddle will do.
    ///
    /// # Errors
    /// What the text does not parse as; a scene that was read before always does.
    pub fn written(&self, scene: &SpaceScene, text: &str) -> Result<String, toml_edit::TomlError> {
        if let (2, Some(slice)) = (self.verdict.dimension, &self.slice_text) {
            return Ok(slice.clone());
        }
        let mut document: toml_edit::DocumentMut = text.parse()?;
        if scene.tissue() == TissueVariant::Homogeneous {
            document.remove("inclusion");
        }
        if let Some(level) = self.body.level {
            let section = &mut document["discretization"];
            if let Some(table) = section.as_table_like_mut() {
                for key in ["spacing", "tolerance", "support", "basis"] {
                    table.remove(key);
                }
            }
            section["level"] = toml_edit::value(i64::from(level));
            section["integration"] = toml_edit::value(self.body.integration.name());
            let Discretization { method, .. } = scene.discretization;
            if self.body.error_estimate.is_none() && !method.integration.is_element() {
                section["support"] = toml_edit::value(method.support);
            }
        }
        if self.verdict.paddles.len() == 1 {
            document["pairs"] = toml_edit::table();
            document["pairs"]["of"] = toml_edit::value("none");
        }
        Ok(document.to_string())
    }

    /// The answer on one screen.
    pub fn summary(&self) -> String {
        let verdict = &self.verdict;
        let paddles = named(&verdict.paddles);
        let is_short = |alternative| verdict.rejected.iter().any(|rejected| rejected.alternative == alternative);
        let short_of = if verdict.paddles.len() == 2 || !fails_alone(self) {
            ""
        } else if is_short(SpaceAlternative::TwoPaddles) {
            "; it is not enough, and a second does not help"
        } else {
            "; it is not enough, and the scene has no pair"
        };
        let what = match (verdict.dimension, verdict.paddles.len()) {
            (2, _) => format!("the slice in plane strain, paddle {paddles}"),
            (_, 1) => format!("the body in three dimensions, one paddle ({paddles})"),
            _ => format!("the body in three dimensions, two paddles ({paddles})"),
        };
        let mut out = format!(
            "{} · {} tissue · tolerance {}\n\nneeded: {what}{short_of}\n\n",
            self.scene, self.tissue, self.tolerance
        );
        let _ = writeln!(out, "body   {}", model(&self.body));
        if let Some(slice) = &self.slice {
            let _ = writeln!(out, "slice  {}; {}", model(&slice.model), slice.plane);
            let ratio = short(self.body.cost_s / slice.model.cost_s);
            let _ = writeln!(out, "the body costs {ratio} times what the slice does, by operations");
        }
        out.push_str(&self.paddle_rows());
        if let Some(slice) = &self.slice {
            out.push_str(&self.of_slice(slice));
        }
        out.push_str(&self.counted());
        out.push_str("\nrejected:\n");
        for r in &verdict.rejected {
            let _ = writeln!(out, "  {:<14} {:>10}  {}", r.alternative.to_string(), r.reason.number_text(), r.reason);
        }
        let _ = writeln!(out, "(fitted in {:.1} s)", self.fit_wall_s);
        out
    }

    /// A row per paddle.
    fn paddle_rows(&self) -> String {
        let mut out = String::from(
            "\n paddle   worst direction   in the slice's direction           λ     across the plane\n          body              body     slice     ratio\n",
        );
        let unit = |value: Option<f64>| match value {
            Some(value) if value.is_finite() => format!("{value:.4}"),
            _ => NONE.to_owned(),
        };
        for paddle in &self.paddles {
            let _ = writeln!(
                out,
                "{:>7}   {:<15} {:>8}  {:>8}  {:>8}  {:>8}  {:>8}",
                paddle.index,
                unit(Some(paddle.body)),
                unit(paddle.body_in_plane),
                unit(paddle.slice),
                unit(paddle.ratio),
                unit(paddle.feedback.map(|feedback| feedback.gain)),
                unit(paddle.feedback.map(|feedback| feedback.across)),
            );
        }
        out
    }

    fn of_slice(&self, slice: &SliceInBody) -> String {
        let length = |value: f64| in_unit(value, &self.length_unit);
        let index = |paddle: Option<u32>| paddle.map_or(NONE.to_owned(), |paddle| paddle.to_string());
        let mut out = format!(
            "\nbest single paddle to control: {} in the body, {} in the slice; best fixture: {} in the body, {} in the slice\n",
            index(self.optimum.dynamic),
            index(slice.optimum.dynamic),
            index(self.optimum.fixture),
            index(slice.optimum.fixture)
        );
        let way = slice.without_help;
        let _ = writeln!(
            out,
            "the target without help at depth {}: body {} in the plane, {} across it, {} along the needle; slice {} and {}",
            length(way.depth),
            length(way.body_in_plane),
            length(way.body_across_plane),
            length(way.body_axial),
            length(way.slice_in_plane),
            length(way.slice_axial)
        );
        if let Some(followed) = &slice.closed_loop {
            let corrected = match followed.converges {
                true => {
                    format!("{} with corrections of what is seen in the plane", length(followed.with_feedback.whole()))
                }
                false => "corrections of what is seen in the plane do not converge".to_owned(),
            };
            let _ = writeln!(
                out,
                "paddle {} into the body by the slice's table, to depth {}: {} are left without corrections, {corrected}; {} without a \
                 paddle",
                followed.paddle,
                length(followed.depth),
                length(followed.table_alone.whole()),
                length(followed.without_help),
            );
        }
        out
    }

    /// One paddle beside two.
    fn counted(&self) -> String {
        let mut out = format!(
            "\n {:<9} {:>8} {:>12} {:>10} {:>10} {:>10} {:>10}  {}\n",
            "paddles", "way", "stroke", "of limit", "of rate", "worst", "noise", "|1 − λ| without inclusions"
        );
        for set in [Some(&self.one), self.two.as_ref()].into_iter().flatten() {
            out.push_str(&self.set_row(set));
        }
        out
    }

    fn set_row(&self, set: &PaddleSet) -> String {
        let share = |value: f64| format!("{:.2} %", 100.0 * value);
        format!(
            " {:<9} {:>8.4} {:>12} {:>10} {:>10} {:>10} {:>10.4}  {}\n",
            named(&set.paddles),
            set.measure,
            in_unit(set.stroke, &self.length_unit),
            share(set.stroke_over_limit),
            share(set.rate_over_limit),
            share(set.worst_over_limit),
            set.noise_gain,
            set.without_knowing.map_or(NONE.to_owned(), |gain| format!("{gain:.3}"))
        )
    }
}

fn named(paddles: &[u32]) -> String {
    paddles.iter().map(ToString::to_string).collect::<Vec<_>>().join(" + ")
}

fn model(model: &FittedModel) -> String {
    let level = model.level.map_or(String::new(), |level| format!(", level {level}"));
    let error = model.error_estimate.map_or_else(
        || ", error unknown and not counted (no tolerance in the scene)".to_owned(),
        |error| format!(", estimated error {:.2} %", 100.0 * error),
    );
    format!(
        "{}{level}, {} nodes{error}; cost {} s by operations ({:.1} s, insertions included)",
        model.integration,
        model.nodes,
        short(model.cost_s),
        model.wall_s
    )
}
