//! Where faults act on samples: between the sensors and the controller's inbox.

use std::collections::VecDeque;

use firmware::contract::frames::TARGET_VISIBLE;
use firmware::contract::{NeedleSample, PaddleSample, TargetSample};
use rand_pcg::Pcg64;

use super::audit::Audit;
use super::fault::{Fault, Stream, normal};

/// What the seam has to know of a sample.
pub trait Sample: Copy {
    /// Its stream.
    const STREAM: Stream;
    /// Publication counter.
    fn sequence(&self) -> u32;
    /// Time of the measurement, ns.
    fn time_ns(&mut self) -> &mut u64;
    /// Its two numbers.
    fn numbers(&mut self) -> [&mut f64; 2];
}

impl Sample for NeedleSample {
    const STREAM: Stream = Stream::Needle;
    fn sequence(&self) -> u32 {
        self.sequence
    }
    fn time_ns(&mut self) -> &mut u64 {
        &mut self.time_ns
    }
    fn numbers(&mut self) -> [&mut f64; 2] {
        [&mut self.depth, &mut self.velocity]
    }
}

impl Sample for TargetSample {
    const STREAM: Stream = Stream::Target;
    fn sequence(&self) -> u32 {
        self.sequence
    }
    fn time_ns(&mut self) -> &mut u64 {
        &mut self.time_ns
    }
    fn numbers(&mut self) -> [&mut f64; 2] {
        let [x, y, _] = &mut self.displacement;
        [x, y]
    }
}

impl Sample for PaddleSample {
    const STREAM: Stream = Stream::Paddle;
    fn sequence(&self) -> u32 {
        self.sequence
    }
    fn time_ns(&mut self) -> &mut u64 {
        &mut self.time_ns
    }
    fn numbers(&mut self) -> [&mut f64; 2] {
        let [x, y, _] = &mut self.displacement;
        [x, y]
    }
}

/// One stream on its way to the controller, which reads the newest delivery only.
#[derive(Clone, Debug)]
pub struct Channel<S> {
    late: VecDeque<(u64, S)>,
    inbox: Option<S>,
    frozen: Option<[f64; 2]>,
}

impl<S> Default for Channel<S> {
    fn default() -> Self {
        Self { late: VecDeque::new(), inbox: None, frozen: None }
    }
}

impl<S: Sample> Channel<S> {
    /// Applies the faults of this stream to `published`, and delivers what arrives at `tick`. Returns how many
    /// injections that was.
    pub fn pass(&mut self, tick: u64, published: Option<S>, faults: &[Fault], audit: &mut Audit) -> u64 {
        let mut injected = 0;
        if let Some(mut sample) = published {
            audit.stream(S::STREAM).publish(sample.sequence());
            let mut later = None;
            let mut lost = false;
            let mut frozen = false;
            for fault in faults {
                match *fault {
                    Fault::Lost(stream) if stream == S::STREAM => lost = true,
                    Fault::Duplicated(stream) if stream == S::STREAM => {
                        self.late.push_back((tick + 1, sample));
                    }
                    Fault::Late(stream, ticks) if stream == S::STREAM => later = Some(tick + ticks),
                    Fault::Frozen(stream) if stream == S::STREAM => {
                        frozen = true;
                        let numbers = sample.numbers();
                        let [a, b] = *self.frozen.get_or_insert([*numbers[0], *numbers[1]]);
                        // A needle that is frozen in depth still says that it moves.
                        match S::STREAM {
                            Stream::Needle => *sample.numbers()[0] = a,
                            Stream::Target | Stream::Paddle => {
                                let [x, y] = sample.numbers();
                                (*x, *y) = (a, b);
                            }
                        }
                    }
                    Fault::Field(stream, index, value) if stream == S::STREAM => *sample.numbers()[index & 1] = value,
                    Fault::Scaled(stream, factor) if stream == S::STREAM => {
                        sample.numbers().into_iter().for_each(|number| *number *= factor);
                    }
                    Fault::Stamped(stream, by_ns) if stream == S::STREAM => {
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
                (true, _) => audit.stream(S::STREAM).lose(sample.sequence()),
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
            audit.stream(S::STREAM).overwrite(old.sequence());
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
            Fault::WrongTarget([x, y]) => {
                sample.displacement[0] += x;
                sample.displacement[1] += y;
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
