//! How long a user unit of a drawing is.

use super::super::{ImportError, ImportOptions, Summary};
use super::element::Viewport;
use crate::number::short;
use crate::scene::millimetres;
use roxmltree::Node;

/// Sides that differ by less than this part are one scale: drawings are rounded.
const SAME: f64 = 1e-3;

/// Millimetres of a length with a unit; none where it has none that is a length by itself.
fn real(text: &str) -> Option<f64> {
    let text = text.trim();
    let unit = text.trim_start_matches(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    // The number may have a power of ten, which begins like the units em and ex.
    let (number, unit) = match unit.to_ascii_lowercase().strip_prefix('e') {
        Some(power) if power.starts_with(|c: char| c.is_ascii_digit() || "+-".contains(c)) => {
            let unit = power.trim_start_matches(|c: char| c.is_ascii_digit() || "+-".contains(c)).len();
            text.split_at(text.len() - unit)
        }
        _ => text.split_at(text.len() - unit.len()),
    };
    let mm = match unit.trim().to_ascii_lowercase().as_str() {
        "mm" => 1.0,
        "cm" => 10.0,
        "q" => 0.25,
        "in" => 25.4,
        "pt" => 25.4 / 72.0,
        "pc" => 25.4 / 6.0,
        "px" => 25.4 / 96.0,
        _ => return None,
    };
    number.trim().parse::<f64>().ok().map(|number| number * mm).filter(|length| length.is_normal() && *length > 0.0)
}

/// The viewBox: its width and height.
fn view_box(root: Node<'_, '_>) -> Result<Option<[f64; 2]>, ImportError> {
    let Some(text) = root.attribute("viewBox") else {
        return Ok(None);
    };
    let numbers: Vec<f64> = text
        .split([' ', ',', '\t', '\n', '\r'])
        .filter(|word| !word.is_empty())
        .filter_map(|w| w.parse().ok())
        .collect();
    match numbers[..] {
        [_, _, width, height] if width.is_normal() && height.is_normal() && width > 0.0 && height > 0.0 => {
            Ok(Some([width, height]))
        }
        _ => {
            let what = format!("viewBox={text:?} are not four numbers with a width and a height above 0");
            Err(ImportError::Syntax { line: 1, what })
        }
    }
}

/// What the root says of lengths: what percentages are parts of, and the scene's length per user unit where the
/// drawing is to scale.
pub(super) fn of_root(
    root: Node<'_, '_>,
    options: &ImportOptions<'_>,
    summary: &mut Summary,
) -> Result<(Viewport, Option<f64>), ImportError> {
    let view = view_box(root)?;
    let [width, height] = ["width", "height"].map(|side| root.attribute(side).and_then(real));
    let viewport = Viewport { size: view };
    let told = |length: &str| root.attribute(length).unwrap_or("").trim().to_owned();
    let mm = match (view, width, height) {
        (_, None, None) => {
            if options.size.is_none() {
                let given = ["width", "height"].map(told).into_iter().filter(|side| !side.is_empty());
                let given = given.collect::<Vec<_>>().join(" × ");
                let has = if given.is_empty() { String::new() } else { format!(" ({given})") };
                summary.note(format!(
                    "scale: the drawing has no width or height in mm, cm, in, pt, pc, Q or px{has}, its numbers are taken as they are"
                ));
            }
            return Ok((viewport, None));
        }
        // Without a viewBox a user unit is a CSS pixel.
        (None, ..) => 25.4 / 96.0,
        (Some([w, _]), Some(width), None) => width / w,
        (Some([_, h]), None, Some(height)) => height / h,
        (Some([w, h]), Some(width), Some(height)) => {
            let [x, y] = [width / w, height / h];
            if (x / y - 1.0).abs() <= SAME { x } else { uneven(root, [x, y], summary)? }
        }
    };
    if options.size.is_some() {
        summary.note("scale: that of --size, not that of the drawing");
        return Ok((viewport, None));
    }
    let Some(unit_mm) = millimetres(options.length) else {
        summary.note(format!(
            "scale: the drawing is in real lengths, and the unit of length {:?} is none that is known (um, mm, cm, m, in): its \
             numbers are taken as they are",
            options.length
        ));
        return Ok((viewport, None));
    };
    let per_unit = mm / unit_mm;
    let page = [told("width"), told("height")].join(" × ");
    summary.note(format!("scale: {} {} per unit of the drawing ({page})", short(per_unit), options.length));
    Ok((viewport, Some(per_unit)))
}

/// One scale of two, as the drawing says it fits its page.
fn uneven(root: Node<'_, '_>, [x, y]: [f64; 2], summary: &mut Summary) -> Result<f64, ImportError> {
    let fit = root.attribute("preserveAspectRatio").unwrap_or("").trim();
    if fit.starts_with("none") {
        let what = "the drawing is stretched to its page (preserveAspectRatio=\"none\"), so lengths differ across and along: give \
                    width and height in the ratio of the viewBox, or --size";
        return Err(ImportError::Unsupported(what.to_owned()));
    }
    let (kind, scale) = if fit.ends_with("slice") { ("larger", x.max(y)) } else { ("smaller", x.min(y)) };
    summary.note(format!("scale: width and height do not fit the viewBox; the {kind} scale holds both ways"));
    Ok(scale)
}
