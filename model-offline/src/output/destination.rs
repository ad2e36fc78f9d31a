//! Where an output goes: a file, also one behind symbolic links, or something that bytes flow into.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

/// Symbolic links that are followed, as many as Linux does.
const MOST_LINKS: usize = 40;

/// What a path that is written to stands for.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Destination {
    /// A file, which need not exist: no symbolic link.
    File(PathBuf),
    /// A device, a pipe, or a descriptor of a process (`/dev/stdout`): there is nothing to put in its place.
    Stream(PathBuf),
}

impl Destination {
    /// Follows symbolic links, so that a link stays, and what is behind it is written.
    ///
    /// # Errors
    /// Links that never end.
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        let mut path = path.to_owned();
        for _ in 0..MOST_LINKS {
            let Ok(target) = path.read_link() else {
                let is_stream = path.exists() && !path.is_file() && !path.is_dir();
                return Ok(if is_stream { Self::Stream(path) } else { Self::File(path) });
            };
            // Links there stand for what a process has opened, whatever name it had.
            if folder_of(&path).canonicalize().is_ok_and(|folder| folder.starts_with("/proc")) {
                return Ok(Self::Stream(path));
            }
            path = folder_of(&path).join(target);
        }
        Err(path.metadata().err().unwrap_or_else(|| io::Error::other("too many symbolic links")))
    }
}

/// Writes to a device, a pipe or a descriptor; to what another descriptor than those of standard output and error is of, if that
/// is a file, at its end.
pub(super) fn write_stream(path: &Path, bytes: &[u8]) -> io::Result<()> {
    // To open it once more would give a position of its own, and what is said afterwards would overwrite the bytes.
    match descriptor_of(path) {
        Some(1) => {
            let mut out = io::stdout().lock();
            return out.write_all(bytes).and_then(|()| out.flush());
        }
        Some(2) => return io::stderr().write_all(bytes),
        _ => {}
    }
    File::options().append(true).open(path)?.write_all(bytes)
}

/// Whether a stream is this process's standard output.
pub(super) fn is_standard_output(stream: &Path) -> bool {
    descriptor_of(stream) == Some(1)
}

/// Which of this process's descriptors a path stands for.
fn descriptor_of(path: &Path) -> Option<u32> {
    let own = ["/proc/self/fd", "/proc/thread-self/fd"].map(|folder| Path::new(folder).canonicalize().ok());
    let folder = folder_of(path).canonicalize().ok()?;
    own.contains(&Some(folder)).then(|| path.file_name()?.to_str()?.parse().ok())?
}

/// The folder that a path lies in.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    #[test]
    fn links_are_followed_to_what_is_behind_them() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("sub")).unwrap();
        fs::write(at("sub/file"), b"").unwrap();
        symlink("sub/file", at("relative")).unwrap();
        symlink(at("relative"), at("chain")).unwrap();
        symlink("sub/none", at("dangling")).unwrap();
        symlink("round", at("round")).unwrap();
        symlink("/dev/null", at("null")).unwrap();
        let file = |name: &str| Destination::File(at(name));
        assert_eq!(Destination::of(&at("new")).unwrap(), file("new"));
        assert_eq!(Destination::of(&at("sub/file")).unwrap(), file("sub/file"));
        assert_eq!(Destination::of(&at("relative")).unwrap(), file("sub/file"));
        assert_eq!(Destination::of(&at("chain")).unwrap(), file("sub/file"));
        assert_eq!(Destination::of(&at("dangling")).unwrap(), file("sub/none"));
        assert_eq!(Destination::of(&at("null")).unwrap(), Destination::Stream("/dev/null".into()));
        assert_eq!(Destination::of(Path::new("bare")).unwrap(), Destination::File("bare".into()));
        let endless = Destination::of(&at("round")).unwrap_err();
        assert!(endless.raw_os_error().is_some(), "{endless}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_descriptor_is_a_stream_whatever_it_was_opened_as() {
        use std::os::fd::AsRawFd as _;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("opened");
        let mut opened = File::create(&path).unwrap();
        opened.write_all(b"before ").unwrap();
        for process in ["self", "thread-self", &std::process::id().to_string()] {
            let descriptor = PathBuf::from(format!("/proc/{process}/fd/{}", opened.as_raw_fd()));
            assert_eq!(Destination::of(&descriptor).unwrap(), Destination::Stream(descriptor.clone()));
            assert_eq!(descriptor_of(&descriptor), u32::try_from(opened.as_raw_fd()).ok());
            assert_eq!(descriptor_of(&descriptor.with_file_name("1")), Some(1), "{process}");
        }
        let link = folder.path().join("link");
        symlink(format!("/proc/self/fd/{}", opened.as_raw_fd()), &link).unwrap();
        super::super::write_whole(&link, b"after").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"before after");
        assert!(link.is_symlink());
    }
}
