//! `host-sim stability` as a user runs it.

use std::path::Path;
use std::process::Output;

fn stability(out: &Path, more: &[&str]) -> Output {
    std::process::Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["stability", "--quick", "--out"])
        .arg(out)
        .args(more)
        .output()
        .unwrap()
}

#[test]
fn the_files_hold_all_parts_and_agree_with_theory() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    let output = stability(&one, &["--threads", "1"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let summary = String::from_utf8(output.stdout).unwrap();
    assert!(summary.contains("no boundary is off by more than 1 cell"), "{summary}");
    assert!(stability(&two, &["--threads", "2", "--quiet"]).stdout.is_empty());
    for file in ["closed_loop.csv", "closed_loop.svg"] {
        assert_eq!(std::fs::read(one.join(file)).unwrap(), std::fs::read(two.join(file)).unwrap(), "{file}");
    }
    let csv = std::fs::read_to_string(one.join("closed_loop.csv")).unwrap();
    let columns = csv.lines().next().unwrap().split(',').count();
    assert!(csv.lines().all(|line| line.split(',').count() == columns));
    for part in ["gain-delay-jacobian,", "table-mismatch,", "rate-limit,"] {
        assert!(csv.lines().any(|line| line.starts_with(part)), "{part}");
    }
    let svg = std::fs::read_to_string(one.join("closed_loop.svg")).unwrap();
    assert!(roxmltree::Document::parse(&svg).is_ok());
}

#[test]
fn a_scene_that_is_not_there_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    assert_eq!(stability(&out, &["--scene", "nowhere.toml"]).status.code(), Some(2));
    assert!(!out.exists());
}
