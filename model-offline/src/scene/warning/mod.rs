//! What is allowed in a scene and seldom meant: each with its numbers, and what to do.

mod find;

pub(crate) use find::{ALONG, towards_target};

use crate::number::{self, in_unit, short};
use std::fmt;

/// Something in a valid scene that is seldom meant. Lengths are in the scene's unit; inclusions are counted from 1 in the
/// order of the file.
#[derive(Debug, Clone, PartialEq)]
pub enum SceneWarning {
    /// The body's file is in another unit of length than the scene says it is, and numbers are taken as they are.
    BodyInOtherUnit {
        /// The file's unit.
        of_file: &'static str,
    },
    /// The needle goes away from the body at its entry.
    NeedlePointsOut {
        /// Angle between the axis and the inner normal of the boundary, degrees.
        degrees: f64,
    },
    /// The needle goes along the surface.
    NeedleAlongSurface {
        /// Angle between the axis and the boundary, degrees.
        degrees: f64,
    },
    /// The needle's line goes elsewhere than to the target.
    NeedleMissesTarget {
        /// Smallest distance of the line from the target.
        miss: f64,
        /// Angle between the axis and the way from the entry to the target, degrees.
        degrees: f64,
    },
    /// The needle comes near the target and goes past it.
    NeedlePassesBeside {
        /// Smallest distance of the line from the target.
        miss: f64,
        /// Depth of the needle.
        depth: f64,
        /// Depth at which the line is nearest to the target.
        nearest_at: f64,
    },
    /// The needle goes deeper than the target lies.
    DeeperThanTarget {
        /// Depth of the needle.
        depth: f64,
        /// Depth at which the line is nearest to the target.
        nearest_at: f64,
    },
    /// The needle comes out on the other side.
    NeedleLeavesBody {
        /// Depth of the needle.
        depth: f64,
        /// Depth at which it comes out.
        at: f64,
    },
    /// The needle comes to the immobile part.
    NeedleMeetsImmobile {
        /// Depth of the needle.
        depth: f64,
        /// Distance of its way from the immobile part.
        distance: f64,
    },
    /// The needle's contact is shorter than the nodes are apart.
    ContactShort {
        /// Length of the contact.
        length: f64,
        /// Node spacing.
        spacing: f64,
    },
    /// Tissue sticks to the shaft, and what slides is not held at all.
    FrictionOnlySticks {
        /// Whose friction it is: an inclusion's, or the needle's.
        inclusion: Option<usize>,
        /// Static friction, force per length.
        static_friction: f64,
    },
    /// Tissue may not bear what the tip presses with, and fine nodes see it.
    TipTooShort {
        /// Whose cutting force it is: an inclusion's, or the needle's.
        inclusion: Option<usize>,
        /// Length that the cutting force is spread over.
        tip_length: f64,
        /// Length from which on tissue bears it.
        least: f64,
    },
    /// The tip is longer than the needle goes, and its cutting force is never reached.
    TipNeverIn {
        /// Length that the cutting force is spread over.
        tip_length: f64,
        /// Depth of the needle.
        depth: f64,
    },
    /// The needle is through the body in next to no time.
    NeedleFast {
        /// Its speed, length per second.
        speed: f64,
        /// The body's size: the diagonal of its bounding box.
        size: f64,
    },
    /// The immobile part moves about as far as the body is large.
    MotionLarge {
        /// Largest distance that breath, cough and recording move it together.
        distance: f64,
        /// The body's size: the diagonal of its bounding box.
        size: f64,
    },
    /// Something is so small beside the body that its unit may be another one.
    Tiny {
        /// What it is.
        what: Small,
        /// Its length or width, or the distance from the boundary.
        length: f64,
        /// The body's size: the diagonal of its bounding box.
        size: f64,
    },
    /// The target is next to the boundary.
    TargetNearBoundary {
        /// Its distance from the boundary.
        distance: f64,
        /// Node spacing.
        spacing: f64,
    },
    /// The target is next to what cannot move.
    TargetNearImmobile {
        /// Its distance from there.
        distance: f64,
    },
    /// An inclusion reaches out of the body.
    InclusionPartlyOutside {
        /// Which.
        inclusion: usize,
        /// Part of its area that is outside, 0 to 1.
        outside: f64,
    },
    /// An inclusion is narrower than the nodes are apart.
    InclusionNarrow {
        /// Which.
        inclusion: usize,
        /// Its smallest width.
        width: f64,
        /// Node spacing.
        spacing: f64,
    },
    /// A later inclusion covers all of another one, which does nothing then.
    InclusionCovered {
        /// Which.
        inclusion: usize,
        /// The later one.
        by: usize,
    },
    /// Two inclusions cover a part of each other.
    InclusionsOverlap {
        /// Which, the one that the file has first.
        first: usize,
        /// The other.
        second: usize,
        /// Area that both cover, length unit squared.
        area: f64,
        /// Part of the smaller one's area that is, 0 to 1.
        share: f64,
    },
    /// Two paddles overlap by much less than either is long.
    PaddlesOverlap {
        /// Index of the paddle that the file has first.
        first: u32,
        /// Index of the other one.
        second: u32,
        /// Length that both cover.
        length: f64,
    },
    /// A paddle is shorter than the nodes are apart.
    PaddleShort {
        /// Its index.
        index: u32,
        /// Its length.
        length: f64,
        /// Node spacing.
        spacing: f64,
    },
    /// Next to nothing is between a paddle and the needle's contact.
    PaddleBesideNeedle {
        /// Its index.
        index: u32,
        /// Distance between them.
        gap: f64,
        /// How far the contact is pushed.
        depth: f64,
    },
    /// The needle's way leads through a paddle.
    PaddleInTheWay {
        /// Its index.
        index: u32,
        /// At which depth; negative: outside the body, on the way in.
        at: f64,
    },
}

/// What is so small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Small {
    /// The needle's contact.
    Contact,
    /// What is between target and boundary.
    TargetsDistance,
    /// The width of an inclusion, counted from 1.
    Inclusion(usize),
    /// The paddle of this index.
    Paddle(u32),
}

impl Small {
    fn told(self, length: &str) -> String {
        match self {
            Self::Contact => format!("the needle contact is {length} long"),
            Self::TargetsDistance => format!("the target is {length} from the boundary"),
            Self::Inclusion(number) => format!("inclusion {number} is {length} wide"),
            Self::Paddle(index) => format!("paddle {index} is {length} long"),
        }
    }
}

impl SceneWarning {
    /// What is unusual, with lengths in this unit (`1`: none).
    pub fn message(&self, unit: &str) -> String {
        let long = |value: f64| in_unit(value, unit);
        match *self {
            Self::BodyInOtherUnit { of_file } => in_other_unit(of_file, unit),
            Self::NeedlePointsOut { degrees } => {
                format!("the needle points out of the body: {degrees:.0}° from straight in")
            }
            Self::NeedleAlongSurface { degrees } => {
                format!("the needle goes along the surface: {degrees:.1}° between its axis and the boundary")
            }
            Self::NeedleMissesTarget { miss, degrees } => format!(
                "the needle does not go towards the target: its line misses it by {}, {degrees:.0}° off the way there",
                long(miss)
            ),
            Self::NeedlePassesBeside { miss, depth, nearest_at } => passes_beside([miss, depth, nearest_at].map(long)),
            Self::DeeperThanTarget { depth, nearest_at } => {
                let [depth, nearest_at] = [depth, nearest_at].map(long);
                format!("the needle goes deeper than the target: depth {depth}, the target lies at {nearest_at}")
            }
            Self::NeedleLeavesBody { depth, at } => {
                format!("the needle leaves the body at depth {}, and its depth is {}", long(at), long(depth))
            }
            Self::NeedleMeetsImmobile { depth, distance } => {
                let [depth, distance] = [depth, distance].map(long);
                format!("the needle ends at the immobile part: at depth {depth} its way comes within {distance} of it")
            }
            Self::ContactShort { length, spacing } => {
                format!("the needle contact is shorter than the node spacing: {} of {}", long(length), long(spacing))
            }
            Self::FrictionOnlySticks { inclusion, static_friction } => {
                let (of, is) = (whose(inclusion), short(static_friction));
                format!("the friction of {of} only sticks: static_friction is {is} and what slides is not held at all")
            }
            Self::TipTooShort { inclusion, tip_length, least } => {
                let (whose, on, from) = (whose(inclusion), long(tip_length), long(least));
                format!("the tip is {on} long, and tissue bears the cutting force of {whose} from {from} on")
            }
            Self::TipNeverIn { tip_length, depth } => never_in([tip_length, depth].map(long)),
            Self::NeedleFast { speed, size } => fast([speed, size].map(long)),
            Self::MotionLarge { distance, size } => {
                format!("[motion] moves the body by up to {}, and it is {} across", long(distance), long(size))
            }
            Self::Tiny { what, length, size } => {
                format!("{}, in a body of {}", what.told(&long(length)), long(size))
            }
            Self::TargetNearBoundary { distance, spacing } => {
                let [at, nodes] = [distance, spacing].map(long);
                format!("the target is nearer to the boundary than the nodes are to each other: {at} of {nodes}")
            }
            Self::TargetNearImmobile { distance } => {
                format!("the target is next to the immobile part, {} from it", long(distance))
            }
            Self::InclusionPartlyOutside { inclusion, outside } => {
                format!("inclusion {inclusion} is partly outside the body: {} of its area", percent(outside))
            }
            Self::InclusionNarrow { inclusion, width, spacing } => {
                format!("inclusion {inclusion} is narrower than the node spacing: {} of {}", long(width), long(spacing))
            }
            Self::InclusionCovered { inclusion, by } => {
                format!("inclusion {inclusion} does nothing: inclusion {by} covers it, and the later one counts")
            }
            Self::InclusionsOverlap { first, second, area, share } => {
                overlap([first, second], &number::area(area, unit), share)
            }
            Self::PaddlesOverlap { first, second, length } => {
                format!("paddles {first} and {second} overlap by {}", long(length))
            }
            Self::PaddleShort { index, length, spacing } => {
                format!("paddle {index} is shorter than the node spacing: {} of {}", long(length), long(spacing))
            }
            Self::PaddleBesideNeedle { index, gap, depth } => {
                let [gap, depth] = [gap, depth].map(long);
                format!("paddle {index} is {gap} beside the needle's contact, which is pushed by {depth}")
            }
            Self::PaddleInTheWay { index, at } => in_the_way(index, at, &long(at.abs())),
        }
    }

    /// What to do.
    pub fn help(&self) -> &'static str {
        match self {
            Self::BodyInOtherUnit { .. } => {
                "give units.length as that of the file, with all other numbers of the scene in it"
            }
            Self::NeedlePointsOut { .. } => "turn the axis round, or move the contact to the other side",
            Self::NeedleAlongSurface { .. } => "turn the axis inwards",
            Self::NeedleMissesTarget { .. } => "turn the axis, or move the contact; nothing to do where it is meant so",
            Self::NeedlePassesBeside { .. } => "turn the axis, or insert less deep; nothing to do where it is meant so",
            Self::DeeperThanTarget { .. } => "insert less deep; nothing to do where it is meant so",
            Self::NeedleLeavesBody { .. } => "insert less deep, or check the units of the depth",
            Self::NeedleMeetsImmobile { .. } => "insert less deep, or turn the axis: what cannot move stops a needle",
            Self::ContactShort { .. } | Self::PaddleShort { .. } => "lengthen it, or take a smaller spacing",
            Self::Tiny { .. } => {
                "check the numbers and their unit; where it is meant so, a tolerance takes many nodes there"
            }
            Self::TipNeverIn { .. } => "give a shorter tip_length",
            Self::NeedleFast { .. } | Self::MotionLarge { .. } => "check the number and its unit",
            Self::FrictionOnlySticks { .. } => "give kinetic_friction too",
            Self::TipTooShort { .. } => {
                "give a longer tip_length, or less force: on fine nodes there may be no equilibrium, and coarse ones hide it"
            }
            Self::TargetNearBoundary { .. } => "take a smaller spacing, or move the target inwards",
            Self::TargetNearImmobile { .. } => "move it away: hardly any paddle moves what is held so near",
            Self::InclusionPartlyOutside { .. } => "the part outside does nothing: move it, or cut it off",
            Self::InclusionNarrow { .. } => {
                "take a smaller spacing, or a tolerance: nodes so far apart hardly know of it"
            }
            Self::InclusionCovered { .. } => "write the inner one after the outer one, or leave it out",
            Self::InclusionsOverlap { .. } => {
                "move one, or write the one that is meant to count after the other; where one is meant to be inside the other, put \
                 all of it there"
            }
            Self::PaddlesOverlap { .. } => {
                "let one end where the other begins: an overlap so short takes elements as short, and insertions do not get far on them"
            }
            Self::PaddleBesideNeedle { .. } => {
                "move it away: next to no tissue is between them, and insertions with this paddle may stop at once"
            }
            Self::PaddleInTheWay { .. } => "move the paddle, or the needle",
        }
    }

    /// What is unusual and what to do, in one line.
    pub fn told(&self, unit: &str) -> String {
        format!("{}; {}", self.message(unit), self.help())
    }
}

fn in_other_unit(of_file: &str, unit: &str) -> String {
    format!("the body's file is in {of_file} and taken as it is, and the scene says that lengths are in {unit}")
}

fn passes_beside([miss, depth, at]: [String; 3]) -> String {
    format!("the needle goes beside the target: at depth {at} it is nearest, {miss} off; it goes to {depth}")
}

fn never_in([tip, depth]: [String; 2]) -> String {
    format!("the tip is {tip} long, and the needle goes {depth} deep: its cutting force is never reached")
}

fn fast([speed, size]: [String; 2]) -> String {
    format!("the needle goes {speed} in a second, through a body of {size} in less than a millisecond")
}

fn in_the_way(index: u32, at: f64, distance: &str) -> String {
    let place = if at < 0.0 { format!("{distance} before its entry") } else { format!("at depth {distance}") };
    format!("paddle {index} is in the needle's way, {place}")
}

impl fmt::Display for SceneWarning {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.told("1"))
    }
}

/// What resists: an inclusion, or everything that the needle goes through.
fn whose(inclusion: Option<usize>) -> String {
    inclusion.map_or("the needle".to_owned(), |number| format!("inclusion {number}"))
}

/// Two inclusions that share an area, of which they say whose it is.
fn overlap([first, second]: [usize; 2], area: &str, share: f64) -> String {
    format!(
        "inclusions {first} and {second} overlap: an area of {area}, {} of the smaller one, is taken to be of inclusion {second}, \
         which comes later",
        percent(share)
    )
}

/// A part of something, never 0 and never all of it.
fn percent(share: f64) -> String {
    match 100.0 * share {
        percent if percent < 0.1 => "less than 0.1 %".to_owned(),
        percent => format!("{} %", short((10.0 * percent).round() / 10.0)),
    }
}
