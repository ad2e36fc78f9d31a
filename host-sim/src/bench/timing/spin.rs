//! Waiting without sleep, for exchanges that are measured in microseconds.

use std::time::Duration;

/// Polls without anything, some ten microseconds, after which others of the same priority may run. A real-time task
/// that only spins keeps its processor for ever: two pairs of them on two processors would wait for partners that never run.
const POLLS_PER_YIELD: u64 = 1 << 8;
/// Polls without anything, a second or more, after which nobody measures any more.
const POLLS_BEFORE_NAPS: u64 = 1 << 24;
const NAP: Duration = Duration::from_millis(1);

/// Counts polls.
#[derive(Debug, Default)]
pub(super) struct Spin {
    polls: u64,
}

impl Spin {
    /// Nothing came: lets others run now and then. Whether that was a nap.
    pub(super) fn nothing(&mut self) -> bool {
        self.polls += 1;
        if self.polls > POLLS_BEFORE_NAPS {
            std::thread::sleep(NAP);
            return true;
        }
        if self.polls.is_multiple_of(POLLS_PER_YIELD) {
            std::thread::yield_now();
        } else {
            std::hint::spin_loop();
        }
        false
    }

    /// Something came.
    pub(super) fn something(&mut self) {
        self.polls = 0;
    }
}
