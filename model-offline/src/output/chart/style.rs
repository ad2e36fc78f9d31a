//! Colours and style sheets. Charts carry classes; what colour a class has is said here, for light and dark grounds.

use std::fmt::Write as _;

const CHART: &str = include_str!("chart.css");

/// Name, colour on a light and on a dark ground. The named colours are those of Okabe & Ito (*Color universal design*,
/// 2008), told apart by people with any kind of colour vision: lighter on a dark ground where they are dark, and yellow
/// darker on a light one.
const COLOURS: [(&str, &str, &str); 18] = [
    ("ground", "#ffffff", "#14171c"),
    ("ink", "#1a1d23", "#e8eaee"),
    ("quiet", "#5b6270", "#a3abb8"),
    ("faint", "#a9afba", "#626b79"),
    ("grid", "#dfe2e8", "#333944"),
    ("body", "#f3f4f7", "#20252d"),
    ("strip", "#fbecd0", "#4a3a1c"),
    ("shade-0", "#b4bac6", "#1d222a"),
    ("shade-1", "#c8cdd7", "#272d37"),
    ("shade-2", "#dce0e7", "#333a46"),
    ("shade-3", "#eff1f5", "#414957"),
    ("orange", "#e69f00", "#e69f00"),
    ("sky", "#56b4e9", "#56b4e9"),
    ("green", "#009e73", "#2cc79b"),
    ("blue", "#0072b2", "#4aa8e0"),
    ("vermillion", "#d55e00", "#f08238"),
    ("purple", "#cc79a7", "#dd94bd"),
    ("yellow", "#b3a400", "#f0e442"),
];

/// Colour of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// Black on light, white on dark.
    Ink,
    /// Grey: what is there for comparison.
    Quiet,
    /// Light grey: what something else dominates.
    Faint,
    /// Orange.
    Orange,
    /// Sky blue.
    Sky,
    /// Bluish green.
    Green,
    /// Blue.
    Blue,
    /// Vermillion.
    Vermillion,
    /// Reddish purple.
    Purple,
    /// Yellow.
    Yellow,
}

impl Colour {
    /// One after the other for what has no colour of its own, such as paddles.
    pub const CYCLE: [Self; 6] = [Self::Blue, Self::Vermillion, Self::Green, Self::Purple, Self::Orange, Self::Sky];

    const ALL: [Self; 10] = [
        Self::Ink,
        Self::Quiet,
        Self::Faint,
        Self::Orange,
        Self::Sky,
        Self::Green,
        Self::Blue,
        Self::Vermillion,
        Self::Purple,
        Self::Yellow,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Ink => "ink",
            Self::Quiet => "quiet",
            Self::Faint => "faint",
            Self::Orange => "orange",
            Self::Sky => "sky",
            Self::Green => "green",
            Self::Blue => "blue",
            Self::Vermillion => "vermillion",
            Self::Purple => "purple",
            Self::Yellow => "yellow",
        }
    }

    /// Class of shapes in this colour.
    pub(super) fn class(self) -> String {
        format!("c-{}", self.name())
    }
}

/// Number of colours of a field, from low to high: viridis.
pub const BANDS: usize = 10;

/// Class of a field's value, 0 to 1; what is outside or no number has the nearest end's.
pub fn band(fraction: f64) -> String {
    format!("f{}", ((fraction * BANDS as f64) as usize).min(BANDS - 1))
}

/// Number of shades of a body without colours, from dark to light.
const SHADES: usize = 4;

/// Class of a surface on which so much light falls, 0 to 1.
pub fn shade(light: f64) -> String {
    format!("s{}", ((light * SHADES as f64) as usize).min(SHADES - 1))
}

/// Colour of a field's value, as [`band`] has it: red, green and blue from 0 to 1.
pub fn band_colour(fraction: f64) -> [f64; 3] {
    let rule = format!(".{}{{fill:#", band(fraction));
    let digits = CHART.split(&rule).nth(1).unwrap_or_default();
    [0, 2, 4]
        .map(|at| digits.get(at..at + 2).and_then(|part| u8::from_str_radix(part, 16).ok()))
        .map(|part| f64::from(part.unwrap_or(0)) / 255.0)
}

fn variables(colour: impl Fn(&(&str, &str, &str)) -> String) -> String {
    COLOURS.iter().fold(String::new(), |mut text, entry| {
        let _ = write!(text, "--{}:{};", entry.0, colour(entry));
        text
    })
}

fn rules() -> String {
    Colour::ALL.iter().fold(String::new(), |mut text, colour| {
        let (class, name) = (colour.class(), colour.name());
        let _ = write!(
            text,
            ".chart .line.{class},.chart .mark.{class}{{stroke:var(--{name})}}.chart .mark.{class},.chart \
             .area.{class}{{fill:var(--{name})}}"
        );
        text
    })
}

/// Style sheet of a page with charts: follows the reader's choice of light or dark, and is light on paper.
pub fn page() -> String {
    let light = variables(|entry| entry.1.to_owned());
    let dark = variables(|entry| entry.2.to_owned());
    format!(
        ":root{{color-scheme:light dark;{light}}}\n\
         @media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n{}{CHART}",
        rules()
    )
}

/// Style sheet of a picture of its own: colours as they are, for readers of SVG that know no variables.
pub(super) fn standalone() -> String {
    let rules = format!("{}{CHART}", rules());
    COLOURS.iter().fold(rules, |text, (name, light, _)| text.replace(&format!("var(--{name})"), light))
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

    #[test]
    fn every_band_has_a_colour() {
        for fraction in [-1.0, 0.0, 0.5, 1.0, f64::NAN, f64::INFINITY] {
            assert!(CHART.contains(&format!(".{}{{fill:", band(fraction))), "{fraction}");
        }
    }
}
