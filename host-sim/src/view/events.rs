//! Server-sent events: `scene` at every new insertion, `frame` at every new state, `idle` now and then.

use std::collections::VecDeque;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use hyper::body::Bytes;
use serde_json::Value;
use tokio::time::{Interval, MissedTickBehavior, interval};

use super::limits::{Deadline, Slot};
use super::page;
use super::shared::{FRAME_NS, Shared, ViewState};

/// Looks without anything new after which a word is said all the same, so that a closed page is noticed.
const LOOKS_PER_WORD: u32 = 60;

/// The events of one page.
#[derive(Debug)]
pub(super) struct Events {
    shared: Arc<Shared>,
    deadline: Arc<Deadline>,
    looks: Interval,
    waiting: VecDeque<Bytes>,
    insertion: u64,
    number: u64,
    idle: u32,
    /// Whether the page knows that nothing new will come.
    told: bool,
    _place: Slot,
}

impl Events {
    pub(super) fn new(shared: Arc<Shared>, deadline: Arc<Deadline>, place: Slot) -> Self {
        let mut looks = interval(Duration::from_nanos(FRAME_NS / 2));
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        Self {
            shared,
            deadline,
            looks,
            waiting: VecDeque::new(),
            insertion: 0,
            number: 0,
            idle: 0,
            told: false,
            _place: place,
        }
    }

    /// The next event. It is asked for when there is room for it: a page that does not read is asked for nothing, and
    /// its connection's deadline passes.
    pub(super) fn poll_next(&mut self, context: &mut Context<'_>) -> Poll<Bytes> {
        self.deadline.extend();
        loop {
            if let Some(event) = self.waiting.pop_front() {
                return Poll::Ready(event);
            }
            ready!(self.looks.poll_tick(context));
            self.look();
        }
    }

    /// Whether something is new.
    fn look(&mut self) {
        match self.shared.newer(self.insertion, self.number) {
            Some(state) => {
                if state.insertion != self.insertion {
                    self.waiting.push_back(event("scene", &page::scene(&state, &self.shared)));
                }
                self.waiting.push_back(event("frame", &page::frame(&state, &self.shared)));
                ViewState { insertion: self.insertion, number: self.number, .. } = state;
                self.idle = 0;
            }
            None if self.shared.is_over() && !self.told => {
                self.told = true;
                self.waiting.push_back(event("idle", &serde_json::json!({ "finished": true })));
            }
            None => {
                self.idle += 1;
                if self.idle.is_multiple_of(LOOKS_PER_WORD) {
                    let finished = self.shared.is_over();
                    self.waiting.push_back(event("idle", &serde_json::json!({ "finished": finished })));
                }
            }
        }
    }
}

fn event(name: &str, data: &Value) -> Bytes {
    format!("event: {name}\ndata: {data}\n\n").into()
}
