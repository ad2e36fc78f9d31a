//! Files of a run: the directory appears whole, or not at all.

use std::path::{Path, PathBuf};

use model_offline::output::{OutputError, write_whole};
use serde::Serialize;

use crate::bench::result::{FORMAT, RunResult};
use crate::bench::strategy::Artifact;
use crate::error::SimError;
use crate::report;

/// The result in a report's directory; also the mark by which a former run is known.
const RESULT_FILE: &str = "result.json";
const REPORT_FILE: &str = "report.html";

fn write_error(path: &Path) -> impl FnOnce(std::io::Error) -> SimError {
    let path = path.to_owned();
    move |source| SimError::Write { path, source }
}

fn whole(path: &Path, bytes: &[u8]) -> Result<(), SimError> {
    write_whole(path, bytes).map_err(|OutputError { path, source, .. }| SimError::Write { path, source })
}

fn parent(directory: &Path) -> &Path {
    match directory.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Refuses directories that cannot become a report, before anything is computed.
///
/// # Errors
/// [`SimError::Usage`].
pub fn check_directory(directory: &Path) -> Result<(), SimError> {
    if !parent(directory).is_dir() {
        return Err(SimError::Usage(format!(
            "--out {}: the directory {} does not exist",
            directory.display(),
            parent(directory).display()
        )));
    }
    let Ok(metadata) = directory.symlink_metadata() else {
        return Ok(());
    };
    let empty = || std::fs::read_dir(directory).is_ok_and(|mut entries| entries.next().is_none());
    if metadata.is_dir() && (empty() || directory.join(RESULT_FILE).is_file()) {
        return Ok(());
    }
    Err(SimError::Usage(format!(
        "--out {}: it exists and is not the report of a former run; name another directory",
        directory.display()
    )))
}

fn json(value: &impl Serialize) -> Vec<u8> {
    let mut bytes = serde_json::to_vec_pretty(value).expect("results have only plain fields");
    bytes.push(b'\n');
    bytes
}

fn compact(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("results have only plain fields")
}

/// Writes a file.
///
/// # Errors
/// [`SimError::Write`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), SimError> {
    whole(path, bytes)
}

/// Writes a text file.
///
/// # Errors
/// [`SimError::Write`].
pub fn write_text(path: &Path, text: &str) -> Result<(), SimError> {
    whole(path, text.as_bytes())
}

/// Writes the result as JSON.
///
/// # Errors
/// [`SimError::Write`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), SimError> {
    whole(path, &json(value))
}

/// Writes the whole report directory; one of a former run is replaced.
///
/// # Errors
/// [`SimError::Write`]; what was there before is untouched then.
pub fn write_run(directory: &Path, result: &RunResult, artifacts: Vec<Artifact>) -> Result<(), SimError> {
    let parent = parent(directory);
    let temporary = tempfile::Builder::new().prefix(".stillpoint-").tempdir_in(parent).map_err(write_error(parent))?;
    let new = temporary.path().join("new");
    std::fs::create_dir(&new).map_err(write_error(&new))?;
    let page = Artifact { name: REPORT_FILE.to_owned(), bytes: report::render(result).into_bytes() };
    // Node positions by the thousand: in one line it is half the size.
    let summary = Artifact { name: RESULT_FILE.to_owned(), bytes: compact(result) };
    for artifact in artifacts.iter().chain([&page, &summary]) {
        let path = new.join(&artifact.name);
        std::fs::write(&path, &artifact.bytes).map_err(write_error(directory))?;
    }
    let old = temporary.path().join("old");
    let replaced = directory.exists();
    if replaced {
        std::fs::rename(directory, &old).map_err(write_error(directory))?;
    }
    std::fs::rename(&new, directory).map_err(|source| {
        if replaced {
            let _ = std::fs::rename(&old, directory);
        }
        write_error(directory)(source)
    })
}

/// Reads the result of a finished run.
///
/// # Errors
/// [`SimError::Read`], [`SimError::NotARun`].
pub fn read_run(directory: &Path) -> Result<RunResult, SimError> {
    let path = directory.join(RESULT_FILE);
    let bytes = std::fs::read(&path).map_err(|source| SimError::Read { path: path.clone(), source })?;
    let not_a_run = |reason: String| SimError::NotARun { path: path.clone(), reason };
    let result: RunResult = serde_json::from_slice(&bytes).map_err(|error| not_a_run(error.to_string()))?;
    if result.format != FORMAT {
        return Err(not_a_run(format!("its format is {}, this program reads {FORMAT}", result.format)));
    }
    Ok(result)
}

/// Makes the report of a finished run again.
///
/// # Errors
/// As [`read_run`], [`SimError::Write`].
pub fn rebuild_report(directory: &Path) -> Result<(), SimError> {
    let result = read_run(directory)?;
    let path = directory.join(REPORT_FILE);
    whole(&path, report::render_with(&result, &report::Attachments::find(directory)).as_bytes())
}

/// Writes the charts of a finished run as pictures of their own; returns their paths.
///
/// # Errors
/// As [`read_run`], [`SimError::Write`].
pub fn write_pictures(directory: &Path, into: &Path) -> Result<Vec<PathBuf>, SimError> {
    let result = read_run(directory)?;
    std::fs::create_dir_all(into).map_err(write_error(into))?;
    let pictures = report::pictures(&result).into_iter().map(|(name, svg)| (into.join(name), svg));
    pictures.map(|(path, svg)| whole(&path, svg.as_bytes()).map(|()| path)).collect()
}
