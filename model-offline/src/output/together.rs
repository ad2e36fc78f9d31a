//! Files that belong together, and signals that come while they are written.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// How many [`Together`] there are.
static BEING_WRITTEN: Mutex<usize> = Mutex::new(0);
/// A pipe that nobody reads must not keep the process from ending.
#[cfg(unix)]
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(5);

fn count() -> MutexGuard<'static, usize> {
    BEING_WRITTEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// While it lives, files are written that belong together: a signal that comes meanwhile does not part them.
#[must_use = "what is written after it is dropped does not belong together"]
#[derive(Debug)]
pub struct Together(());

/// Files are written from now on until what is returned is dropped; may be nested.
pub fn together() -> Together {
    *count() += 1;
    Together(())
}

impl Drop for Together {
    fn drop(&mut self) {
        *count() -= 1;
    }
}

/// From now on SIGINT and SIGTERM leave no file half made, and none without those that belong to it. While nothing is written
/// they end the process as they would have done. What is being written is finished first, and the process with it, as if
/// the signal had come after its end; if that takes more than five seconds, it is ended all the same.
#[cfg(unix)]
pub fn end_between_results() {
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;
    // Refused only for signals that cannot be caught, which these are not; they would end the process as before.
    let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else { return };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            // Kept to the end, so that nothing begins to be written meanwhile.
            let mut count = count();
            if *count > 0 {
                drop(count);
                std::thread::sleep(PATIENCE);
                count = self::count();
            }
            let _ = emulate_default_handler(signal);
            drop(count);
        }
    });
}

/// Signals are a matter of Unix.
#[cfg(not(unix))]
pub fn end_between_results() {}
