//! Whether a factor fits into the memory that the process may have: of the machine, of the control groups that it runs in
//! (containers, batch jobs), and of its own limits (`ulimit`). A process that takes more gets killed without a word.

use super::packing;
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// A factor that there is no memory for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub struct NotEnoughMemory {
    /// Unknowns of the matrix; none for a mesh, of which they are not known yet.
    pub unknowns: usize,
    /// Bytes that it takes to factorise, and that are free; none where the factor has more entries than can be numbered.
    pub needed: Option<(u64, u64)>,
    /// Bytes of these that a process whose addresses are limited needs whatever it factorises.
    pub fixed: u64,
}

impl std::fmt::Display for NotEnoughMemory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.unknowns {
            0 => write!(f, "to mesh the body would take ")?,
            unknowns => write!(f, "to factorise {unknowns} unknowns would take ")?,
        }
        match self.needed {
            Some((needed, free)) if self.fixed > needed / 2 => {
                return write!(
                    f,
                    "{} of addresses, and {} are left to this process: {} of it are set aside whatever the mesh, for each \
                     thread as much as the caches of this machine are large; allow it more (ulimit -v), or take fewer \
                     threads (--threads 1)",
                    in_words(needed),
                    in_words(free),
                    in_words(self.fixed)
                );
            }
            Some((needed, free)) => write!(f, "{}, and {} of memory are free", in_words(needed), in_words(free))?,
            None => write!(f, "more than {}, which is not tried", in_words(MOST_ENTRIES * BYTES))?,
        }
        f.write_str(": take a coarser mesh, or elements (fem-t6, in space fem-t10) where it is a meshfree one")
    }
}

fn in_words(bytes: u64) -> String {
    match bytes {
        0..1_000_000_000 => format!("{:.0} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}

/// Bytes of an entry.
const BYTES: u64 = size_of::<f64>() as u64;
/// Entries that signed numbers of 32 bits count.
const MOST_ENTRIES: u64 = i32::MAX as u64;

/// What is computed beside a factor takes so much where a process's addresses are limited: stacks, results.
const BESIDE: u64 = 1 << 25;

/// How often it is asked again, a millisecond later, where a process's addresses are limited.
const PATIENCE: usize = 100;

/// What takes less is not asked for: a few pages are there, or nothing is.
const LITTLE: u64 = 1 << 24;

/// Whoever asks for memory takes it before the next one asks: the system counts pages once they are written to.
static TAKING: Mutex<()> = Mutex::new(());

/// Takes memory to factorise so many unknowns, which `allocate` must write to, or refuses where there are not so many bytes.
pub(super) fn take<T>(unknowns: usize, bytes: u64, allocate: impl FnOnce() -> T) -> Result<T, NotEnoughMemory> {
    let is_limited = is_limited();
    if bytes < LITTLE && !is_limited {
        return Ok(allocate());
    }
    let fixed = || BESIDE + packing::outstanding();
    if is_limited {
        // Threads that have ended give back what was theirs a moment later.
        for _ in 0..PATIENCE {
            if room_for(unknowns, bytes, fixed(), addresses()).is_ok() {
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    // It guards nothing that a panic could leave half done.
    let _others_wait = TAKING.lock().unwrap_or_else(PoisonError::into_inner);
    let addresses = is_limited.then(addresses).flatten().map(|left| (fixed(), left));
    let memory = (bytes >= LITTLE).then(available).flatten();
    room_in(unknowns, bytes, addresses, memory)?;
    Ok(allocate())
}

/// Addresses are set aside that are never written to: they count against the process's own limits, and take no memory. `addresses`:
/// how many are set aside, and left.
fn room_in(
    unknowns: usize,
    bytes: u64,
    addresses: Option<(u64, u64)>,
    memory: Option<u64>,
) -> Result<(), NotEnoughMemory> {
    if let Some((fixed, left)) = addresses {
        room_for(unknowns, bytes, fixed, Some(left))?;
    }
    room_for(unknowns, bytes, 0, memory)
}

/// Refuses so many unknowns where there are not so many bytes for what comes before the factor.
///
/// # Errors
/// [`NotEnoughMemory`].
pub(crate) fn room(unknowns: usize, bytes: u64) -> Result<(), NotEnoughMemory> {
    take(unknowns, bytes, || ())
}

fn room_for(unknowns: usize, bytes: u64, fixed: u64, free: Option<u64>) -> Result<(), NotEnoughMemory> {
    let needed = bytes.saturating_add(fixed);
    match free {
        Some(free) if needed > free => Err(NotEnoughMemory { unknowns, needed: Some((needed, free)), fixed }),
        _ => Ok(()),
    }
}

/// Whether the process's own limits may end it, rather than the machine's memory.
fn is_limited() -> bool {
    static IS_LIMITED: OnceLock<bool> = OnceLock::new();
    *IS_LIMITED.get_or_init(|| addresses().is_some())
}

/// Bytes of addresses that the process's own limits leave it; none where it has none.
fn addresses() -> Option<u64> {
    let read = |file: &str| std::fs::read_to_string(file).unwrap_or_default();
    of_limits(&read("/proc/self/limits"), &read("/proc/self/status"))
}

/// Bytes of memory that this process can take without pushing anything out, as Linux tells it; none elsewhere.
fn available() -> Option<u64> {
    let read = |file: &str| std::fs::read_to_string(file).unwrap_or_default();
    let machine = kilobytes(&read("/proc/meminfo"), "MemAvailable:");
    let groups = of_control_groups(&read("/proc/self/cgroup"), Path::new("/sys/fs/cgroup"));
    [machine, groups].into_iter().flatten().min()
}

/// The value in a line such as `VmSize:  123 kB`, in bytes.
fn kilobytes(told: &str, name: &str) -> Option<u64> {
    let line = told.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|count| count.saturating_mul(1024))
}

/// What is left of the process's limits on its address space and its data.
fn of_limits(limits: &str, status: &str) -> Option<u64> {
    let left = |limit: &str, used: &str| {
        let line = limits.lines().find_map(|line| line.strip_prefix(limit))?;
        let soft = line.split_whitespace().next()?.parse::<u64>().ok()?;
        Some(soft.saturating_sub(kilobytes(status, used)?))
    };
    [left("Max address space", "VmSize:"), left("Max data size", "VmData:")].into_iter().flatten().min()
}

/// What is left of the limits of the control groups that a process belongs to, of either version. What a container sees of
/// them may begin at its own, whatever their full path.
fn of_control_groups(own: &str, root: &Path) -> Option<u64> {
    let mut least = None;
    for line in own.lines() {
        let Some((controllers, group)) = line.split_once(':').and_then(|(_, rest)| rest.split_once(':')) else {
            continue;
        };
        let (root, version) = match controllers {
            "" => (root.to_owned(), &VERSION_2),
            _ if controllers.split(',').any(|name| name == "memory") => (root.join("memory"), &VERSION_1),
            _ => continue,
        };
        for ancestor in Path::new(group.trim_start_matches('/')).ancestors() {
            least = least.into_iter().chain(version.left(&root.join(ancestor))).min();
        }
    }
    least
}

/// What the files of a control group are called.
struct ControlGroup {
    limits: &'static [&'static str],
    usage: &'static str,
    /// In its statistics: what can be let go, of files that were read.
    released: &'static [&'static str],
}

const VERSION_1: ControlGroup = ControlGroup {
    limits: &["memory.limit_in_bytes"],
    usage: "memory.usage_in_bytes",
    released: &["total_inactive_file ", "total_active_file "],
};
const VERSION_2: ControlGroup = ControlGroup {
    // The second is none that kills: what goes beyond crawls.
    limits: &["memory.max", "memory.high"],
    usage: "memory.current",
    released: &["inactive_file ", "active_file ", "slab_reclaimable "],
};

impl ControlGroup {
    fn left(&self, folder: &Path) -> Option<u64> {
        let read = |file: &str| std::fs::read_to_string(folder.join(file)).ok();
        let number = |file: &str| read(file)?.trim().parse::<u64>().ok();
        let limit = self.limits.iter().filter_map(|file| number(file)).min()?;
        let statistics = read("memory.stat").unwrap_or_default();
        let count =
            |name: &str| statistics.lines().find_map(|line| line.strip_prefix(name)?.trim().parse::<u64>().ok());
        let released = self.released.iter().filter_map(|name| count(name)).fold(0, u64::saturating_add);
        let used = number(self.usage)?.saturating_sub(released);
        Some(limit.saturating_sub(used))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn what_is_larger_than_the_machine_is_refused_in_words_and_not_allocated() {
        assert_eq!(take(30, 3720, || 7), Ok(7));
        // Ten million gigabytes.
        let refused = take(9_000_000, 1 << 56, || unreachable!("it was refused"));
        let Some(free) = available() else { return };
        assert!((1 << 20..1 << 50).contains(&free), "{free}");
        let told = refused.unwrap_err().to_string();
        assert!(told.starts_with("to factorise 9000000 unknowns would take 72057594.0 GB, and "), "{told}");
        assert!(told.contains("B of memory are free: take a coarser mesh"), "{told}");
        let told = |bytes: u64, free: u64| room_for(300, bytes, 0, Some(free)).map_err(|refused| refused.to_string());
        assert_eq!(told(41_400_000, 41_400_000), Ok(()));
        let small = told(41_400_000, 2_000_000).unwrap_err();
        assert!(small.contains("41 MB, and 2 MB of memory are free"), "{small}");
        assert_eq!(room_for(300, u64::MAX, 1, None), Ok(()));
        let fixed = room_for(300, 1_000, 2_000_000_000, Some(900_000_000)).unwrap_err().to_string();
        assert!(fixed.contains("2.0 GB of addresses, and 900 MB are left") && fixed.contains("--threads 1"), "{fixed}");
        // A large limit in a small container, which the model fits into and what is only set aside does not.
        let (gigabyte, model) = (1 << 30, 1 << 26);
        assert_eq!(room_in(300, model, Some((5 * gigabyte, 64 * gigabyte)), Some(4 * gigabyte)), Ok(()));
        let narrow = room_in(300, model, Some((5 * gigabyte, 4 * gigabyte)), Some(64 * gigabyte)).unwrap_err();
        assert!(narrow.to_string().contains("ulimit -v"), "{narrow}");
        let full = room_in(300, model, Some((5 * gigabyte, 64 * gigabyte)), Some(model / 2)).unwrap_err();
        assert!(!full.to_string().contains("ulimit -v"), "{full}");
        let uncounted = NotEnoughMemory { unknowns: 1, needed: None, fixed: 0 };
        assert!(
            uncounted
                .to_string()
                .starts_with("to factorise 1 unknowns would take more than 17.2 GB, which is not tried:")
        );
    }

    #[test]
    fn limits_of_the_process_count_with_what_it_has_taken() {
        let limits = "Limit Soft Limit Hard Limit Units\n\
            Max data size             unlimited            unlimited            bytes     \n\
            Max address space         512000000            unlimited            bytes     \n";
        let status = "Name:\tx\nVmPeak:\t  900000 kB\nVmSize:\t  100000 kB\nVmData:\t   50000 kB\n";
        assert_eq!(of_limits(limits, status), Some(512_000_000 - 102_400_000));
        assert_eq!(of_limits(&limits.replace("512000000", "unlimited"), status), None);
        assert_eq!(of_limits(&limits.replace("512000000", "1000"), status), Some(0));
        let both = limits.replacen("unlimited ", "52000000 ", 1);
        assert_eq!(of_limits(&both, status), Some(52_000_000 - 51_200_000));
        assert_eq!(of_limits("", ""), None);
    }

    #[test]
    fn the_tightest_control_group_counts_with_what_can_be_let_go() {
        let root = tempfile::tempdir().unwrap();
        let write = |file: &str, text: &str| {
            let file = root.path().join(file);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, text).unwrap();
        };
        let left = |own: &str| of_control_groups(own, root.path());
        assert_eq!(left("0::/job/step\n"), None);
        write("job/memory.max", "1000\n");
        write("job/memory.current", "700\n");
        write("job/memory.stat", "anon 400\nfile 300\ninactive_file 150\nactive_file 40\nslab_reclaimable 10\n");
        assert_eq!(left("0::/job/step\n"), Some(500));
        write("job/step/memory.max", "max\n");
        write("job/step/memory.current", "100\n");
        assert_eq!(left("0::/job/step\n"), Some(500));
        write("job/step/memory.high", "450\n");
        assert_eq!(left("0::/job/step\n"), Some(350));
        // What a container sees: its own group as the root, under a path that is not there.
        write("memory/memory.limit_in_bytes", "9000\n");
        write("memory/memory.usage_in_bytes", "8900\n");
        write("memory/memory.stat", "inactive_file 1\ntotal_inactive_file 30\ntotal_active_file 20\n");
        let both = "4:cpu,cpuacct:/docker/abc\n3:devices,memory:/docker/abc\n0::/job/step\n";
        assert_eq!(left(both), Some(150));
        assert_eq!(left(&both.replace("memory", "misc")), Some(350));
        write("memory/memory.usage_in_bytes", "9900\n");
        assert_eq!(left(both), Some(0));
    }
}
