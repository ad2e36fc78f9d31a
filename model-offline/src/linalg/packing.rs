//! Addresses that products of matrices take. The library beneath sets twice the machine's last-level caches aside for every thread
//! that multiplies, at its first product. Hardly any of it is ever written to, so that it is no memory; but it counts where the
//! addresses of a process are limited (`ulimit -v`), and a process that does not get them ends there.

use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// Caches are taken to be at least so large, bytes.
const LEAST: u64 = 2 << 20;
/// And the last-level ones so many times those of the level before.
const OVER_LEVEL_2: u64 = 4;

/// Threads that have multiplied and not ended.
static MULTIPLYING: AtomicU64 = AtomicU64::new(0);

/// Lives as long as its thread, and with what is set aside for it.
struct Counted;

impl Drop for Counted {
    fn drop(&mut self) {
        MULTIPLYING.fetch_sub(1, Ordering::Relaxed);
    }
}

thread_local! {
    static COUNTED: Counted = {
        MULTIPLYING.fetch_add(1, Ordering::Relaxed);
        Counted
    };
}

/// Notes that this thread has multiplied.
pub(super) fn multiplied() {
    COUNTED.with(|_| ());
}

/// Bytes of addresses that the threads which work together here have not taken yet.
pub(super) fn outstanding() -> u64 {
    static OF_A_THREAD: OnceLock<u64> = OnceLock::new();
    let of_a_thread = *OF_A_THREAD.get_or_init(|| 2 * last_level_caches(Path::new("/sys/devices/system/cpu")));
    // Beside the threads of a pool there is the one that waits for them. Asking for their number outside of one would start one.
    let threads = rayon::current_thread_index().map_or(1, |_| rayon::current_num_threads() as u64 + 1);
    threads.saturating_sub(MULTIPLYING.load(Ordering::Relaxed)).saturating_mul(of_a_thread)
}

/// Bytes of all last-level caches of the machine, as Linux tells them below this folder: each processor's share of those that it uses.
fn last_level_caches(processors: &Path) -> u64 {
    let folders = |folder: &Path, name: &str| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let named = |path: &Path| path.file_name().is_some_and(|file| file.to_string_lossy().starts_with(name));
        entries.filter(|path| named(path)).collect::<Vec<_>>()
    };
    let (mut level_2, mut level_3) = (0, 0.0);
    for cache in folders(processors, "cpu").iter().flat_map(|cpu| folders(&cpu.join("cache"), "index")) {
        let told = |file: &str| std::fs::read_to_string(cache.join(file)).unwrap_or_default().trim().to_owned();
        let (Some(size), Some(shared_by)) = (size_of_cache(&told("size")), count_of(&told("shared_cpu_list"))) else {
            continue;
        };
        match told("level").as_str() {
            "2" => level_2 = level_2.max(size),
            "3" => level_3 += size as f64 / shared_by as f64,
            _ => {}
        }
    }
    (level_3.round() as u64).max(OVER_LEVEL_2.saturating_mul(level_2)).max(LEAST)
}

/// Bytes behind "480M".
fn size_of_cache(told: &str) -> Option<u64> {
    let digits = told.trim_end_matches(['K', 'M', 'G']);
    let unit = match &told[digits.len()..] {
        "" => 1,
        "K" => 1 << 10,
        "M" => 1 << 20,
        "G" => 1 << 30,
        _ => return None,
    };
    digits.parse::<u64>().ok()?.checked_mul(unit)
}

/// How many processors "0-3,8" are.
fn count_of(list: &str) -> Option<u64> {
    let counts = list.split(',').map(|item| match item.split_once('-') {
        Some((first, last)) => last.parse::<u64>().ok()?.checked_sub(first.parse().ok()?)?.checked_add(1),
        None => item.parse::<u64>().ok().map(|_| 1),
    });
    counts.sum::<Option<u64>>().filter(|count| *count > 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn caches_are_those_of_the_whole_machine() {
        let root = tempfile::tempdir().unwrap();
        assert_eq!(last_level_caches(root.path()), LEAST);
        // Four processors, two to a core, with a last-level cache for each core.
        for cpu in 0..4 {
            for (index, level, size, shared_by) in
                [(0, 1, "48K", "0-1"), (1, 2, "2048K", "0-1"), (2, 3, "16384K", if cpu < 2 { "0-1" } else { "2,3" })]
            {
                let folder = root.path().join(format!("cpu{cpu}/cache/index{index}"));
                fs::create_dir_all(&folder).unwrap();
                for (file, told) in
                    [("level", level.to_string().as_str()), ("size", size), ("shared_cpu_list", shared_by)]
                {
                    fs::write(folder.join(file), format!("{told}\n")).unwrap();
                }
            }
        }
        assert_eq!(last_level_caches(root.path()), 32 << 20);
        assert_eq!(
            ["480M", "7", "2G", "M", "3T"].map(size_of_cache),
            [Some(480 << 20), Some(7), Some(2 << 30), None, None]
        );
        assert_eq!(["0-3,8", "5", "3-1", ""].map(count_of), [Some(5), Some(1), None, None]);
    }

    #[test]
    fn a_thread_that_has_multiplied_asks_for_no_more() {
        let in_its_own_thread = |work: fn() -> u64| std::thread::spawn(work).join().unwrap();
        let before = in_its_own_thread(outstanding);
        let after = in_its_own_thread(|| {
            multiplied();
            outstanding()
        });
        // Others multiply beside this test.
        assert!(after <= before && after == 0, "{before} {after}");
    }
}
