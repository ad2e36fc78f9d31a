//! What can go wrong, by name, and when.

use firmware::contract::frames::{MAX_DIMENSION, MAX_PADDLES};
use firmware::{Ledger, StreamLedger};
use rand_distr::Distribution;
use rand_distr::uniform::{UniformFloat, UniformInt, UniformSampler};
use rand_pcg::Pcg64;

/// Which stream of samples a fault is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Needle encoder, at loop rate.
    Needle,
    /// Target sensor, slow and late.
    Target,
    /// Encoder of the only or the first paddle, at loop rate.
    Paddle,
    /// Encoder of the second paddle, at loop rate.
    SecondPaddle,
}

impl Stream {
    /// All of them.
    pub const ALL: [Self; 2 + MAX_PADDLES] = [Self::Needle, Self::Target, Self::Paddle, Self::SecondPaddle];

    /// Those of paddles, in the order of the controller's table.
    pub const PADDLES: [Self; MAX_PADDLES] = [Self::Paddle, Self::SecondPaddle];

    /// Those that there are with so many paddles.
    pub fn with(paddles: usize) -> &'static [Self] {
        &Self::ALL[..(2 + paddles).min(Self::ALL.len())]
    }

    /// Whether it is one of a paddle.
    pub const fn is_of_paddle(self) -> bool {
        matches!(self, Self::Paddle | Self::SecondPaddle)
    }

    /// How many numbers a sample of it has in this many dimensions.
    pub const fn numbers(self, dimension: usize) -> usize {
        match self {
            Self::Needle => 2,
            Self::Target | Self::Paddle | Self::SecondPaddle => dimension,
        }
    }

    /// The controller's account of it.
    pub const fn account(self, ledger: &Ledger) -> &StreamLedger {
        match self {
            Self::Needle => &ledger.needle,
            Self::Target => &ledger.target,
            Self::Paddle => {
                let [first, _] = &ledger.paddles;
                first
            }
            Self::SecondPaddle => {
                let [_, second] = &ledger.paddles;
                second
            }
        }
    }
}

/// One thing that goes wrong while it is active.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// The controller's step takes this many periods.
    SlowStep(f64),
    /// The clock of the controller reads earlier by this many ns.
    ClockBack(u64),
    /// The wall clock of the machine jumps by this many ns; the steady clock goes on.
    WallClock(i64),
    /// The plant's process is stopped: it publishes nothing and its sequences stand still.
    PeerStopped,
    /// Samples are published and never arrive.
    Lost(Stream),
    /// Every sample arrives once more on the following tick, after what arrives then.
    Duplicated(Stream),
    /// Samples arrive this many ticks later, after what arrives then.
    Late(Stream, u64),
    /// The value stays while sequence and time go on.
    Frozen(Stream),
    /// A number of the sample, counted from 0, has this value.
    Field(Stream, usize, f64),
    /// All numbers of the sample are this many times too large.
    Scaled(Stream, f64),
    /// Samples are stamped this many ns later than they were measured.
    Stamped(Stream, i64),
    /// The sensor does not see the target.
    Hidden,
    /// The sensor follows something else, at this distance (length).
    WrongTarget([f64; MAX_DIMENSION]),
    /// The target sensor has this much more noise (standard deviation, length).
    Noise(f64),
    /// The actuator of the paddle in this place does not move.
    Stuck(usize),
    /// The actuator of the paddle in this place reaches this part of its command.
    ActuatorGain(usize, f64),
    /// A paddle with this identity is attached in this place.
    PaddleIdentity(usize, u32),
    /// Each paddle's actuator has the commands of the other one.
    CommandsExchanged,
    /// Each paddle's samples arrive where the other's are read, with the identity that is expected there.
    SamplesExchanged,
    /// The tissue answers the paddle with this multiple of the table's Jacobian.
    TissueGain(f64),
    /// Something pushes the target sideways with this speed (length/s); what it has pushed stays.
    Push(f64),
    /// The needle is driven with this multiple of its speed.
    NeedleSpeed(f64),
}

impl Fault {
    /// Draws one fault with parameters from mild to absurd. Lengths are fractions of `length`, the depth of the table.
    pub fn random<const D: usize, const P: usize>(random: &mut Pcg64, period_ns: u64, length: f64) -> Self {
        let streams = Stream::with(P);
        let stream = streams[below(random, streams.len() as u64) as usize];
        let sign = if below(random, 2) == 0 { 1.0 } else { -1.0 };
        match below(random, 20) {
            0 => Self::SlowStep(between(random, 0.5, 6.0)),
            1 => Self::ClockBack(1 + below(random, 10 * period_ns)),
            2 => Self::WallClock(3_600_000_000_000 * sign as i64),
            3 => Self::PeerStopped,
            4 => Self::Lost(stream),
            5 => Self::Duplicated(stream),
            6 => Self::Late(stream, 1 + below(random, 120)),
            7 => Self::Frozen(stream),
            8 => {
                const VALUES: [f64; 8] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-310, 1e3, -1e3, f64::MAX, 0.0];
                let field = below(random, stream.numbers(D) as u64) as usize;
                Self::Field(stream, field, VALUES[below(random, VALUES.len() as u64) as usize])
            }
            9 => Self::Scaled(stream, 10f64.powf(between(random, -3.0, 3.0)) * sign),
            10 => Self::Stamped(stream, (between(random, 0.0, 300.0) * sign * period_ns as f64) as i64),
            11 => Self::Hidden,
            12 => Self::WrongTarget(std::array::from_fn(
                |i| if i < D { between(random, -1.0, 1.0) * length } else { 0.0 },
            )),
            13 => Self::Noise(10f64.powf(between(random, -5.0, -1.0)) * length),
            14 => Self::Stuck(place(random, P)),
            15 => Self::ActuatorGain(place(random, P), between(random, 0.0, 1.5)),
            16 => Self::PaddleIdentity(place(random, P), below(random, 8) as u32),
            17 => Self::TissueGain(between(random, -2.0, 3.0)),
            18 => Self::Push(between(random, -0.1, 0.1) * length),
            _ => Self::NeedleSpeed(between(random, -8.0, 8.0)),
        }
    }
}

/// One of so many places for paddles; nothing is drawn where there is only one.
fn place(random: &mut Pcg64, paddles: usize) -> usize {
    if paddles > 1 { below(random, paddles as u64) as usize } else { 0 }
}

/// A fault and the ticks of the plant in which it is active.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// What goes wrong.
    pub fault: Fault,
    /// First tick.
    pub from: u64,
    /// First tick after it.
    pub until: u64,
}

impl Event {
    /// Whether it is active at `tick`.
    pub const fn is_active(&self, tick: u64) -> bool {
        self.from <= tick && tick < self.until
    }
}

/// An integer from 0 to `bound` − 1.
pub fn below(random: &mut Pcg64, bound: u64) -> u64 {
    UniformInt::<u64>::sample_single(0, bound.max(1), random).unwrap_or(0)
}

/// A number from `low` up to `high`.
pub fn between(random: &mut Pcg64, low: f64, high: f64) -> f64 {
    UniformFloat::<f64>::sample_single(low, high, random).unwrap_or(low)
}

/// A standard normal number.
pub fn normal(random: &mut Pcg64) -> f64 {
    rand_distr::StandardNormal.sample(random)
}
