//! Every rule by which a scene is unusual, in the order of the file.

use super::{SceneWarning, Small};
use crate::discretization::Resolution;
use crate::geometry::{Point2, cross, distance_to_polyline, distance_to_segment, segments_meet, shared_area};
use crate::material::Material;
use crate::scene::{Resistance, Scene};

/// A needle at less than this angle to the boundary goes along it, degrees.
pub(crate) const ALONG: f64 = 10.0;
/// A needle at more than this angle to the way to the target goes elsewhere, degrees. Those of `breast` and `tethered` that
/// pass the target on purpose have 37 and 31, that of a starter scene 46.
const ELSEWHERE: f64 = 60.0;
/// From this part of the way to the target on, a needle is meant to come near it.
const NEAR: f64 = 0.5;
/// Then this part of its depth is how far off it may be.
const BESIDE: f64 = 0.1;
/// Lengths that differ by less are the same, part of the body's size or of each other.
const SAME: f64 = 1e-9;
/// Parts of an area below this are rounding.
const NO_AREA: f64 = 1e-6;
/// Share of the smaller inclusion that overlaps where only the rounding of a shared edge does.
const SHARED_EDGE: f64 = 1e-3;
/// Overlaps of inclusions that are told: who has more has drawn all of them over each other, and their number grows with its square.
const MOST_OVERLAPS: usize = 100;
/// Part of a paddle's length below which an overlap with another is hardly meant: two places that share more are alternatives.
const SHORT_OVERLAP: f64 = 0.02;
/// Part of the depth that a paddle is away from the needle's contact at least: found by trial, insertions with paddles nearer than half
/// of that stopped before their first increment on some meshes.
const BESIDE_NEEDLE: f64 = 0.01;
/// Part of the body's size below which a length is hardly meant.
const TINY: f64 = 1e-3;
/// How much more than by the rule a tip may press on nodes that are given by their spacing, which may hide it.
const HIDDEN: f64 = 2.0;
/// Sizes of the body per second above which a speed is hardly meant.
const FASTEST: f64 = 1e3;
/// Part of the body's size above which a motion is hardly meant.
const FARTHEST_MOVED: f64 = 0.5;
/// Part of the body's size within which what cannot move holds a target as well.
const HELD: f64 = 0.01;

impl Scene {
    /// What is allowed in the scene and seldom meant, in the order of the file.
    pub fn warnings(&self) -> Vec<SceneWarning> {
        let spacing = match self.discretization.resolution {
            Resolution::Spacing(spacing) => Some(spacing),
            Resolution::Tolerance(_) | Resolution::Level(_) => None,
        };
        let rules = Rules { scene: self, spacing, size: self.outline.size() };
        let mut found = rules.inclusions();
        found.extend(rules.needle_direction());
        found.extend(rules.needle_way());
        found.extend(rules.contact());
        found.extend(rules.friction());
        found.extend(rules.tip());
        found.extend(rules.tip_never_in());
        found.extend(rules.needle_fast());
        found.extend(rules.motion());
        found.extend(rules.target());
        found.extend(rules.paddles());
        found
    }

    /// The same in words, with the scene's unit and what to do.
    pub fn told_warnings(&self) -> Vec<String> {
        self.warnings().iter().map(|warning| warning.told(&self.length_unit)).collect()
    }
}

/// What is unusual about the way of a needle of some depth to a target that its line misses, being nearest at another depth,
/// in a body of this size.
pub(crate) fn towards_target(depth: f64, nearest_at: f64, miss: f64, size: f64) -> Option<SceneWarning> {
    let degrees = miss.atan2(nearest_at).to_degrees();
    if degrees > ELSEWHERE {
        Some(SceneWarning::NeedleMissesTarget { miss, degrees })
    } else if depth >= NEAR * nearest_at && miss > BESIDE * depth {
        Some(SceneWarning::NeedlePassesBeside { miss, depth, nearest_at })
    } else if depth > nearest_at + SAME * size {
        Some(SceneWarning::DeeperThanTarget { depth, nearest_at })
    } else {
        None
    }
}

/// Length that two segments share that lie on one line, within a tolerance; 0 where they do not.
fn overlap([a, b]: [Point2; 2], [c, d]: [Point2; 2], tolerance: f64) -> f64 {
    let along = (b - a).normalize();
    if [c, d].iter().any(|x| cross(along, x - a).abs() > tolerance) {
        return 0.0;
    }
    let at = |x: Point2| (x - a).dot(&along);
    let (low, high) = (at(c).min(at(d)).max(0.0), at(c).max(at(d)).min(at(b)));
    (high - low).max(0.0)
}

struct Rules<'a> {
    scene: &'a Scene,
    /// Node spacing, where it is given.
    spacing: Option<f64>,
    size: f64,
}

impl Rules<'_> {
    /// The spacing, if this length is shorter.
    fn longer_spacing(&self, length: f64) -> Option<f64> {
        self.spacing.filter(|spacing| length < spacing * (1.0 - SAME))
    }

    /// What is so small that no spacing is needed to say so.
    fn tiny(&self, what: Small, length: f64) -> Option<SceneWarning> {
        let has_tolerance = matches!(self.scene.discretization.resolution, Resolution::Tolerance(_));
        let is_tiny = has_tolerance && length < TINY * self.size;
        is_tiny.then_some(SceneWarning::Tiny { what, length, size: self.size })
    }

    fn inclusions(&self) -> Vec<SceneWarning> {
        let (mut found, mut overlaps) = (Vec::new(), Vec::new());
        for (i, region) in self.scene.inclusions.iter().map(|inclusion| &inclusion.outline).enumerate() {
            let (inclusion, area) = (i + 1, region.area());
            let outside = 1.0 - shared_area(&[&self.scene.outline], region.vertices()) / area;
            if outside > NO_AREA {
                found.push(SceneWarning::InclusionPartlyOutside { inclusion, outside });
            }
            let width = region.width();
            if let Some(spacing) = self.longer_spacing(width) {
                found.push(SceneWarning::InclusionNarrow { inclusion, width, spacing });
            }
            found.extend(self.tiny(Small::Inclusion(inclusion), width));
            let more = MOST_OVERLAPS - overlaps.len();
            overlaps.extend((0..i).filter_map(|first| self.overlap(first, i)).take(more));
        }
        found.extend(overlaps);
        found
    }

    /// Two inclusions of which neither is inside the other, or of which the later one leaves nothing of the other. A later one that
    /// is inside is what it looks like, and an edge that both have but for rounding is no overlap.
    fn overlap(&self, first: usize, second: usize) -> Option<SceneWarning> {
        let [a, b] = [first, second].map(|i| &self.scene.inclusions[i].outline);
        let ((low, high), (low_b, high_b)) = (a.bounds(), b.bounds());
        let apart = (0..2).any(|k| low[k] >= high_b[k] || low_b[k] >= high[k]);
        if apart {
            return None;
        }
        let smaller = a.area().min(b.area());
        let area = shared_area(&[a], b.vertices());
        let share = (area / smaller).min(1.0);
        if area > (1.0 - NO_AREA) * a.area() {
            return Some(SceneWarning::InclusionCovered { inclusion: first + 1, by: second + 1 });
        }
        let inside = area > (1.0 - NO_AREA) * b.area();
        let overlap = SceneWarning::InclusionsOverlap { first: first + 1, second: second + 1, area, share };
        (share > SHARED_EDGE && !inside).then_some(overlap)
    }

    /// Angle between the axis and the inner normals of the boundary at the entry, the largest where it enters at a corner,
    /// degrees; none where it enters inside.
    fn degrees_from_inwards(&self) -> Option<f64> {
        let entry = self.scene.needle.entry();
        let edges = self.scene.outline.edges().filter(|(a, b)| distance_to_segment(entry, *a, *b) <= SAME * self.size);
        let inwards = edges.map(|(a, b)| Point2::new(a.y - b.y, b.x - a.x).normalize().dot(&self.scene.needle.axis));
        inwards.min_by(f64::total_cmp).map(|least| least.clamp(-1.0, 1.0).acos().to_degrees())
    }

    /// Depth at which the needle comes out of the body; none where it is not in it at first.
    fn comes_out(&self) -> Option<f64> {
        let needle = &self.scene.needle;
        self.scene.outline.way_inside(needle.entry(), needle.axis, SAME * self.size)
    }

    fn needle_direction(&self) -> Option<SceneWarning> {
        let Some(degrees) = self.degrees_from_inwards() else { return self.towards_target() };
        let to_surface = 90.0 - degrees;
        if to_surface.abs() < ALONG {
            Some(SceneWarning::NeedleAlongSurface { degrees: to_surface.abs() })
        } else if self.comes_out().is_none() {
            Some(SceneWarning::NeedlePointsOut { degrees })
        } else {
            self.towards_target()
        }
    }

    fn towards_target(&self) -> Option<SceneWarning> {
        let (nearest_at, miss) = self.scene.target_from_needle();
        towards_target(self.scene.needle.depth, nearest_at, miss, self.size)
    }

    /// Where the needle's way ends.
    fn needle_way(&self) -> Vec<SceneWarning> {
        let needle = &self.scene.needle;
        let depth = needle.depth;
        let Some(out) = self.comes_out() else { return Vec::new() };
        let mut found = Vec::new();
        if depth > out + SAME * self.size {
            found.push(SceneWarning::NeedleLeavesBody { depth, at: out });
        }
        let end = needle.entry() + needle.axis * depth.min(out);
        let to_immobile = self.scene.immobile.iter().map(|path| distance_to_polyline(end, path));
        let distance = to_immobile.fold(f64::INFINITY, f64::min);
        // No more than half its way: a needle may enter beside what holds the body.
        let near = self.spacing.map_or(SAME * self.size, |spacing| spacing.min(0.5 * depth));
        if distance <= near {
            found.push(SceneWarning::NeedleMeetsImmobile { depth: depth.min(out), distance });
        }
        found
    }

    fn contact(&self) -> Option<SceneWarning> {
        let length = self.scene.needle.contact_length();
        let short = self.longer_spacing(length).map(|spacing| SceneWarning::ContactShort { length, spacing });
        short.or_else(|| self.tiny(Small::Contact, length))
    }

    fn friction(&self) -> Vec<SceneWarning> {
        let of_needle = self.scene.needle.shaft.map(|shaft| (None, shaft.resistance));
        let of_inclusions = self
            .scene
            .inclusions
            .iter()
            .enumerate()
            .filter_map(|(i, inclusion)| Some((Some(i + 1), inclusion.resistance?)));
        let only_sticks =
            |r: &Resistance| r.static_friction > 0.0 && r.kinetic_friction == 0.0 && r.viscous_friction == 0.0;
        // What inclusions take from the needle is told of once.
        let of_inclusions = of_inclusions
            .filter(|(_, own)| of_needle.is_none_or(|(_, needles)| !only_sticks(&needles) || needles != *own));
        of_needle
            .into_iter()
            .chain(of_inclusions)
            .filter(|(_, resistance)| only_sticks(resistance))
            .map(|(inclusion, resistance)| SceneWarning::FrictionOnlySticks {
                inclusion,
                static_friction: resistance.static_friction,
            })
            .collect()
    }

    fn tip_never_in(&self) -> Option<SceneWarning> {
        let (shaft, depth) = (self.scene.needle.shaft?, self.scene.needle.depth);
        let tip_length = shaft.tip_length;
        (tip_length > depth).then_some(SceneWarning::TipNeverIn { tip_length, depth })
    }

    fn needle_fast(&self) -> Option<SceneWarning> {
        let (speed, size) = (self.scene.needle.speed, self.size);
        (speed > FASTEST * size).then_some(SceneWarning::NeedleFast { speed, size })
    }

    fn motion(&self) -> Option<SceneWarning> {
        let motion = &self.scene.motion;
        let breath = motion.breathing.map_or(0.0, |breathing| breathing.amplitude.abs());
        let surge = motion.surge.map_or(0.0, |surge| surge.amplitude.abs());
        let recorded = motion.recorded.iter().map(|(_, moved)| moved.norm()).fold(0.0, f64::max);
        // They add up.
        let distance = breath + surge + recorded;
        (distance > FARTHEST_MOVED * self.size).then_some(SceneWarning::MotionLarge { distance, size: self.size })
    }

    /// Tissue beside a tip bears about twice its shear modulus per length of it, found by trial; nodes that are further apart
    /// than the tip is long do not see more, and bear it on the length of their spacing.
    fn tip(&self) -> Vec<SceneWarning> {
        let Some(shaft) = self.scene.needle.shaft else { return Vec::new() };
        let bearing = self.spacing.map_or(shaft.tip_length, |spacing| HIDDEN * shaft.tip_length.max(spacing));
        let of_inclusions = self.scene.inclusions.iter().enumerate().map(|(i, inclusion)| {
            let law = inclusion.material.as_ref().unwrap_or(&self.scene.material);
            let resistance = inclusion.resistance.unwrap_or(shaft.resistance);
            (Some(i + 1), law, inclusion.stiffness, resistance)
        });
        let places = std::iter::once((None, &self.scene.material, 1.0, shaft.resistance)).chain(of_inclusions);
        let too_short = places.filter_map(|(inclusion, law, stiffness, resistance)| {
            let shear_modulus = stiffness * Material::<2>::rest_shear_modulus(law);
            let (tip_length, least) = (shaft.tip_length, resistance.cutting_force / (2.0 * shear_modulus));
            (bearing < least).then_some(SceneWarning::TipTooShort { inclusion, tip_length, least })
        });
        too_short.collect()
    }

    fn target(&self) -> Option<SceneWarning> {
        let to_immobile = self.scene.immobile.iter().map(|path| distance_to_polyline(self.scene.target, path));
        let from_immobile = to_immobile.fold(f64::INFINITY, f64::min);
        if self.spacing.is_none() && from_immobile < HELD * self.size {
            return Some(SceneWarning::TargetNearImmobile { distance: from_immobile });
        }
        let distance = self.scene.outline.distance_to_boundary(self.scene.target);
        let near = self.longer_spacing(distance).map(|spacing| SceneWarning::TargetNearBoundary { distance, spacing });
        near.or_else(|| self.tiny(Small::TargetsDistance, distance))
    }

    fn paddles(&self) -> Vec<SceneWarning> {
        let mut found = Vec::new();
        for (i, paddle) in self.scene.paddles.iter().enumerate() {
            let [a, b] = paddle.segment;
            let length = (b - a).norm();
            if let Some(spacing) = self.longer_spacing(length) {
                found.push(SceneWarning::PaddleShort { index: paddle.index, length, spacing });
            }
            found.extend(self.tiny(Small::Paddle(paddle.index), length));
            let (gap, depth) = (self.scene.paddle_facts(i).from_contact, self.scene.needle.depth);
            if self.scene.needle.shaft.is_none() && gap < BESIDE_NEEDLE * depth {
                found.push(SceneWarning::PaddleBesideNeedle { index: paddle.index, gap, depth });
            }
            if let Some(at) = self.in_the_way([a, b]) {
                found.push(SceneWarning::PaddleInTheWay { index: paddle.index, at });
            }
            for before in &self.scene.paddles[..i] {
                let overlap = overlap(before.segment, paddle.segment, SAME * self.size);
                if overlap > SAME * self.size && overlap < SHORT_OVERLAP * length {
                    found.push(SceneWarning::PaddlesOverlap {
                        first: before.index,
                        second: paddle.index,
                        length: overlap,
                    });
                }
            }
        }
        found
    }

    /// The depth at which the needle, as far as it goes and as far as it comes from, meets a segment.
    fn in_the_way(&self, [a, b]: [Point2; 2]) -> Option<f64> {
        let needle = &self.scene.needle;
        let entry = needle.entry();
        // What points out comes from inside: that is another warning.
        let before = if self.comes_out().is_some() { self.size } else { 0.0 };
        let clear = needle.shaft.map_or(0.0, |shaft| shaft.radius).max(SAME * self.size);
        let (from, to) = (entry - needle.axis * before, entry + needle.axis * needle.depth);
        if !segments_meet(from, to, a, b, clear) {
            return None;
        }
        // Where the line crosses that of the segment, within its ends.
        let along = b - a;
        let by = crate::geometry::cross(needle.axis, along);
        let share = if by == 0.0 { 0.5 } else { crate::geometry::cross(a - entry, needle.axis) / by };
        Some((a + along * share.clamp(0.0, 1.0) - entry).dot(&needle.axis))
    }
}
