//! Whether a mesh has a scene's inclusions: small ones fall through coarse meshes.

use crate::discretization::TetMesh;
use crate::geometry::Point;
use crate::geometry::implicit::share;
use crate::scene::space::SpaceScene;

/// An inclusion is seen if elements have this part of its volume.
const SEEN: f64 = 0.5;
/// Volumes are sampled on grids of so many points along each side.
const STEPS: i32 = 24;

/// Places of the inclusions of which elements have too little, or nothing, without what later ones take of them.
pub(super) fn poorly_seen(scene: &SpaceScene, mesh: &TetMesh) -> Vec<usize> {
    let mut found = vec![0.0; scene.inclusions.len() + 1];
    let volumes = mesh.volumes();
    mesh.part.iter().zip(&volumes).for_each(|(part, volume)| found[*part as usize] += volume);
    (0..scene.inclusions.len())
        .filter(|i| found[i + 1] < SEEN * volume(scene, *i) || found[i + 1] == 0.0 && is_there(scene, *i))
        .collect()
}

/// Whether an inclusion has a volume that no later one takes.
fn is_there(scene: &SpaceScene, place: usize) -> bool {
    share(scene.inclusions[place].region.as_ref(), scene.body.as_ref(), &|x| is_free(scene, place, x))
}

fn is_free(scene: &SpaceScene, place: usize, x: &Point<3>) -> bool {
    scene.inclusions[place + 1..].iter().all(|later| later.region.level(x) > 0.0)
}

/// The volume of an inclusion in the body that no later one takes, sampled.
fn volume(scene: &SpaceScene, place: usize) -> f64 {
    let region = &scene.inclusions[place].region;
    let Some((low, high)) = scene.body.bounds() else { return 0.0 };
    let (low, high) = region.bounds().map_or((low, high), |(l, h)| (low.sup(&l), high.inf(&h)));
    let steps = || 0..STEPS;
    let all = steps().flat_map(|i| steps().flat_map(move |j| steps().map(move |k| [i, j, k])));
    let at = |cell: [i32; 3]| {
        Point::<3>::from_fn(|k, _| low[k] + (high[k] - low[k]) * (f64::from(cell[k]) + 0.5) / f64::from(STEPS))
    };
    let is_in = |x: &Point<3>| region.level(x) < 0.0 && scene.body.level(x) < 0.0 && is_free(scene, place, x);
    let inside = all.filter(|cell| is_in(&at(*cell))).count();
    (high - low).map(|side| side.max(0.0)).product() * inside as f64 / f64::from(STEPS).powi(3)
}
