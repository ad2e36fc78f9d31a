//! The archive for a microcontroller: it links without anything else, and no panic can be reached in it.

mod toolchain;

use std::path::{Path, PathBuf};
use std::process::Command;

const TARGET: &str = "thumbv7em-none-eabihf";

fn rustc(arguments: &[&str]) -> String {
    let output = Command::new("rustc").args(arguments).output().unwrap();
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

fn has_target() -> bool {
    let libraries = rustc(&["--print", "target-libdir", "--target", TARGET]);
    !libraries.is_empty() && Path::new(&libraries).is_dir()
}

/// The linker that comes with the compiler.
fn linker() -> PathBuf {
    let version = rustc(&["-vV"]);
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).unwrap().to_owned();
    Path::new(&rustc(&["--print", "sysroot"])).join("lib/rustlib").join(host).join("bin/rust-lld")
}

/// The functions that the header declares.
fn exported() -> Vec<String> {
    let header = std::fs::read_to_string(toolchain::package().join("include/stillpoint.h")).unwrap();
    let name = |line: &str| {
        let start = line.find("stillpoint_")?;
        let (name, _) = line[start..].split_once('(')?;
        let declares = line.starts_with(|c: char| c.is_ascii_alphabetic()) && !name.contains(' ');
        declares.then(|| name.to_owned())
    };
    header.lines().filter_map(name).collect()
}

/// Links these functions and nothing else, as a program would: the map of what stays, or what the linker complains about.
fn link(functions: &[String], cfg: &[&str]) -> Result<String, String> {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c-library-image");
    let arguments = [&["--profile", "image", "--target", TARGET, "--", "--cfg", "panic_proof"], cfg].concat();
    let built = toolchain::cargo(&directory, &arguments);
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    let folder = tempfile::tempdir().unwrap();
    let map = folder.path().join("map");
    let linked = Command::new(linker())
        .args(["-flavor", "gnu", "--gc-sections", "--entry=stillpoint_step"])
        .args(functions.iter().map(|name| format!("--undefined={name}")))
        .arg(directory.join(TARGET).join("image/libstillpoint.a"))
        .arg(format!("-Map={}", map.display()))
        .arg("-o")
        .arg(folder.path().join("linked"))
        .output()
        .unwrap();
    if linked.status.success() {
        Ok(std::fs::read_to_string(map).unwrap())
    } else {
        Err(String::from_utf8_lossy(&linked.stderr).into_owned())
    }
}

/// Bytes of the output sections that a microcontroller keeps in flash.
fn flash(map: &str) -> u64 {
    let size = |line: &str| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let &[_, _, size, _, name] = fields.as_slice() else { return None };
        [".text", ".rodata", ".data", ".ARM.exidx"].contains(&name).then(|| u64::from_str_radix(size, 16).unwrap())
    };
    map.lines().filter_map(size).sum()
}

#[test]
fn no_panic_can_be_reached_and_a_planted_one_is_found() {
    if !has_target() || !linker().is_file() {
        return toolchain::skip(
            "the archive for a microcontroller",
            "no bare-metal target: rustup target add thumbv7em-none-eabihf",
        );
    }
    let exported = exported();
    assert_eq!(exported.len(), 16, "{exported:?}");
    let proof = link(&exported, &[]).unwrap_or_else(|complaint| panic!("a panic can be reached:\n{complaint}"));
    for name in &exported {
        assert!(proof.contains(name.as_str()), "{name} is not linked: the proof proves nothing");
    }
    // Words cost flash, which a program does not pay that does not ask for them.
    let wordless: Vec<String> = exported
        .iter()
        .filter(|name| !["last_error", "fault_names"].iter().any(|n| name.ends_with(n)))
        .cloned()
        .collect();
    let small = link(&wordless, &[]).unwrap();
    eprintln!("flash: {} bytes, without texts of errors and faults {}", flash(&proof), flash(&small));
    assert!(flash(&small) < flash(&proof));
    let control =
        link(&exported, &["--cfg", "panic_control"]).expect_err("a planted panic links: the proof proves nothing");
    assert!(control.contains("undefined symbol: a_panic_can_be_reached"), "{control}");
}
