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
