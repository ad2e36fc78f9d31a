//! `host-sim tables` as a user runs it.

#[test]
fn files_are_written_for_a_tissue_that_leaves_its_reduced_models_range() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("charts");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["tables", "--scene", "paper-hull", "--tissue", "homogeneous", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let csv = std::fs::read_to_string(out.join("tables.csv")).unwrap();
    assert_eq!(csv.lines().count(), 15, "{csv}");
    for line in csv.lines().skip(1) {
        let error: f64 = line.split(',').nth(4).unwrap().parse().unwrap();
        // The best static paddle leaves a hundred times more.
        assert!(error < 1e-4 && line.ends_with(','), "{line}");
    }
    let svg = std::fs::read_to_string(out.join("tables.svg")).unwrap();
    assert!(roxmltree::Document::parse(&svg).is_ok());
}

#[test]
fn a_scene_that_is_not_there_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("charts");
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["tables", "--scene", "nowhere.toml", "--out"])
        .arg(&out)
        .status()
        .unwrap();
    assert_eq!(status.code(), Some(2));
    assert!(!out.exists());
}
