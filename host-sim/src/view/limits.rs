//! How many may be in, and for how long.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

#[cfg(feature = "foxglove")]
use model_offline::output::table_text::hex;
#[cfg(feature = "foxglove")]
use sha2::{Digest as _, Sha256};
use tokio::time::Instant;

/// Connections at a time; more are closed at once.
pub(super) const MAX_CONNECTIONS: usize = 64;
/// Pages that may look on at the same time.
pub(super) const MAX_LOOKERS: usize = 4;
/// Foxglove's clients at the same time.
#[cfg(feature = "foxglove")]
pub(super) const MAX_CLIENTS: usize = 4;
/// Time for them to say goodbye at the end.
#[cfg(feature = "foxglove")]
const GOODBYE: Duration = Duration::from_secs(1);
/// Time of a connection without any progress.
pub(super) const PATIENCE: Duration = Duration::from_secs(5);

/// Who may come in, and how many are in.
#[derive(Debug)]
pub(super) struct Gate {
    pub(super) token: String,
    pub(super) port: u16,
    lookers: AtomicUsize,
    connections: AtomicUsize,
    #[cfg(feature = "foxglove")]
    clients: AtomicUsize,
}

/// A place that is free again when this is dropped.
#[derive(Debug)]
pub(super) struct Slot {
    gate: Arc<Gate>,
    of: fn(&Gate) -> &AtomicUsize,
}

impl Drop for Slot {
    fn drop(&mut self) {
        (self.of)(&self.gate).fetch_sub(1, Ordering::AcqRel);
    }
}

impl Gate {
    /// Opens for who knows the token.
    pub(super) fn new(token: String, port: u16) -> Self {
        Self {
            token,
            port,
            lookers: AtomicUsize::new(0),
            connections: AtomicUsize::new(0),
            #[cfg(feature = "foxglove")]
            clients: AtomicUsize::new(0),
        }
    }

    fn take(self: &Arc<Self>, of: fn(&Self) -> &AtomicUsize, most: usize) -> Option<Slot> {
        let next = |taken: usize| (taken < most).then_some(taken + 1);
        of(self).fetch_update(Ordering::AcqRel, Ordering::Acquire, next).ok()?;
        Some(Slot { gate: Arc::clone(self), of })
    }

    /// A place for a page that looks on, if there is one.
    pub(super) fn look_on(self: &Arc<Self>) -> Option<Slot> {
        self.take(|gate| &gate.lookers, MAX_LOOKERS)
    }

    /// A place for a connection, if there is one.
    pub(super) fn connect(self: &Arc<Self>) -> Option<Slot> {
        self.take(|gate| &gate.connections, MAX_CONNECTIONS)
    }

    /// A place for a client of Foxglove's, if there is one.
    #[cfg(feature = "foxglove")]
    pub(super) fn join(self: &Arc<Self>) -> Option<Slot> {
        self.take(|gate| &gate.clients, MAX_CLIENTS)
    }

    /// What tells this run from others, to whom knows its token.
    #[cfg(feature = "foxglove")]
    pub(super) fn session(&self) -> String {
        hex(&Sha256::digest(&self.token)[..8])
    }

    /// Waits until all clients are gone, but not for long.
    #[cfg(feature = "foxglove")]
    pub(super) fn see_off(&self) {
        let until = std::time::Instant::now() + GOODBYE;
        while self.clients.load(Ordering::Acquire) > 0 && std::time::Instant::now() < until {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// When a connection is given up, unless something has happened by then.
#[derive(Debug)]
pub(super) struct Deadline(Mutex<Instant>);

impl Deadline {
    /// A connection begins.
    pub(super) fn new() -> Self {
        Self(Mutex::new(Instant::now() + PATIENCE))
    }

    /// The other side has taken what there was.
    pub(super) fn extend(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now() + PATIENCE;
    }

    /// Waits until it has passed.
    pub(super) async fn passed(&self) {
        loop {
            let at = *self.0.lock().unwrap_or_else(PoisonError::into_inner);
            if Instant::now() >= at {
                return;
            }
            tokio::time::sleep_until(at).await;
        }
    }
}
