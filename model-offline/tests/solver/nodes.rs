//! Nodes and cells of the bundled scenes.

use model_offline::discretization::cells::nodal_cells::clipped_voronoi;
use model_offline::discretization::nodes::graded::{Grading, InterfaceFit, graded_nodes};
use model_offline::discretization::nodes::lattice::lattice_nodes;
use model_offline::geometry::{Point2, Polygon, distance_to_segment};
use model_offline::scene::Scene;

#[test]
fn the_papers_scenes_have_the_node_counts_of_an_independent_implementation() {
    for (name, spacing, expected) in
        [("paper", 0.1, 106), ("paper-hull", 0.1, 126), ("paper", 0.05, 386), ("paper", 0.025, 1471)]
    {
        let scene = Scene::bundled(name).unwrap();
        assert_eq!(lattice_nodes(&scene.features(), spacing).len(), expected, "{name} at {spacing}");
    }
}

#[test]
fn nodes_follow_the_outline_and_gather_at_the_paddles() {
    let scene = Scene::bundled("paper").unwrap();
    let grading =
        Grading { coarsest: 0.1, finest: 0.005, slope: 0.3, interface: 0.05, narrow: 0.5, fit: InterfaceFit::Between };
    let nodes = graded_nodes(&scene.features(), &grading);
    assert!(scene.outline.vertices().iter().all(|v| nodes.contains(v)));
    assert!(nodes.contains(&scene.target));
    for paddle in &scene.paddles {
        let [a, b] = paddle.segment;
        assert!(nodes.iter().filter(|x| distance_to_segment(**x, a, b) < 1e-9).count() > 5);
        let others = nodes.iter().filter(|x| **x != a);
        assert!(others.map(|x| (x - a).norm()).fold(f64::INFINITY, f64::min) < 0.008);
    }
}

#[test]
fn lattice_cells_are_the_lattice_squares() {
    // Four cells meet in every corner, and rounding must not turn that into cells that are missing.
    let outline = Polygon::new(
        [[0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.5]].iter().map(|p| Point2::from(*p)).collect(),
    )
    .unwrap();
    for spacing in [0.1, 0.05, 0.025, 0.0125] {
        let scene = Scene::bundled("paper").unwrap();
        let nodes = lattice_nodes(&scene.features(), spacing);
        let cells = clipped_voronoi(&nodes, &outline).unwrap();
        let total: f64 = cells.iter().map(|c| c.area).sum();
        assert!((total - 0.875).abs() < 1e-12, "{spacing}: {total}");
        for (x, cell) in nodes.iter().zip(&cells) {
            let full = spacing * spacing;
            let share = if outline.distance_to_boundary(*x) < 0.4 * spacing { 0.12..0.88 } else { 0.999..1.001 };
            assert!(share.contains(&(cell.area / full)), "{spacing}: node {x:?} has {}", cell.area / full);
        }
    }
}
