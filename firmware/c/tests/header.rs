//! The header is what the sources say, and its constants are those of the controller.

use std::path::{Path, PathBuf};

use firmware::contract::frames::{COMMAND_VALID, TARGET_VISIBLE};
use firmware::{Faults, Mode};
use stillpoint::types::*;

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The header that follows from the sources.
fn generated(crate_dir: &Path) -> String {
    let config = cbindgen::Config::from_file(here().join("cbindgen.toml")).unwrap();
    // Files by name, in the order of the header: no cargo is asked.
    let names = ["types", "faults", "status", "instance", "api"];
    let sources = names.map(|name| crate_dir.join(format!("src/{name}.rs")));
    let builder = sources.iter().fold(cbindgen::Builder::new().with_config(config), cbindgen::Builder::with_src);
    let mut bytes = Vec::new();
    builder.generate().unwrap().write(&mut bytes);
    String::from_utf8(bytes).unwrap()
}

fn committed() -> PathBuf {
    here().join("include/stillpoint.h")
}

#[test]
fn the_committed_header_is_that_of_the_sources() {
    let generated = generated(here());
    if std::env::var_os("STILLPOINT_WRITE_HEADER").is_some() {
        std::fs::write(committed(), &generated).unwrap();
    }
    let committed = std::fs::read_to_string(committed()).unwrap_or_default();
    let first = committed.lines().zip(generated.lines()).find(|(old, new)| old != new);
    assert!(
        committed == generated,
        "include/stillpoint.h is stale, first at {first:?}: write it by \
         `STILLPOINT_WRITE_HEADER=1 cargo test -p stillpoint-c --test header`"
    );
}

/// `#define`s of the header with their values.
fn defines(header: &str) -> Vec<(String, u64)> {
    let define = |line: &str| {
        let (name, value) = line.strip_prefix("#define ")?.split_once(' ')?;
        let digits = value.trim_end_matches(|c: char| c.is_ascii_alphabetic());
        Some((name.to_owned(), digits.parse().unwrap_or_else(|_| panic!("{line}"))))
    };
    header.lines().filter_map(define).collect()
}

#[test]
fn constants_are_the_controllers() {
    let defines = defines(&generated(here()));
    let value = |name: &str| {
        let found: Vec<u64> = defines.iter().filter(|(defined, _)| defined == name).map(|(_, value)| *value).collect();
        assert_eq!(found.len(), 1, "{name}");
        found[0]
    };
    for (fault, name) in Faults::NAMES {
        assert_eq!(value(&format!("STILLPOINT_FAULT_{name}")), fault.bits(), "{name}");
    }
    let faults = defines.iter().filter(|(name, _)| name.starts_with("STILLPOINT_FAULT_")).count();
    assert_eq!(faults, Faults::NAMES.len());
    for mode in [Mode::Hold, Mode::Run, Mode::Safe] {
        assert_eq!(value(&format!("STILLPOINT_MODE_{}", mode.name())), u64::from(mode as u32));
    }
    assert_eq!(value("STILLPOINT_TARGET_VISIBLE"), u64::from(TARGET_VISIBLE));
    assert_eq!(value("STILLPOINT_COMMAND_VALID"), u64::from(COMMAND_VALID));
    assert_eq!(value("STILLPOINT_MEMORY_BYTES"), STILLPOINT_MEMORY_BYTES as u64);
}

/// The structs of C are those of the plane: a frame without its third component and its second paddle. What was compiled
/// against version 1 of the interface finds every field where it was.
#[test]
fn samples_and_commands_lie_in_memory_as_in_the_first_version() {
    assert_eq!(size_of::<StillpointNeedleSample>(), size_of::<firmware::NeedleSample>());
    let component = size_of::<f64>();
    assert_eq!(size_of::<StillpointTargetSample>(), size_of::<firmware::TargetSample>() - component);
    assert_eq!(size_of::<StillpointPaddleSample>(), size_of::<firmware::PaddleSample>() - component);
    assert_eq!(size_of::<StillpointCommand>(), 64);
    assert_eq!(std::mem::offset_of!(StillpointCommand, faults), std::mem::offset_of!(firmware::PaddleCommand, faults));
    assert_eq!(std::mem::offset_of!(StillpointCommand, displacement_lu), 32);
    assert_eq!(std::mem::offset_of!(StillpointCommand, flags), 60);
}

/// The control of the comparison: what is changed in the sources shows in the header.
#[test]
fn a_changed_source_changes_the_header() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("src")).unwrap();
    for entry in std::fs::read_dir(here().join("src")).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap().replace("pub depth_lu: f64", "pub depth_mm: f64");
        std::fs::write(folder.path().join("src").join(path.file_name().unwrap()), text).unwrap();
    }
    let changed = generated(folder.path());
    assert!(changed.contains("double depth_mm;") && !changed.contains("depth_lu"), "{changed}");
}
