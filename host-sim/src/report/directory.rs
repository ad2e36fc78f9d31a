//! Files of a run: the directory appears whole, or not at all.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

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
    let Ok(metadata) = directory.symlink_metadata() else {
        return Ok(());
    };
    let empty = || std::fs::read_dir(directory).is_ok_and(|mut entries| entries.next().is_none());
    if metadata.is_dir() && (empty() || directory.join(RESULT_FILE).is_file()) {
        return Ok(());
    }
    Err(UsageError::NotAReport { directory: directory.to_owned() }.into())
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

/// Writes a directory that appears whole; a former one is replaced.
fn write_directory(directory: &Path, artifacts: &[Artifact]) -> Result<(), SimError> {
    let parent = parent(directory);
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
    std::fs::rename(&new, directory).map_err(|source| {
        if replaced {
            let _ = std::fs::rename(&old, directory);
        }
        FileError::write(directory)(source)
    })?;
    Ok(sync(parent).map_err(FileError::write(parent))?)
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

/// The result of a finished run.
enum AnyRun {
    Plane(Box<RunResult>),
    Space(Box<SpaceRun>),
}

impl AnyRun {
    fn read(directory: &Path) -> Result<Self, SimError> {
        /// What tells results apart.
        #[derive(Deserialize)]
        struct Kind {
            format: u32,
            dimension: Option<u32>,
        }
        let path = directory.join(RESULT_FILE);
        let bytes = read_bytes(&path)?;
        let not_a_run = |reason: String| SimError::NotARun { path: path.clone(), reason };
        let failed = |error: serde_json::Error| not_a_run(error.to_string());
        let Kind { format, dimension } = serde_json::from_slice(&bytes).map_err(failed)?;
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
    std::fs::create_dir_all(into).map_err(FileError::write(into))?;
    let pictures = pictures.into_iter().map(|(name, svg)| (into.join(name), svg));
    pictures.map(|(path, svg)| Ok(write_bytes(&path, svg.as_bytes()).map(|()| path)?)).collect()
}
