//! Signals that ask for the end: remembered, and answered between two ticks, so that everything is tidied up.

use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use super::error::RuntimeError;

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
