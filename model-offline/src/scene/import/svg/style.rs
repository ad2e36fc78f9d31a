//! What an element's style and attributes say: whether it is seen, and how it is transformed.

use kurbo::Affine;
use roxmltree::Node;
use std::str::FromStr as _;

/// A property, from the style or an attribute of its name.
pub(super) fn property<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    styled(node, name).or(node.attribute(name).map(str::trim))
}

/// The same from the style alone.
fn styled<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let rules = node.attribute("style").unwrap_or("").split(';');
    // The last one counts.
    rules.rev().find_map(|rule| {
        let (key, value) = rule.split_once(':')?;
        (key.trim().eq_ignore_ascii_case(name)).then(|| value.trim().trim_end_matches("!important").trim())
    })
}

/// Why an element and all that is within it cannot be seen.
pub(super) fn unseen(node: Node<'_, '_>) -> Option<&'static str> {
    if property(node, "display") == Some("none") {
        return Some("it is hidden (display: none)");
    }
    let opacity = property(node, "opacity")?.trim_end_matches('%').trim().parse::<f64>().ok()?;
    (opacity <= 0.0).then_some("it cannot be seen (opacity: 0)")
}

/// How an element is transformed, where it is.
pub(super) struct Moved {
    /// Whether by its attribute alone, and not by its style.
    pub(super) is_read: bool,
    /// Whether it is the same about the point that it names as about the origin.
    pub(super) is_about_origin: bool,
}

/// Whether and how an element is transformed.
pub(super) fn moved(node: Node<'_, '_>) -> Option<Moved> {
    let by_style = ["transform", "translate", "rotate", "scale"].map(|name| styled(node, name));
    let is_read = by_style.into_iter().flatten().all(is_none);
    let transform = node.attribute("transform").filter(|text| !is_none(text));
    (transform.is_some() || !is_read).then(|| {
        // Shifts are the same about every point.
        let is_shift = transform.and_then(|text| affine(text).ok()).is_none_or(|transform| {
            let [a, b, c, d, ..] = transform.as_coeffs();
            [a, b, c, d] == [1.0, 0.0, 0.0, 1.0]
        });
        let is_zero = |length: &str| length.trim_end_matches(|c: char| c.is_ascii_alphabetic() || c == '%') == "0";
        let origin = property(node, "transform-origin").unwrap_or("");
        Moved { is_read, is_about_origin: is_shift || origin.split_whitespace().all(is_zero) }
    })
}

/// Whether a transform says that there is none.
pub(super) fn is_none(transform: &str) -> bool {
    matches!(transform.trim(), "" | "none")
}

/// The transform of an attribute.
pub(super) fn affine(transform: &str) -> Result<Affine, svgtypes::Error> {
    svgtypes::Transform::from_str(transform).map(|t| Affine::new([t.a, t.b, t.c, t.d, t.e, t.f]))
}
