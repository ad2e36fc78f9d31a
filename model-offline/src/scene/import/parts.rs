//! What lies on the outline or in it: needle, target, paddles and what is fixed, put to where a scene needs them.

use super::ImportedNeedle;
use super::along::{Along, CORNER};
use super::shape::Shape;
use crate::geometry::{Location, Point2, Polygon, cross, distance_to_polyline, nearest_on_loop};
use crate::number::short;
use crate::scene::middle;

/// What is farther off the outline than this part of the body's size is not meant to be on it.
pub(super) const OFF: f64 = 0.05;
/// A needle's contact as part of the edge that it enters: what a starter scene has.
const CONTACT: f64 = 0.3;
/// The shortest contact, part of the body's size: more than the distance of nodes of a starter scene.
const SHORTEST_CONTACT: f64 = 0.06;
/// What lies on the outline within this part of the body's size is meant to run along it.
const ON: f64 = 0.01;

/// What a shape becomes, with what had to be done to it; or why it cannot.
type Placed<T> = Result<(T, Option<String>), String>;

fn share(part: f64) -> String {
    format!("{} % of the body's size", short(100.0 * part))
}

/// The middle of a closed shape, or the end of a line.
pub(super) fn target(along: &Along<'_>, shape: &Shape) -> Result<Point2, String> {
    let outline = along.outline;
    let point = match (shape.closed, Polygon::new(shape.points.clone())) {
        (true, Ok(polygon)) => polygon.centroid(),
        (true, Err(_)) => shape.points.iter().sum::<Point2>() / (shape.points.len() as f64),
        (false, _) => *shape.points.last().ok_or("it has no point")?,
    };
    match outline.locate(point, 1e-9 * along.size) {
        Location::Inside => Ok(point),
        Location::OnBoundary => Err("it is on the boundary; put the target into the body".to_owned()),
        Location::Outside => {
            let (_, off) = along.station(point);
            Err(format!("it is outside the body, {} off; put the target into it", share(off / along.size)))
        }
    }
}

/// The part of one edge that a line runs along.
pub(super) fn paddle(along: &Along<'_>, shape: &Shape) -> Placed<[Point2; 2]> {
    let [a, b] = shape.ends().ok_or("it has no points")?;
    let whole = (b - a).norm();
    let mut nearest = f64::INFINITY;
    let mut best: Option<(f64, [Point2; 2])> = None;
    for (start, end) in along.outline.edges() {
        let edge = end - start;
        let length = edge.norm();
        let direction = edge / length;
        let way = [a, b].map(|p| (p - start).dot(&direction));
        let clipped = way.map(|s| if s < CORNER * along.size { 0.0 } else { s }).map(|s| s.min(length));
        let clipped = clipped.map(|s| if length - s < CORNER * along.size { length } else { s });
        let covered = (clipped[1] - clipped[0]).abs();
        // How far off the line is where it runs beside the edge.
        let off = clipped.map(|s| {
            let part = if way[1] == way[0] { 0.0 } else { ((s - way[0]) / (way[1] - way[0])).clamp(0.0, 1.0) };
            (a + (b - a) * part - (start + direction * s)).norm()
        });
        let off = off[0].max(off[1]);
        if covered > 0.0 {
            nearest = nearest.min(off);
        }
        if off <= OFF * along.size && best.is_none_or(|(most, _)| covered > most) {
            best = Some((covered, clipped.map(|s| start + direction * s)));
        }
    }
    let (_, to_outline) = along.station(0.5 * (a + b));
    match best {
        Some((covered, ends)) if covered > CORNER * along.size => {
            // Lines that are drawn across an edge or past its end lose what is not on it.
            let lost = whole > (1.0 + 2.0 * ON) * covered;
            let percent = short((100.0 * covered / whole).round());
            Ok((ends, lost.then(|| format!("{percent} % of it are on one edge, the rest is cut off"))))
        }
        Some(_) => Err("it covers no part of an edge of the outline; draw it along one".to_owned()),
        None => {
            let off = if nearest.is_finite() { nearest.max(to_outline) } else { to_outline };
            Err(format!(
                "it is {} off every edge that it runs along, more than {} %; draw it on the outline",
                share(off / along.size),
                100.0 * OFF
            ))
        }
    }
}

/// Parts of the boundary that a line runs along, or that are in a closed shape.
pub(super) fn fixed(along: &Along<'_>, shape: &Shape) -> Result<Vec<Vec<Point2>>, String> {
    if shape.closed
        && let Ok(polygon) = Polygon::new(shape.points.clone())
    {
        let parts = inside(along, &polygon);
        return if parts.is_empty() {
            Err("no part of the boundary is inside it; draw it across the outline, or a line along it".to_owned())
        } else {
            Ok(parts)
        };
    }
    let [a, b] = shape.ends().ok_or("it has no points")?;
    let ([from, off_from], [to, off_to]) = ([a, b].map(|p| along.station(p))).map(|(s, off)| [s, off]).into();
    let off = off_from.max(off_to);
    if off > OFF * along.size {
        return Err(format!("it ends {} off the outline; draw it along the outline", share(off / along.size)));
    }
    let ways = [along.part(from, to), along.part(to, from)];
    // The way around the body on which the outline is nearest to the line.
    let far = |way: &Vec<Point2>| {
        let on_way = way.windows(2).flat_map(|s| (0..=4).map(|i| s[0] + (s[1] - s[0]) * (f64::from(i) / 4.0)));
        let from_way = on_way.map(|p| distance_to_polyline(p, &shape.points)).fold(0.0, f64::max);
        shape.points.iter().map(|p| distance_to_polyline(*p, way)).fold(from_way, f64::max)
    };
    let [one, other] = ways.each_ref().map(far);
    let [first, second] = ways;
    let path = if one <= other { first } else { second };
    let length: f64 = path.windows(2).map(|s| (s[1] - s[0]).norm()).sum();
    if length <= CORNER * along.size {
        return Err("it covers no part of the boundary; draw it along the outline".to_owned());
    }
    if one.min(other) > 2.0 * OFF * along.size {
        let off = share(one.min(other) / along.size);
        return Err(format!("between its ends it is {off} off the outline; draw it along the outline"));
    }
    Ok(vec![path])
}

/// The parts of the boundary that are in a shape, or on its own boundary.
fn inside(along: &Along<'_>, shape: &Polygon) -> Vec<Vec<Point2>> {
    let mut stations = Vec::new();
    let mut start = 0.0;
    for (a, b) in along.outline.edges() {
        let length = (b - a).norm();
        stations.push(start);
        for (c, d) in shape.edges() {
            let by = cross(b - a, d - c);
            let (s, t) = (cross(c - a, d - c) / by, cross(c - a, b - a) / by);
            if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
                stations.push(along.at_corner(start + s * length));
            }
        }
        start += length;
    }
    // Beside an edge that it shares, a shape crosses nothing.
    stations.extend(shape.vertices().iter().map(|v| along.station(*v)).filter(|s| s.1 <= ON * along.size).map(|s| s.0));
    stations.iter_mut().for_each(|s| *s = s.rem_euclid(along.length));
    stations.sort_by(f64::total_cmp);
    stations.dedup_by(|a, b| (*a - *b).abs() < 1e-9 * along.length);
    let count = stations.len();
    let end = |i: usize| if i + 1 < count { stations[i + 1] } else { stations[0] + along.length };
    let is_in = |i: usize| {
        let middle = along.point(0.5 * (stations[i] + end(i)));
        shape.locate(middle, 0.2 * ON * along.size) != Location::Outside
    };
    let inside: Vec<bool> = (0..count).map(is_in).collect();
    if inside.iter().all(|is| *is) {
        let mut around = along.part(0.0, 0.5 * along.length);
        around.pop();
        return vec![[around, along.part(0.5 * along.length, 0.0)].concat()];
    }
    let begins = (0..count).filter(|i| inside[*i] && !inside[(*i + count - 1) % count]);
    let parts = begins.map(|first| {
        let last = (first..first + count).take_while(|i| inside[i % count]).last().unwrap_or(first);
        (stations[first], end(last % count))
    });
    let long = parts.filter(|(from, to)| (to - from).rem_euclid(along.length) > CORNER * along.size);
    long.map(|(from, to)| along.part(from, to)).collect()
}

/// A line from outside to the tip, or along the boundary: there it is the contact itself.
pub(super) fn needle(along: &Along<'_>, shape: &Shape) -> Placed<ImportedNeedle> {
    let outline = along.outline;
    let on_boundary = shape.points.iter().all(|p| outline.distance_to_boundary(*p) <= ON * along.size);
    if on_boundary && !shape.closed {
        return on_contact(along, shape);
    }
    let [first, last] = shape.ends().ok_or("it has no points")?;
    let depth = |p: Point2| {
        let distance = nearest_on_loop(outline.vertices(), p).map_or(0.0, |near| near.distance);
        if outline.contains(p) { distance } else { -distance }
    };
    // A closed shape has no direction: its tip is what is deeper inside.
    let turned = depth(first) > 0.0 && depth(last) < 0.0 || shape.closed && depth(first) > depth(last);
    let (mut line, mut note) = (if shape.closed { vec![first, last] } else { shape.points.clone() }, None);
    if turned {
        line.reverse();
        note = (!shape.closed).then(|| "drawn from its tip outwards, and turned round".to_owned());
    }
    let (begin, tip) = (line[0], line[line.len() - 1]);
    if depth(tip) <= 0.0 {
        return Err("its tip is not in the body; draw it from outside to where the tip shall be".to_owned());
    }
    let entry = match entry(outline, &line) {
        Some(entry) => entry,
        None => {
            // It begins inside: it came in where the line, backwards, comes out.
            let back = (begin - tip).normalize();
            let way = outline.way_inside(begin, back, 1e-9 * along.size).unwrap_or(0.0);
            note = Some("it begins in the body, and enters where its line does".to_owned());
            begin + back * way
        }
    };
    if (tip - entry).norm() <= CORNER * along.size {
        return Err("it hardly reaches into the body; draw it to where the tip shall be".to_owned());
    }
    if line.windows(2).map(|s| (s[1] - s[0]).norm()).sum::<f64>() > (1.0 + ON) * (tip - begin).norm() {
        note = Some("it is bent: its axis is straight from where it enters to its tip".to_owned());
    }
    let (station, _) = along.station(entry);
    let contact = contact(along, station);
    // Scenes have it enter in the middle of its contact, and its tip is what it was drawn for.
    let enters = middle(&contact);
    let moved = (enters - entry).norm() / along.size;
    if moved > CORNER {
        let aside = format!("it enters {} further from the corner, where its contact has room", share(moved));
        note = Some(note.map_or_else(|| aside.clone(), |before| format!("{before}; {aside}")));
    }
    let way = tip - enters;
    Ok((ImportedNeedle { contact, axis: way.normalize(), most: way.norm() }, note))
}

/// Where a line first comes in.
fn entry(outline: &Polygon, line: &[Point2]) -> Option<Point2> {
    for piece in line.windows(2) {
        let way = piece[1] - piece[0];
        let mut crossings: Vec<f64> = outline
            .edges()
            .filter_map(|(c, d)| {
                let by = cross(way, d - c);
                let (s, t) = (cross(c - piece[0], d - c) / by, cross(c - piece[0], way) / by);
                ((0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t)).then_some(s)
            })
            .collect();
        crossings.sort_by(f64::total_cmp);
        let ends = crossings.iter().copied().skip(1).chain([1.0]);
        let comes_in = |(from, to): &(f64, f64)| to > from && outline.contains(piece[0] + way * (0.5 * (from + to)));
        if let Some((at, _)) = crossings.iter().copied().zip(ends).find(comes_in) {
            return Some(piece[0] + way * at);
        }
    }
    None
}

/// The boundary around an entry: within the edge where that is long enough, and as long on both sides. Only where a
/// corner leaves less than the shortest contact is it not the middle.
fn contact(along: &Along<'_>, entry: f64) -> Vec<Point2> {
    let (_, start, end) = along.edge(entry);
    let entry = entry.rem_euclid(along.length);
    let shortest = SHORTEST_CONTACT * along.size;
    let length = (CONTACT * (end - start)).max(shortest).min(0.5 * along.length);
    // Not to the corner itself, where it could touch what is on the next edge.
    let margin = 0.02 * (end - start);
    if length + 2.0 * margin <= end - start {
        let room = 2.0 * (entry - start).min(end - entry) - 2.0 * margin;
        let length = length.min(room.max(shortest));
        let from = (entry - 0.5 * length).clamp(start + margin, end - margin - length);
        return along.part(from, from + length);
    }
    let from = entry - 0.5 * length;
    along.part(along.at_corner(from), along.at_corner(from + length))
}

/// A line on the boundary is the contact, and the needle goes straight in.
fn on_contact(along: &Along<'_>, shape: &Shape) -> Placed<ImportedNeedle> {
    let path = fixed(along, shape)?.into_iter().next().ok_or("it covers no part of the boundary")?;
    let (first, last) = (path[0], path[path.len() - 1]);
    let chord = (last - first).norm();
    if chord <= CORNER * along.size {
        return Err("it covers no part of the boundary; draw it along the outline".to_owned());
    }
    let normal = Point2::new(first.y - last.y, last.x - first.x) / chord;
    let length: f64 = path.windows(2).map(|s| (s[1] - s[0]).norm()).sum();
    let middle = path_point(&path, 0.5 * length);
    let is_inwards = along.outline.contains(middle + normal * (1e-3 * along.size));
    let axis = if is_inwards { normal } else { -normal };
    let most = along.outline.way_inside(middle, axis, 1e-6 * along.size).unwrap_or(along.size);
    Ok((
        ImportedNeedle { contact: path, axis, most },
        Some("on the boundary: its contact, and it goes straight in".to_owned()),
    ))
}

/// The point at a way along a line.
fn path_point(path: &[Point2], mut way: f64) -> Point2 {
    for piece in path.windows(2) {
        let length = (piece[1] - piece[0]).norm();
        if way <= length && length > 0.0 {
            return piece[0] + (piece[1] - piece[0]) * (way / length);
        }
        way -= length;
    }
    path[path.len() - 1]
}

#[cfg(test)]
mod tests {
    use super::super::role::Meaning;
    use super::*;

    fn block() -> Polygon {
        Polygon::new([[0.0, 0.0], [100.0, 0.0], [100.0, 60.0], [0.0, 60.0]].map(Point2::from).to_vec()).unwrap()
    }

    fn shape(points: &[[f64; 2]], closed: bool) -> Shape {
        let points = points.iter().map(|p| Point2::from(*p)).collect();
        Shape::new(String::new(), Meaning::default(), points, closed)
    }

    fn is(path: &[Point2], expected: &[[f64; 2]]) -> bool {
        let equal = |a: &[Point2]| a.iter().zip(expected).all(|(a, b)| (a - Point2::from(*b)).norm() < 1e-6);
        let back: Vec<Point2> = path.iter().rev().copied().collect();
        path.len() == expected.len() && (equal(path) || equal(&back))
    }

    #[test]
    fn a_needle_enters_where_it_crosses_the_outline() {
        let block = block();
        let along = Along::new(&block);
        let at = |points: &[[f64; 2]]| needle(&along, &shape(points, false)).unwrap();
        let (straight, note) = at(&[[50.0, 90.0], [50.0, 20.0]]);
        assert!(is(&straight.contact, &[[35.0, 60.0], [65.0, 60.0]]), "{:?}", straight.contact);
        assert_eq!((straight.axis, straight.most, note), (Point2::new(0.0, -1.0), 40.0, None));
        // Near a corner the contact stays on its edge, and gets shorter: the needle enters where it was drawn.
        let (corner, note) = at(&[[90.0, 90.0], [90.0, 20.0]]);
        assert!(is(&corner.contact, &[[82.0, 60.0], [98.0, 60.0]]) && note.is_none(), "{corner:?} {note:?}");
        assert_eq!((corner.axis, corner.most), (Point2::new(0.0, -1.0), 40.0));
        // Nearer it is moved, says so, and still aims at its tip.
        let (moved, note) = at(&[[98.5, 90.0], [98.5, 20.0]]);
        let enters = middle(&moved.contact);
        assert!(enters.x < 98.0 && note.unwrap().contains("further from the corner"), "{moved:?}");
        assert!((enters + moved.axis * moved.most - Point2::new(98.5, 20.0)).norm() < 1e-9);
        let (slant, _) = at(&[[0.0, 100.0], [60.0, 40.0]]);
        assert!(
            (slant.axis - Point2::new(1.0, -1.0).normalize()).norm() < 1e-12
                && (slant.most - 800f64.sqrt()).abs() < 1e-9
        );
        // The other way round, from inside, bent, as a thin shape, and on the boundary.
        let (turned, note) = at(&[[50.0, 20.0], [50.0, 90.0]]);
        assert!(turned == straight && note.unwrap().contains("turned"));
        let (inside, note) = at(&[[50.0, 50.0], [50.0, 20.0]]);
        assert!(inside == straight && note.unwrap().contains("begins in the body"));
        let (bent, note) = at(&[[20.0, 90.0], [50.0, 70.0], [50.0, 20.0]]);
        assert!(bent == straight && note.unwrap().contains("bent"));
        let thin = shape(&[[49.0, 20.0], [51.0, 20.0], [51.0, 90.0], [49.0, 90.0]], true);
        assert_eq!(needle(&along, &thin).unwrap().0, straight);
        let (on, _) = at(&[[40.0, 60.1], [60.0, 60.0]]);
        assert!(is(&on.contact, &[[40.0, 60.0], [60.0, 60.0]]) && on.axis == Point2::new(0.0, -1.0), "{on:?}");
        assert!((on.most - 60.0).abs() < 1e-9);
        assert!(needle(&along, &shape(&[[50.0, 90.0], [50.0, 59.9]], false)).unwrap_err().contains("hardly"));
    }

    /// On a curve an edge is too short for a contact.
    #[test]
    fn a_contact_on_a_curve_goes_around_its_corners() {
        let circle: Vec<Point2> =
            (0..60).map(|i| f64::from(i) * 0.1047197551).map(|a| Point2::new(a.cos(), a.sin()) * 50.0).collect();
        let circle = Polygon::new(circle).unwrap();
        let along = Along::new(&circle);
        let (needle, _) = needle(&along, &shape(&[[3.0, 80.0], [0.0, 0.0]], false)).unwrap();
        let length: f64 = needle.contact.windows(2).map(|s| (s[1] - s[0]).norm()).sum();
        assert!(
            (length / along.size - SHORTEST_CONTACT).abs() < 0.01 && needle.contact.len() > 2,
            "{:?}",
            needle.contact
        );
        assert!(needle.contact.iter().all(|p| circle.distance_to_boundary(*p) < 1e-9));
    }

    #[test]
    fn a_paddle_is_put_onto_the_edge_that_it_covers_most() {
        let block = block();
        let along = Along::new(&block);
        let at = |points: &[[f64; 2]], closed: bool| paddle(&along, &shape(points, closed)).unwrap();
        let (on, note) = at(&[[20.0, -1.0], [40.0, 1.0]], false);
        assert!(is(&on, &[[20.0, 0.0], [40.0, 0.0]]) && note.is_none(), "{on:?} {note:?}");
        // Past the corner: what is on one edge.
        let (cut, note) = at(&[[80.0, -2.0], [120.0, -2.0]], false);
        assert!(is(&cut, &[[80.0, 0.0], [100.0, 0.0]]) && note.unwrap().contains("50 %"), "{cut:?}");
        let (thin, _) = at(&[[101.0, 10.0], [104.0, 10.0], [104.0, 30.0], [101.0, 30.0]], true);
        assert!(is(&thin, &[[100.0, 10.0], [100.0, 30.0]]), "{thin:?}");
        let off = paddle(&along, &shape(&[[20.0, 20.0], [40.0, 20.0]], false)).unwrap_err();
        assert!(off.contains("17.15 % of the body's size off"), "20 of 116.6: {off}");
    }

    #[test]
    fn what_is_fixed_is_a_part_of_the_boundary() {
        let block = block();
        let along = Along::new(&block);
        let at = |points: &[[f64; 2]], closed: bool| fixed(&along, &shape(points, closed)).unwrap();
        let line = at(&[[10.0, 1.0], [90.0, -1.0]], false);
        assert!(line.len() == 1 && is(&line[0], &[[10.0, 0.0], [90.0, 0.0]]), "{line:?}");
        // Around a corner, and the long way round where the line goes there.
        let corner = at(&[[80.0, 0.0], [100.0, 1.0], [101.0, 20.0]], false);
        assert!(is(&corner[0], &[[80.0, 0.0], [100.0, 0.0], [100.0, 20.0]]), "{corner:?}");
        let around = at(&[[80.0, 0.0], [0.0, 0.0], [0.0, 60.0], [100.0, 60.0], [100.0, 20.0]], false);
        assert!(is(&around[0], &[[80.0, 0.0], [0.0, 0.0], [0.0, 60.0], [100.0, 60.0], [100.0, 20.0]]), "{around:?}");
        // A bone across the boundary, one beside it, one around a corner and two feet of one.
        let across = at(&[[20.0, -10.0], [50.0, -10.0], [50.0, 10.0], [20.0, 10.0]], true);
        assert!(across.len() == 1 && is(&across[0], &[[20.0, 0.0], [50.0, 0.0]]), "{across:?}");
        let beside = at(&[[20.0, -10.0], [50.0, -10.0], [50.0, 0.0], [20.0, 0.0]], true);
        assert!(beside.len() == 1 && is(&beside[0], &[[20.0, 0.0], [50.0, 0.0]]), "{beside:?}");
        let origin = at(&[[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]], true);
        assert!(origin.len() == 1 && is(&origin[0], &[[9.0, 0.0], [0.0, 0.0], [0.0, 9.0]]), "{origin:?}");
        let feet = at(
            &[
                [10.0, 5.0],
                [10.0, -9.0],
                [90.0, -9.0],
                [90.0, 5.0],
                [70.0, 5.0],
                [70.0, -5.0],
                [30.0, -5.0],
                [30.0, 5.0],
            ],
            true,
        );
        assert!(feet.len() == 2 && feet.iter().all(|f| (f[0] - f[1]).norm() == 20.0), "{feet:?}");
    }

    #[test]
    fn a_target_is_the_middle_of_its_shape_or_the_end_of_its_line() {
        let block = block();
        let along = Along::new(&block);
        let square = shape(&[[40.0, 20.0], [50.0, 20.0], [50.0, 30.0], [40.0, 30.0]], true);
        assert_eq!(target(&along, &square), Ok(Point2::new(45.0, 25.0)));
        assert_eq!(target(&along, &shape(&[[40.0, 90.0], [50.0, 20.0]], false)), Ok(Point2::new(50.0, 20.0)));
    }
}
