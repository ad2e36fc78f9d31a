//! How the paddle follows its commands.

use std::collections::VecDeque;

use nalgebra::SVector;

/// How the paddle's actuator follows commands. The default is a servo that is there within one tick, at its rate limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorModel {
    /// Largest speed, length/s.
    pub max_rate: f64,
    /// Time constant of a first-order lag, s; 0: none.
    pub lag_s: f64,
    /// Ticks that a command waits before it acts.
    pub delay_ticks: u32,
    /// Part of the commanded displacement that is reached.
    pub gain: f64,
}

/// A paddle in D dimensions and the actuator that moves it.
#[derive(Clone, Debug)]
pub struct PaddleActuator<const D: usize = 2> {
    model: ActuatorModel,
    waiting: VecDeque<SVector<f64, D>>,
    goal: SVector<f64, D>,
    position: SVector<f64, D>,
}

impl<const D: usize> PaddleActuator<D> {
    /// A paddle at rest where it touches the undeformed tissue.
    pub fn new(model: ActuatorModel) -> Self {
        Self { model, waiting: VecDeque::new(), goal: SVector::zeros(), position: SVector::zeros() }
    }

    /// A paddle at rest in this place (displacement, length).
    pub fn at(model: ActuatorModel, position: SVector<f64, D>) -> Self {
        Self { goal: position, position, ..Self::new(model) }
    }

    /// Changes the part of the command that is reached.
    pub fn set_gain(&mut self, gain: f64) {
        self.model.gain = gain;
    }

    /// Displacement now, length.
    pub fn position(&self) -> SVector<f64, D> {
        self.position
    }

    /// `elapsed_s` pass with this command, or without one (the last goal stays).
    pub fn advance(&mut self, command: Option<SVector<f64, D>>, elapsed_s: f64) {
        self.waiting.push_back(command.unwrap_or(*self.waiting.back().unwrap_or(&self.goal)));
        while self.waiting.len() > self.model.delay_ticks as usize {
            let Some(goal) = self.waiting.pop_front() else {
                break;
            };
            self.goal = goal;
        }
        let approached = if self.model.lag_s > 0.0 { 1.0 - (-elapsed_s / self.model.lag_s).exp() } else { 1.0 };
        let way = self.goal * self.model.gain - self.position;
        let step = way * approached;
        let longest = self.model.max_rate * elapsed_s;
        // A command that keeps to the same limit arrives, whatever the rounding of its length.
        self.position += if step.norm() > longest * (1.0 + 1e-9) { step * (longest / step.norm()) } else { step };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    const SERVO: ActuatorModel = ActuatorModel { max_rate: 0.1, lag_s: 0.0, delay_ticks: 0, gain: 1.0 };

    #[test]
    fn the_paddle_keeps_its_rate_limit() {
        let mut paddle = PaddleActuator::new(SERVO);
        let goal = Vector2::new(0.03, 0.04);
        for _ in 0..100 {
            let before = paddle.position();
            paddle.advance(Some(goal), 1e-3);
            assert!((paddle.position() - before).norm() <= 1e-4 * (1.0 + 1e-9));
        }
        assert!((paddle.position().norm() - 0.01).abs() < 1e-12);
    }

    #[test]
    fn delay_lag_and_gain_act() {
        let goal = Vector2::new(1e-5, 0.0);
        let mut delayed = PaddleActuator::new(ActuatorModel { delay_ticks: 2, ..SERVO });
        delayed.advance(Some(goal), 1e-3);
        delayed.advance(Some(goal), 1e-3);
        assert_eq!(delayed.position(), Vector2::zeros());
        delayed.advance(Some(goal), 1e-3);
        assert_eq!(delayed.position(), goal);

        let mut lagging = PaddleActuator::new(ActuatorModel { lag_s: 1e-3, ..SERVO });
        lagging.advance(Some(goal), 1e-3);
        assert!((lagging.position().x / goal.x - (1.0 - (-1.0f64).exp())).abs() < 1e-12);

        let mut weak = PaddleActuator::new(ActuatorModel { gain: 0.5, ..SERVO });
        weak.advance(Some(goal), 1e-3);
        assert_eq!(weak.position(), goal * 0.5);
    }
}
