//! Tables and tabulated bodies in space: held against differences, whole solves, and each other.

use firmware::contract::{Header, TableError};
use model_offline::discretization::{Integration, Method, Resolution};
use model_offline::geometry::Point;
use model_offline::model::space::SpaceBody;
use model_offline::model::{DrivenBody, control_derivatives};
use model_offline::placement::space::holding::hold;
use model_offline::placement::space::insertion::InsertionModel;
use model_offline::placement::space::rest::rest_responses;
use model_offline::placement::space::workflow::insertion_model;
use model_offline::reduction::tabulated::Untabulated;
use model_offline::reduction::{Tabulated, TabulationOptions};
use model_offline::scene::space::SpaceScene;
use model_offline::solver::equilibrium::NewtonSettings;
use model_offline::table::TableOptions;
use model_offline::table::space::SpaceTable;
use nalgebra::{DMatrix, Vector3};
use std::sync::LazyLock;

/// Followed on linear tetrahedra, at rest quadratic ones: the default of a tolerance, on the coarsest mesh.
fn scan() -> &'static InsertionModel {
    static SCAN: LazyLock<InsertionModel> = LazyLock::new(|| insertions("scan", 0));
    &SCAN
}

/// A bundled scene whose insertions answer at rest as quadratic tetrahedra of a level.
fn insertions(scene: &str, level: i32) -> InsertionModel {
    let mut scene = SpaceScene::bundled(scene).unwrap().with_method(Method::new(Integration::FemT10));
    scene.discretization.resolution = Resolution::Level(level);
    insertion_model(&scene).unwrap()
}

fn off_line(body: &SpaceBody<'_>, model: &InsertionModel) -> f64 {
    (model.scene().needle.orthogonal().transpose() * body.target_displacement()).norm()
}

/// First and second derivatives by depth and six displacements against central differences of solved states.
#[test]
fn derivatives_in_space_are_those_of_solved_states() {
    let model = scan();
    let size = model.scene().needle.depth;
    let at = [0.3 * size, 0.02 * size, -0.03 * size, 0.01 * size, -0.02 * size, 0.01 * size, 0.02 * size];
    let solved = |control: usize, step: f64| {
        let mut to = at;
        to[control] += step;
        let mut body = model.body(&[0, 5], NewtonSettings::default()).unwrap();
        body.drive_to(&to).unwrap();
        let found = control_derivatives::<3, _>(&mut body).unwrap();
        (body.target_displacement(), found)
    };
    let (_, here) = solved(0, 0.0);
    let bend = here.bend.unwrap();
    let largest = bend.iter().map(DMatrix::amax).fold(0.0, f64::max);
    let step = 1e-3 * size;
    for control in 0..7 {
        let [(ahead, slope_ahead), (behind, slope_behind)] = [step, -step].map(|step| solved(control, step));
        let slope = (ahead - behind) / (2.0 * step);
        assert!((here.slope.column(control) - slope).amax() < 1e-4 * here.slope.amax(), "{control}");
        let change = (slope_ahead.slope - slope_behind.slope) / (2.0 * step);
        for (row, bend) in bend.iter().enumerate() {
            let off = (bend.column(control).transpose() - change.row(row)).amax();
            assert!(off < 5e-3 * largest, "{control} of {row}: {off:.2e} of {largest:.2e}");
        }
    }
}

#[test]
fn paddles_that_hold_leave_nothing_off_the_needles_line() {
    let model = scan();
    for attached in [vec![0], vec![4, 5], vec![1, 2]] {
        let mut body = model.body(&attached, NewtonSettings::default()).unwrap();
        for share in [0.2, 0.5] {
            let depth = share * model.scene().needle.depth;
            hold(&mut body, depth).unwrap();
            assert_eq!(body.depth(), depth);
            assert!(off_line(&body, model) < 1e-9 * model.scene().size(), "{attached:?} {depth}");
        }
    }
}

/// Relative distances, at a state of the insertion on which paddles hold the target, from the accurate model that has followed it
/// itself: of the Jacobian as insertions have it, of the coarse mesh's own, and of the target's displacement as insertions have it.
fn off_at(model: &InsertionModel, attached: &[usize], depth: f64) -> [f64; 3] {
    let mut body = model.body(attached, NewtonSettings::default()).unwrap();
    let mut accurate = model.accurate().body(attached, NewtonSettings::default()).unwrap();
    let mut coarse = model.coarse().body(attached, NewtonSettings::default()).unwrap();
    for step in 1..=4 {
        hold(&mut body, 0.25 * f64::from(step) * depth).unwrap();
        accurate.drive(body.depth(), body.paddles()).unwrap();
        coarse.drive(body.depth(), body.paddles()).unwrap();
    }
    let jacobian = accurate.actuation_jacobian().unwrap();
    let off = |of: &mut SpaceBody<'_>| (of.actuation_jacobian().unwrap() - &jacobian).norm() / jacobian.norm();
    let moved = accurate.target_displacement();
    [off(&mut body), off(&mut coarse), (body.target_displacement() - moved).norm() / moved.norm()]
}

/// As deep as the accurate model goes itself before it is squeezed to nothing at rims, it says what the corrected coarse one does, and
/// not what that says alone.
#[test]
fn at_depth_the_accurate_model_says_what_insertions_are_made_of() {
    let model = scan();
    for attached in [[4, 5], [0, 1]] {
        let [corrected, alone, moved] = off_at(model, &attached, 0.15 * model.scene().needle.depth);
        println!("{attached:?}: {corrected:.3} {alone:.3} {moved:.3}");
        assert!(corrected < 0.02 && alone > 3.0 * corrected && moved < 0.03);
    }
}

/// The guide's table of how far that goes.
#[test]
#[ignore = "minutes; prints a table of the guide"]
fn how_far_jacobians_are_off_at_depth() {
    for (scene, level, pair, shares) in
        [("block", 0, [3, 8], &[0.25][..]), ("block", 0, [1, 2], &[0.25]), ("scan", 1, [5, 6], &[0.15, 0.35, 0.65])]
    {
        let model = insertions(scene, level);
        let attached = pair.map(|index| model.scene().paddle_position(index).unwrap());
        for share in shares {
            let depth = share * model.scene().needle.depth;
            let [corrected, alone, _] = off_at(&model, &attached, depth);
            println!(
                "{scene} {pair:?} depth {depth}: coarse {:.1} %, corrected {:.1} %",
                100.0 * alone,
                100.0 * corrected
            );
            assert!(corrected < 0.5 * alone);
        }
    }
}

/// Pairs in another order, and such as the scene does not study, answer at rest as the accurate model.
#[test]
fn every_order_of_paddles_is_corrected() {
    let model = scan();
    let jacobian =
        |attached: &[usize]| model.body(attached, NewtonSettings::default()).unwrap().actuation_jacobian().unwrap();
    let (there, back) = (jacobian(&[4, 5]), jacobian(&[5, 4]));
    assert!((there.columns(0, 3) - back.columns(3, 3)).amax() < 1e-9 * there.amax());
    assert!((there.columns(3, 3) - back.columns(0, 3)).amax() < 1e-9 * there.amax());
}

/// The path of a table between its knots, and its Jacobian at rest, against the model that it was made of.
#[test]
fn a_table_holds_the_target_between_its_knots() {
    let model = scan();
    let paddles = model.best_to_control().unwrap();
    let table = SpaceTable::build(model, &paddles, &TableOptions::default()).unwrap();
    assert_eq!(table.paddles(), paddles);
    let SpaceTable::Two(of_two) = &table else { panic!("the best is a pair") };
    let places: Vec<usize> = paddles.iter().map(|&p| model.scene().paddle_position(p).unwrap()).collect();
    let mut body = model.body(&places, NewtonSettings::default()).unwrap();
    let mut unheld = model.body(&[], NewtonSettings::default()).unwrap();
    for share in [0.13, 0.48, 0.87] {
        let depth = share * model.scene().needle.depth;
        let location = of_two.locate(depth).unwrap();
        let path = location.paddle_path();
        body.drive(depth, &[path.column(0).into_owned(), path.column(1).into_owned()]).unwrap();
        unheld.drive(depth, &[]).unwrap();
        let (left, without) = (off_line(&body, model), off_line(&unheld, model));
        assert!(left < 1e-4 * without, "{left} of {without} at {depth}");
        assert!((location.target_displacement() - body.target_displacement()).norm() < 1e-3 * without);
    }
    let pair = model.scene().pairs.iter().position(|pair| pair.to_vec() == places).unwrap();
    let rest = &rest_responses(model.accurate()).unwrap()[model.scene().paddles.len() + pair];
    let own = DMatrix::from_fn(3, 6, |r, c| of_two.knots[0].jacobian[c / 3][(r, c % 3)]);
    assert!((own - &rest.jacobian).amax() < 1e-6 * rest.jacobian.amax());
    // Through a file and back.
    let bytes = table.to_bytes().unwrap();
    assert_eq!(SpaceTable::read(&bytes).unwrap(), table);
    let header = Header::read(&bytes).unwrap();
    assert_eq!((header.dimension, header.paddle_dof, header.scene_hash), (3, 6, model.scene().hash()));
    assert!(matches!(firmware::decode::<f64, 2, 1, 1>(&bytes), Err(TableError::Dimension { .. })));
}

#[test]
fn tables_are_of_one_paddle_or_two_that_there_are() {
    let model = scan();
    let refused = |paddles: &[u32]| {
        SpaceTable::build(model, paddles, &TableOptions { knots: 3, ..TableOptions::default() })
            .unwrap_err()
            .to_string()
    };
    assert!(refused(&[]).contains("one or, in space, two"));
    assert!(refused(&[1, 2, 3]).contains("3 paddles"));
    assert!(refused(&[1, 99]).contains("99"));
    assert!(refused(&[3, 3]).contains("paddle 3 is named twice"));
}

/// What tells scenes apart does, and what does not matter to numbers does not.
#[test]
fn the_hash_is_of_what_the_numbers_depend_on() {
    use model_offline::scene::space::AnyScene;
    let text = include_str!("../../scenes/block.toml");
    let hash = |text: &str| match AnyScene::parse(text, "block.toml").unwrap() {
        AnyScene::Space(scene) => scene.hash(),
        AnyScene::Planar(_) => panic!("in space"),
    };
    let own = hash(text);
    assert_eq!(own, hash(&format!("# A word.\n{text}")));
    assert_ne!(own, hash(&text.replace("stiffness = 100.0", "stiffness = 99.0")));
    let scene = SpaceScene::bundled("block").unwrap();
    assert_eq!(own, scene.hash());
    assert_ne!(own, scene.without_inclusions().hash());
}

/// Ways that the table was not made of: near the planned one, beside it, too far, too deep.
#[test]
fn a_tabulated_body_follows_the_full_one_and_knows_where_it_does_not() {
    let model = scan();
    let options = TabulationOptions { tolerance: 0.01, steered: true, threads: 2 };
    let (table, report) = Tabulated::learn(model, &[4, 5], &options).unwrap();
    assert!(report.worst_error <= 0.01 * report.scale && report.worst_estimate <= 0.01 * report.scale, "{report:?}");
    assert!(report.trials >= 40 && report.fresh >= 20 && report.least_effectivity > 0.7, "{report:?}");
    let mut body = table.body();
    let mut full = model.body(&[4, 5], NewtonSettings::default()).unwrap();
    let mut short = 0;
    for k in 1..=20 {
        let t = f64::from(k) / 20.0;
        let depth = t * table.deepest();
        let beside = Vector3::new((9.0 * t).sin(), (7.0 * t).cos() - 1.0, (5.0 * t).sin()) * (0.3 * report.room[0]);
        let paddles: Vec<Point<3>> = table.way(depth).iter().map(|way| way + beside).collect();
        body.drive(depth, &paddles).unwrap();
        full.drive(depth, &paddles).unwrap();
        let error = (body.target_displacement() - full.target_displacement()).norm();
        assert!(error <= 0.01 * report.scale, "{k}: {error:.2e} of {:.2e}", report.scale);
        short += usize::from(error > body.error_estimate());
    }
    // An upper bound with probability n/(n + 1) at every state.
    assert!(short <= 2, "short at {short} of 20");
    let before = body.target_displacement();
    let way = table.way(table.deepest());
    let deeper = body.drive(1.1 * table.deepest(), &way).unwrap_err();
    assert!(matches!(deeper, Untabulated::Depth { .. }));
    let far: Vec<Point<3>> = way.iter().map(|way| way + Vector3::x() * (1.1 * report.room[0])).collect();
    assert!(matches!(body.drive(table.deepest(), &far), Err(Untabulated::Beside { paddle: 0, .. })));
    assert_eq!(body.target_displacement(), before);
    // A table that is asked for more than it can has none.
    let tiny = TabulationOptions { tolerance: 1e-12, ..options };
    let refused = Tabulated::learn(model, &[4, 5], &tiny).unwrap_err().to_string();
    assert!(refused.contains("insert less deep"), "{refused}");
}

/// At a tabulated depth what is left out is of third order in the distance from the way: half of it leaves an eighth.
#[test]
fn a_tabulated_body_is_of_third_order_beside_its_way() {
    let model = scan();
    let options = TabulationOptions { tolerance: 0.01, steered: true, threads: 2 };
    let (table, report) = Tabulated::learn(model, &[4, 5], &options).unwrap();
    let depth = table.deepest() * ((table.knots() - 1) / 2) as f64 / (table.knots() - 1) as f64;
    for (k, direction) in [Vector3::x(), Vector3::y(), Vector3::new(0.6, 0.0, 0.8)].into_iter().enumerate() {
        let error = |share: f64| {
            let mut paddles = table.way(depth);
            paddles[k % 2] += direction * (share * report.room[k % 2]);
            let (mut body, mut full) = (table.body(), model.body(&[4, 5], NewtonSettings::default()).unwrap());
            body.drive(depth, &paddles).unwrap();
            full.drive(depth, &paddles).unwrap();
            (body.target_displacement() - full.target_displacement()).norm()
        };
        let order = (error(0.9) / error(0.45)).log2();
        assert!((2.6..3.6).contains(&order), "{k}: order {order:.2}");
    }
}

/// Held paddles and none: one control, the same answers as the full model, nothing beside rest.
#[test]
fn fixtures_are_tabulated_by_depth_alone() {
    let model = scan();
    for attached in [vec![], vec![2, 3]] {
        let options = TabulationOptions { tolerance: 0.01, steered: false, threads: 2 };
        let (table, report) = Tabulated::learn(model, &attached, &options).unwrap();
        let still = vec![Point::<3>::zeros(); attached.len()];
        let (mut body, mut full) = (table.body(), model.body(&attached, NewtonSettings::default()).unwrap());
        for share in [0.21, 0.66, 1.0] {
            let depth = share * table.deepest();
            body.drive(depth, &still).unwrap();
            full.drive(depth, &still).unwrap();
            let error = (body.target_displacement() - full.target_displacement()).norm();
            assert!(error <= 1e-3 * report.scale, "{attached:?} {share}: {error:.2e}");
        }
        if !attached.is_empty() {
            let moved = vec![Vector3::x(); attached.len()];
            assert!(body.drive(0.5 * table.deepest(), &moved).is_err());
        }
    }
}
