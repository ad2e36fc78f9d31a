//! The needle's drive: in at constant speed, in steps, after a wait, with a dwell and the way back, or as recorded.

use std::sync::Arc;

/// Start and stop of the needle take this long, s: no needle drive starts with a jump in speed.
const RAMP_S: f64 = 0.1;

/// Where the needle is, and how fast it goes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NeedleMotion {
    /// Depth, length.
    pub depth: f64,
    /// Velocity, length/s.
    pub velocity: f64,
}

/// When the needle started, if it has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NeedleStart(Option<u64>);

impl NeedleStart {
    /// It starts now, ns, unless it has before.
    pub fn at(&mut self, time_ns: u64) {
        self.0.get_or_insert(time_ns);
    }

    /// When, ns.
    pub fn time_ns(&self) -> Option<u64> {
        self.0
    }

    /// Time since, s; −1 before.
    pub fn since_s(&self, time_ns: u64) -> f64 {
        self.0.map_or(-1.0, |started_ns| time_ns.saturating_sub(started_ns) as f64 * 1e-9)
    }
}

/// What moves the needle.
pub trait NeedleDrive {
    /// Motion at a time since the start, s (negative: not started). Called once per tick, in order.
    fn motion(&mut self, since_start_s: f64) -> NeedleMotion;
}

/// How the needle goes, from its start on: moves one after the other, at rest between them.
///
/// ```
/// use host_sim::world::needle::NeedleTrajectory;
///
/// // In 4 s to a depth of 0.1, after two of waiting; there for one, and back.
/// let way = NeedleTrajectory::new(0.1, 4.0).after(2.0).dwelling(1.0).withdrawn();
/// assert_eq!((way.at(1.9).depth, way.at(6.5).depth, way.at(11.0).depth), (0.0, 0.1, 0.0));
/// assert_eq!((way.wait_s(), way.insertion_s(), way.end_s()), (2.0, 4.0, 11.0));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct NeedleTrajectory {
    moves: Arc<[Move]>,
    end_s: f64,
}

/// From one depth to another.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Move {
    start_s: f64,
    duration_s: f64,
    from: f64,
    to: f64,
    speed: Speed,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Speed {
    /// Constant between two ramps of so many seconds.
    Trapezoid { ramp_s: f64 },
    /// Between these at the ends: the depth is a cubic.
    Between { from: f64, to: f64 },
}

impl Move {
    fn new(start_s: f64, duration_s: f64, from: f64, to: f64) -> Self {
        let ramp_s = RAMP_S.min(0.25 * duration_s);
        Self { start_s, duration_s, from, to, speed: Speed::Trapezoid { ramp_s } }
    }

    fn end_s(&self) -> f64 {
        self.start_s + self.duration_s
    }

    fn way(&self) -> f64 {
        self.to - self.from
    }

    /// Largest speed, length/s; of a cubic at most that.
    fn speed(&self) -> f64 {
        match self.speed {
            Speed::Trapezoid { ramp_s } => (self.way() / (self.duration_s - ramp_s)).abs(),
            Speed::Between { from, to } => (1.5 * self.way() / self.duration_s).abs().max(from.abs()).max(to.abs()),
        }
    }

    /// Motion so many seconds after its start, within its duration.
    fn at(&self, time_s: f64) -> NeedleMotion {
        let Self { duration_s, from, to, .. } = *self;
        match self.speed {
            Speed::Trapezoid { ramp_s } => {
                let speed = self.way() / (duration_s - ramp_s);
                let left_s = duration_s - time_s;
                let (depth, velocity) = if time_s < ramp_s {
                    (from + 0.5 * speed * time_s * time_s / ramp_s, speed * time_s / ramp_s)
                } else if time_s < duration_s - ramp_s {
                    (from + speed * (time_s - 0.5 * ramp_s), speed)
                } else {
                    (to - 0.5 * speed * left_s * left_s / ramp_s, speed * left_s / ramp_s)
                };
                NeedleMotion { depth, velocity }
            }
            Speed::Between { from: first, to: last } => {
                let (s, way) = (time_s / duration_s, self.way());
                let (a, b) = (first * duration_s, last * duration_s);
                let (square, cube) = (3.0 * way - 2.0 * a - b, a + b - 2.0 * way);
                NeedleMotion {
                    depth: from + s * (a + s * (square + s * cube)),
                    velocity: (a + s * (2.0 * square + 3.0 * s * cube)) / duration_s,
                }
            }
        }
    }
}

impl NeedleTrajectory {
    /// To `depth` (length) in `insertion_s` seconds, at constant speed between two short ramps.
    pub fn new(depth: f64, insertion_s: f64) -> Self {
        Self::of(vec![Move::new(0.0, insertion_s, 0.0, depth)])
    }

    /// The same in equal steps, with pauses of so many seconds between them.
    #[must_use]
    pub fn in_steps(depth: f64, insertion_s: f64, steps: u32, pause_s: f64) -> Self {
        let (count, each_s) = (f64::from(steps.max(1)), insertion_s / f64::from(steps.max(1)));
        // The last step ends at the depth itself, not a rounding beyond it, where no table reaches.
        let after = |k: f64| if k < count { depth * k / count } else { depth };
        let step = |k: u32| {
            let k = f64::from(k);
            Move::new(k * (each_s + pause_s), each_s, after(k), after(k + 1.0))
        };
        Self::of((0..steps.max(1)).map(step).collect())
    }

    /// Through rows of time in s and depth, times ascending: between them depth and velocity are continuous, and a depth
    /// that rises in the rows rises between them. It waits until the first.
    ///
    /// # Errors
    /// [`RecordedNeedleError`] names the row.
    pub fn recorded(rows: &[(f64, f64)]) -> Result<Self, RecordedNeedleError> {
        check_rows(rows)?;
        let slope = |k: usize| (rows[k + 1].1 - rows[k].1) / (rows[k + 1].0 - rows[k].0);
        // Harmonic means of the slopes on either side, none where they differ in sign (Fritsch & Butland 1984).
        let at = |k: usize| match (k.checked_sub(1).map(slope), (k + 1 < rows.len()).then(|| slope(k))) {
            (Some(before), Some(after)) if before * after > 0.0 => 2.0 * before * after / (before + after),
            _ => 0.0,
        };
        let moves = (0..rows.len() - 1).map(|k| {
            let ((start_s, from), (end_s, to)) = (rows[k], rows[k + 1]);
            let speed = Speed::Between { from: at(k), to: at(k + 1) };
            Move { start_s, duration_s: end_s - start_s, from, to, speed }
        });
        Ok(Self::of(moves.collect()))
    }

    fn of(moves: Vec<Move>) -> Self {
        let end_s = moves.last().map_or(0.0, Move::end_s);
        Self { moves: moves.into(), end_s }
    }

    /// The same so many seconds later.
    #[must_use]
    pub fn after(self, wait_s: f64) -> Self {
        let later = |each: &Move| Move { start_s: each.start_s + wait_s, ..*each };
        Self { moves: self.moves.iter().map(later).collect(), end_s: self.end_s + wait_s }
    }

    /// The same, and so many seconds at rest at its end.
    #[must_use]
    pub fn dwelling(self, dwell_s: f64) -> Self {
        Self { end_s: self.end_s + dwell_s, ..self }
    }

    /// The same, and back to where it started, as fast as it came.
    #[must_use]
    pub fn withdrawn(self) -> Self {
        let (Some(first), Some(last)) = (self.moves.first(), self.moves.last()) else { return self };
        let (came_s, back) = (self.insertion_s(), Move::new(self.end_s, 0.0, last.to, first.from));
        let ramp_s = RAMP_S.min(0.25 * came_s);
        let back = Move { duration_s: came_s, speed: Speed::Trapezoid { ramp_s }, ..back };
        Self::of(self.moves.iter().copied().chain([back]).collect())
    }

    /// The same in a part of the time, waits and all.
    #[must_use]
    pub fn faster(self, times: f64) -> Self {
        let sooner = |each: &Move| Move {
            start_s: each.start_s / times,
            duration_s: each.duration_s / times,
            speed: match each.speed {
                Speed::Trapezoid { .. } => Move::new(0.0, each.duration_s / times, 0.0, 0.0).speed,
                Speed::Between { from, to } => Speed::Between { from: from * times, to: to * times },
            },
            ..*each
        };
        Self { moves: self.moves.iter().map(sooner).collect(), end_s: self.end_s / times }
    }

    /// Seconds before it moves.
    pub fn wait_s(&self) -> f64 {
        self.moves.iter().find(|each| each.way() != 0.0).map_or(self.end_s, |first| first.start_s)
    }

    /// Seconds of motion until it is as deep as it gets, pauses left out.
    pub fn insertion_s(&self) -> f64 {
        let deepest = self.depth();
        let until = self.moves.iter().position(|each| each.to >= deepest).unwrap_or(0);
        self.moves.iter().take(until + 1).filter(|each| each.way() != 0.0).map(|each| each.duration_s).sum()
    }

    /// Seconds of everything but waiting and the insertion: pauses, rests, and ways back.
    pub fn pauses_s(&self) -> f64 {
        self.end_s - self.wait_s() - self.insertion_s()
    }

    /// When everything is done, s.
    pub fn end_s(&self) -> f64 {
        self.end_s
    }

    /// Largest depth, length.
    pub fn depth(&self) -> f64 {
        self.moves.iter().map(|each| each.to).fold(0.0, f64::max)
    }

    /// Its largest speed, length/s.
    pub fn speed(&self) -> f64 {
        self.moves.iter().map(Move::speed).fold(0.0, f64::max)
    }

    /// A time at which it moves, in the middle of the insertion, s.
    pub fn midway_s(&self) -> f64 {
        let middle = 0.5 * self.depth();
        let under_way = self.moves.iter().find(|each| each.to > middle);
        under_way
            .map_or(0.0, |each| each.start_s + each.duration_s * ((middle - each.from) / each.way()).clamp(0.0, 1.0))
    }

    /// Motion at a time after the start, s (negative: not started).
    pub fn at(&self, time_s: f64) -> NeedleMotion {
        let begun = self.moves.partition_point(|each| each.start_s <= time_s);
        let Some(last) = begun.checked_sub(1).and_then(|k| self.moves.get(k)) else {
            let depth = self.moves.first().map_or(0.0, |first| first.from);
            return NeedleMotion { depth, velocity: 0.0 };
        };
        if time_s < last.end_s() {
            last.at(time_s - last.start_s)
        } else {
            NeedleMotion { depth: last.to, velocity: 0.0 }
        }
    }
}

fn check_rows(rows: &[(f64, f64)]) -> Result<(), RecordedNeedleError> {
    if rows.len() < 2 {
        return Err(RecordedNeedleError::TooFew { rows: rows.len() });
    }
    for (row, &(time_s, depth)) in rows.iter().enumerate() {
        let row = row + 1;
        if !(time_s.is_finite() && time_s >= 0.0 && depth.is_finite() && depth >= 0.0) {
            return Err(RecordedNeedleError::Number { row, time_s, depth });
        }
    }
    if let Some(k) = (1..rows.len()).find(|&k| rows[k].0 <= rows[k - 1].0) {
        return Err(RecordedNeedleError::NotLater { row: k + 1, time_s: rows[k].0 });
    }
    if rows.iter().all(|row| row.1 == 0.0) {
        return Err(RecordedNeedleError::StaysOut);
    }
    if rows[0].1 != 0.0 {
        return Err(RecordedNeedleError::NotAtRest { depth: rows[0].1 });
    }
    Ok(())
}

/// Rows of a recorded needle that cannot be followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordedNeedleError {
    /// No motion.
    #[error("{rows} rows: a motion takes at least two rows of time_s,depth")]
    TooFew {
        /// How many there are.
        rows: usize,
    },
    /// Not a time or not a depth.
    #[error("row {row}: {time_s} s, depth {depth}: both must be numbers, at least 0")]
    Number {
        /// From 1.
        row: usize,
        /// Its time.
        time_s: f64,
        /// Its depth.
        depth: f64,
    },
    /// Times go back.
    #[error("row {row}: {time_s} s is not later than the row before: sort the rows by time")]
    NotLater {
        /// From 1.
        row: usize,
        /// Its time.
        time_s: f64,
    },
    /// It never goes in.
    #[error("every depth is 0: the needle never goes in")]
    StaysOut,
    /// It begins within the tissue.
    #[error("row 1: depth {depth}: the needle begins at the skin, at depth 0")]
    NotAtRest {
        /// Its depth.
        depth: f64,
    },
}

impl NeedleDrive for NeedleTrajectory {
    fn motion(&mut self, since_start_s: f64) -> NeedleMotion {
        self.at(since_start_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 1e-3;

    /// Velocity is the slope of the depth, and neither jumps.
    fn is_smooth(way: &NeedleTrajectory, largest_change: f64) {
        let mut before = way.at(0.0);
        for tick in 1..=(way.end_s() / STEP_S) as u32 {
            let now = way.at(f64::from(tick) * STEP_S);
            let mean = 0.5 * (now.velocity + before.velocity);
            assert!((now.depth - before.depth - mean * STEP_S).abs() < 1e-6, "{tick}: {now:?} after {before:?}");
            assert!((now.velocity - before.velocity).abs() < largest_change, "{tick}: {now:?} after {before:?}");
            assert!(now.velocity.abs() <= way.speed() * (1.0 + 1e-12), "{tick}: {now:?}");
            before = now;
        }
    }

    #[test]
    fn the_needle_arrives_without_jumps() {
        let trajectory = NeedleTrajectory::new(0.1, 5.0);
        assert_eq!(trajectory.at(-1.0), NeedleMotion { depth: 0.0, velocity: 0.0 });
        assert_eq!(trajectory.at(5.0), NeedleMotion { depth: 0.1, velocity: 0.0 });
        is_smooth(&trajectory, 3e-4);
    }

    #[test]
    fn steps_pauses_dwell_and_the_way_back_follow_each_other() {
        let way = NeedleTrajectory::in_steps(12.0, 3.0, 3, 0.5).after(2.0).dwelling(1.5).withdrawn();
        for (time_s, depth) in [(1.0, 0.0), (3.2, 4.0), (4.7, 8.0), (6.0, 12.0), (7.4, 12.0), (9.0, 6.0), (10.5, 0.0)] {
            assert!((way.at(time_s).depth - depth).abs() < 1e-12, "{time_s}: {:?}", way.at(time_s));
        }
        assert_eq!((way.wait_s(), way.insertion_s(), way.end_s(), way.depth()), (2.0, 3.0, 10.5, 12.0));
        assert_eq!(way.pauses_s(), 1.0 + 1.5 + 3.0);
        assert!((way.at(way.midway_s()).depth - 6.0).abs() < 0.3 && way.at(way.midway_s()).velocity > 0.0);
        is_smooth(&way, 0.06);
        let hurried = way.faster(2.0);
        assert_eq!((hurried.at(3.0).depth, hurried.end_s()), (12.0, 5.25));
        is_smooth(&hurried, 0.12);
    }

    #[test]
    fn a_recorded_needle_goes_through_its_rows_and_never_beyond_them() {
        let rows = [(0.5, 0.0), (1.0, 2.0), (1.2, 6.0), (3.0, 6.0), (4.0, 1.0)];
        let way = NeedleTrajectory::recorded(&rows).unwrap();
        for (time_s, depth) in rows {
            assert!((way.at(time_s).depth - depth).abs() < 1e-12);
        }
        is_smooth(&way, 0.6);
        for tick in 0..5000 {
            let depth = way.at(f64::from(tick) * STEP_S).depth;
            assert!((0.0..=6.0 + 1e-12).contains(&depth), "{tick}: {depth}");
        }
        assert!((way.at(2.0).depth - 6.0).abs() < 1e-12, "it rests where the rows do");
        assert_eq!((way.wait_s(), way.depth(), way.end_s()), (0.5, 6.0, 4.0));
        assert!((way.insertion_s() - 0.7).abs() < 1e-12);
    }

    #[test]
    fn rows_that_cannot_be_followed_are_named() {
        let refuse = |rows: &[(f64, f64)]| NeedleTrajectory::recorded(rows).unwrap_err();
        assert_eq!(refuse(&[(0.0, 0.0)]), RecordedNeedleError::TooFew { rows: 1 });
        assert!(matches!(refuse(&[(0.0, 0.0), (f64::NAN, 1.0)]), RecordedNeedleError::Number { row: 2, .. }));
        assert!(matches!(refuse(&[(0.0, 0.0), (1.0, -1.0)]), RecordedNeedleError::Number { row: 2, .. }));
        let back = [(0.0, 0.0), (1.0, 1.0), (1.0, 2.0)];
        assert_eq!(refuse(&back), RecordedNeedleError::NotLater { row: 3, time_s: 1.0 });
        assert_eq!(refuse(&[(0.0, 0.0), (1.0, 0.0)]), RecordedNeedleError::StaysOut);
        assert_eq!(refuse(&[(0.0, 1.0), (1.0, 2.0)]), RecordedNeedleError::NotAtRest { depth: 1.0 });
    }

    /// A table ends at the depth: what a rounding lies beyond it is a fault.
    #[test]
    fn steps_end_at_the_depth_to_the_last_bit() {
        for depth in [0.1, 0.7, 12.0, 1.0 / 3.0] {
            for steps in [1, 3, 6, 7, 12, 24, 49] {
                let needle = NeedleTrajectory::in_steps(depth, 5.0, steps, 0.5);
                assert_eq!(needle.depth(), depth, "{steps} steps");
                assert_eq!(needle.at(needle.end_s()).depth, depth, "{steps} steps");
            }
        }
    }
}
