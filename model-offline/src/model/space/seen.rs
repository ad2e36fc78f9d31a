//! Whether a mesh has what a scene has: small inclusions, bores and slots fall through coarse meshes.

use crate::discretization::TetMesh;
use crate::discretization::meshing::surface_points;
use crate::geometry::implicit::share;
use crate::geometry::surface::Facets;
use crate::geometry::{Implicit, Point};
use crate::random::SplitMix64;
use crate::scene::space::SpaceScene;

/// What is farther away than this part of the edges there is no chord across a curved surface.
const LOST: f64 = 0.3;
/// Beside a point of the surface, at this part of the spacing of such points, there is some of the body.
const BESIDE: f64 = 1e-3;
/// As deep at least as this part of that distance.
const LEAST: f64 = 0.1;
/// An inclusion is seen if elements have this part of its volume.
const SEEN: f64 = 0.5;
/// Volumes are sampled on grids of so many points along each side.
const STEPS: i32 = 24;
/// A volume is known from so many of them.
const FEWEST: usize = 500;
/// How far off such a volume may be, as a part of it.
pub(super) const SAMPLING_ERROR: f64 = 0.03;
/// The surface of a mesh is nowhere farther from the body's than this part of the edges there: with eight edges around
/// a bore it is at 0.1 of them.
const SAG: f64 = 0.1;
/// Nor need it be nearer than this part of the longest edges that the mesh may have: creases that no edge follows are cut
/// at any size.
const NEAR: f64 = 0.05;
/// The same of a measured surface.
const NEAR_MEASURED: f64 = 0.2;

/// Places of the inclusions of which elements have too little, or nothing, without what later ones take of them.
pub(super) fn poorly_seen(scene: &SpaceScene, mesh: &TetMesh) -> Vec<usize> {
    let mut found = vec![0.0; scene.inclusions.len() + 1];
    let volumes = mesh.volumes();
    mesh.part.iter().zip(&volumes).for_each(|(part, volume)| found[*part as usize] += volume);
    (0..scene.inclusions.len())
        .filter(|i| found[i + 1] < SEEN * volume(scene, *i) || found[i + 1] == 0.0 && is_there(scene, *i))
        .collect()
}

/// Points of the body's surface.
#[derive(Debug)]
pub(super) struct BodySurface<'a> {
    body: &'a dyn Implicit,
    points: Vec<Point<3>>,
}

/// Where the surface of a mesh is too far from the body's.
#[derive(Debug, Default)]
pub(super) struct Missed {
    /// Points on one of the two surfaces, too far from the other.
    pub(super) all: Vec<Point<3>>,
    /// Those of them on the body's surface that are so far away that the mesh knows nothing of what they belong to.
    pub(super) lost: Vec<Point<3>>,
}

impl<'a> BodySurface<'a> {
    /// Roughly `spacing` (at a point; length units) apart. However small a bore is, there is a point of it.
    pub(super) fn new(scene: &'a SpaceScene, spacing: &dyn Fn(&Point<3>) -> f64) -> Self {
        let body = scene.body.as_ref();
        let mut points = surface_points(body, body, spacing);
        points.retain(|x| has_inside(body, x, BESIDE * spacing(x)));
        Self { body, points }
    }

    /// What a mesh misses, given how long edges are (at a point, and at most; length units).
    pub(super) fn missed(&self, mesh: &TetMesh, size: &dyn Fn(&Point<3>) -> f64, coarsest: f64) -> Missed {
        let near = coarsest * if self.body.is_measured() { NEAR_MEASURED } else { NEAR };
        let allowed = |x: &Point<3>| (SAG * size(x)).max(near.min(LOST * size(x)));
        let (triangles, mut missed) = (triangles(mesh), Missed::default());
        let middles = triangles.iter().map(|t| t.iter().sum::<Point<3>>() / 3.0);
        missed.all.extend(middles.filter(|x| self.body.level(x).abs() > allowed(x)));
        let facets = Facets::new(triangles.into_iter());
        for x in &self.points {
            let distance = facets.distance(x);
            if distance > allowed(x) {
                missed.all.push(*x);
            }
            if distance > LOST * size(x) {
                missed.lost.push(*x);
            }
        }
        missed
    }

    /// The longest way from one of them to the surface of a mesh, length units.
    pub(super) fn farthest(&self, mesh: &TetMesh) -> f64 {
        let facets = Facets::new(triangles(mesh).into_iter());
        self.points.iter().map(|x| facets.distance(x)).fold(0.0, f64::max)
    }
}

/// Those of a mesh's surface.
fn triangles(mesh: &TetMesh) -> Vec<[Point<3>; 3]> {
    mesh.boundary().into_iter().map(|t| t.map(|n| mesh.nodes[n as usize])).collect()
}

/// Whether any of the body is so near to a point. Where two of its parts share a face, levels vanish although there is
/// nothing: a bore that ends at the surface has such a disc at its mouth.
fn has_inside(body: &dyn Implicit, x: &Point<3>, distance: f64) -> bool {
    (0..6).any(|i| {
        let mut beside = *x;
        beside[i / 2] += if i % 2 == 0 { distance } else { -distance };
        body.level(&beside) < -LEAST * distance
    })
}

/// Whether an inclusion has a volume that no later one takes.
fn is_there(scene: &SpaceScene, place: usize) -> bool {
    share(scene.inclusions[place].region.as_ref(), scene.body.as_ref(), &|x| is_free(scene, place, x))
}

fn is_free(scene: &SpaceScene, place: usize, x: &Point<3>) -> bool {
    scene.inclusions[place + 1..].iter().all(|later| later.region.level(x) > 0.0)
}

/// The volume of an inclusion in the body that no later one takes, sampled; length units cubed.
fn volume(scene: &SpaceScene, place: usize) -> f64 {
    let region = &scene.inclusions[place].region;
    let Some((low, high)) = scene.body.bounds() else { return 0.0 };
    let (low, high) = region.bounds().map_or((low, high), |(l, h)| (low.sup(&l), high.inf(&h)));
    let is_in = |x: &Point<3>| region.level(x) < 0.0 && scene.body.level(x) < 0.0 && is_free(scene, place, x);
    let inside = samples(low, high).filter(is_in).count();
    (high - low).map(|side| side.max(0.0)).product() * inside as f64 / f64::from(STEPS).powi(3)
}

/// The same from a point anywhere in each cell of the grid, which layers and rods of any width and direction are known by to a few per
/// cent; none where too few are in it.
pub(super) fn sampled_volume(scene: &SpaceScene, place: usize) -> Option<f64> {
    let region = &scene.inclusions[place].region;
    let body = scene.body.bounds()?;
    let (low, high) = region.bounds().map_or(body, |(l, h)| (body.0.sup(&l), body.1.inf(&h)));
    let cell = (high - low) / f64::from(STEPS);
    let mut random = SplitMix64(0);
    let mut anywhere = |x: Point<3>| x + cell.map(|side| side * (random.unit() - 0.5));
    let is_in = |x: &Point<3>| region.level(x) < 0.0 && scene.body.level(x) < 0.0 && is_free(scene, place, x);
    let inside = samples(low, high).map(&mut anywhere).filter(is_in).count();
    (inside >= FEWEST).then(|| cell.product() * inside as f64)
}

/// The part of an inclusion that is outside of the body, 0 to 1, sampled; none of what has no end, or is as long as the body: layers
/// are meant to reach beyond it.
pub(super) fn outside(scene: &SpaceScene, place: usize) -> f64 {
    let region = &scene.inclusions[place].region;
    let Some(((low, high), body)) = region.bounds().zip(scene.body.bounds()) else { return 0.0 };
    if (0..3).any(|k| low[k] <= body.0[k] && high[k] >= body.1[k]) {
        return 0.0;
    }
    let all: Vec<Point<3>> = samples(low, high).filter(|x| region.level(x) < 0.0).collect();
    let out = all.iter().filter(|x| scene.body.level(x) > 0.0).count();
    out as f64 / all.len().max(1) as f64
}

/// The middles of the cells of a grid in a box.
fn samples(low: Point<3>, high: Point<3>) -> impl Iterator<Item = Point<3>> {
    let steps = || 0..STEPS;
    let all = steps().flat_map(move |i| steps().flat_map(move |j| steps().map(move |k| [i, j, k])));
    all.map(move |cell| {
        Point::<3>::from_fn(|k, _| low[k] + (high[k] - low[k]) * (f64::from(cell[k]) + 0.5) / f64::from(STEPS))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::space::AnyScene;

    /// `block` with other inclusions.
    fn scene(inclusions: &str) -> SpaceScene {
        let text = include_str!("../../../scenes/block.toml");
        let at = text.find("[[inclusion]]").unwrap();
        let end = at + 1 + text[at + 1..].find("\n[").unwrap();
        let text = format!("{}{inclusions}{}", &text[..at], &text[end..]);
        let AnyScene::Space(scene) = AnyScene::parse(&text, "block.toml").unwrap() else { panic!("planar") };
        *scene
    }

    /// However thin and slanted: half of the block is above z = x, a layer of it 0.065 thick.
    #[test]
    fn layers_are_sampled_as_thick_as_they_are() {
        let layer =
            |from: f64| format!("{{ half_space = {{ point = [0.0, 0.0, {from:?}], normal = [0.0, 0.0, -1.0] }} }}");
        let flat = format!("[[inclusion]]\nsolid = {}\nstiffness = 3.0\n", layer(0.935));
        let slanted = "[[inclusion]]\nsolid = { half_space = { point = [0.0, 0.0, 0.0], normal = [1.0, 0.0, -1.0] } }\nstiffness = 3.0\n";
        for (text, thick) in [(flat.as_str(), 0.065), (slanted, 0.5)] {
            let found = sampled_volume(&scene(text), 0).unwrap();
            assert!((found / thick - 1.0).abs() < 0.04, "{text}: {found}");
            assert_eq!(outside(&scene(text), 0), 0.0);
        }
        // Too thin to say anything of it.
        let wire = "[[inclusion]]\nsolid = { cylinder = { from = [0.2, 0.2, 0.2], to = [0.7, 0.7, 0.7], radius = 0.02 } }\nstiffness = 3.0\n";
        assert_eq!(sampled_volume(&scene(wire), 0), None);
    }

    /// A ball that a later box takes an eighth of, and one that half of is in the body.
    #[test]
    fn volumes_are_those_of_geometry() {
        let ball = |x: f64, y: f64| {
            format!(
                "[[inclusion]]\nellipsoid = {{ centre = [{x:?}, {y:?}, 0.5], semi_axes = [0.1, 0.1, 0.1] }}\nstiffness = 3.0\n"
            )
        };
        let cut = "[[inclusion]]\nbox = { min = [0.3, 0.3, 0.5], max = [0.4, 0.4, 0.7] }\nstiffness = 2.0\n";
        let scene = scene(&(ball(0.3, 0.3) + &ball(1.0, 0.6) + cut));
        let whole = 4.0 / 3.0 * std::f64::consts::PI * 1e-3;
        let found = [0, 1, 2].map(|place| (volume(&scene, place), outside(&scene, place)));
        let near = |a: f64, b: f64| (a - b).abs() < 0.01 * whole;
        for (place, (volume, _)) in found.iter().enumerate() {
            let sampled = sampled_volume(&scene, place).unwrap();
            assert!((sampled / volume - 1.0).abs() < 0.02, "{place}: {sampled} {volume}");
        }
        assert!(near(found[0].0, 7.0 / 8.0 * whole) && found[0].1 == 0.0, "{found:?}");
        assert!(near(found[1].0, 0.5 * whole) && (found[1].1 - 0.5).abs() < 0.01, "{found:?}");
        assert!((found[2].0 - 2e-3).abs() < 1e-12 && found[2].1 == 0.0, "{found:?}");
    }
}
