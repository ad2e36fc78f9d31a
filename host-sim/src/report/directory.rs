//! Files of a run: the directory appears whole, or not at all.

use std::ffi::OsStr;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use model_offline::output::together;
use model_offline::scene::TissueVariant;
use serde::{Deserialize, Serialize};

use super::{Attachments, pictures, render, render_with};
use crate::bench::error::SimError;
use crate::bench::in_space::SpaceRun;
use crate::bench::result::{FORMAT, RunResult};
use crate::bench::usage::UsageError;
use crate::record::error::FileError;
use crate::record::files::{Artifact, read_bytes, write_bytes};
use crate::report::page::space;

/// The result in a report's directory; also the mark by which a former run is known.
const RESULT_FILE: &str = "result.json";
const REPORT_FILE: &str = "report.html";
/// What a run has of every insertion ends in one of these, and starts with the tissue.
const ENDINGS: [&str; 7] = [".rec", ".csv", ".mcap", ".foxglove.json", ".vtu", ".pvd", ".py"];

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
        let parent = parent(directory).to_owned();
        return Err(UsageError::NoParent { directory: directory.to_owned(), parent }.into());
    }
    tempfile::tempfile_in(parent(directory)).map_err(FileError::write(directory))?;
    let Ok(metadata) = directory.symlink_metadata() else {
        return Ok(());
    };
    let empty = || std::fs::read_dir(directory).is_ok_and(|mut entries| entries.next().is_none());
    if metadata.is_dir() && (empty() || Kind::read(directory).is_ok()) {
        return Ok(());
    }
    Err(UsageError::NotAReport { directory: directory.to_owned() }.into())
}

/// Whether a run writes files of this name: those of a former run are replaced, whatever else is there stays.
fn is_of_a_run(name: &OsStr) -> bool {
    let Some(name) = name.to_str() else { return false };
    let of_a_tissue = TissueVariant::ALL.iter().any(|tissue| {
        name.strip_prefix(tissue.name())
            .is_some_and(|rest| rest.starts_with('-') && ENDINGS.iter().any(|e| rest.ends_with(e)))
    });
    of_a_tissue || name == RESULT_FILE || name == REPORT_FILE
}

/// Writes the whole report directory; one of a former run is replaced.
///
/// # Errors
/// [`SimError::File`]; what was there before is untouched then.
pub fn write_run(directory: &Path, result: &RunResult, mut artifacts: Vec<Artifact>) -> Result<(), SimError> {
    artifacts.push(Artifact { name: REPORT_FILE.to_owned(), bytes: render(result).into_bytes() });
    // Node positions by the thousand: in one line it is half the size.
    artifacts.push(encoded(directory, result)?);
    write_directory(directory, &artifacts)
}

/// The same of a run in space. Its page is of what the file says, whose numbers JSON's reader may take for their neighbours: `report`
/// makes the same one again, byte by byte.
///
/// # Errors
/// As [`write_run`].
pub fn write_space_run(directory: &Path, result: &SpaceRun, mut artifacts: Vec<Artifact>) -> Result<(), SimError> {
    let file = encoded(directory, result)?;
    let read = serde_json::from_slice(&file.bytes);
    let page = space::render(read.as_ref().unwrap_or(result), &Attachments::default());
    artifacts.extend([Artifact { name: REPORT_FILE.to_owned(), bytes: page.into_bytes() }, file]);
    write_directory(directory, &artifacts)
}

fn encoded(directory: &Path, result: &impl Serialize) -> Result<Artifact, SimError> {
    let bytes = serde_json::to_vec(result).map_err(std::io::Error::from).map_err(FileError::write(directory))?;
    Ok(Artifact { name: RESULT_FILE.to_owned(), bytes })
}

/// Writes a directory that appears whole; files of a former run are replaced, others go on being there.
fn write_directory(directory: &Path, artifacts: &[Artifact]) -> Result<(), SimError> {
    // Where it really is: a path through the directory itself leads nowhere once that is moved.
    let resolved = resolve(directory).map_err(FileError::write(directory))?;
    let (directory, parent) = (resolved.as_path(), parent(&resolved));
    let temporary =
        tempfile::Builder::new().prefix(".stillpoint-").tempdir_in(parent).map_err(FileError::write(parent))?;
    let new = temporary.path().join("new");
    std::fs::create_dir(&new).map_err(FileError::write(&new))?;
    for artifact in artifacts {
        let path = new.join(&artifact.name);
        write_synced(&path, &artifact.bytes).map_err(FileError::write(directory))?;
    }
    sync(&new).map_err(FileError::write(directory))?;
    let old = temporary.path().join("old");
    let replaced = directory.exists();
    if replaced {
        std::fs::rename(directory, &old).map_err(FileError::write(directory))?;
    }
    let put =
        std::fs::rename(&new, directory).and_then(|()| if replaced { keep_others(&old, directory) } else { Ok(()) });
    if let Err(source) = put {
        // Nothing of what was there is thrown away, if it cannot be put back.
        if replaced && (directory.exists() || std::fs::rename(&old, directory).is_err()) {
            let path = temporary.keep().join("old");
            return Err(SimError::FormerReport { directory: directory.to_owned(), path, source });
        }
        return Err(FileError::write(directory)(source).into());
    }
    Ok(sync(parent).map_err(FileError::write(parent))?)
}

/// A path without links and detours; of what does not exist yet, that of its parent.
fn resolve(directory: &Path) -> std::io::Result<PathBuf> {
    match directory.file_name() {
        Some(name) if !directory.exists() => Ok(parent(directory).canonicalize()?.join(name)),
        _ => directory.canonicalize(),
    }
}

/// Moves what no run writes from a former directory to the one in its place.
fn keep_others(former: &Path, directory: &Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(former)? {
        let entry = entry?;
        let to = directory.join(entry.file_name());
        if !is_of_a_run(&entry.file_name()) && to.symlink_metadata().is_err() {
            std::fs::rename(entry.path(), to)?;
        }
    }
    Ok(())
}

/// Writes a file and waits until the disk has it: a report that appears whole must be whole after a power cut as well.
fn write_synced(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

/// Waits until the disk has a directory's names.
fn sync(directory: &Path) -> std::io::Result<()> {
    File::open(directory)?.sync_all()
}

/// Reads the result of a finished run in the plane.
///
/// # Errors
/// [`SimError::File`], [`SimError::NotARun`].
pub fn read_run(directory: &Path) -> Result<RunResult, SimError> {
    match AnyRun::read(directory)? {
        AnyRun::Plane(result) => Ok(*result),
        AnyRun::Space(_) => {
            let reason = "it is in space, where a run in the plane was expected".to_owned();
            Err(SimError::NotARun { path: directory.join(RESULT_FILE), reason })
        }
    }
}

/// What tells results apart.
#[derive(Deserialize)]
struct Kind {
    format: u32,
    dimension: Option<u32>,
}

impl Kind {
    fn read(directory: &Path) -> Result<(Self, Vec<u8>), SimError> {
        let path = directory.join(RESULT_FILE);
        let bytes = read_bytes(&path)?;
        let kind = serde_json::from_slice(&bytes);
        Ok((kind.map_err(|error| SimError::NotARun { path, reason: error.to_string() })?, bytes))
    }
}

/// The result of a finished run.
enum AnyRun {
    Plane(Box<RunResult>),
    Space(Box<SpaceRun>),
}

impl AnyRun {
    fn read(directory: &Path) -> Result<Self, SimError> {
        let path = directory.join(RESULT_FILE);
        let (Kind { format, dimension }, bytes) = Kind::read(directory)?;
        let not_a_run = |reason: String| SimError::NotARun { path: path.clone(), reason };
        let failed = |error: serde_json::Error| not_a_run(error.to_string());
        if format != FORMAT {
            return Err(not_a_run(format!("its format is {format}, this program reads {FORMAT}")));
        }
        if dimension == Some(3) {
            let run: SpaceRun = serde_json::from_slice(&bytes).map_err(failed)?;
            run.check().map_err(not_a_run)?;
            return Ok(Self::Space(Box::new(run)));
        }
        Ok(Self::Plane(Box::new(serde_json::from_slice(&bytes).map_err(failed)?)))
    }
}

/// Makes the report of a finished run again.
///
/// # Errors
/// [`SimError::File`], [`SimError::NotARun`].
pub fn rebuild_report(directory: &Path) -> Result<(), SimError> {
    let attachments = Attachments::find(directory);
    let page = match AnyRun::read(directory)? {
        AnyRun::Plane(result) => render_with(&result, &attachments),
        AnyRun::Space(result) => space::render(&result, &attachments),
    };
    Ok(write_bytes(&directory.join(REPORT_FILE), page.as_bytes())?)
}

/// Writes the charts of a finished run as pictures of their own; returns their paths.
///
/// # Errors
/// [`SimError::File`], [`SimError::NotARun`].
pub fn write_pictures(directory: &Path, into: &Path) -> Result<Vec<PathBuf>, SimError> {
    let pictures: Vec<(String, String)> = match AnyRun::read(directory)? {
        AnyRun::Plane(result) => pictures(&result).into_iter().map(|(name, svg)| (name.to_owned(), svg)).collect(),
        AnyRun::Space(result) => space::pictures(&result),
    };
    FileError::make_folder(into)?;
    let pictures = pictures.into_iter().map(|(name, svg)| (into.join(name), svg));
    let _together = together();
    pictures.map(|(path, svg)| Ok(write_bytes(&path, svg.as_bytes()).map(|()| path)?)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The least that is known as a former run.
    fn run(bytes: &[u8]) -> Vec<Artifact> {
        let named = |name: &str, bytes: &[u8]| Artifact { name: name.to_owned(), bytes: bytes.to_vec() };
        vec![named(RESULT_FILE, br#"{"format": 1}"#), named("inclusion-dynamic.rec", bytes)]
    }

    fn names(directory: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(directory).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_new_run_replaces_a_former_one_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let report = folder.path().join("report");
        write_directory(&report, &run(b"first")).unwrap();
        std::fs::write(report.join("homogeneous-none.csv"), "of the first run").unwrap();
        std::fs::write(report.join("pareto.json"), "of another command").unwrap();
        std::fs::create_dir(report.join("notes")).unwrap();
        std::fs::write(report.join("notes/bench.txt"), "a day's work").unwrap();
        check_directory(&report).unwrap();
        // Through itself: once it is moved, the path leads nowhere.
        write_directory(&report.join("../report"), &run(b"second")).unwrap();
        assert_eq!(names(&report), ["inclusion-dynamic.rec", "notes", "pareto.json", RESULT_FILE]);
        assert_eq!(std::fs::read(report.join("inclusion-dynamic.rec")).unwrap(), b"second");
        assert_eq!(std::fs::read(report.join("notes/bench.txt")).unwrap(), b"a day's work");
        assert_eq!(names(folder.path()), ["report"], "nothing is left beside it");
    }

    #[test]
    fn another_program_s_result_is_no_report() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(RESULT_FILE), r#"{"other": "tool"}"#).unwrap();
        assert!(matches!(check_directory(folder.path()), Err(SimError::Usage(UsageError::NotAReport { .. }))));
    }
}
