//! One build serves both programs: whatever is asked of a crate by the whole workspace is asked of it by each program alone,
//! so that `cargo run` compiles nothing again.

use std::collections::BTreeSet;
use std::process::Command;

/// Crates with their features, as a selection of packages needs them.
fn crates(selection: &[&str]) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--locked",
            "--edges",
            "normal,build",
            "--prefix",
            "none",
            "--no-dedupe",
            "--format",
            "{p} [{f}]",
        ])
        .args(selection)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(|line| line.trim_end_matches(" (*)").to_owned()).collect()
}

#[test]
fn each_program_alone_asks_for_the_features_of_the_workspace() {
    let all = crates(&["--workspace"]);
    for package in ["host-sim", "model-offline", "tests"] {
        let alone = crates(&["--package", package]);
        assert!(alone.len() > 100, "{package}: only {} crates", alone.len());
        let different: Vec<&str> = alone.difference(&all).map(String::as_str).collect();
        // Ask for what the workspace's line has and this one lacks in the manifest of the package.
        assert!(different.is_empty(), "compiled again for {package}:\n{}", different.join("\n"));
    }
}
