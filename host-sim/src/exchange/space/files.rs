//! Files in places that everybody may write to: nothing is followed, nothing that belongs to somebody else is touched.

use std::ffi::OsStr;
use std::fs::{DirBuilder, File, Permissions};
use std::io::{Read as _, Write as _};
use std::os::fd::OwnedFd;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rustix::fs::{FlockOperation, Mode, OFlags, flock};

use crate::exchange::error::LinkError;

/// Where POSIX shared memory appears as files.
pub(super) const SHARED_MEMORY: &str = "/dev/shm";
/// Start of the name of every file of a link in shared memory, and of its directory.
const MARK: &str = "stillpoint_";
const ROOT_MARK: &str = "stillpoint-";
/// Ends a link's name in the names of its files: no link's name has it.
const END_OF_NAME: char = '.';

/// File in a link's directory with the part of its names that nobody else can guess.
const KEY_FILE: &str = "key";
/// File in a link's directory that everybody locks who has entered.
const PRESENCE_FILE: &str = "present";

/// What iceoryx2 makes in a link's directory.
const TRANSPORT_DIRECTORIES: [&str; 2] = ["nodes", "services"];

/// What a path of iceoryx2's may be long, 255, without what its longest has besides the directory that links are in and twice
/// the link's name: marks, a key, a hash of 40 digits, two numbers of 32, words. Past it, it panics.
pub(super) const ROOM: usize = 94;
/// Where links are whose directory for temporary files has too long a path.
const SHORT_BASE: &str = "/tmp";

/// How long somebody who has a link's key may take to enter.
const ON_THE_WAY: Duration = Duration::from_secs(10);
/// How long somebody else may be at work in a link's directory.
const LOCK_TIMEOUT: Duration = Duration::from_secs(8);
const BETWEEN_TRIALS: Duration = Duration::from_millis(2);

/// Where directories of links may be.
pub(super) fn bases() -> [PathBuf; 2] {
    [std::env::temp_dir(), PathBuf::from(SHORT_BASE)]
}

/// Directory of a link's files: in that for temporary files, or in `/tmp` where paths of the files in it would be longer than
/// iceoryx2 can say. Everybody with the same environment comes to the same.
pub(super) fn root(name: &str) -> PathBuf {
    let [temporary, short] = bases();
    let fits = temporary.as_os_str().len() + 2 * name.len() <= ROOM;
    (if fits { temporary } else { short }).join(format!("{ROOT_MARK}{name}"))
}

/// Name of the link that a directory is of, if it is one's.
pub(super) fn name_of_root(file_name: &str) -> Option<&str> {
    file_name.strip_prefix(ROOT_MARK)
}

/// Name of the link that a file in shared memory is of, if it is one's.
pub(super) fn name_of_file(file_name: &str) -> Option<&str> {
    Some(file_name.strip_prefix(MARK)?.split_once(END_OF_NAME)?.0)
}

/// Start of the names of a link's files with this key.
pub(super) fn prefix(name: &str, key: &str) -> String {
    format!("{MARK}{name}{END_OF_NAME}{key}_")
}

fn is_own(metadata: &std::fs::Metadata) -> bool {
    metadata.uid() == rustix::process::geteuid().as_raw()
}

/// Own files of a link in shared memory.
pub(super) fn in_shared_memory(name: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let ours = entries.filter(|entry| {
        name_of_file(&entry.file_name().to_string_lossy()) == Some(name)
            && entry.path().symlink_metadata().is_ok_and(|metadata| is_own(&metadata))
    });
    ours.map(|entry| entry.path()).collect()
}

/// Opens a regular file of this user's own, and nothing else: no link is followed, and the owner is that of what was
/// opened.
pub(super) fn open_own(path: &Path) -> Option<File> {
    // Without waiting: somebody may have put a pipe there.
    let flags = OFlags::RDWR | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let file = File::from(rustix::fs::open(path, flags, Mode::empty()).ok()?);
    let metadata = file.metadata().ok()?;
    (metadata.is_file() && metadata.nlink() == 1 && is_own(&metadata)).then_some(file)
}

/// Takes everybody else's rights to a file of this user's own, and has all of its memory allocated now, so that a lack
/// of memory fails here and never in the loop.
///
/// # Errors
/// [`LinkError::Directory`], [`LinkError::Memory`].
pub(super) fn secure(path: &Path) -> Result<(), LinkError> {
    // Gone by now, or somebody else's: neither is ours to change.
    let Some(file) = open_own(path) else { return Ok(()) };
    let Ok(metadata) = file.metadata() else { return Ok(()) };
    let failed = |source| LinkError::Directory { path: path.to_owned(), source };
    if metadata.mode() & 0o077 != 0 {
        file.set_permissions(Permissions::from_mode(0o600)).map_err(failed)?;
    }
    let length = metadata.len();
    if length == 0 {
        return Ok(());
    }
    match rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::KEEP_SIZE, 0, length) {
        Err(rustix::io::Errno::NOSPC) => Err(LinkError::Memory { available: 0, needed: length }),
        _ => Ok(()),
    }
}

/// Makes the directory, owner-only.
///
/// # Errors
/// [`LinkError::Directory`]; [`LinkError::Foreign`] when there is something else of that name already.
pub(super) fn make_root(root: &Path) -> Result<(), LinkError> {
    let failed = |source| LinkError::Directory { path: root.to_owned(), source };
    match DirBuilder::new().mode(0o700).create(root) {
        Err(error) if error.kind() != std::io::ErrorKind::AlreadyExists => Err(failed(error)),
        _ => open_root(root).map(drop),
    }
}

/// Opens the directory. That for temporary files is everybody's: one of this name that somebody else has made, may
/// write to, or has linked elsewhere is not used.
fn open_root(root: &Path) -> Result<File, LinkError> {
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let failed = |source| LinkError::Directory { path: root.to_owned(), source };
    let opened = rustix::fs::open(root, flags, Mode::empty()).map_err(|errno| match errno {
        rustix::io::Errno::LOOP | rustix::io::Errno::NOTDIR | rustix::io::Errno::ACCESS => {
            LinkError::Foreign { path: root.to_owned() }
        }
        errno => failed(errno.into()),
    })?;
    let directory = File::from(opened);
    let metadata = directory.metadata().map_err(failed)?;
    if is_own(&metadata) && metadata.mode() & 0o077 == 0 {
        Ok(directory)
    } else {
        Err(LinkError::Foreign { path: root.to_owned() })
    }
}

/// Whoever has this is alone at work in the directory; a process that dies lets go.
#[derive(Debug)]
pub(in crate::exchange) struct Locked(#[expect(dead_code, reason = "held until dropped")] File);

/// Makes the directory if need be, and waits until nobody else is at work in it.
///
/// # Errors
/// [`LinkError::Directory`], also when somebody else does not finish; [`LinkError::Foreign`].
pub(super) fn lock_root(root: &Path) -> Result<Locked, LinkError> {
    lock_root_within(root, LOCK_TIMEOUT)
}

/// The same, for who does not wait that long.
///
/// # Errors
/// As [`lock_root`].
pub(super) fn lock_root_within(root: &Path, patience: Duration) -> Result<Locked, LinkError> {
    let failed = |source| LinkError::Directory { path: root.to_owned(), source };
    let until = Instant::now() + patience;
    loop {
        make_root(root)?;
        // It may have been removed and made anew between any two of these lines.
        match open_root(root) {
            Ok(directory) => match flock(&directory, FlockOperation::NonBlockingLockExclusive) {
                Ok(()) => {
                    let locked = directory.metadata().map_err(failed)?.ino();
                    if root.symlink_metadata().is_ok_and(|metadata| metadata.ino() == locked) {
                        return Ok(Locked(directory));
                    }
                }
                Err(rustix::io::Errno::WOULDBLOCK | rustix::io::Errno::INTR) => {}
                Err(errno) => return Err(failed(errno.into())),
            },
            Err(LinkError::Directory { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
        if Instant::now() > until {
            return Err(failed(std::io::Error::other("another process holds it and does not finish")));
        }
        std::thread::sleep(BETWEEN_TRIALS);
    }
}

/// The key in a locked directory: `wanted` if there is none, else a new one that nobody can guess.
///
/// # Errors
/// [`LinkError::Directory`]; [`LinkError::Occupied`] where there is no key but something that is no link's: it would be
/// removed with the link.
pub(super) fn key(root: &Path, _locked: &Locked, wanted: Option<&str>) -> Result<String, LinkError> {
    let path = root.join(KEY_FILE);
    let failed = |source| LinkError::Directory { path: path.clone(), source };
    if let Some(found) = known_key(root) {
        return Ok(found);
    }
    let entries = std::fs::read_dir(root).map_err(failed)?.filter_map(Result::ok);
    if entries.map(|entry| entry.file_name()).any(|name| !is_of_a_link(&name)) {
        return Err(LinkError::Occupied { path: root.to_owned() });
    }
    let key = wanted.map_or_else(random_key, |key| Ok(key.to_owned())).map_err(failed)?;
    let flags = OFlags::WRONLY | OFlags::CREATE | OFlags::TRUNC | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let opened: OwnedFd = rustix::fs::open(&path, flags, Mode::from_raw_mode(0o600)).map_err(|e| failed(e.into()))?;
    File::from(opened).write_all(key.as_bytes()).map_err(failed)?;
    Ok(key)
}

/// Whether a link's directory has something of this name.
fn is_of_a_link(name: &OsStr) -> bool {
    let known = [KEY_FILE, PRESENCE_FILE].into_iter().chain(TRANSPORT_DIRECTORIES);
    known.into_iter().any(|known| name == known)
}

/// The key in a directory, if there is one: its name alone does not make it a link's.
pub(super) fn known_key(root: &Path) -> Option<String> {
    let mut found = String::new();
    open_own(&root.join(KEY_FILE))?.take(64).read_to_string(&mut found).ok()?;
    (found.len() == 16 && found.bytes().all(|byte| byte.is_ascii_hexdigit())).then_some(found)
}

/// Whether a directory has what iceoryx2 makes, nothing else, and no key: somebody went in while somebody else removed it.
pub(super) fn is_half_removed(root: &Path) -> bool {
    let names: Vec<_> =
        std::fs::read_dir(root).into_iter().flatten().flatten().map(|entry| entry.file_name()).collect();
    let has_transport = TRANSPORT_DIRECTORIES.iter().any(|known| names.iter().any(|name| name == known));
    has_transport && known_key(root).is_none() && names.iter().all(|name| is_of_a_link(name))
}

/// 64 bits from the operating system, as hexadecimal digits.
///
/// # Errors
/// There is no source of randomness.
pub(in crate::exchange) fn random_key() -> std::io::Result<String> {
    let mut bytes = [0; 8];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(format!("{:016x}", u64::from_le_bytes(bytes)))
}

fn presence_file(root: &Path) -> std::io::Result<File> {
    let flags = OFlags::RDWR | OFlags::CREATE | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    Ok(rustix::fs::open(root.join(PRESENCE_FILE), flags, Mode::from_raw_mode(0o600))?.into())
}

/// Whoever has this has entered the link; a process that dies has left it.
#[derive(Debug)]
pub(in crate::exchange) struct Presence(#[expect(dead_code, reason = "held until dropped")] File);

/// Enters.
///
/// # Errors
/// [`LinkError::Directory`].
pub(super) fn enter(root: &Path) -> Result<Presence, LinkError> {
    let failed = |source| LinkError::Directory { path: root.to_owned(), source };
    let file = presence_file(root).map_err(failed)?;
    flock(&file, FlockOperation::NonBlockingLockShared).map_err(|errno| failed(errno.into()))?;
    Ok(Presence(file))
}

/// Whether it is certain that nobody has entered. What cannot be found out is not certain.
pub(super) fn is_empty(root: &Path, _locked: &Locked) -> bool {
    presence_file(root).is_ok_and(|file| flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok())
}

/// Whether somebody has made the key who may be about to enter: it is new, and nobody ever has entered. Were the directory removed
/// now, the peer would make another key.
#[expect(clippy::disallowed_methods, reason = "files have the wall clock's time")]
pub(super) fn is_awaited(root: &Path, _locked: &Locked) -> bool {
    let made = root.join(KEY_FILE).symlink_metadata().and_then(|metadata| metadata.modified());
    // A key of a time to come may be new: clocks are set.
    made.is_ok_and(|made| made.elapsed().map_or(true, |age| age < ON_THE_WAY)) && !root.join(PRESENCE_FILE).exists()
}

/// Removes the link's files in shared memory that have no bytes yet. Whoever makes one holds the lock from before it is
/// there until it has its size, so that under the lock an empty one is a dead process's; iceoryx2 0.10 would wait for it to
/// grow, without end.
pub(super) fn remove_half_made(name: &str, _locked: &Locked) {
    for file in in_shared_memory(name) {
        if file.symlink_metadata().is_ok_and(|metadata| metadata.is_file() && metadata.len() == 0) {
            let _ = std::fs::remove_file(file);
        }
    }
}

/// Removes a link's directory and its files in shared memory. Whether there were any of the latter.
pub(super) fn remove(name: &str, _locked: &Locked) -> bool {
    let files = in_shared_memory(name);
    let root = root(name);
    // The key last: by it a sweep knows what somebody did not finish removing.
    for entry in std::fs::read_dir(&root).into_iter().flatten().flatten().filter(|entry| entry.file_name() != KEY_FILE)
    {
        let path = entry.path();
        let _ = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
    }
    let _ = std::fs::remove_dir_all(root);
    for file in &files {
        let _ = std::fs::remove_file(file);
    }
    !files.is_empty()
}

/// While this lives, files that this process makes are its user's alone, whoever makes them: the transport has modes of
/// its own. One at a time, since the mask is the whole process's.
#[derive(Debug)]
pub(super) struct OwnerOnly {
    before: Mode,
    _turn: MutexGuard<'static, ()>,
}

impl OwnerOnly {
    pub(super) fn begin() -> Self {
        static TURN: Mutex<()> = Mutex::new(());
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        Self { before: rustix::process::umask(Mode::from_raw_mode(0o077)), _turn: turn }
    }
}

impl Drop for OwnerOnly {
    fn drop(&mut self) {
        rustix::process::umask(self.before);
    }
}
