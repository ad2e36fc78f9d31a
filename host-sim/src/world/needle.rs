//! The needle's drive.

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

/// What moves the needle.
pub trait NeedleDrive {
    /// Motion at a time since the start, s (negative: not started). Called once per tick, in order.
    fn motion(&mut self, since_start_s: f64) -> NeedleMotion;
}

/// An insertion: constant speed between two short ramps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeedleTrajectory {
    depth: f64,
    insertion_s: f64,
    ramp_s: f64,
}

impl NeedleTrajectory {
    /// To `depth` (length) in `insertion_s` seconds.
    pub fn new(depth: f64, insertion_s: f64) -> Self {
        Self { depth, insertion_s, ramp_s: RAMP_S.min(0.25 * insertion_s) }
    }

    /// Its largest speed, length/s.
    pub fn speed(&self) -> f64 {
        self.depth / (self.insertion_s - self.ramp_s)
    }

    /// Motion at a time after the start, s (negative: not started).
    pub fn at(&self, time_s: f64) -> NeedleMotion {
        let (depth, velocity) = self.depth_and_velocity(time_s);
        NeedleMotion { depth, velocity }
    }

    fn depth_and_velocity(&self, time_s: f64) -> (f64, f64) {
        let (total, ramp) = (self.insertion_s, self.ramp_s);
        let speed = self.speed();
        if time_s <= 0.0 {
            (0.0, 0.0)
        } else if time_s < ramp {
            (0.5 * speed * time_s * time_s / ramp, speed * time_s / ramp)
        } else if time_s < total - ramp {
            (speed * (time_s - 0.5 * ramp), speed)
        } else if time_s < total {
            let left = total - time_s;
            (self.depth - 0.5 * speed * left * left / ramp, speed * left / ramp)
        } else {
            (self.depth, 0.0)
        }
    }
}

impl NeedleDrive for NeedleTrajectory {
    fn motion(&mut self, since_start_s: f64) -> NeedleMotion {
        self.at(since_start_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_needle_arrives_without_jumps() {
        let trajectory = NeedleTrajectory::new(0.1, 5.0);
        assert_eq!(trajectory.at(-1.0), NeedleMotion { depth: 0.0, velocity: 0.0 });
        assert_eq!(trajectory.at(5.0), NeedleMotion { depth: 0.1, velocity: 0.0 });
        let step_s = 1e-3;
        let mut before = trajectory.at(0.0);
        for tick in 1..=5000 {
            let now = trajectory.at(f64::from(tick) * step_s);
            let mean = 0.5 * (now.velocity + before.velocity);
            assert!((now.depth - before.depth - mean * step_s).abs() < 1e-9, "velocity is the slope");
            assert!((now.velocity - before.velocity).abs() < 3e-4, "no jump of the velocity");
            before = now;
        }
    }
}
