//! Places that everybody may write to, and what others may have put there.

use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};

use iceoryx2::service::ipc;

use super::*;
use crate::exchange::{ControllerPorts, PlantPorts};

/// Somebody else's number: only root can make files that are theirs.
const NOBODY: u32 = 65_534;

/// Named after this process, so that no sweep takes it.
fn space(what: &str) -> Space {
    Space::new(&format!("{RUN}{}-{what}", std::process::id())).unwrap()
}

fn mode(path: &Path) -> u32 {
    path.symlink_metadata().unwrap().mode() & 0o777
}

/// A file of this user's that looks like one of the space's, for everybody to read.
fn plant(path: PathBuf) -> PathBuf {
    std::fs::write(&path, [0; 100]).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o644)).unwrap();
    path
}

fn name_of_a_file(space: &Space, what: &str) -> PathBuf {
    Path::new(files::SHARED_MEMORY).join(format!("{}{what}", files::prefix(&space.name, &space.key)))
}

#[test]
fn rights_to_own_files_are_taken_away_and_links_are_not_followed() {
    let space = space("links");
    let folder = tempfile::tempdir().unwrap();
    let own = plant(name_of_a_file(&space, "own"));
    let elsewhere = plant(folder.path().join("not ours to change"));
    let link = name_of_a_file(&space, "link");
    symlink(&elsewhere, &link).unwrap();
    space.secure().unwrap();
    assert_eq!((mode(&own), mode(&elsewhere)), (0o600, 0o644));
    space.leave::<ipc::Service>(Departure::First);
    assert!(!own.exists() && link.symlink_metadata().is_err() && elsewhere.exists());
}

#[test]
fn files_of_others_are_left_alone_and_stop_nobody() {
    if !rustix::process::geteuid().is_root() {
        return println!("skipped: only root can make files that belong to others");
    }
    let space = space("others");
    let theirs = plant(name_of_a_file(&space, "theirs"));
    std::fs::set_permissions(&theirs, std::fs::Permissions::from_mode(0o666)).unwrap();
    std::os::unix::fs::chown(&theirs, Some(NOBODY), None).unwrap();
    let ports = PlantPorts::<ipc::Service>::open(&space).unwrap();
    assert_eq!(mode(&theirs), 0o666);
    drop(ports);
    space.leave::<ipc::Service>(Departure::First);
    assert!(theirs.exists() && !space.root().exists());
    std::fs::remove_file(theirs).unwrap();
}

#[test]
fn a_squatted_directory_is_refused_and_a_link_to_one_is() {
    let name = format!("test-squat-{}", std::process::id());
    let folder = tempfile::tempdir().unwrap();
    let place = files::root(&name);
    symlink(folder.path(), &place).unwrap();
    assert!(matches!(Space::new(&name), Err(LinkError::Foreign { .. })));
    std::fs::remove_file(&place).unwrap();
    std::fs::create_dir(&place).unwrap();
    std::fs::set_permissions(&place, std::fs::Permissions::from_mode(0o777)).unwrap();
    assert!(matches!(Space::new(&name), Err(LinkError::Foreign { .. })), "others may write to it");
    std::fs::remove_dir(&place).unwrap();
}

#[test]
fn a_directory_with_other_things_in_it_is_no_link_s_and_keeps_them() {
    let name = format!("test-occupied-{}", std::process::id());
    let place = files::root(&name);
    files::make_root(&place).unwrap();
    std::fs::write(place.join("report.html"), "hours of work").unwrap();
    assert!(matches!(Space::new(&name), Err(LinkError::Occupied { .. })));
    assert_eq!(std::fs::read_dir(&place).unwrap().count(), 1);
    std::fs::remove_dir_all(&place).unwrap();
    // What somebody did not finish removing is taken over.
    files::make_root(&place).unwrap();
    std::fs::create_dir(place.join("nodes")).unwrap();
    Space::new(&name).unwrap().leave::<ipc::Service>(Departure::First);
    assert!(!place.exists());
}

/// A process of a link whose owner was killed may come back to a directory that a sweep has just removed.
#[test]
fn what_is_made_in_a_directory_without_a_key_is_swept_when_its_owner_is_gone() {
    let mut gone = std::process::Command::new("true").spawn().unwrap();
    gone.wait().unwrap();
    let of = |what: &str| files::root(&format!("{RUN}{}-{what}", gone.id()));
    for (what, entry) in [("nodes", "nodes"), ("other", "pictures")] {
        files::make_root(&of(what)).unwrap();
        std::fs::create_dir(of(what).join(entry)).unwrap();
    }
    assert!(is_swept(&of("nodes")) && of("other").exists());
    std::fs::remove_dir_all(of("other")).unwrap();
}

/// Past 255 characters iceoryx2 panics. Its longest path has a mark, the link's name and key, a hash, two numbers and a word.
#[test]
fn no_path_in_a_link_s_directory_is_too_long() {
    let key = "0".repeat(16);
    for length in [1, 28, LONGEST_NAME] {
        let name = "n".repeat(length);
        let longest = format!(
            "{}{}_{}_{}.connection",
            files::prefix(&name, &key),
            "h".repeat(40),
            "1".repeat(32),
            "2".repeat(32)
        );
        let fits = "q".repeat(files::ROOM - 2 * length);
        let root = Path::new(&fits).join(format!("stillpoint-{name}"));
        assert!(root.join(longest).as_os_str().len() <= 255, "{length}");
    }
}

#[test]
fn names_of_runs_and_of_files_cannot_be_guessed() {
    let [a, b] = [(); 2].map(|()| Space::unique().unwrap());
    assert_ne!(a.name, b.name);
    assert_ne!(a.key, b.key);
    assert_eq!(a.key.len(), 16);
    assert_eq!(Space::new(a.name()).unwrap().key, a.key, "the same on both sides");
    for space in [a, b] {
        space.leave::<ipc::Service>(Departure::First);
        assert!(!space.root().exists());
    }
}

#[test]
fn what_the_transport_makes_belongs_to_the_user_alone() {
    let space = space("modes");
    let ports = PlantPorts::<ipc::Service>::open(&space).unwrap();
    let traces = space.traces();
    assert!(traces.len() > 1, "{traces:?}");
    for path in traces {
        assert_eq!(mode(&path) & 0o077, 0, "{}", path.display());
    }
    drop(ports);
    space.leave::<ipc::Service>(Departure::First);
}

#[test]
fn nobody_removes_a_space_that_somebody_is_in() {
    // No process is in its name: only who has entered counts.
    let space = Space::new(&format!("test-alive-{}", std::process::id())).unwrap();
    let plant = PlantPorts::<ipc::Service>::open(&space).unwrap();
    let controller = ControllerPorts::<ipc::Service>::open(&space).unwrap();
    let before = space.traces();
    drop(controller);
    // Another user of the same name; whatever a listing tells it, somebody has entered.
    let visitor = Space::new(space.name()).unwrap();
    visitor.leave::<ipc::Service>(Departure::First);
    let locked = visitor.lock().unwrap();
    assert!(!files::is_empty(&visitor.root, &locked));
    drop(locked);
    assert!(!sweep().contains(&space.name), "swept while somebody is in it");
    assert!(before.iter().filter(|path| path.exists()).count() > 1 && space.root().exists());
    drop(plant);
    space.leave::<ipc::Service>(Departure::First);
    assert!(space.traces().is_empty());
}

/// Sweeps until a file or directory is gone: another sweep of the same moment may have it locked, or be at it.
fn is_swept(path: &Path) -> bool {
    let until = std::time::Instant::now() + Duration::from_secs(5);
    while path.exists() && std::time::Instant::now() < until {
        sweep();
    }
    !path.exists()
}

/// Two processes that are started together each sweep first: one between the other's key and its entering would have it meet
/// another key than its peer.
#[test]
fn a_link_that_somebody_is_about_to_enter_is_not_swept() {
    let name = format!("test-awaited-{}", std::process::id());
    let [first, second] = [(); 2].map(|()| {
        let space = Space::new(&name).unwrap();
        assert!(!sweep().contains(&name), "swept before anybody could enter");
        space
    });
    assert_eq!(first.key, second.key);
    // Whoever has entered and gone without removing it, is dead.
    drop(files::enter(&first.root).unwrap());
    assert!(is_swept(&first.root));
    // An old key is nobody's either.
    let old = Space::new(&name).unwrap();
    let key = files::open_own(&old.root.join("key")).unwrap();
    let made = key.metadata().unwrap().modified().unwrap();
    key.set_modified(made - Duration::from_secs(60)).unwrap();
    assert!(is_swept(&old.root));
}

#[test]
fn what_the_dead_have_left_is_swept_and_what_the_living_have_is_not() {
    // No process has this number: it is above what any kernel gives.
    let dead = Space::new(&format!("{RUN}{}-test", i32::MAX)).unwrap();
    let living = Space::unique().unwrap();
    let [left, kept] = [&dead, &living].map(|space| plant(name_of_a_file(space, "memory")));
    let swept = sweep();
    assert!(!swept.contains(&living.name), "{swept:?}");
    assert!(is_swept(dead.root()) && is_swept(&left));
    assert!(kept.exists() && living.root().exists());
    living.leave::<ipc::Service>(Departure::First);
    assert!(!kept.exists());
}

/// A process that is killed after it has made a file and before that has its size leaves it empty.
#[test]
fn no_file_that_was_left_half_made_holds_anybody_up() {
    iceoryx2::prelude::set_log_level(iceoryx2::prelude::LogLevel::Error);
    let all = {
        let space = space("whole");
        let _ports = PlantPorts::<ipc::Service>::open(&space).unwrap();
        let all = files::in_shared_memory(&space.name).len();
        space.leave::<ipc::Service>(Departure::First);
        all
    };
    assert!(all > 5, "{all} files");
    for half_made in 0..all {
        let space = space(&format!("half-{half_made}"));
        let ports = PlantPorts::<ipc::Service>::open(&space).unwrap();
        let mut files = files::in_shared_memory(&space.name);
        files.sort();
        std::fs::remove_file(&files[half_made]).unwrap();
        std::fs::write(&files[half_made], []).unwrap();
        std::fs::set_permissions(&files[half_made], std::fs::Permissions::from_mode(0o200)).unwrap();
        let (finished, finish) = std::sync::mpsc::channel();
        let visitor = space.clone();
        // Whether it gets in beside such ruins is another matter; that it comes back is this one's.
        std::thread::spawn(move || finished.send(ControllerPorts::<ipc::Service>::open(&visitor).is_ok()));
        let name = files[half_made].display();
        finish.recv_timeout(Duration::from_secs(30)).unwrap_or_else(|_| panic!("{name}: waits without end"));
        drop(ports);
        space.leave::<ipc::Service>(Departure::Last);
        assert!(space.traces().is_empty(), "{name}: {:?}", space.traces());
    }
}
