//! Who is told how far a long computation has come.

use model_offline::output::terminal::LongRun;

/// Somebody who wants to know how far a comparison has come.
pub trait Progress: Sync {
    /// So many steps there will be.
    fn begin(&self, steps: u64) {
        let _ = steps;
    }

    /// So many more than was thought.
    fn extend(&self, steps: u64) {
        let _ = steps;
    }

    /// One of them is done.
    fn step(&self) {}

    /// What is being done from now on.
    fn say(&self, what: &str) {
        let _ = what;
    }

    /// As far as is known, what is being done will take so long, and what comes then so long, s.
    fn expect(&self, this_s: f64, then_s: f64) {
        let _ = (this_s, then_s);
    }
}

/// Nobody wants to know.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {}

impl Progress for indicatif::ProgressBar {
    fn begin(&self, steps: u64) {
        self.set_length(steps);
    }

    fn extend(&self, steps: u64) {
        self.inc_length(steps);
    }

    fn step(&self) {
        self.inc(1);
    }

    fn say(&self, what: &str) {
        self.set_message(what.to_owned());
    }
}

impl Progress for LongRun {
    fn begin(&self, steps: u64) {
        self.bar.set_length(steps);
    }

    fn extend(&self, steps: u64) {
        self.bar.inc_length(steps);
    }

    fn step(&self) {
        self.bar.inc(1);
    }

    fn say(&self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    fn expect(&self, this_s: f64, then_s: f64) {
        self.left.expect(this_s, then_s);
    }
}
