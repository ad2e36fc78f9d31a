//! The other process: is it alive, and how long is it waited for.

pub mod child;
pub mod introduction;

use std::time::{Duration, Instant};

use iceoryx2::service::Service;
use rustix::process::{Pid, getppid};

use self::child::{ControllerProcess, describe_exit};
use crate::exchange::Space;
use crate::runtime::error::{Role, RuntimeError};
use crate::runtime::signals;

/// Polls without giving the processor away: an answer usually comes within a few µs.
const SPINS: u32 = 200;
/// Polls between two looks at signals and at the peer.
const POLLS_PER_LOOK: u32 = 512;
/// Silence after which polling may be slow: the other side is busy, perhaps with a solve, and may need this processor.
const NAP_AFTER: Duration = Duration::from_millis(2);
const NAP: Duration = Duration::from_micros(100);
/// Naps between two looks: every few ms.
const NAPS_PER_LOOK: u32 = 32;

/// Who the peer is, as far as its death can be noticed.
#[derive(Debug)]
pub enum Peer {
    /// The controller that the plant has started.
    Child(ControllerProcess),
    /// The plant that has started this controller.
    Parent(Pid),
    /// A process in another terminal, known by its marks in the link's space.
    Elsewhere(Box<Space>, Role),
    /// A thread of this process, in tests.
    Thread(Role),
}

impl Peer {
    fn role(&self) -> Role {
        match self {
            Self::Child(_) => Role::Controller,
            Self::Parent(_) => Role::Plant,
            Self::Elsewhere(_, role) | Self::Thread(role) => *role,
        }
    }

    /// Fails if the peer is known to be dead.
    ///
    /// # Errors
    /// [`RuntimeError::PeerDied`].
    pub fn check<S: Service>(&mut self) -> Result<(), RuntimeError> {
        let how = match self {
            Self::Child(child) => child.ended().map(|status| describe_exit(&status)),
            Self::Parent(parent) => (getppid() != Some(*parent)).then(|| "this process was left behind".to_owned()),
            Self::Elsewhere(space, _) => {
                space.has_dead_peer::<S>().then(|| "it left its marks in shared memory".to_owned())
            }
            Self::Thread(_) => None,
        };
        match how {
            None => Ok(()),
            Some(how) => Err(RuntimeError::PeerDied { peer: self.role(), how }),
        }
    }
}

/// Waits for an answer by polling: a bounded spin, then with the processor offered to others.
#[derive(Debug)]
pub struct Patience {
    polls: u32,
    naps: u32,
    since: Option<Instant>,
    timeout: Duration,
}

impl Patience {
    /// Gives up after `timeout`.
    pub fn new(timeout: Duration) -> Self {
        Self { polls: 0, naps: 0, since: None, timeout }
    }

    /// Nothing came at this poll. Looks at signals, the peer and the time now and then.
    ///
    /// # Errors
    /// [`RuntimeError::Interrupted`], [`RuntimeError::PeerDied`], [`RuntimeError::PeerSilent`].
    pub fn wait<S: Service>(&mut self, peer: &mut Peer) -> Result<(), RuntimeError> {
        self.polls += 1;
        if self.polls < SPINS {
            std::hint::spin_loop();
            return Ok(());
        }
        let silent = self.since.get_or_insert_with(Instant::now).elapsed();
        let look = if silent > NAP_AFTER {
            std::thread::sleep(NAP);
            self.naps += 1;
            self.naps.is_multiple_of(NAPS_PER_LOOK)
        } else {
            std::thread::yield_now();
            self.polls.is_multiple_of(POLLS_PER_LOOK)
        };
        if !look {
            return Ok(());
        }
        signals::check()?;
        peer.check::<S>()?;
        if silent > self.timeout {
            return Err(RuntimeError::PeerSilent { peer: peer.role(), silent_s: silent.as_secs_f64() });
        }
        Ok(())
    }
}
