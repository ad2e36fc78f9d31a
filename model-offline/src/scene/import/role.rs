//! What a name in a drawing or a mesh says: the role of a shape, and the material that it is made of.

use crate::material::Preset;
use crate::scene::error::nearest;
use std::fmt;
use strum::VariantArray as _;

/// What a shape is in the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The body's outline.
    Body,
    /// A region of another stiffness.
    Inclusion,
    /// The needle, from outside to its tip, or its contact on the boundary.
    Needle,
    /// The point to hold still.
    Target,
    /// A place of the paddle, with its number where the name has one.
    Paddle(Option<u32>),
    /// What holds the body.
    Fixed,
}

/// All of them, as they are told to people.
pub(super) const ROLES: &str = "body, inclusion-…, needle, target, paddle-1, fixed";

impl fmt::Display for Role {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Body => formatter.write_str("body"),
            Self::Inclusion => formatter.write_str("inclusion"),
            Self::Needle => formatter.write_str("needle"),
            Self::Target => formatter.write_str("target"),
            Self::Paddle(None) => formatter.write_str("paddle"),
            Self::Paddle(Some(index)) => write!(formatter, "paddle {index}"),
            Self::Fixed => formatter.write_str("fixed"),
        }
    }
}

/// What a name says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Meaning {
    pub(super) role: Option<Role>,
    pub(super) preset: Option<Preset>,
    /// What else it may have been meant to say: a role or a material whose name is nearly that.
    pub(super) meant: Option<&'static str>,
}

/// First words that say a role.
const WORDS: [(&str, Role); 21] = [
    ("body", Role::Body),
    ("outline", Role::Body),
    ("domain", Role::Body),
    ("inclusion", Role::Inclusion),
    ("inclusions", Role::Inclusion),
    ("tumour", Role::Inclusion),
    ("tumours", Role::Inclusion),
    ("tumor", Role::Inclusion),
    ("tumors", Role::Inclusion),
    ("lesion", Role::Inclusion),
    ("lesions", Role::Inclusion),
    ("needle", Role::Needle),
    ("needles", Role::Needle),
    ("target", Role::Target),
    ("targets", Role::Target),
    ("paddle", Role::Paddle(None)),
    ("paddles", Role::Paddle(None)),
    ("fixed", Role::Fixed),
    ("immobile", Role::Fixed),
    ("bone", Role::Fixed),
    ("bones", Role::Fixed),
];

/// What a name says: its first word is a role (`inclusion-hard`, `Paddle 1`, `fixed_left`), the rest or all of it may
/// be the name of a material (`body-breast-fat`, `liver`). Capitals do not matter; words are parted by `-`, `_` and
/// spaces.
pub(super) fn meaning(name: &str) -> Meaning {
    let lower = name.to_lowercase();
    let words: Vec<&str> = lower.split(['-', '_', ' ', '.', ':']).filter(|word| !word.is_empty()).collect();
    let preset = |words: &[&str]| words.join("-").parse::<Preset>().ok();
    let Some((first, rest)) = words.split_first() else {
        return Meaning::default();
    };
    let material = |words: &[&str]| nearest(&words.join("-"), Preset::VARIANTS.iter().map(|preset| preset.name()));
    match word(first) {
        None => {
            let preset = preset(&words);
            let roles = WORDS.iter().map(|(word, _)| *word);
            let role = || nearest(first.trim_end_matches(|c: char| c.is_ascii_digit()), roles);
            let meant = if preset.is_none() { role().or_else(|| material(&words)) } else { None };
            Meaning { role: None, preset, meant }
        }
        Some(Role::Paddle(_)) => {
            let digits = first.trim_start_matches(|c: char| !c.is_ascii_digit());
            let number = if digits.is_empty() { rest.first().copied().unwrap_or("") } else { digits };
            Meaning { role: Some(Role::Paddle(number.parse().ok())), ..Meaning::default() }
        }
        Some(role) => {
            let preset = preset(rest);
            Meaning { role: Some(role), preset, meant: if preset.is_none() { material(rest) } else { None } }
        }
    }
}

/// Whether a name has a role's word in it that does not come first.
pub(super) fn has_role_later(name: &str) -> bool {
    let lower = name.to_lowercase();
    lower.split(['-', '_', ' ', '.', ':']).filter(|part| !part.is_empty()).skip(1).any(|part| word(part).is_some())
}

fn word(word: &str) -> Option<Role> {
    let word = word.trim_end_matches(|c: char| c.is_ascii_digit());
    WORDS.iter().find_map(|(known, role)| (*known == word).then_some(*role))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_word_is_the_role_and_the_rest_may_be_a_material() {
        for (name, role, preset) in [
            ("body", Some(Role::Body), None),
            ("Body_Breast-Fat", Some(Role::Body), Some(Preset::BreastFat)),
            ("OUTLINE", Some(Role::Body), None),
            ("inclusion-hard", Some(Role::Inclusion), None),
            ("Tumour 2", Some(Role::Inclusion), None),
            ("lesion2", Some(Role::Inclusion), None),
            ("needle", Some(Role::Needle), None),
            ("target-1", Some(Role::Target), None),
            ("paddle-1", Some(Role::Paddle(Some(1))), None),
            ("Paddle 12", Some(Role::Paddle(Some(12))), None),
            ("paddle3", Some(Role::Paddle(Some(3))), None),
            ("paddle-99999999999", Some(Role::Paddle(None)), None),
            ("paddles", Some(Role::Paddle(None)), None),
            ("fixed_left", Some(Role::Fixed), None),
            ("bone", Some(Role::Fixed), None),
            ("liver", None, Some(Preset::Liver)),
            ("gelatine-5", None, Some(Preset::Gelatine5)),
            ("path1234", None, None),
            ("nobody", None, None),
            ("left paddle", None, None),
            ("-", None, None),
            ("Targets", Some(Role::Target), None),
            ("needles", Some(Role::Needle), None),
        ] {
            let found = meaning(name);
            assert_eq!((found.role, found.preset), (role, preset), "{name}");
            // Whoever says a role means it.
            assert!(found.meant.is_none() || role.is_none() && preset.is_none(), "{name}: {found:?}");
        }
        assert!(has_role_later("left paddle") && !has_role_later("paddle-left") && !has_role_later("left side"));
    }

    #[test]
    fn what_is_nearly_a_role_or_a_material_may_have_been_meant() {
        for (name, meant) in [
            ("fixd", Some("fixed")),
            ("Traget-2", Some("target")),
            ("needel", Some("needle")),
            ("paddel3", Some("paddle")),
            ("inclusion-breast-glnd", Some("breast-gland")),
            ("tumour-livr", Some("liver")),
            ("Skin_Rabit", Some("skin-rabbit")),
            // What is no word of ours at all, or right.
            ("inclusion-hard", None),
            ("body-2", None),
            ("left side", None),
            ("breast-gland", None),
        ] {
            assert_eq!(meaning(name).meant, meant, "{name}");
        }
    }
}
