use super::solids::{cube, cuboid, flipped, sphere, tetrahedron, together};
use super::*;
use crate::geometry::Implicit as _;
use crate::random::SplitMix64;

/// Distance to the surface of a box, negative inside.
fn of_box(x: &Point<3>, low: f64, high: f64) -> f64 {
    let out = x.map(|c| (low - c).max(c - high));
    if out.max() <= 0.0 { out.max() } else { out.map(|c| c.max(0.0)).norm() }
}

/// But for rounding.
fn is(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 1e-12 * expected.abs()
}

fn has_note(surface: &CheckedSurface, words: &str) -> bool {
    surface.notes().iter().any(|note| note.contains(words))
}

#[test]
fn level_of_a_cube_is_the_distance_to_it() {
    let checked = cube(-1.0, 2.0).check().unwrap();
    let mut random = SplitMix64(1);
    for _ in 0..20_000 {
        let x = Point::<3>::from_fn(|_, _| 0.5 + 4.0 * random.symmetric());
        let (level, expected) = (checked.level(&x), of_box(&x, -1.0, 2.0));
        assert!((level - expected).abs() < 1e-12, "{x}: {level} is not {expected}");
    }
    // On edges' and corners' normals, where faces alone do not say which side it is.
    for x in [[3.0, 3.0, 0.0], [3.0, 3.0, 3.0], [-2.0, -2.0, -2.0], [2.0, 2.0, 2.5]].map(Point::<3>::from) {
        assert!((checked.level(&x) - of_box(&x, -1.0, 2.0)).abs() < 1e-12, "{x}");
    }
    assert_eq!(checked.level(&Point::<3>::new(2.0, 0.1, 0.2)), 0.0);
    assert_eq!(checked.level(&Point::<3>::new(f64::NAN, 0.0, 0.0)), f64::INFINITY);
}

#[test]
fn the_gradient_is_the_slope_of_the_level_and_one_long() {
    let checked = sphere(10.0, 3).check().unwrap();
    let mut random = SplitMix64(2);
    for _ in 0..500 {
        let x = Point::<3>::from_fn(|_, _| 14.0 * random.symmetric());
        let gradient = checked.gradient(&x);
        assert!((gradient.norm() - 1.0).abs() < 1e-12);
        let slope = (checked.level(&(x + gradient * 1e-4)) - checked.level(&(x - gradient * 1e-4))) / 2e-4;
        // Inside, two faces may be equally near between both points.
        assert!((slope - 1.0).abs() < 1e-6 || checked.level(&x) < 0.0, "{x}: {slope}");
        assert!((checked.level(&(x - gradient * checked.level(&x)))).abs() < 1e-9);
    }
    let on = Point::<3>::new(0.3, 2.0, 0.1);
    let normal = cube(-1.0, 2.0).check().unwrap().gradient(&on);
    assert!((normal - Point::<3>::new(0.0, 1.0, 0.0)).norm() < 1e-12, "{normal}");
}

/// A spike whose tip's faces say the wrong side far from it; the pseudonormal says the right one.
#[test]
fn beyond_a_sharp_tip_is_outside() {
    let mut spike = tetrahedron();
    spike.vertices[3] = Point::<3>::new(40.0, 0.5, 1.0);
    let checked = spike.check().unwrap();
    let mut random = SplitMix64(3);
    for _ in 0..2000 {
        let x = Point::<3>::new(41.0 + 20.0 * random.unit(), 20.0 * random.symmetric(), 20.0 * random.symmetric());
        assert!(checked.level(&x) > 0.0, "{x}");
    }
}

#[test]
fn solids_have_their_volumes() {
    for (solid, volume, within) in [
        (cube(0.0, 2.0), 8.0, 1e-12),
        (tetrahedron(), 10.0, 1e-12),
        (sphere(10.0, 4), 4.0 / 3.0 * std::f64::consts::PI * 1e3, 0.03),
    ] {
        let checked = solid.check().unwrap();
        assert!((checked.volume() / volume - 1.0).abs() < within, "{}", checked.volume());
        assert_eq!(checked.components(), 1);
        assert!(!has_note(&checked, "turned") && !has_note(&checked, "left out"), "{:?}", checked.notes());
    }
}

#[test]
fn a_flipped_face_is_turned_and_noted() {
    let mut solid = sphere(5.0, 2);
    // The first one, too: its neighbours are not what is wrong.
    solid.triangles[0].swap(0, 1);
    solid.triangles[7].swap(0, 1);
    let checked = solid.check().unwrap();
    assert!(has_note(&checked, "2 triangles faced the other way"), "{:?}", checked.notes());
    assert!(is(checked.volume(), sphere(5.0, 2).check().unwrap().volume()));
}

#[test]
fn a_surface_that_faces_inwards_is_turned_as_a_whole_and_noted() {
    let checked = flipped(cube(0.0, 2.0)).check().unwrap();
    assert!(has_note(&checked, "turned as a whole"), "{:?}", checked.notes());
    assert!(is(checked.volume(), 8.0));
    assert!(checked.level(&Point::<3>::repeat(1.0)) < 0.0);
}

#[test]
fn a_hole_is_named_with_its_place_and_width() {
    let mut solid = cube(0.0, 2.0);
    // Half of the face z = 2: corners (0, 0, 2), (2, 0, 2), (2, 2, 2).
    solid.triangles.remove(2);
    let Err(SurfaceError::Open { gaps }) = solid.check() else { panic!() };
    let [gap] = gaps[..] else { panic!("{gaps:?}") };
    let rim = 4.0 + 8.0_f64.sqrt();
    assert!((gap.rim - rim).abs() < 1e-12 && gap.edges == 3, "{gap:?}");
    assert!((gap.width - 4.0 * 2.0 / rim).abs() < 1e-12, "{gap:?}");
    assert!(gap.at.z == 2.0 && gap.at.x >= gap.at.y, "{gap:?}");
    let told = SurfaceError::Open { gaps }.to_string();
    assert!(told.contains("1 place") && told.contains("rim of 3 edges"), "{told}");
}

/// A seam whose sides are a little apart, as exporters leave them: named as wide as it is, and not closed.
#[test]
fn a_slit_is_as_wide_as_its_sides_are_apart() {
    let mut solid = cube(0.0, 20.0);
    // The face z = 20 has its own corners, one of them off by 0.003.
    let first = solid.vertices.len() as u32;
    solid.vertices.extend([4, 5, 7, 6].map(|v: usize| solid.vertices[v]));
    solid.vertices[first as usize + 2].x += 0.003;
    solid.triangles[2] = [first, first + 1, first + 2];
    solid.triangles[3] = [first, first + 2, first + 3];
    let Err(SurfaceError::Open { gaps }) = solid.check() else { panic!() };
    let [gap] = gaps[..] else { panic!("{gaps:?}") };
    assert!((gap.width - 0.003).abs() < 1e-5, "{gap:?}");
    assert_eq!(gap.edges, 4);
}

#[test]
fn two_parts_are_two_parts_and_a_cavity_is_one() {
    let apart = together(&cube(0.0, 1.0), &cube(3.0, 5.0)).check().unwrap();
    assert!(apart.components() == 2 && is(apart.volume(), 9.0));
    assert!(has_note(&apart, "2 separate closed parts"));
    let hollow = together(&cube(0.0, 4.0), &flipped(cube(1.0, 2.0))).check().unwrap();
    assert!(hollow.components() == 2 && is(hollow.volume(), 63.0));
    assert!(hollow.level(&Point::<3>::repeat(1.5)) > 0.0 && hollow.level(&Point::<3>::repeat(0.9)) < 0.0);
    let inside_out = flipped(together(&cube(0.0, 4.0), &flipped(cube(1.0, 2.0)))).check().unwrap();
    assert!(is(inside_out.volume(), 63.0));
    let nested = together(&cube(0.0, 4.0), &cube(1.0, 2.0)).check();
    assert!(matches!(nested, Err(SurfaceError::Nested { at }) if at == Point::<3>::repeat(1.0)), "{nested:?}");
}

#[test]
fn parts_that_cut_or_overlap_are_refused_with_the_place() {
    let at = |other: &TriangleSurface| match together(&cube(0.0, 2.0), other).check() {
        Err(SurfaceError::SelfIntersection { at, .. }) => at,
        other => panic!("{other:?}"),
    };
    // Both surfaces meet there: the point is on both.
    let cut = at(&cube(1.0, 3.0));
    assert!(of_box(&cut, 0.0, 2.0).abs() < 1e-12 && of_box(&cut, 1.0, 3.0).abs() < 1e-12, "{cut}");
    let turned = at(&cuboid([0.5, 0.5, -1.0], [1.5, 1.5, 3.0]));
    assert!(of_box(&turned, 0.0, 2.0).abs() < 1e-12, "{turned}");
    // Face on face, a corner region only: no edge goes through a face.
    let stacked = at(&cuboid([1.0, 1.0, 2.0], [3.0, 3.0, 4.0]));
    assert!(stacked.z == 2.0 && stacked.x >= 1.0 && stacked.x <= 2.0, "{stacked}");
    // A corner on a face.
    let mut tip = tetrahedron();
    tip.vertices = [[0.5, 0.7, 2.0], [0.0, 0.0, 3.0], [1.0, 0.0, 3.0], [0.5, 1.0, 3.0]].map(Point::<3>::from).to_vec();
    assert!((at(&tip) - Point::<3>::new(0.5, 0.7, 2.0)).norm() < 1e-12);
}

#[test]
fn a_dent_that_goes_through_the_other_side_is_refused() {
    let mut solid = sphere(5.0, 2);
    let top = solid.vertices.iter().position(|x| x.z == 5.0).unwrap();
    solid.vertices[top].z = -3.0;
    assert!(solid.check().is_ok());
    solid.vertices[top].z = -6.0;
    let Err(SurfaceError::SelfIntersection { at, .. }) = solid.check() else { panic!() };
    assert!(at.z < -4.0, "{at}");
}

/// Rounding to single precision on turned faces must not look like cuts.
#[test]
fn turned_solids_do_not_meet_themselves() {
    let turn = nalgebra::Rotation3::from_euler_angles(0.3, 1.1, -0.7);
    for (solid, shift) in [(cube(-1.0, 1.0), 0.0), (sphere(3.0, 3), 0.0), (sphere(3.0, 3), 1000.0)] {
        let mut solid = solid;
        for x in &mut solid.vertices {
            *x = (turn * *x).add_scalar(shift).map(|c| f64::from(c as f32));
        }
        solid.check().unwrap();
    }
}

#[test]
fn edges_of_three_triangles_and_one_sided_surfaces_are_refused() {
    // Two cubes with one edge in common.
    let touching = together(&cube(0.0, 1.0), &cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 1.0])).check();
    let edge = [[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]].map(Point::<3>::from);
    let is_edge = |found: [Point<3>; 2]| found == edge || found == [edge[1], edge[0]];
    assert!(matches!(touching, Err(SurfaceError::Branching { edge, triangles: 4 }) if is_edge(edge)), "{touching:?}");
    // The projective plane of six vertices: closed, with one side.
    let triangles = vec![
        [0, 1, 2],
        [0, 2, 3],
        [0, 3, 4],
        [0, 4, 5],
        [0, 5, 1],
        [1, 2, 4],
        [2, 3, 5],
        [3, 4, 1],
        [4, 5, 2],
        [5, 1, 3],
    ];
    let mut random = SplitMix64(5);
    let vertices = (0..6).map(|_| Point::<3>::from_fn(|_, _| random.unit())).collect();
    let plane = TriangleSurface { vertices, triangles }.check();
    assert!(matches!(plane, Err(SurfaceError::OneSided { .. })), "{plane:?}");
}

#[test]
fn triangles_without_area_are_left_out_and_noted() {
    let mut solid = cube(0.0, 2.0);
    solid.triangles.push([1, 1, 4]);
    let checked = solid.check().unwrap();
    assert!(has_note(&checked, "1 triangles without area"), "{:?}", checked.notes());
    assert_eq!(checked.surface().triangles.len(), 12);
    // The middle of an edge, with a flat triangle that joins its halves to the whole.
    let mut solid = cube(0.0, 2.0);
    let [a, b, c] = solid.triangles[0];
    let middle = solid.vertices.len() as u32;
    solid.vertices.push((solid.vertices[a as usize] + solid.vertices[b as usize]) * 0.5);
    solid.triangles[0] = [a, middle, c];
    solid.triangles.extend([[middle, b, c], [a, b, middle]]);
    let checked = solid.check().unwrap();
    assert!(has_note(&checked, "a neighbour was cut in two"), "{:?}", checked.notes());
    assert!(is(checked.volume(), 8.0) && checked.surface().triangles.len() == 14);
    let flat = TriangleSurface { vertices: vec![Point::<3>::zeros(); 3], triangles: vec![[0, 1, 2]; 1000] };
    assert!(matches!(flat.check(), Err(SurfaceError::Empty)));
}

#[test]
fn numbers_that_are_none_are_refused() {
    for value in [f64::NAN, f64::INFINITY, 1e13] {
        let mut solid = cube(0.0, 1.0);
        solid.vertices[3].y = value;
        assert!(matches!(solid.check(), Err(SurfaceError::Coordinate { vertex: 3, .. })));
    }
    let mut solid = cube(0.0, 1.0);
    solid.triangles[4][1] = 8;
    assert!(matches!(solid.check(), Err(SurfaceError::Index { triangle: 4, vertex: 8, vertices: 8 })));
}

#[test]
fn only_equal_vertices_become_one() {
    let zero = |x: f64, z: f64| Point::<3>::new(x, 1.0, z);
    let of = |third: Point<3>| {
        let triangle = [zero(0.0, 0.0), zero(1.0, 0.0), zero(0.0, 1.0)];
        TriangleSurface::of_soup(&[triangle, [third, triangle[2], triangle[1]]]).vertices.len()
    };
    assert_eq!(of(zero(-0.0, 0.0)), 3, "minus zero is zero");
    assert_eq!(of(zero(1e-15, 0.0)), 4);
}

#[test]
fn pieces_between_sharp_edges_are_counted_and_flat_ones_made_flat() {
    let turn = nalgebra::Rotation3::from_euler_angles(0.3, 1.1, -0.7);
    let mut turned = cube(-1.0, 1.0);
    turned.vertices.iter_mut().for_each(|x| *x = (turn * *x).map(|c| f64::from(c as f32)));
    for (solid, expected) in [(cube(-2.0, 3.5), "6 flat and 0 curved"), (turned, "6 flat and 0 curved")] {
        let checked = solid.check().unwrap();
        assert!(has_note(&checked, expected), "{:?}", checked.notes());
        // Every corner is on three planes, to double precision.
        for x in &checked.surface().vertices {
            let on = |sheet: &&crate::geometry::Sheet<'_>| sheet.level(x).abs() < 1e-15 * 8.0;
            assert_eq!(checked.sheets().iter().filter(on).count(), 3, "{x}");
        }
    }
    assert!(has_note(&sphere(7.0, 2).check().unwrap(), "smooth"));
}

#[test]
fn single_precision_stands_for_the_decimal_that_was_written() {
    let single = |x: f64| f64::from(x as f32);
    let checked = cuboid([single(0.1), single(-0.3), 0.0], [single(0.7), single(1.1), single(2.3)]).check().unwrap();
    assert_eq!(checked.extent(), (Point::<3>::new(0.1, -0.3, 0.0), Point::<3>::new(0.7, 1.1, 2.3)));
}
