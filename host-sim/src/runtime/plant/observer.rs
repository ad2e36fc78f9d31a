//! Somebody who looks on while a plant runs: the loop tells, and never waits for an answer.

use firmware::{Faults, Mode};
use model_offline::model::TissueModel;

use crate::runtime::accounting::tick::ControllerTick;
use crate::runtime::time::mode::RunMode;
use crate::world::space::{PreparedBody, SpaceTissue};
use crate::world::tissue::TissuePlant;
use crate::world::truth::Truth;

/// A moment of the simulation, as the loop knows it.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// What is true.
    pub truth: Truth,
    /// Time since the start of the needle, s.
    pub time_s: f64,
    /// When the tick began to be solved, ns of the steady clock.
    pub began_ns: u64,
    /// Whether the needle moves already: before, nothing is to be held.
    pub is_counted: bool,
    /// What the controller's last command said; none before the first one.
    pub answer: Option<Answer>,
    /// What controller and plant told each other last, up to the tick before; none before the first command.
    pub exchanged: Option<ControllerTick>,
}

/// What a command says of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Mode; none where the number is none of its own.
    pub mode: Option<Mode>,
    /// Faults that are present.
    pub faults: Faults,
}

/// Looks on at tissue T.
pub trait Observer<T>: std::fmt::Debug + Send {
    /// A moment that may be looked at; must not wait, but where it holds time after this moment.
    fn offer(&mut self, tissue: &T, moment: &Moment);

    /// Whether the insertion is to end now.
    fn ends_early(&self) -> bool;

    /// Called between two ticks of lockstep, where time may be held: no clock is in the record.
    fn hold(&mut self);
}

/// An insertion that is about to begin, into this body.
#[derive(Clone, Debug)]
pub struct ObservedInsertion<B> {
    /// What the needle goes into.
    pub body: B,
    /// What drives time.
    pub mode: RunMode,
    /// Period of the loop, ns.
    pub period_ns: u64,
    /// What it is about, in a line.
    pub title: String,
}

/// A planar body with one of its paddles.
#[derive(Clone, Copy, Debug)]
pub struct PlanarBody<'m> {
    /// Its tissue.
    pub model: &'m TissueModel,
    /// Index of the attached paddle.
    pub paddle: u32,
}

/// Looks on at one insertion after another.
pub trait Spectator: std::fmt::Debug {
    /// Begins to look on in the plane.
    fn observe<'m>(&self, insertion: ObservedInsertion<PlanarBody<'m>>) -> Box<dyn Observer<TissuePlant<'m>>>;

    /// Begins to look on in space.
    fn observe_in_space<'m>(
        &self,
        insertion: ObservedInsertion<&PreparedBody<'m>>,
    ) -> Box<dyn Observer<SpaceTissue<'m>>>;
}
