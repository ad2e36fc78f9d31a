//! Where things go on an outline that does not say so.

use super::sides::{Stretch, facing, sides};
use super::{depth_for, rounded, rounded_down};
use crate::geometry::{Point2, Polygon, distance_to_polyline, segments_meet};
use crate::scene::import::{Imported, ImportedNeedle, straight_under};
use crate::scene::middle;

/// Paddle positions that are suggested at most.
const PADDLES: usize = 5;
/// With fewer, places beside the needle's contact are suggested as well.
const FEW: usize = 3;
/// A needle's contact as part of what it enters; it is no wider than the body.
const CONTACT: f64 = 0.3;
/// The shortest contact, part of the body's size: more than the distance of nodes of a starter scene.
const SHORTEST_CONTACT: f64 = 0.06;
/// How steep at most what faces up or down may be, as the cosine of its slope: below 45°, and where that is too little, more.
const STEEP: [f64; 3] = [0.72, 0.5, 0.2];
/// Depth as part of the tissue ahead of the needle: what is thin bends.
const AHEAD: f64 = 0.07;
/// And as part of its contact: a short one squeezes the tissue at its ends.
const OF_CONTACT: f64 = 0.15;
/// Parts that are at most so much higher than the lowest one, of the body's height, stand beside it.
const BESIDE: f64 = 0.05;
/// How far what holds a curve reaches up from its lowest point, of the body's height.
const HELD: f64 = 0.15;
/// Length of a curve that carries a paddle, part of the body's size, and the longest paddle there.
const CURVE: f64 = 0.22;
const ON_CURVE: f64 = 0.15;
/// How far a curve may be off a paddle on it, of the paddle's length: more is no curve that is made straight.
const BULGE: f64 = 0.08;
/// How far ahead of a needle its target is at most, of its contact: farther away hardly anything moves.
const FARTHEST: f64 = 1.5;
/// Room that counts as much as a way across the needle's line.
const NEXT: f64 = 0.02;
/// How far beside the middle it is: on a line of symmetry a target does not move sideways, and there would be nothing to see.
const ASIDE: f64 = 0.35;

/// The parts of a scene on an outline.
pub(super) struct Layout {
    /// The outline, straight under paddles.
    pub(super) outline: Polygon,
    /// Under which suggested paddles it was not, and how far it was off, length.
    pub(super) straightened: Vec<(u32, f64)>,
    pub(super) immobile: Vec<Vec<Point2>>,
    pub(super) contact: Vec<Point2>,
    pub(super) axis: Point2,
    pub(super) depth: f64,
    pub(super) target: Point2,
    pub(super) paddles: Vec<(u32, [Point2; 2])>,
    pub(super) spacing: f64,
}

impl Layout {
    /// What the import gives, and suggestions for the rest that keep clear of it.
    pub(super) fn of(imported: &Imported) -> Self {
        let outline = &imported.outline;
        let size = outline.size();
        let mut taken = Taken { pieces: imported.paddles.iter().map(|paddle| paddle.1).collect(), size };
        imported.needle.iter().for_each(|needle| taken.take(&needle.contact));
        imported.immobile.iter().for_each(|path| taken.take(path));
        let immobile = if imported.immobile.is_empty() { lowest(outline, &taken) } else { imported.immobile.clone() };
        immobile.iter().for_each(|path| taken.take(path));
        let needle = imported.needle.clone().unwrap_or_else(|| entry(outline, &taken, imported.target));
        let deepest = imported.target.map(|target| (target - middle(&needle.contact)).dot(&needle.axis));
        let deepest = deepest.filter(|way| *way > 0.0).map_or(f64::INFINITY, rounded_down);
        let mut layout = Self {
            outline: outline.clone(),
            straightened: Vec::new(),
            depth: imported.depth.unwrap_or_else(|| depth(outline, &needle).min(deepest)),
            target: imported.target.unwrap_or_else(|| innermost(outline, &needle)),
            paddles: imported.paddles.clone(),
            contact: needle.contact,
            axis: needle.axis,
            immobile,
            spacing: rounded(size / 25.0),
        };
        if layout.paddles.is_empty() {
            taken.take(&layout.contact);
            // The needle comes from there.
            let enters = middle(&layout.contact);
            taken.take(&[enters, enters - layout.axis * size]);
            layout.suggest_paddles(&taken, imported);
        }
        layout
    }

    /// Paddles on what is free, and the outline straight under them.
    fn suggest_paddles(&mut self, taken: &Taken, imported: &Imported) {
        // Coordinates that people can read.
        let step = 10f64.powf((2e-6 * taken.size).log10().floor());
        let on_grid = |p: Point2| p.map(|v| (v / step).round() * step);
        // What the body loses where it becomes straight must be nothing that was drawn.
        let drawn = imported.inclusions.iter().flat_map(|inclusion| inclusion.outline.vertices()).copied();
        let drawn: Vec<Point2> = drawn.chain([self.target]).filter(|p| self.outline.contains(*p)).collect();
        let mut ends: Vec<Point2> = Vec::new();
        let mut index = 1;
        for place in self.places(taken) {
            let segment = if self.outline.segment_on_boundary(place[0], place[1], 1e-9 * taken.size) {
                place
            } else if let Some(straight) = straight_under(&self.outline, place, &ends, on_grid)
                && drawn.iter().all(|p| straight.outline.contains(*p))
            {
                self.outline = straight.outline;
                self.straightened.push((index, straight.by));
                straight.chord
            } else {
                continue;
            };
            ends.extend(segment);
            self.paddles.push((index, segment));
            index += 1;
        }
    }

    /// Places for paddles around the body that keep clear of what is taken: those that the target sees at the widest angles.
    fn places(&self, taken: &Taken) -> Vec<[Point2; 2]> {
        let free = |place: &[Point2; 2]| taken.leaves(*place);
        let on = |side: &Stretch| match side.edges().collect::<Vec<_>>()[..] {
            [edge] => on_edge(edge, taken.size),
            _ => side.runs(|edge| taken.leaves(edge)).iter().flat_map(|run| on_curve(run, taken.size)).collect(),
        };
        // What has no corner is walked around from the middle of what holds it.
        let seam = self.immobile.first().map_or(Point2::zeros(), |path| middle(path));
        let sides = sides(&self.outline, seam);
        let mut places: Vec<[Point2; 2]> = sides.iter().flat_map(on).filter(free).collect();
        if places.len() < FEW {
            let others = Taken { pieces: places.clone(), size: taken.size };
            let beside = sides.iter().flat_map(|side| beside_contact(side, taken));
            places.extend(beside.filter(|place| free(place) && others.leaves(*place)));
        }
        if places.is_empty() {
            // Beside the contact, near a corner.
            let beside = self.outline.edges().flat_map(|(a, b)| {
                [(0.02, 0.25), (0.75, 0.98)].map(|(from, to)| [a + (b - a) * from, a + (b - a) * to])
            });
            return beside.filter(free).take(1).collect();
        }
        let seen =
            |place: &[Point2; 2]| (place[1] - place[0]).norm() / ((place[0] + place[1]) * 0.5 - self.target).norm();
        let mut angles: Vec<f64> = places.iter().map(seen).collect();
        angles.sort_by(|a, b| b.total_cmp(a));
        let least = angles[angles.len().min(PADDLES) - 1];
        places.retain(|place| seen(place) >= least);
        places.truncate(PADDLES);
        places
    }
}

/// What something sits on already.
struct Taken {
    pieces: Vec<[Point2; 2]>,
    size: f64,
}

impl Taken {
    fn take(&mut self, path: &[Point2]) {
        self.pieces.extend(path.windows(2).map(|piece| [piece[0], piece[1]]));
    }

    /// Whether a piece of the boundary touches none of it.
    fn leaves(&self, piece: [Point2; 2]) -> bool {
        self.pieces.iter().all(|[a, b]| !segments_meet(piece[0], piece[1], *a, *b, 2e-3 * self.size))
    }
}

/// Height of a part of the boundary against its length: short ones are no base and no entry where a longer one is nearly as
/// low (`up` = −1) or high (1). The least is best.
fn merit([a, b]: [Point2; 2], up: f64) -> f64 {
    -up * 0.5 * (a.y + b.y) - 0.5 * (b - a).norm()
}

fn best_edge(outline: &Polygon, up: f64, free: impl Fn([Point2; 2]) -> bool) -> Option<[Point2; 2]> {
    let edges = outline.edges().map(|(a, b)| [a, b]).filter(|edge| free(*edge));
    edges.min_by(|a, b| merit(*a, up).total_cmp(&merit(*b, up)))
}

/// What the body stands on: all that faces down and is lowest.
fn lowest(outline: &Polygon, taken: &Taken) -> Vec<Vec<Point2>> {
    let (low, high) = outline.bounds();
    let height = high.y - low.y;
    for steepest in STEEP {
        let parts = facing(outline, -1.0, steepest);
        let parts: Vec<Stretch> = parts.iter().flat_map(|part| part.runs(|edge| taken.leaves(edge))).collect();
        let Some(base) = parts.iter().min_by(|a, b| merit(a.ends(), -1.0).total_cmp(&merit(b.ends(), -1.0))) else {
            continue;
        };
        let beside = parts.iter().filter(|part| part.lowest() <= base.lowest() + BESIDE * height);
        let near = |part: &Stretch| part.runs(|[a, b]| a.y.min(b.y) <= part.lowest() + HELD * height);
        let held: Vec<Stretch> = beside.flat_map(near).collect();
        if held.iter().map(Stretch::length).sum::<f64>() >= SHORTEST_CONTACT * taken.size {
            return held.into_iter().map(|part| part.0).collect();
        }
    }
    // A body that stands on a corner lies on one side of it.
    let edge = best_edge(outline, -1.0, |edge| taken.leaves(edge)).or_else(|| best_edge(outline, -1.0, |_| true));
    edge.iter().map(|edge| edge.to_vec()).collect()
}

/// A needle straight into what faces up and is highest, where it is free; towards a target that is given.
fn entry(outline: &Polygon, taken: &Taken, target: Option<Point2>) -> ImportedNeedle {
    let free = |contact: &Stretch| contact.edges().all(|piece| taken.leaves(piece));
    let on = |steepest: f64| {
        let mut parts = facing(outline, 1.0, steepest);
        parts.sort_by(|a, b| merit(a.ends(), 1.0).total_cmp(&merit(b.ends(), 1.0)));
        parts.iter().find_map(|part| contact_on(part, outline, target, free))
    };
    let steep = || {
        let middle = |edge: [Point2; 2]| {
            let [from, to] = [0.5 - 0.5 * CONTACT, 0.5 + 0.5 * CONTACT].map(|share| share * (edge[1] - edge[0]).norm());
            Stretch(edge.to_vec()).between(from, to)
        };
        let edge = best_edge(outline, 1.0, |edge| free(&middle(edge))).or_else(|| best_edge(outline, 1.0, |_| true));
        edge.map_or_else(|| Stretch(outline.vertices()[..2].to_vec()), middle)
    };
    let contact = STEEP.into_iter().find_map(on).unwrap_or_else(steep);
    let [from, to] = contact.ends();
    // The interior is on the left of the boundary.
    let axis = Point2::new(from.y - to.y, to.x - from.x).normalize();
    ImportedNeedle { contact: contact.0, axis, most: f64::INFINITY }
}

/// The part of a stretch that a needle's contact takes, the longest that is free: as near to its middle as can be, or where
/// the needle goes nearest to the target. None where it is too short for one, or taken.
fn contact_on(
    part: &Stretch,
    outline: &Polygon,
    target: Option<Point2>,
    free: impl Fn(&Stretch) -> bool,
) -> Option<Stretch> {
    let whole = part.length();
    let shortest = SHORTEST_CONTACT * outline.size();
    let longest = (CONTACT * whole).min(outline.width()).max(shortest);
    let lengths =
        [longest, (0.5 * longest).max(shortest), shortest].into_iter().filter(|length| *length <= 0.9 * whole);
    for length in lengths {
        let least = 0.5 * length / whole;
        let around = |share: f64| part.between(share * whole - 0.5 * length, share * whole + 0.5 * length);
        // Where a body is long and thin, the middle is out of reach of whatever is on its ends.
        let wanted = (outline.width() / whole).clamp(least, 0.5);
        let shares = (0..=20).map(|k| 0.05 * f64::from(k)).chain([wanted]);
        let contacts = shares.filter(|share| *share >= least && *share <= 1.0 - least);
        let contacts = contacts.map(|share| (share, around(share))).filter(|(_, contact)| free(contact));
        let past = |(share, contact): &(f64, Stretch)| {
            let [from, to] = contact.ends();
            let miss = |target: Point2| (target - (from + to) * 0.5).dot(&(to - from).normalize()).abs();
            target.map_or((share - wanted).abs(), miss)
        };
        if let Some((_, contact)) = contacts.min_by(|a, b| past(a).total_cmp(&past(b))) {
            return Some(contact);
        }
    }
    None
}

/// A depth that the tissue ahead of the needle bears with a paddle that follows.
fn depth(outline: &Polygon, needle: &ImportedNeedle) -> f64 {
    let size = outline.size();
    let enters = middle(&needle.contact);
    let ahead = outline.way_inside(enters, needle.axis, 1e-6 * size).unwrap_or(size);
    let contact = (needle.contact[needle.contact.len() - 1] - needle.contact[0]).norm();
    let borne = rounded(AHEAD * ahead).min(rounded(OF_CONTACT * contact));
    depth_for(size, outline.width()).min(borne).min(rounded_down(needle.most))
}

/// Places on a straight side. Long ones carry two paddles; none reaches a corner, where it could touch the immobile part.
fn on_edge([a, b]: [Point2; 2], size: f64) -> Vec<[Point2; 2]> {
    let spans: &[(f64, f64)] = if (b - a).norm() > 0.25 * size { &[(0.15, 0.45), (0.55, 0.85)] } else { &[(0.2, 0.8)] };
    spans.iter().map(|(from, to)| [a + (b - a) * *from, a + (b - a) * *to]).collect()
}

/// Places on both sides of what is on a straight side already.
fn beside_contact(side: &Stretch, taken: &Taken) -> Vec<[Point2; 2]> {
    let [[a, b]] = side.edges().collect::<Vec<_>>()[..] else { return Vec::new() };
    let on = |p: &Point2| distance_to_polyline(*p, &[a, b]) <= 1e-6 * taken.size;
    let shares = |piece: &[Point2; 2]| piece.map(|p| (p - a).norm() / (b - a).norm());
    let covered = taken.pieces.iter().filter(|piece| piece.iter().all(on)).map(shares);
    let (first, last) =
        covered.fold((1.0_f64, 0.0_f64), |(first, last), [from, to]| (first.min(from.min(to)), last.max(from.max(to))));
    let place = |from: f64, to: f64| [a + (b - a) * from, a + (b - a) * to];
    let rests = [(first, -first), (last, 1.0 - last)];
    let long = rests.iter().filter(|(_, rest)| first < last && rest.abs() > 0.1);
    long.map(|(at, rest)| place(at + 0.1 * rest, at + 0.6 * rest)).collect()
}

/// Places along a curve, shorter where it bends more.
fn on_curve(run: &Stretch, size: f64) -> Vec<[Point2; 2]> {
    let whole = run.length();
    if whole < 0.5 * CURVE * size {
        return Vec::new();
    }
    let count = (whole / (CURVE * size)).floor().max(1.0);
    let longest = 0.5 * (0.6 * whole / count).min(ON_CURVE * size);
    let flat = |part: &Stretch| {
        let [a, b] = part.ends();
        part.0.iter().all(|p| distance_to_polyline(*p, &[a, b]) <= BULGE * (b - a).norm())
    };
    let place = |k: u32| {
        let centre = (f64::from(k) + 0.5) * whole / count;
        let halves = [1.0, 0.7, 0.5].map(|share| share * longest);
        halves.iter().map(|half| run.between(centre - half, centre + half)).find(flat).map(|part| part.ends())
    };
    (0..count as u32).filter_map(place).collect()
}

/// The point of a grid that is farthest from the boundary and from the needle's contact, ahead of the needle where the tissue is.
fn innermost(outline: &Polygon, needle: &ImportedNeedle) -> Point2 {
    let (low, high) = outline.bounds();
    let steps = 40;
    let grid = (0..=steps * steps).map(|n| {
        let share = Point2::new(f64::from(n % steps) / f64::from(steps), f64::from(n / steps) / f64::from(steps));
        low + (high - low).component_mul(&share)
    });
    let room = |p: &Point2| {
        if outline.contains(*p) {
            outline.distance_to_boundary(*p).min(distance_to_polyline(*p, &needle.contact))
        } else {
            0.0
        }
    };
    let contact = (needle.contact[needle.contact.len() - 1] - needle.contact[0]).norm();
    let across = Point2::new(needle.axis.y, -needle.axis.x);
    let across = if across.x < 0.0 { -across } else { across };
    let enters = middle(&needle.contact);
    let ahead = |p: &Point2| {
        let way = p - enters;
        let depth = way.dot(&needle.axis);
        depth > 0.0 && depth <= FARTHEST * contact && way.dot(&across).abs() <= 0.5 * contact
    };
    // Of points with as much room the one next to the needle's line.
    let merit = |p: &Point2| room(p) - NEXT * (p - enters).dot(&across).abs();
    let farthest = |a: &Point2, b: &Point2| merit(a).total_cmp(&merit(b));
    let before = grid.clone().filter(ahead).max_by(farthest).filter(|p| room(p) > 0.0);
    let best = before.or_else(|| grid.max_by(farthest)).unwrap_or(low);
    let aside = best + across * (ASIDE * room(&best).min(contact));
    Point2::new(rounded3(aside.x, high.x - low.x), rounded3(aside.y, high.y - low.y))
}

/// A thousandth of `scale`.
fn rounded3(value: f64, scale: f64) -> f64 {
    let step = 10f64.powf(scale.log10().floor() - 2.0);
    (value / step).round() * step
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(points: &[[f64; 2]]) -> Polygon {
        Polygon::new(points.iter().map(|p| Point2::from(*p)).collect()).unwrap()
    }

    fn layout(outline: Polygon) -> Layout {
        Layout::of(&Imported::of(outline, Vec::new()))
    }

    fn length(path: &[Point2]) -> f64 {
        path.windows(2).map(|piece| (piece[1] - piece[0]).norm()).sum()
    }

    fn circle(corners: u32, radius: f64) -> Polygon {
        let angle = |i: u32| std::f64::consts::TAU * (f64::from(i) + 0.3) / f64::from(corners);
        polygon(&(0..corners).map(|i| [radius * angle(i).cos(), radius * angle(i).sin()]).collect::<Vec<_>>())
    }

    /// However finely a circle is drawn, it lies on a part of its lower quarter, and needle and paddles are as large.
    #[test]
    fn on_a_curve_nothing_is_as_small_as_its_edges() {
        for corners in [40, 90, 300] {
            let round = layout(circle(corners, 50.0));
            let held: f64 = round.immobile.iter().map(|path| length(path)).sum();
            assert!((60.0..80.0).contains(&held), "{corners}: a quarter is 78.5, held is {held}");
            assert!(round.immobile.iter().flatten().all(|p| p.y < -30.0));
            assert!((20.0..26.0).contains(&length(&round.contact)), "{:?}", round.contact);
            assert!((middle(&round.contact) - Point2::new(0.0, 50.0)).norm() < 6.0 && round.axis.y < -0.98);
            let sizes: Vec<f64> = round.paddles.iter().map(|(_, ends)| length(ends)).collect();
            assert!(sizes.len() >= 4 && sizes.iter().all(|size| (12.0..24.0).contains(size)), "{corners}: {sizes:?}");
            // Straight under each of them, by no more than the sagitta of the longest.
            let straight = |ends: &[Point2; 2]| round.outline.segment_on_boundary(ends[0], ends[1], 1e-6);
            assert!(round.paddles.iter().all(|(_, ends)| straight(ends)));
            assert!(
                round.straightened.iter().all(|(_, by)| *by < 24.0 * 24.0 / 400.0 + 0.1),
                "{:?}",
                round.straightened
            );
        }
    }

    #[test]
    fn a_body_stands_on_all_its_legs() {
        let legs =
            [[0, 0], [50, 0], [50, 60], [70, 60], [70, 0], [120, 0], [120, 80], [0, 80]].map(|p| p.map(f64::from));
        let table = layout(polygon(&legs));
        let held: Vec<f64> = table.immobile.iter().map(|path| length(path)).collect();
        assert_eq!(held, [50.0, 50.0]);
        // The bridge is what bends.
        assert!(table.depth <= AHEAD * 20.0 + 1e-12, "{}", table.depth);
    }

    /// A target in the middle of a long strip is out of reach of paddles on its ends.
    #[test]
    fn into_a_strip_the_needle_goes_near_an_end() {
        let strip = layout(polygon(&[[0.0, 0.0], [150.0, 0.0], [150.0, 25.0], [0.0, 25.0]]));
        let end =
            strip.paddles.iter().map(|(_, ends)| (middle(ends) - strip.target).norm()).fold(f64::INFINITY, f64::min);
        assert!(end < 25.0 && strip.target.x > 100.0, "{end} {}", strip.target);
        assert!(length(&strip.contact) <= 25.0 + 1e-9);
    }

    #[test]
    fn the_target_is_ahead_of_the_needle_and_aside() {
        let ell = [[0, 0], [120, 0], [120, 50], [50, 50], [50, 100], [0, 100]].map(|p| p.map(f64::from));
        for outline in
            [polygon(&ell), circle(60, 0.03), polygon(&[[0.0, 0.0], [30.0, 0.0], [30.0, 120.0], [0.0, 120.0]])]
        {
            let size = outline.size();
            let Layout { contact, axis, target, .. } = layout(outline);
            let (way, wide) = (target - middle(&contact), length(&contact));
            let across = (way - axis * way.dot(&axis)).norm();
            assert!(way.dot(&axis) > 0.0 && way.dot(&axis) <= FARTHEST * wide, "{way} {wide}");
            assert!(across > 1e-3 * size && across < 0.5 * wide, "{across} of {wide}");
        }
    }

    /// Where a paddle would cut off what is drawn there is none, and where something is in the middle the needle goes beside it.
    #[test]
    fn what_is_drawn_stays_and_is_kept_clear_of() {
        for degrees in (0..180).step_by(4) {
            let towards = f64::from(degrees).to_radians();
            let mut imported = Imported::of(circle(90, 50.0), Vec::new());
            imported.target = Some(Point2::new(towards.cos(), towards.sin()) * 49.4);
            assert!(Layout::of(&imported).outline.contains(imported.target.unwrap()), "{degrees}");
        }
        let mut imported = Imported::of(polygon(&[[0.0, 0.0], [140.0, 0.0], [140.0, 60.0], [0.0, 60.0]]), Vec::new());
        imported.paddles = vec![(1, [[90.0, 60.0], [50.0, 60.0]].map(Point2::from))];
        let needle = Layout::of(&imported);
        assert!(needle.axis.y == -1.0 && length(&needle.contact) > 20.0, "{:?}", needle.contact);
        assert!(needle.contact.iter().all(|p| !(50.0..=90.0).contains(&p.x)));
    }

    /// Three at least on a block with round corners and on polygons with few, two on a slanted strip, and none over another.
    #[test]
    fn round_corners_and_strips_have_paddles_as_well() {
        let arc = |k: u32| (0..=6).map(move |i| std::f64::consts::FRAC_PI_2 * (f64::from(k) + f64::from(i) / 6.0));
        let corner = |k: u32| [[60.0, 25.0], [-60.0, 25.0], [-60.0, -25.0], [60.0, -25.0]][k as usize];
        let on = |k: u32| arc(k).map(move |a| [corner(k)[0] + 5.0 * a.cos(), corner(k)[1] + 5.0 * a.sin()]);
        let rounded = polygon(&(0..4).flat_map(on).collect::<Vec<_>>());
        let slanted = [[0.0, 0.0], [113.0, 113.0], [99.0, 127.0], [-14.0, 14.0]];
        for (outline, least) in [(rounded, 3), (circle(16, 80.0), 3), (circle(17, 80.0), 3), (polygon(&slanted), 2)] {
            let Layout { paddles, .. } = layout(outline);
            assert!(paddles.len() >= least, "{paddles:?}");
            for (k, (_, one)) in paddles.iter().enumerate() {
                let clear = |(_, other): &(u32, [Point2; 2])| !segments_meet(one[0], one[1], other[0], other[1], 1e-3);
                assert!(paddles[k + 1..].iter().all(clear), "{paddles:?}");
            }
        }
    }

    /// A needle that is suggested goes to a target that is given.
    #[test]
    fn a_given_target_is_aimed_at() {
        let mut imported = Imported::of(polygon(&[[0.0, 0.0], [100.0, 0.0], [100.0, 60.0], [0.0, 60.0]]), Vec::new());
        imported.target = Some(Point2::new(75.0, 30.0));
        let Layout { contact, target, .. } = Layout::of(&imported);
        assert!((middle(&contact).x - 75.0).abs() < 3.0 && target.x == 75.0, "{contact:?}");
    }
}
