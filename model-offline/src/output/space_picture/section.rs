//! Tetrahedra cut by a plane.

use super::CutPlane;
use crate::geometry::Point;

/// What a plane cuts of a tetrahedron.
#[derive(Debug, Clone, PartialEq)]
pub struct Cut {
    /// The tetrahedron.
    pub tetrahedron: usize,
    /// Three or four corners in order: coordinates in the plane, length, and the field's value.
    pub corners: Vec<([f64; 2], f64)>,
}

/// Cuts every tetrahedron, with a field that is linear in each. What lies in the plane counts as beyond it, so that
/// tetrahedra that share a face in it are cut once.
pub fn cut(nodes: &[Point<3>], tetrahedra: &[[u32; 4]], values: &[f64], plane: &CutPlane) -> Vec<Cut> {
    let distances: Vec<f64> = nodes.iter().map(|x| plane.distance(x)).collect();
    // The same from either end of an edge, bit by bit.
    let crossing = |a: u32, b: u32| {
        let (a, b) = (a.min(b) as usize, a.max(b) as usize);
        let part = distances[a] / (distances[a] - distances[b]);
        (plane.coordinates(&nodes[a].lerp(&nodes[b], part)), values[a] + part * (values[b] - values[a]))
    };
    let of = |(tetrahedron, corners): (usize, &[u32; 4])| {
        let is_beyond = |node: &u32| distances[*node as usize] >= 0.0;
        let (beyond, before): (Vec<u32>, Vec<u32>) = corners.iter().copied().partition(is_beyond);
        let corners = match (&beyond[..], &before[..]) {
            ([one], others) | (others, [one]) => others.iter().map(|other| crossing(*one, *other)).collect(),
            (&[a, b], &[c, d]) => vec![crossing(a, c), crossing(a, d), crossing(b, d), crossing(b, c)],
            _ => return None,
        };
        Some(Cut { tetrahedron, corners })
    };
    tetrahedra.iter().enumerate().filter_map(of).collect()
}

/// Cuts triangles: the two ends of what the plane has in common with each.
pub(super) fn cut_triangles(nodes: &[Point<3>], triangles: &[[u32; 3]], plane: &CutPlane) -> Vec<[[f64; 2]; 2]> {
    let distance = |node: u32| plane.distance(&nodes[node as usize]);
    let of = |triangle: &[u32; 3]| {
        let distances = triangle.map(distance);
        let single = (0..3).find(|&k| {
            let [here, next, last] = [0, 1, 2].map(|step| distances[(k + step) % 3] >= 0.0);
            here != next && here != last
        })?;
        Some([1, 2].map(|step| {
            let (a, b) = (triangle[single], triangle[(single + step) % 3]);
            let (a, b) = (a.min(b), a.max(b));
            let part = distance(a) / (distance(a) - distance(b));
            plane.coordinates(&nodes[a as usize].lerp(&nodes[b as usize], part))
        }))
    };
    triangles.iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::space_picture::{SpaceGeometry, planes};
    use crate::placement::space::workflow::coarse;
    use crate::scene::space::{AnyScene, SpaceScene};

    fn area(cut: &Cut) -> f64 {
        let points = &cut.corners;
        let next = points.iter().cycle().skip(1);
        0.5 * points.iter().zip(next).map(|((a, _), (b, _))| a[0] * b[1] - a[1] * b[0]).sum::<f64>().abs()
    }

    fn scene(text: &str) -> Box<SpaceScene> {
        match AnyScene::parse(text, "test").unwrap() {
            AnyScene::Space(scene) => scene,
            AnyScene::Planar(_) => panic!("in space"),
        }
    }

    /// Of the cube of `block` all three sections are unit squares, through nodes and faces that lie in the planes too; a
    /// field that is linear is itself in them.
    #[test]
    fn sections_of_a_cube_have_its_area_and_a_linear_field_is_itself() {
        let model = coarse(&SpaceScene::bundled("block").unwrap()).unwrap();
        let geometry = SpaceGeometry::new(&model);
        let nodes: Vec<Point<3>> = geometry.nodes.iter().map(|x| Point::from(*x)).collect();
        let of = |x: &Point<3>| 1.0 + 2.0 * x.x - 3.0 * x.y + 0.5 * x.z;
        let values: Vec<f64> = nodes.iter().map(of).collect();
        let mut offsets = vec![];
        for plane in planes(&geometry) {
            for moved in [0.0, 0.013, 0.25] {
                let plane = CutPlane { offset: plane.offset + moved, ..plane.clone() };
                let cuts = cut(&nodes, &geometry.tetrahedra, &values, &plane);
                let whole: f64 = cuts.iter().map(area).sum();
                assert!((whole - 1.0).abs() < 1e-9, "{}: {whole}", plane.name("1"));
                for (at, value) in cuts.iter().flat_map(|cut| &cut.corners) {
                    let x = plane.directions[0] * at[0] + plane.directions[1] * at[1] + plane.normal * plane.offset;
                    assert!((of(&x) - value).abs() < 1e-9);
                }
                offsets.push(plane.offset);
            }
        }
        assert_eq!(offsets.len(), 9);
        // An oblique one: the regular hexagon halfway along the diagonal.
        let normal: Point<3> = Point::repeat(1.0 / 3f64.sqrt());
        let right: Point<3> = Point::from([1.0, -1.0, 0.0]).normalize();
        let directions = [right, normal.cross(&right)];
        let plane = CutPlane { normal, offset: 0.5 * 3f64.sqrt(), directions, across_needle: false };
        let whole: f64 = cut(&nodes, &geometry.tetrahedra, &values, &plane).iter().map(area).sum();
        assert!((whole - 0.75 * 3f64.sqrt()).abs() < 1e-9, "{whole}");
    }

    /// Of a ball: π (r² − d²), less what chords take; never more.
    #[test]
    fn sections_of_a_ball_are_discs() {
        let text = "[scene]\nname = \"ball\"\ndimension = 3\nunits = { length = \"mm\", stress = \"kPa\" }\n\
            [domain]\nsolid = { sphere = { centre = [5.0, 0.0, -3.0], radius = 20.0 } }\n\
            [material]\nmodel = \"neo-hookean\"\nlambda = 30.0\nmu = 6.0\n\
            [immobile]\nregions = [{ box = { min = [-20.0, -20.0, -24.0], max = [30.0, 20.0, -15.0] } }]\n\
            [needle]\nregion = { sphere = { centre = [5.0, 0.0, 17.0], radius = 6.0 } }\naxis = [0.0, 0.0, -1.0]\ndepth = 4.0\n\
            [target]\nposition = [5.0, 0.0, 2.0]\n\
            [[paddle]]\nindex = 7\nregion = { sphere = { centre = [25.0, 0.0, -3.0], radius = 6.0 } }\n\
            [discretization]\nspacing = 4.0\n";
        let model = coarse(&scene(text)).unwrap();
        let geometry = SpaceGeometry::new(&model);
        let nodes: Vec<Point<3>> = geometry.nodes.iter().map(|x| Point::from(*x)).collect();
        let values = vec![0.0; nodes.len()];
        for plane in planes(&geometry) {
            for moved in [0.0, 7.5, -6.1] {
                let plane = CutPlane { offset: plane.offset + moved, ..plane.clone() };
                let distance = plane.distance(&Point::from([5.0, 0.0, -3.0]));
                let disc = std::f64::consts::PI * (400.0 - distance * distance);
                let whole: f64 = cut(&nodes, &geometry.tetrahedra, &values, &plane).iter().map(area).sum();
                assert!(whole < disc && whole > 0.93 * disc, "{}: {whole} of {disc}", plane.name("mm"));
            }
        }
    }
}
