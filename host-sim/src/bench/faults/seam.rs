//! Where faults act on samples: between the sensors and the controller's inbox.

use std::collections::VecDeque;

use firmware::contract::frames::TARGET_VISIBLE;
use firmware::contract::{NeedleSample, PaddleSample, TargetSample};
use rand_pcg::Pcg64;

use super::audit::Audit;
use super::fault::{Fault, Stream, normal};

/// What the seam has to know of a sample.
pub trait Sample: Copy {
    /// Publication counter.
    fn sequence(&self) -> u32;
    /// Time of the measurement, ns.
    fn time_ns(&mut self) -> &mut u64;
    /// Its numbers in so many dimensions.
    fn numbers(&mut self, dimension: usize) -> Vec<&mut f64>;
}

impl Sample for NeedleSample {
    fn sequence(&self) -> u32 {
        self.sequence
    }
    fn time_ns(&mut self) -> &mut u64 {
        &mut self.time_ns
    }
    fn numbers(&mut self, _: usize) -> Vec<&mut f64> {
        vec![&mut self.depth, &mut self.velocity]
    }
}

impl Sample for TargetSample {
    fn sequence(&self) -> u32 {
        self.sequence
    }
    fn time_ns(&mut self) -> &mut u64 {
        &mut self.time_ns
    }
    fn numbers(&mut self, dimension: usize) -> Vec<&mut f64> {
        self.displacement.iter_mut().take(dimension).collect()
    }
}

impl Sample for PaddleSample {
    fn sequence(&self) -> u32 {
        self.sequence
    }
    fn time_ns(&mut self) -> &mut u64 {
        &mut self.time_ns
    }
    fn numbers(&mut self, dimension: usize) -> Vec<&mut f64> {
        self.displacement.iter_mut().take(dimension).collect()
    }
}

/// One stream on its way to the controller, which reads the newest delivery only.
#[derive(Clone, Debug)]
pub struct Channel<S> {
    stream: Stream,
    dimension: usize,
    late: VecDeque<(u64, S)>,
    inbox: Option<S>,
    frozen: Option<Vec<f64>>,
}

impl<S: Sample> Channel<S> {
    /// The way of this stream in so many dimensions.
    pub fn new(stream: Stream, dimension: usize) -> Self {
        Self { stream, dimension, late: VecDeque::new(), inbox: None, frozen: None }
    }

    /// Applies the faults of this stream to `published`, and delivers what arrives at `tick`. Returns how many
    /// injections that was.
    pub fn pass(&mut self, tick: u64, published: Option<S>, faults: &[Fault], audit: &mut Audit) -> u64 {
        let mut injected = 0;
        let Self { stream: own, dimension, .. } = *self;
        if let Some(mut sample) = published {
            audit.stream(own).publish(sample.sequence());
            let mut later = None;
            let mut lost = false;
            let mut frozen = false;
            for fault in faults {
                match *fault {
                    Fault::Lost(stream) if stream == own => lost = true,
                    Fault::Duplicated(stream) if stream == own => {
                        self.late.push_back((tick + 1, sample));
                    }
                    Fault::Late(stream, ticks) if stream == own => later = Some(tick + ticks),
                    Fault::Frozen(stream) if stream == own => {
                        frozen = true;
                        let numbers = sample.numbers(dimension);
                        let kept = self.frozen.get_or_insert_with(|| numbers.iter().map(|number| **number).collect());
                        // A needle that is frozen in depth still says that it moves.
                        let count = if own == Stream::Needle { 1 } else { dimension };
                        numbers.into_iter().zip(kept).take(count).for_each(|(number, kept)| *number = *kept);
                    }
                    Fault::Field(stream, index, value) if stream == own => {
                        if let Some(number) = sample.numbers(dimension).get_mut(index) {
                            **number = value;
                        }
                    }
                    Fault::Scaled(stream, factor) if stream == own => {
                        sample.numbers(dimension).into_iter().for_each(|number| *number *= factor);
                    }
                    Fault::Stamped(stream, by_ns) if stream == own => {
                        let time = sample.time_ns();
                        *time = time.saturating_add_signed(by_ns);
                    }
                    _ => continue,
                }
                injected += 1;
            }
            if !frozen {
                self.frozen = None;
            }
            match (lost, later) {
                (true, _) => audit.stream(own).lose(sample.sequence()),
                (false, Some(at)) => self.late.push_back((at, sample)),
                (false, None) => self.deliver(sample, audit),
            }
        }
        // What is late arrives after what is fresh: the reader sees the older one last. Delays may differ, so that
        // the queue is not sorted.
        for _ in 0..self.late.len() {
            if let Some((at, sample)) = self.late.pop_front() {
                if at <= tick { self.deliver(sample, audit) } else { self.late.push_back((at, sample)) }
            }
        }
        injected
    }

    fn deliver(&mut self, sample: S, audit: &mut Audit) {
        if let Some(old) = self.inbox.replace(sample) {
            audit.stream(self.stream).overwrite(old.sequence());
        }
    }

    /// The controller reads.
    pub fn take(&mut self) -> Option<S> {
        self.inbox.take()
    }
}

/// Faults that only the target sensor has; returns how many injections that was.
pub fn see(sample: &mut TargetSample, faults: &[Fault], random: &mut Pcg64) -> u64 {
    let mut injected = 0;
    for fault in faults {
        match *fault {
            Fault::Hidden => sample.flags &= !TARGET_VISIBLE,
            Fault::WrongTarget(away) => {
                sample.displacement.iter_mut().zip(away).for_each(|(component, away)| *component += away);
            }
            Fault::Noise(deviation) => {
                sample.displacement.iter_mut().for_each(|component| *component += deviation * normal(random));
            }
            _ => continue,
        }
        injected += 1;
    }
    injected
}
