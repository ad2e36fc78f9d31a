//! Outputs, checked before the work begins: a result that cannot be kept is known in the first second, and no output
//! overwrites an input or another output.

use super::destination::{Destination, folder_of, is_standard_output};
use super::terminal;
use std::path::{Path, PathBuf};

/// An output that is refused before anything is computed.
#[derive(Debug, thiserror::Error)]
#[error("{option} {}: {reason}", path.display())]
pub struct OutputRefused {
    /// The option that names it.
    pub option: &'static str,
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub reason: RefusalReason,
}

/// Why an output is refused.
#[derive(Debug, thiserror::Error)]
pub enum RefusalReason {
    /// It would overwrite what the command reads.
    #[error("this is an input of the same command; name another file")]
    IsInput,
    /// Two outputs would overwrite each other.
    #[error("{0} names the same file; name two")]
    Twice(&'static str),
    /// A folder is in its place.
    #[error("a directory is in its place; name a file")]
    IsDirectory,
    /// Symbolic links that never end.
    #[error("the symbolic links lead round in a circle: {0}")]
    Link(std::io::Error),
    /// Nothing can be written in its folder.
    #[error("nothing can be written in its directory ({}): {source}", folder.display())]
    Folder {
        /// The folder, behind symbolic links.
        folder: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// Refuses outputs that cannot be written, that name one file twice, or that name an input. An output is the option that
/// names it and its path; symbolic links are followed. Inputs that do not exist (names of bundled scenes) are passed over; devices and pipes, such
/// as `/dev/stdout`, are written to as they are and may be named twice.
///
/// # Errors
/// [`OutputRefused`] names the option and the file; nothing has been written.
pub fn check_outputs(inputs: &[&Path], outputs: &[(&'static str, Option<&Path>)]) -> Result<(), OutputRefused> {
    let inputs: Vec<Identity> = inputs.iter().filter(|path| path.exists()).map(|path| Identity::of(path)).collect();
    let mut seen: Vec<(&'static str, Identity)> = Vec::new();
    for (option, path) in outputs.iter().filter_map(|&(option, path)| Some((option, path?))) {
        let refused = |reason| OutputRefused { option, path: path.to_owned(), reason };
        if path.is_dir() || path.as_os_str().as_encoded_bytes().ends_with(b"/") {
            return Err(refused(RefusalReason::IsDirectory));
        }
        let file = match Destination::of(path).map_err(|error| refused(RefusalReason::Link(error)))? {
            // A descriptor may be of a file.
            Destination::Stream(stream) if inputs.contains(&Identity::of(&stream)) => {
                return Err(refused(RefusalReason::IsInput));
            }
            Destination::Stream(stream) => {
                if is_standard_output(&stream) {
                    terminal::give_way();
                }
                continue;
            }
            Destination::File(file) => file,
        };
        let identity = Identity::of(&file);
        if inputs.contains(&identity) {
            return Err(refused(RefusalReason::IsInput));
        }
        if let Some((other, _)) = seen.iter().find(|(_, other)| *other == identity) {
            return Err(refused(RefusalReason::Twice(other)));
        }
        let folder = folder_of(&file);
        tempfile::tempfile_in(folder)
            .map_err(|source| refused(RefusalReason::Folder { folder: folder.to_owned(), source }))?;
        seen.push((option, identity));
    }
    Ok(())
}

/// What makes two paths the same file, whether it exists or not, through links of either kind.
#[derive(Debug)]
struct Identity {
    path: PathBuf,
    inode: Option<(u64, u64)>,
}

impl PartialEq for Identity {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path || (self.inode.is_some() && self.inode == other.inode)
    }
}

impl Identity {
    fn of(path: &Path) -> Self {
        let resolved = path.canonicalize().or_else(|_| {
            let folder = folder_of(path).canonicalize()?;
            Ok::<_, std::io::Error>(path.file_name().map_or(folder.clone(), |name| folder.join(name)))
        });
        Self { path: resolved.unwrap_or_else(|_| path.to_owned()), inode: inode(path) }
    }
}

#[cfg(unix)]
fn inode(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt as _;
    let metadata = path.metadata().ok()?;
    Some((metadata.dev(), metadata.ino()))
}

#[cfg(not(unix))]
fn inode(_: &Path) -> Option<(u64, u64)> {
    None
}

#[cfg(test)]
mod tests {
    use super::{RefusalReason, check_outputs};
    use std::fs;

    #[test]
    fn an_output_is_no_input_and_no_other_output_whatever_it_is_called() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("ok.rec"), b"data").unwrap();
        fs::create_dir(at("sub")).unwrap();
        fs::hard_link(at("ok.rec"), at("hard")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(at("ok.rec"), at("soft")).unwrap();
        let input = at("ok.rec");
        for alias in ["ok.rec", "sub/../ok.rec", "./ok.rec", "hard", "soft"] {
            let refused = check_outputs(&[&input], &[("--csv", Some(&at(alias)))]).unwrap_err();
            assert!(matches!(refused.reason, RefusalReason::IsInput), "{alias}: {refused}");
        }
        let refused =
            check_outputs(&[], &[("--csv", Some(&at("new"))), ("--mcap", Some(&at("sub/../new")))]).unwrap_err();
        assert!(matches!(refused.reason, RefusalReason::Twice("--csv")), "{refused}");
        let refused = check_outputs(&[], &[("--json", Some(&at("sub")))]).unwrap_err();
        assert!(matches!(refused.reason, RefusalReason::IsDirectory), "{refused}");
        let refused = check_outputs(&[], &[("--json", Some(&at("none/x")))]).unwrap_err();
        assert!(matches!(refused.reason, RefusalReason::Folder { .. }), "{refused}");
        check_outputs(&[&input, &at("paper")], &[("--csv", Some(&at("a"))), ("--json", Some(&at("b")))]).unwrap();
        #[cfg(unix)]
        {
            let link = |to: &str, name: &str| std::os::unix::fs::symlink(to, at(name)).unwrap();
            link("new", "sub/../to-new");
            link("to-new", "sub/../round");
            let both = [("--csv", Some(at("new"))), ("--mcap", Some(at("to-new")))];
            let refused = check_outputs(&[], &both.each_ref().map(|(o, p)| (*o, p.as_deref()))).unwrap_err();
            assert!(matches!(refused.reason, RefusalReason::Twice("--csv")), "{refused}");
            fs::remove_file(at("to-new")).unwrap();
            link("round", "to-new");
            let refused = check_outputs(&[], &[("--csv", Some(&at("round")))]).unwrap_err();
            assert!(matches!(refused.reason, RefusalReason::Link(_)), "{refused}");
            fs::remove_file(at("to-new")).unwrap();
            fs::remove_file(at("round")).unwrap();
        }
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            if cfg!(unix) { 4 } else { 3 },
            "something was written"
        );
    }
}
