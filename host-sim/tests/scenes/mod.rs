//! Scenes of tests.

use std::path::{Path, PathBuf};

/// The bundled scene `scan` with these pairs alone, whose study is short.
pub(crate) fn with_pairs(directory: &Path, pairs: &str) -> PathBuf {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-offline/scenes");
    std::fs::copy(scenes.join("scan.nii.gz"), directory.join("scan.nii.gz")).unwrap();
    let text = std::fs::read_to_string(scenes.join("scan.toml")).unwrap();
    let scene = directory.join("pairs.toml");
    std::fs::write(&scene, text.replace("of = \"all\"", &format!("of = {pairs}"))).unwrap();
    scene
}

/// The same on a coarse mesh and a short way, for tests to which it is nothing how good tissue and tables are.
pub(crate) fn quick_with_pairs(directory: &Path, pairs: &str) -> PathBuf {
    let scene = with_pairs(directory, pairs);
    let mut text = std::fs::read_to_string(&scene).unwrap();
    for (whole, quick) in [
        ("depth = 27.0\n", "depth = 6.0\n"),
        ("increments = 5\n", "increments = 2\n"),
        ("tolerance = 0.05\n", "spacing = 9.0\nintegration = \"fem-t4\"\n"),
    ] {
        assert!(text.contains(whole), "the bundled scene has changed: {whole}");
        text = text.replace(whole, quick);
    }
    std::fs::write(&scene, text).unwrap();
    scene
}
