//! A needle drive that can be hurried, turned round and sent to and fro.

use firmware::contract::Table;

use crate::world::needle::{NeedleDrive, NeedleMotion};

/// Time in which the drive reaches the largest speed of the table, s.
const RAMP_S: f64 = 0.1;

/// Goes to its end at a speed, and back if it shuttles. It knows where it ends, and is at rest there.
#[derive(Clone, Debug)]
pub struct ShuttleDrive {
    motion: NeedleMotion,
    /// Depths between which it goes, length.
    range: [f64; 2],
    /// Speed of the insertion, length/s.
    speed: f64,
    /// Largest change of the speed, length/s².
    acceleration: f64,
    period_s: f64,
    /// 1 on the way in, −1 on the way out.
    direction: f64,
    shuttles: bool,
    /// Speed over what it should be.
    pub hurry: f64,
}

impl ShuttleDrive {
    /// At rest where the table begins, to go to `depth_end` at this speed, in steps of `period_s`.
    pub fn new<const D: usize, const N: usize, const P: usize>(
        table: &Table<f64, D, N, P>,
        depth_end: f64,
        speed: f64,
        period_s: f64,
    ) -> Self {
        let start = table.validity.depth_start;
        Self {
            motion: NeedleMotion { depth: start, velocity: 0.0 },
            range: [start, depth_end],
            speed,
            acceleration: table.validity.needle_speed / RAMP_S,
            period_s,
            direction: 1.0,
            shuttles: false,
            hurry: 1.0,
        }
    }

    /// The same, turning back at its ends again and again.
    #[must_use]
    pub fn to_and_fro(self) -> Self {
        Self { shuttles: true, ..self }
    }

    /// Where it is, length.
    pub fn depth(&self) -> f64 {
        self.motion.depth
    }
}

impl NeedleDrive for ShuttleDrive {
    fn motion(&mut self, since_start_s: f64) -> NeedleMotion {
        let [start, end] = self.range;
        let NeedleMotion { depth, velocity } = self.motion;
        let mut setpoint = if since_start_s >= 0.0 { self.speed * self.hurry * self.direction } else { 0.0 };
        let left = if setpoint > 0.0 { end - depth } else { depth - start }.max(0.0);
        if left < 1e-3 * (end - start) && self.shuttles && setpoint * self.direction > 0.0 {
            self.direction = -self.direction;
        }
        let stoppable = (1.8 * self.acceleration * left).sqrt();
        setpoint = setpoint.clamp(-stoppable, stoppable);
        let change = self.acceleration * self.period_s;
        let after = velocity + (setpoint - velocity).clamp(-change, change);
        let depth = (depth + 0.5 * (velocity + after) * self.period_s).clamp(start, end);
        self.motion = NeedleMotion { depth, velocity: after };
        self.motion
    }
}
