//! A table of another scene is not used in silence.

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
