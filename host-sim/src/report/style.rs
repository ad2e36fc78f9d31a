//! Colours and style sheets.

use std::fmt::Write as _;

const PAGE: &str = include_str!("page.css");
const CHART: &str = include_str!("chart.css");

/// Names, colours on a light and on a dark ground. Nothing is told by colour alone: lines differ by their dashes,
/// points by their shape.
const COLOURS: [(&str, &str, &str); 12] = [
    ("ground", "#ffffff", "#14171c"),
    ("ink", "#1a1d23", "#e8eaee"),
    ("quiet", "#5b6270", "#a3abb8"),
    ("grid", "#dfe2e8", "#333944"),
    ("body", "#f3f4f7", "#20252d"),
    ("strip", "#f7e3cf", "#4a3521"),
    ("none", "#6b7280", "#b4bac5"),
    ("static", "#b4500b", "#f2a15c"),
    ("dynamic", "#1d5fbf", "#7db4ff"),
    ("free", "#0f7a5c", "#5fd3ae"),
    ("needle", "#44484f", "#c9ced7"),
    ("target", "#c0152f", "#ff7d8f"),
];

fn variables(colour: impl Fn(&(&str, &str, &str)) -> String) -> String {
    COLOURS.iter().fold(String::new(), |mut text, entry| {
        let _ = write!(text, "--{}:{};", entry.0, colour(entry));
        text
    })
}

/// Of the page.
pub(super) fn page() -> String {
    let light = variables(|entry| entry.1.to_owned());
    let dark = variables(|entry| entry.2.to_owned());
    format!(
        ":root{{color-scheme:light dark;{light}}}\n\
         @media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n{PAGE}{CHART}"
    )
}

/// Of a picture of its own: colours as they are, for readers of SVG that know no variables.
pub(super) fn standalone() -> String {
    COLOURS.iter().fold(CHART.to_owned(), |text, (name, light, _)| text.replace(&format!("var(--{name})"), light))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variable_has_a_colour() {
        assert!(!standalone().contains("var("));
        for used in page().split("var(--").skip(1) {
            let name = used.split(')').next().unwrap();
            assert!(COLOURS.iter().any(|entry| entry.0 == name), "{name}");
        }
    }
}
