use super::*;
use crate::material::Law;
use crate::output::state::State;
use crate::scene::Scene;
use nalgebra::Matrix2;
use roxmltree::Document;

/// A bundled scene of linear tissue with this rule, and what it says of a uniform displacement gradient.
fn uniform(name: &str, integration: Integration, gradient: Matrix2<f64>) -> (TissueModel, Vec<f64>) {
    let mut scene = Scene::bundled(name).unwrap().without_inclusions();
    scene.material = Law::linear(383.0, 318.5).unwrap();
    scene.discretization.method.integration = integration;
    scene.discretization.method.support = integration.default_support();
    let model = TissueModel::new(&scene).unwrap();
    // Linear completeness: coefficients that are a linear field's nodal values give that field.
    let coefficients = model.positions().iter().flat_map(|x| <[f64; 2]>::from(gradient * x)).collect();
    (model, coefficients)
}

fn numbers(document: &Document<'_>, name: &str) -> Vec<f64> {
    let array = document.descendants().find(|node| node.attribute("Name") == Some(name)).expect(name);
    array.text().unwrap().split_whitespace().map(|word| word.parse().unwrap()).collect()
}

/// Uniaxial strain and simple shear of linear tissue: stress in closed form, out of the plane too.
#[test]
fn stress_of_a_uniform_strain_is_that_of_hookes_law() {
    let (lambda, mu, e) = (383.0, 318.5, 1e-6);
    for integration in [Integration::Scni, Integration::FemT3, Integration::FemT6] {
        let (model, stretched) = uniform("paper", integration, Matrix2::new(e, 0.0, 0.0, 0.0));
        let text = vtu(&model, &stretched);
        let document = Document::parse(&text).unwrap();
        let near = |found: f64, expected: f64| (found - expected).abs() < 1e-4 * mu * e;
        let axial = (lambda + 2.0 * mu) * e;
        let expected = [axial, 0.0, 0.0, 0.0, lambda * e, 0.0, 0.0, 0.0, lambda * e];
        let tensors = numbers(&document, "cauchy_stress");
        assert_eq!(tensors.len(), 9 * model.cells().len());
        for tensor in tensors.chunks(9) {
            assert!(tensor.iter().zip(expected).all(|(a, b)| near(*a, b)), "{integration}: {tensor:?}");
        }
        for principal in numbers(&document, "principal_stress").chunks(3) {
            assert!(principal.iter().zip([axial, lambda * e, lambda * e]).all(|(a, b)| near(*a, b)), "{principal:?}");
        }
        assert!(numbers(&document, "von_mises_stress").iter().all(|v| near(*v, 2.0 * mu * e)));
        assert!(numbers(&document, "det_f").iter().all(|j| (j - 1.0 - e).abs() < 1e-9));
        assert!(numbers(&document, "principal_strain").chunks(3).all(|p| (p[0] - e).abs() < 1e-4 * e));
        let moved = numbers(&document, "displacement");
        let points = numbers(&document, "Points");
        assert!(moved.chunks(3).zip(points.chunks(3)).all(|(u, x)| (u[0] - e * x[0]).abs() < 1e-9 * e && u[1] == 0.0));

        let (model, sheared) = uniform("paper", integration, Matrix2::new(0.0, e, 0.0, 0.0));
        let text = vtu(&model, &sheared);
        let document = Document::parse(&text).unwrap();
        assert!(numbers(&document, "von_mises_stress").iter().all(|v| near(*v, 3.0_f64.sqrt() * mu * e)));
    }
}

/// Elements share the model's nodes; nodal cells are a net without seams: corners − edges + cells = 1 (Euler).
#[test]
fn cells_are_connected() {
    for name in ["paper", "breast"] {
        for (integration, shape) in [(Integration::FemT3, 5.0), (Integration::FemT6, 22.0)] {
            let (model, u) = uniform(name, integration, Matrix2::zeros());
            let text = vtu(&model, &u);
            let document = Document::parse(&text).unwrap();
            assert_eq!(numbers(&document, "Points").len(), 3 * model.nodes(), "{name} {integration}");
            assert!(numbers(&document, "types").iter().all(|t| *t == shape));
        }
        let (model, u) = uniform(name, Integration::Scni, Matrix2::zeros());
        let text = vtu(&model, &u);
        let document = Document::parse(&text).unwrap();
        let corners = numbers(&document, "connectivity");
        let ends = numbers(&document, "offsets");
        let mut edges = std::collections::HashSet::new();
        let mut start = 0;
        for end in ends.iter().map(|end| *end as usize) {
            let cell = &corners[start..end];
            for (i, a) in cell.iter().enumerate() {
                let b = cell[(i + 1) % cell.len()];
                edges.insert((a.min(b) as u64, a.max(b) as u64));
            }
            start = end;
        }
        let points = numbers(&document, "Points").len() / 3;
        assert_eq!(points + ends.len(), edges.len() + 1, "{name}: {points} corners, {} cells", ends.len());
    }
}

#[test]
fn regions_and_materials_are_numbered_and_unknown_stress_is_left_out() {
    let model = TissueModel::new(&Scene::bundled("breast").unwrap()).unwrap();
    let text = vtu(&model, &vec![0.0; 2 * model.nodes()]);
    let document = Document::parse(&text).unwrap();
    let regions = numbers(&document, "region");
    for (cell, region) in model.cells().iter().zip(&regions) {
        let inside = model.scene().inclusions.iter().rposition(|i| i.outline.contains(cell.centroid()));
        assert_eq!(*region, inside.map_or(0.0, |i| i as f64 + 1.0));
    }
    assert!(regions.contains(&1.0));
    assert!(text.contains("Name=\"displacement [mm]\"") && text.contains("Name=\"von_mises_stress [kPa]\""));
    let relaxing = TissueModel::new(&Scene::bundled("breast-world").unwrap()).unwrap();
    let text = vtu(&relaxing, &vec![0.0; 2 * relaxing.nodes()]);
    assert!(!has_stress(&relaxing) && !text.contains("stress"), "its past is not in the displacement");
}

/// Needle, target and paddles are where the scene has them and go where the tissue does; names are escaped.
#[test]
fn parts_and_script_show_the_scene() {
    let mut scene = Scene::bundled("paper").unwrap();
    scene.length_unit = "\"<m>&".to_owned();
    let model = TissueModel::new(&scene).unwrap();
    let gradient = Matrix2::new(0.01, 0.02, -0.03, 0.005);
    let coefficients: Vec<f64> = model.positions().iter().flat_map(|x| <[f64; 2]>::from(gradient * x)).collect();
    let text = parts(&model, State { coefficients: &coefficients, depth: 0.1, within: false });
    let document = Document::parse(&text).unwrap();
    let part = numbers(&document, "part");
    assert_eq!(part.iter().filter(|p| **p == 4.0).count(), scene.paddles.len());
    assert_eq!(
        numbers(&document, "paddle").iter().sum::<f64>(),
        scene.paddles.iter().map(|p| f64::from(p.index)).sum::<f64>()
    );
    let (points, moved) = (numbers(&document, "Points"), numbers(&document, "displacement [\"<m>&]"));
    for (x, u) in points.chunks(3).zip(moved.chunks(3)) {
        let expected = gradient * Point2::new(x[0], x[1]);
        assert!((u[0] - expected.x).abs() < 1e-8 && (u[1] - expected.y).abs() < 1e-8, "{x:?} {u:?}");
    }
    let target: [f64; 2] = scene.target.into();
    assert!(points.chunks(3).any(|x| [x[0], x[1]] == target));
    let units = [&scene.length_unit[..], &scene.stress_unit];
    let (scene, body, parts) = (&scene.name[..], "a \"b\".vtu", "p.vtu");
    let script = script(Shown { scene, units, body, parts, stress: true, ..Shown::default() });
    assert!(
        script.contains(r#"BODY, PARTS = "a \"b\".vtu", "p.vtu""#)
            && !script.contains('@')
            && script.contains(r#"displacement [\"<m>&]"#),
        "{script}"
    );
}

/// A name that Python would take for an encoding, or the template for a place of its own, is only a name.
#[test]
fn any_name_of_a_scene_is_only_a_name() {
    let script = script(Shown { scene: "recoding: a@body@\nb", body: "c.vtu", parts: "p.vtu", ..Shown::default() });
    let lines: Vec<&str> = script.lines().collect();
    assert!(lines[0].contains("coding: utf-8"), "{}", lines[0]);
    assert!(lines[2].starts_with("# recoding: a@body@ b:"), "{}", lines[2]);
    assert!(!lines[1].contains("recoding"), "Python looks at two lines");
}

/// A script of a body in space cuts it open along the needle through the target, and what is left out is on the side of the eye.
#[test]
fn a_body_in_space_is_cut_open_towards_the_eye() {
    use crate::geometry::Point;
    use crate::output::space_picture::SpaceGeometry;
    use crate::placement::space::workflow::coarse;
    use crate::scene::space::SpaceScene;
    for (name, paddles) in [("block", vec![3, 8]), ("mound", vec![1]), ("scan", vec![5, 6])] {
        let scene = SpaceScene::bundled(name).unwrap();
        let sight = Sight::new(&SpaceGeometry::new(&coarse(&scene).unwrap()), &paddles);
        let [normal, towards, up] = [sight.normal, sight.view[0], sight.view[1]].map(Point::from);
        assert_eq!(Point::from(sight.origin), scene.target);
        assert!((normal.norm() - 1.0).abs() < 1e-12 && normal.dot(&scene.needle.axis).abs() < 1e-9, "{name}");
        // At least by 45° of what it could be, of two orthogonal planes.
        let aside = towards - scene.needle.axis * scene.needle.axis.dot(&towards);
        assert!(normal.dot(&towards) >= aside.norm() * 0.5f64.sqrt() - 1e-9, "{name}");
        assert!(up.dot(&towards).abs() < 1e-9, "{name}");
        let units = [&scene.length_unit[..], &scene.stress_unit];
        let in_space = Some(sight);
        let shown =
            Shown { scene: name, units, body: "b.vtu", parts: "p.vtu", stress: true, of_points: true, in_space };
        let script = script(shown);
        for line in ["ClipType.Origin = ", "ClipType.Normal = ", "CameraPosition = ", "shown.Representation = "] {
            assert_eq!(script.matches(line).count(), 1, "{line}");
        }
        assert!(!script.contains("\"2D\""));
    }
}
