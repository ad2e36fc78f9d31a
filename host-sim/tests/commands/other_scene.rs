//! Scenes that are not the paper's: tables of another one are not used in silence, every body of a report is drawn, and what is too
//! slow for a clock is reported without.

use assert_cmd::Command;
use std::path::Path;

fn host_sim(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.current_dir(folder).args(["run", "--quiet", "--tissue", "homogeneous", "--mode", "lockstep"]);
    command.args(["--insertion-time", "0.05", "--duration", "0.06", "--json", "result.json"]);
    command
}

/// Writes the controller table of a scene, homogeneous.
fn table(scene: &model_offline::scene::Scene, path: &Path) {
    use model_offline::table::{TableOptions, build, to_bytes};
    let (model, _) = model_offline::placement::discretise(&scene.without_inclusions()).unwrap();
    let table = build(&model, 3, &TableOptions { knots: 3, ..TableOptions::default() }).unwrap();
    std::fs::write(path, to_bytes(&table).unwrap()).unwrap();
}

#[test]
fn a_table_of_another_scene_is_refused_unless_somebody_insists() {
    let folder = tempfile::tempdir().unwrap();
    let scene = model_offline::scene::Scene::bundled("paper").unwrap();
    table(&scene, &folder.path().join("own.table"));
    let mut moved = scene.clone();
    moved.target.x += 0.01;
    table(&moved, &folder.path().join("other.table"));

    host_sim(folder.path()).args(["--table", "own.table"]).assert().success();
    let own = std::fs::read_to_string(folder.path().join("result.json")).unwrap();
    assert!(!own.contains("another scene"));

    let refused = host_sim(folder.path()).args(["--table", "other.table", "--out", "refused"]).assert().code(2);
    let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(said.contains("other.table") && said.contains("--allow-other-scene"), "{said}");
    assert!(!folder.path().join("refused").exists());

    host_sim(folder.path())
        .args(["--table", "other.table", "--allow-other-scene", "--out", "insisted"])
        .assert()
        .success();
    let page = std::fs::read_to_string(folder.path().join("insisted/report.html")).unwrap();
    assert!(page.contains("homogeneous of another scene"), "the report does not say so");
}

/// A body whose elements follow the edge of its inclusion, so that either tissue has a mesh of its own.
const TWO_MESHES: &str = r#"
scene = { name = "two meshes", dimension = 2, units = { length = "mm", stress = "kPa" } }
domain.outline = [[0, 0], [100, 0], [100, 60], [0, 60]]
material = { model = "neo-hookean", lambda = 8.0, mu = 2.0 }
inclusion = [{ outline = [[55, 22], [75, 22], [75, 41], [55, 41]], stiffness = 6.0 }]
immobile.paths = [[[0, 0], [100, 0]]]
needle = { contact = [[65, 60], [35, 60]], axis = [0.0, -1.0], depth = 6.0, increments = 10 }
target.position = [81, 30]
paddle = [{ index = 1, segment = [[100, 10], [100, 28]] }, { index = 2, segment = [[100, 34], [100, 52]] }]
discretization = { tolerance = 0.03, integration = "fem-t6" }
"#;

/// All bodies of a result are drawn on one surface, whatever nodes their own models have: each frame has a place and a value for
/// every node, nothing has moved at rest, and what is beside the target goes where the target went.
#[test]
fn bodies_with_nodes_of_their_own_are_drawn_on_one_surface() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("two.toml"), TWO_MESHES).unwrap();
    let mut run = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    run.args(["run", "--quiet", "--scene", "two.toml", "--mode", "lockstep", "--insertion-time", "0.5"]);
    run.args(["--out", "report", "--json", "result.json"]).current_dir(folder.path()).assert().success();
    let text = std::fs::read_to_string(folder.path().join("result.json")).unwrap();
    let result: host_sim::bench::result::RunResult = serde_json::from_str(&text).unwrap();
    let [homogeneous, inclusion] = [0, 1].map(|i| result.placements[i].nodes);
    assert_ne!(homogeneous, inclusion, "this scene is to have two meshes");
    let (geometry, target) = (&result.geometry, result.geometry.target);
    let away = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let nearest = (0..geometry.nodes.len())
        .min_by(|&a, &b| away(geometry.nodes[a], target).total_cmp(&away(geometry.nodes[b], target)))
        .unwrap();
    let mut drawn = 0;
    for strategy in result.results() {
        let (first, last) = (&strategy.frames[0], strategy.frames.last().unwrap());
        for frame in &strategy.frames {
            let counts = [frame.nodes.len(), frame.strain.len(), frame.von_mises.len()];
            assert_eq!(counts, [geometry.nodes.len(); 3]);
        }
        let moved = |nodes: &[[f64; 2]]| {
            nodes.iter().zip(&geometry.nodes).map(|(now, rest)| away(*now, *rest)).fold(0.0, f64::max)
        };
        assert!(moved(&first.nodes) < 1e-4, "{}", moved(&first.nodes));
        assert!(moved(&last.nodes) < 1.3 * last.depth, "{}", moved(&last.nodes));
        let went = strategy.series.last().unwrap();
        let by_series = [
            geometry.orthogonal[0] * went.orthogonal_error + geometry.needle_axis[0] * went.axial,
            geometry.orthogonal[1] * went.orthogonal_error + geometry.needle_axis[1] * went.axial,
        ];
        let [now, rest] = [last.nodes[nearest], geometry.nodes[nearest]];
        let by_frame = [now[0] - rest[0], now[1] - rest[1]];
        assert!(away(by_series, by_frame) < 0.05 * last.depth, "{by_series:?} {by_frame:?}");
        drawn += 1;
    }
    assert_eq!(drawn, 8);
    // The picture of a case with the other mesh, and the page.
    let picture = "draw report/result.json --case 2 --field strain -o case.svg";
    let program = Path::new(env!("CARGO_BIN_EXE_host-sim")).with_file_name("model-offline");
    if program.is_file() {
        Command::new(program).args(picture.split(' ')).current_dir(folder.path()).assert().success();
    }
}

/// A tissue that cannot keep the period has a report all the same, of what has no clock, and the word that free-run is missing.
#[test]
fn a_tissue_that_is_too_slow_for_the_clock_costs_no_report() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("two.toml"), TWO_MESHES).unwrap();
    let run = |more: &[&str]| {
        let mut run = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        run.args(["run", "--quiet", "--scene", "two.toml", "--tissue", "inclusion", "--plant", "full"]);
        run.args(["--rate", "10000", "--insertion-time", "0.1"]).args(more);
        let refused = run.current_dir(folder.path()).assert().code(2);
        // In lines that are as long as the terminal is wide.
        let said = String::from_utf8_lossy(&refused.get_output().stderr).replace('│', "");
        said.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let said = run(&["--out", "report"]);
    assert!(said.contains("the report has no free-run") && said.contains("cannot keep a period"), "{said}");
    assert!(said.contains("--mode lockstep"), "{said}");
    let text = std::fs::read_to_string(folder.path().join("report/result.json")).unwrap();
    let result: host_sim::bench::result::RunResult = serde_json::from_str(&text).unwrap();
    let strategies = &result.cases[0].strategies;
    assert!(strategies.dynamic.is_some() && strategies.dynamic_free_run.is_none());
    assert!(folder.path().join("report/report.html").is_file());
    // Where nothing else was asked for there is nothing to report.
    let said = run(&["--mode", "free-run", "--out", "none"]);
    assert!(said.contains("cannot keep a period") && !folder.path().join("none").exists(), "{said}");
}
