//! Rows 1 to 32 of the catalogue, one function each, grouped by what they touch.

pub(crate) mod actuation;
pub(crate) mod bytes;
pub(crate) mod needle;
pub(crate) mod streams;
pub(crate) mod time;
pub(crate) mod values;

use firmware::contract::Table;
use firmware::{Faults, Mode, State};
use rand_pcg::Pcg64;

use super::closed_loop::{ClosedLoop, Setup};
use super::evidence::Evidence;
use super::fault::{Fault, below};
use crate::bench::error::SimError;

/// What every row gets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trial<'t> {
    /// The controller's table.
    pub(crate) table: &'t Table<f64, 2>,
    /// Seed of noise and phases.
    pub(crate) seed: u64,
    /// Monitors of the controller that are off.
    pub(crate) without: Faults,
}

impl<'t> Trial<'t> {
    /// Generator for the phases of a row.
    fn random(&self, row: u128) -> Pcg64 {
        Pcg64::new(u128::from(self.seed), 100 + row)
    }

    fn setup(&self) -> Setup {
        Setup { without: self.without, ..Setup::new(self.table, self.seed) }
    }

    /// A bench in RUN, in the middle of an insertion, at a phase drawn from `random`.
    fn running(&self, random: &mut Pcg64) -> Result<ClosedLoop<'t>, SimError> {
        self.running_with(self.setup(), random)
    }

    fn running_with(&self, setup: Setup, random: &mut Pcg64) -> Result<ClosedLoop<'t>, SimError> {
        let mut bench = ClosedLoop::new(self.table, setup)?;
        bench.run(1000 + below(random, 500));
        Ok(bench)
    }

    /// Two benches in the same state.
    fn twins(&self, random: &mut Pcg64) -> Result<[ClosedLoop<'t>; 2], SimError> {
        let ticks = 1000 + below(random, 500);
        let one = || -> Result<ClosedLoop<'t>, SimError> {
            let mut bench = ClosedLoop::new(self.table, self.setup())?;
            bench.run(ticks);
            Ok(bench)
        };
        Ok([one()?, one()?])
    }
}

/// Lets both pass the same ticks; whether all displacements have the same bits.
fn same_motion(twins: &mut [ClosedLoop<'_>; 2], ticks: u64) -> bool {
    (0..ticks).all(|_| {
        let [a, b] = twins.each_mut().map(|bench| bench.step().map(|e| e.command.displacement[0].map(f64::to_bits)));
        a == b
    })
}

fn integral_bits(state: &State<f64>) -> Option<[u64; 3]> {
    state.integral().map(|integral| integral[0].map(f64::to_bits))
}

/// Everything is over: within `limit` ticks the loop is in RUN again by itself.
fn comes_back(bench: &mut ClosedLoop<'_>, limit: u64, evidence: &mut Evidence, what: impl Fn() -> String) {
    let back = bench.mode() == Mode::Run || bench.until(limit, super::evidence::is_in(Mode::Run)).is_some();
    evidence.require(back, || format!("{}: no RUN within {limit} ticks: {}", what(), bench.state.faults()));
}

/// In SAFE, and there it stays until somebody re-arms; then RUN follows.
fn stays_safe_until_rearmed(bench: &mut ClosedLoop<'_>, evidence: &mut Evidence, what: impl Fn() -> String) {
    bench.run(50);
    evidence.expect_mode(bench, Mode::Safe, &what);
    bench.rearm();
    comes_back(bench, 200, evidence, || format!("{}, re-armed", what()));
}

/// The fault lasts for ever.
const FOR_EVER: u64 = u64::MAX / 2;

/// Injects `fault` for `ticks` and lets them pass.
fn during(bench: &mut ClosedLoop<'_>, fault: Fault, ticks: u64) {
    bench.inject(fault, ticks).run(ticks);
}
