//! The library as the guide builds it, and the compilers of this machine.
#![allow(dead_code)] // Each test uses some of it.

use std::ffi::OsStr;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Says what is not tested here, and why.
///
/// # Panics
/// In CI, which sets `CI_NEEDS_QEMU`: a test that is skipped there is a test that nobody runs.
pub(crate) fn skip(untested: &str, missing: impl Display) {
    assert!(std::env::var_os("CI_NEEDS_QEMU").is_none(), "{missing}");
    eprintln!("skipped: {untested} was not tested: {missing}");
}

pub(crate) fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Whether a program is there.
pub(crate) fn answers(program: &str) -> bool {
    let found = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    found.is_ok_and(|status| status.success())
}

/// Builds the archive as the guide does, with these arguments besides, apart from the build that runs the tests.
pub(crate) fn cargo<S: AsRef<OsStr>>(directory: &Path, arguments: &[S]) -> std::process::Output {
    Command::new(env!("CARGO"))
        .args(["rustc", "--quiet", "--locked", "--lib", "--crate-type", "staticlib", "--target-dir"])
        .arg(directory)
        .args(arguments)
        .current_dir(package())
        .env_remove("CARGO_BUILD_TARGET")
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// A place for programs that are linked with the library.
pub(crate) struct Build {
    folder: tempfile::TempDir,
    archive: PathBuf,
}

impl Build {
    /// `None`, and a word about it, without a compiler.
    pub(crate) fn new(untested: &str) -> Option<Self> {
        if !answers("gcc") || !answers("g++") {
            skip(untested, "no gcc or g++: install a C compiler");
            return None;
        }
        let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c-library");
        // With the assertions and overflow checks of a test build.
        let built = cargo::<&str>(&directory, &[]);
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
        Some(Self { folder: tempfile::tempdir().unwrap(), archive: directory.join("debug/libstillpoint.a") })
    }

    /// The example, with every warning an error.
    pub(crate) fn compile(&self, compiler: &str, options: &[&str]) -> PathBuf {
        self.compile_source(&package().join("example/loop.c"), compiler, options)
    }

    pub(crate) fn compile_source(&self, source: &Path, compiler: &str, options: &[&str]) -> PathBuf {
        let program = self.folder.path().join("program");
        let compiled = Command::new(compiler)
            .args(options)
            .args(["-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "-I"])
            .arg(package().join("include"))
            .arg(source)
            // What follows is an archive, whatever language was asked for.
            .args(["-x", "none"])
            .arg(&self.archive)
            .arg("-o")
            .arg(&program)
            .output()
            .unwrap();
        assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
        program
    }
}
