//! Rows 1 to 32 of the catalogue, one function each, grouped by what they touch.

pub(crate) mod actuation;
pub(crate) mod bytes;
pub(crate) mod needle;
pub(crate) mod pairs;
pub(crate) mod streams;
pub(crate) mod time;
pub(crate) mod values;

use firmware::contract::frames::{MAX_DIMENSION, MAX_PADDLES};
use firmware::contract::{Knot, PaddleCommand, Table};
use firmware::{Direction, Faults, Mode, State};
use nalgebra::{SMatrix, SVector};
use rand_pcg::Pcg64;

use super::closed_loop::{ClosedLoop, Setup};
use super::evidence::Evidence;
use super::fault::{Fault, Stream, below};
use crate::bench::error::SimError;

/// What every row gets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trial<'t, const D: usize = 2, const N: usize = 1, const P: usize = 1> {
    /// The controller's table.
    pub(crate) table: &'t Table<f64, D, N, P>,
    /// Seed of noise and phases.
    pub(crate) seed: u64,
    /// Monitors of the controller that are off.
    pub(crate) without: Faults,
}

impl<'t, const D: usize, const N: usize, const P: usize> Trial<'t, D, N, P> {
    /// Generator for the phases of a row.
    fn random(&self, row: u128) -> Pcg64 {
        Pcg64::new(u128::from(self.seed), 100 + row)
    }

    fn setup(&self) -> Setup<D, P> {
        Setup { without: self.without, ..Setup::new(self.table, self.seed) }
    }

    /// A bench in RUN, in the middle of an insertion, at a phase drawn from `random`.
    fn running(&self, random: &mut Pcg64) -> Result<ClosedLoop<'t, D, N, P>, SimError> {
        self.running_with(self.setup(), random)
    }

    fn running_with(&self, setup: Setup<D, P>, random: &mut Pcg64) -> Result<ClosedLoop<'t, D, N, P>, SimError> {
        let mut bench = ClosedLoop::new(self.table, setup)?;
        bench.run(1000 + below(random, 500));
        Ok(bench)
    }

    /// Two benches in the same state.
    fn twins(&self, random: &mut Pcg64) -> Result<[ClosedLoop<'t, D, N, P>; 2], SimError> {
        let ticks = 1000 + below(random, 500);
        let one = || -> Result<ClosedLoop<'t, D, N, P>, SimError> {
            let mut bench = ClosedLoop::new(self.table, self.setup())?;
            bench.run(ticks);
            Ok(bench)
        };
        Ok([one()?, one()?])
    }

    /// All streams of samples.
    fn streams(&self) -> &'static [Stream] {
        Stream::with(P)
    }

    /// Those of paddles, with the paddle's place in the table.
    fn paddles(&self) -> impl Iterator<Item = (usize, Stream)> {
        Stream::PADDLES.into_iter().take(P).enumerate()
    }
}

/// Lets both pass the same ticks; whether all displacements have the same bits.
fn same_motion<const D: usize, const N: usize, const P: usize>(
    twins: &mut [ClosedLoop<'_, D, N, P>; 2],
    ticks: u64,
) -> bool {
    (0..ticks).all(|_| {
        let [a, b] = twins.each_mut().map(|bench| bench.step().map(|e| motion_bits(&e.command)));
        a == b
    })
}

/// Where a command has the paddles, bit by bit.
fn motion_bits(command: &PaddleCommand) -> [[u64; MAX_DIMENSION]; MAX_PADDLES] {
    command.displacement.map(|of| of.map(f64::to_bits))
}

fn integral_bits<const D: usize, const N: usize, const P: usize>(
    state: &State<f64, D, N, P>,
) -> Option<[[u64; MAX_DIMENSION]; MAX_PADDLES]> {
    state.integral().map(|integral| integral.map(|of| of.map(f64::to_bits)))
}

/// Everything is over: within `limit` ticks the loop is in RUN again by itself.
fn comes_back<const D: usize, const N: usize, const P: usize>(
    bench: &mut ClosedLoop<'_, D, N, P>,
    limit: u64,
    evidence: &mut Evidence,
    what: impl Fn() -> String,
) {
    let back = bench.mode() == Mode::Run || bench.until(limit, super::evidence::is_in(Mode::Run)).is_some();
    evidence.require(back, || format!("{}: no RUN within {limit} ticks: {}", what(), bench.state.faults()));
}

/// In SAFE, and there it stays until somebody re-arms; then RUN follows.
fn stays_safe_until_rearmed<const D: usize, const N: usize, const P: usize>(
    bench: &mut ClosedLoop<'_, D, N, P>,
    evidence: &mut Evidence,
    what: impl Fn() -> String,
) {
    bench.run(50);
    evidence.expect_mode(bench, Mode::Safe, &what);
    bench.rearm();
    comes_back(bench, 200, evidence, || format!("{}, re-armed", what()));
}

/// How far each paddle goes per orthogonal displacement of the target, as the controller's law has it.
fn law<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
    knot: &Knot<f64, D, P>,
) -> [SMatrix<f64, D, N>; P] {
    let limits = table.paddles.each_ref().map(|paddle| paddle.max_displacement);
    let largest = limits.into_iter().fold(0.0, f64::max);
    let weights = limits.map(|limit| (limit / largest) * (limit / largest));
    Direction::default_in(D).solve(&knot.jacobian, &table.orthogonal, &weights)
}

/// The largest of a quantity of each paddle over all knots.
fn largest<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
    of: impl Fn(&Knot<f64, D, P>) -> [f64; P],
) -> [f64; P] {
    table.knots.iter().map(of).fold([0.0; P], |largest, now| std::array::from_fn(|p| largest[p].max(now[p])))
}

/// How far each paddle goes at most for a unit of a push along this direction.
fn excursions<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
    push: &SVector<f64, N>,
) -> [f64; P] {
    largest(table, |knot| law(table, knot).map(|direction| (direction * push).norm()))
}

/// How far each paddle goes at most per depth of the needle, by the table's own path.
fn steepest<const D: usize, const N: usize, const P: usize>(table: &Table<f64, D, N, P>) -> [f64; P] {
    largest(table, |knot| std::array::from_fn(|place| SVector::from(knot.paddle_path_slope.column(place)).norm()))
}

/// The fault lasts for ever.
const FOR_EVER: u64 = u64::MAX / 2;

/// Injects `fault` for `ticks` and lets them pass.
fn during<const D: usize, const N: usize, const P: usize>(
    bench: &mut ClosedLoop<'_, D, N, P>,
    fault: Fault,
    ticks: u64,
) {
    bench.inject(fault, ticks).run(ticks);
}
