//! Signals that ask for the end, or for a re-arming: remembered, and answered between two ticks, so that everything is
//! tidied up and no step is interrupted.

use model_offline::output::terminal::complain;
use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};

use crate::runtime::error::RuntimeError;

static RECEIVED: OnceLock<Arc<AtomicUsize>> = OnceLock::new();

/// Remembers SIGINT, SIGTERM and SIGHUP from now on instead of dying of them.
pub fn install() {
    RECEIVED.get_or_init(|| {
        let received = Arc::new(AtomicUsize::new(0));
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            let number = usize::try_from(signal).unwrap_or(0);
            // Refused only for signals that cannot be caught, which these are not.
            let _ = signal_hook::flag::register_usize(signal, Arc::clone(&received), number);
        }
        received
    });
}

/// Takes SIGUSR1 as the word of somebody who has looked: the controller is to be re-armed. Only its user and root can
/// send it. Returns where it is noted.
pub fn install_rearming() -> Arc<AtomicBool> {
    let asked = Arc::new(AtomicBool::new(false));
    // Refused only for signals that cannot be caught, which this one is not.
    let _ = signal_hook::flag::register(SIGUSR1, Arc::clone(&asked));
    asked
}

/// Fails once a signal has asked for the end.
///
/// # Errors
/// [`RuntimeError::Interrupted`].
pub fn check() -> Result<(), RuntimeError> {
    let number = RECEIVED.get().map_or(0, |received| received.load(Ordering::Relaxed));
    let signal = match i32::try_from(number) {
        Ok(SIGINT) => "SIGINT (Ctrl-C)",
        Ok(SIGTERM) => "SIGTERM",
        Ok(SIGHUP) => "SIGHUP",
        _ => return Ok(()),
    };
    Err(RuntimeError::Interrupted { signal })
}

/// How often a computation that looks at no signals is looked after.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);

/// Does something long that looks at no signal and leaves nothing to tidy up: a signal ends the process meanwhile, with
/// exit code 1 and a word on stderr.
pub fn ends_at_once<T>(work: impl FnOnce() -> T) -> T {
    /// Tells the watcher, also when the work panics.
    struct Done<'d>(&'d AtomicBool);
    impl Drop for Done<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Release);
        }
    }
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let watcher = scope.spawn(|| {
            while !done.load(Ordering::Acquire) {
                if let Err(interrupted) = check() {
                    complain(&format!("Error: {interrupted}"));
                    std::process::exit(1);
                }
                std::thread::park_timeout(BETWEEN_LOOKS);
            }
        });
        let finished = {
            let _done = Done(&done);
            work()
        };
        watcher.thread().unpark();
        finished
    })
}
