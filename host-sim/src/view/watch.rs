//! The loop's end: leaves a state for the page now and then, and holds time where the page wants it held.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use nalgebra::Vector3;

use super::body::{ShownBody, SpaceShown};
use super::shared::{CHANGES, FRAME_NS, Shared, ViewState};
use crate::record::export::messages::Said;
use crate::runtime::accounting::tick::ControllerTick;
use crate::runtime::plant::observer::{Moment, ObservedInsertion, Observer, PlanarBody};
use crate::runtime::signals;
use crate::runtime::time::clock::{now_ns, sleep_until};
use crate::runtime::time::mode::RunMode;
use crate::world::space::{PreparedBody, SpaceTissue};
use crate::world::tissue::TissuePlant;
use crate::world::truth::Truth;

/// How long a paused loop sleeps between two looks.
const PAUSE: Duration = Duration::from_millis(5);

/// Lockstep that falls behind the clock on the wall by more than this does not catch up, ns.
const CATCH_UP_NS: u64 = 200_000_000;

/// Keeps lockstep from running ahead of the clock on the wall.
#[derive(Debug)]
struct Pacing {
    period_ns: u64,
    next_ns: u64,
}

impl Pacing {
    /// For ticks of this period, ns.
    fn new(period_ns: u64) -> Self {
        Self { period_ns, next_ns: now_ns() }
    }

    fn restart(&mut self) {
        self.next_ns = now_ns();
    }

    fn keep(&mut self, thousandths: u64) {
        if thousandths == 0 {
            return;
        }
        self.next_ns += self.period_ns * 1000 / thousandths;
        let now = now_ns();
        if self.next_ns > now {
            sleep_until(self.next_ns);
        } else if now - self.next_ns > CATCH_UP_NS {
            // Too slow for this pace: what is lost stays lost.
            self.next_ns = now;
        }
    }
}

/// Looks on at one insertion.
#[derive(Debug)]
pub(super) struct Watch {
    shared: Arc<Shared>,
    mode: RunMode,
    pacing: Pacing,
    due_ns: u64,
    solve_ns: u64,
    late_ns: u64,
    /// Directions in which the target is to stay, one in the plane and two in space.
    orthogonal: Vec<Vector3<f64>>,
    /// Its largest displacement in them, length.
    largest: f64,
    /// When the next tick of free-run is due, ns.
    expected_ns: Option<u64>,
    /// Whether time is held after the tick that was offered last.
    held: bool,
    /// What the controller said last of itself.
    said: Option<Said>,
    /// Changes that no state has yet, with their times, ns.
    changes: VecDeque<(u64, Said)>,
}

/// Keeps the newest changes. Allocates nothing.
fn remember(changes: &mut VecDeque<(u64, Said)>, change: (u64, Said)) {
    if changes.len() == CHANGES {
        changes.pop_front();
    }
    changes.push_back(change);
}

impl Watch {
    /// Begins an insertion in the plane.
    pub(super) fn new(shared: &Arc<Shared>, insertion: ObservedInsertion<PlanarBody<'_>>) -> Self {
        let PlanarBody { model, paddle } = insertion.body;
        let [x, y] = model.scene().needle.orthogonal().into();
        let body = ShownBody::Plane(Arc::new(model.clone()), paddle);
        Self::of(shared, insertion, body, vec![0.0; model.dofs()], vec![Vector3::new(x, y, 0.0)])
    }

    /// Begins an insertion in space.
    pub(super) fn in_space(shared: &Arc<Shared>, insertion: ObservedInsertion<&PreparedBody<'_>>) -> Self {
        let orthogonal = insertion.body.model().scene().needle.orthogonal();
        let body = ShownBody::Space(Arc::new(SpaceShown::new(insertion.body)));
        let orthogonal = orthogonal.column_iter().map(|direction| direction.into_owned()).collect();
        Self::of(shared, insertion, body, Vec::new(), orthogonal)
    }

    fn of<B>(
        shared: &Arc<Shared>,
        insertion: ObservedInsertion<B>,
        body: ShownBody,
        coefficients: Vec<f64>,
        orthogonal: Vec<Vector3<f64>>,
    ) -> Self {
        let ObservedInsertion { mode, period_ns, title, .. } = insertion;
        {
            let mut state = shared.state();
            *state = ViewState {
                insertion: state.insertion + 1,
                title,
                live: shared.restarts_are_allowed(),
                mode: Some(mode),
                body: Some(body),
                coefficients,
                changes: VecDeque::with_capacity(CHANGES),
                ..ViewState::default()
            };
        }
        Self {
            shared: Arc::clone(shared),
            mode,
            pacing: Pacing::new(period_ns),
            due_ns: 0,
            solve_ns: 0,
            late_ns: 0,
            orthogonal,
            largest: 0.0,
            expected_ns: None,
            held: false,
            said: None,
            changes: VecDeque::with_capacity(CHANGES),
        }
    }

    /// Remembers what the controller says of itself where that is new, until a state is left.
    fn hear(&mut self, exchanged: &ControllerTick) {
        let now = Said::from(&exchanged.command);
        if self.said.replace(now) != Some(now) {
            remember(&mut self.changes, (exchanged.inputs.time_ns, now));
        }
    }

    /// The target's displacement in the directions in which it is to stay: with a sign where there is one.
    fn error(&self, truth: &Truth) -> f64 {
        let target = Vector3::from(truth.target);
        match &self.orthogonal[..] {
            [one] => one.dot(&target),
            all => all.iter().map(|one| one.dot(&target).powi(2)).sum::<f64>().sqrt(),
        }
    }

    /// Leaves a state if one is due and nobody reads the last one, with what is copied into it. Waits for nobody, unless time is
    /// held after this tick: then the page is to show this one, and no earlier one.
    fn leave(&mut self, moment: &Moment, copy: impl FnOnce(&mut ViewState)) {
        let now = now_ns();
        self.solve_ns = self.solve_ns.max(now.saturating_sub(moment.began_ns));
        if self.mode == RunMode::FreeRun {
            // From the first release that was missed: time goes on at a later one.
            let time_ns = moment.truth.time_ns;
            let due_ns = self.expected_ns.map_or(time_ns, |expected_ns| expected_ns.min(time_ns));
            self.late_ns = self.late_ns.max(moment.began_ns.saturating_sub(due_ns));
            self.expected_ns = Some(time_ns + self.pacing.period_ns);
        }
        let error = self.error(&moment.truth);
        if moment.is_counted {
            self.largest = self.largest.max(error.abs());
        }
        if let Some(exchanged) = &moment.exchanged {
            self.hear(exchanged);
        }
        self.held = self.mode == RunMode::Lockstep && self.shared.is_paused();
        if now < self.due_ns && !self.held {
            return;
        }
        let free = if self.held { Some(self.shared.state()) } else { self.shared.try_state() };
        let Some(mut state) = free else { return };
        self.due_ns = now + FRAME_NS;
        copy(&mut state);
        self.changes.drain(..).for_each(|change| remember(&mut state.changes, change));
        state.number += 1;
        state.held = self.held;
        state.time_s = moment.time_s;
        state.truth = moment.truth;
        state.error = error;
        state.answer = moment.answer;
        state.exchanged = moment.exchanged;
        state.largest = self.largest;
        state.solve_ns = std::mem::take(&mut self.solve_ns);
        state.late_ns = std::mem::take(&mut self.late_ns);
        let [solve_us, late_us] = [state.solve_ns, state.late_ns].map(|ns| ns as f64 * 1e-3);
        // Before the needle starts there is no time of its own: a line from there would be a ramp that never was.
        if moment.time_s < 0.0 {
            return;
        }
        state.history.push([moment.time_s, error, solve_us, late_us], moment.truth.target);
    }

    /// Holds time while paused, and to keep pace with the clock on the wall. A pause that was asked for since the last offer
    /// begins with the next tick: the tick that is held is the one that is shown.
    fn wait(&mut self) {
        while self.held && self.shared.is_paused() && !self.shared.ends_early() && signals::check().is_ok() {
            let step = self.shared.take_step();
            self.pacing.restart();
            if step {
                return;
            }
            std::thread::sleep(PAUSE);
        }
        self.pacing.keep(self.shared.pace());
    }
}

impl Drop for Watch {
    /// What the controller said since the last state was left is not lost with the insertion.
    fn drop(&mut self) {
        if self.changes.is_empty() {
            return;
        }
        let mut state = self.shared.state();
        self.changes.drain(..).for_each(|change| remember(&mut state.changes, change));
        state.number += 1;
    }
}

impl<'m> Observer<TissuePlant<'m>> for Watch {
    fn offer(&mut self, tissue: &TissuePlant<'m>, moment: &Moment) {
        self.leave(moment, |state| {
            tissue.copy_coefficients(&mut state.coefficients);
            // Few scenes have one, and then a reading was made for it just now.
            if let Some(newest) = tissue.needle().last()
                && state.needle.as_ref().is_none_or(|shown| shown.since_start_s < newest.since_start_s)
            {
                state.needle = Some(newest.clone());
            }
        });
    }

    fn ends_early(&self) -> bool {
        self.shared.ends_early()
    }

    fn hold(&mut self) {
        self.wait();
    }
}

impl<'m> Observer<SpaceTissue<'m>> for Watch {
    fn offer(&mut self, _: &SpaceTissue<'m>, moment: &Moment) {
        self.leave(moment, |_| ());
    }

    fn ends_early(&self) -> bool {
        self.shared.ends_early()
    }

    fn hold(&mut self) {
        self.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Knobs;
    use crate::world::tissue::WantedPlant;
    use firmware::contract::PaddleCommand;
    use firmware::{Inputs, Mode};
    use model_offline::model::TissueModel;
    use model_offline::scene::Scene;

    const KNOBS: Knobs = Knobs { needle_speed: 1.0, target_rate: 50.0, latency: 20.0, noise: 1.0, stiffness: 1.0 };

    #[test]
    fn the_loop_never_waits_for_a_reader() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let tissue = TissuePlant::new(&model, None, WantedPlant::Full).unwrap();
        let shared = Arc::new(Shared::new(KNOBS));
        let insertion = ObservedInsertion {
            body: PlanarBody { model: &model, paddle: 0 },
            mode: RunMode::Lockstep,
            period_ns: 1_000_000,
            title: String::new(),
        };
        let mut watch = Watch::new(&shared, insertion);
        let truth = Truth { tick: 1, ..Truth::default() };
        let moment = Moment { truth, time_s: 0.0, began_ns: 0, is_counted: true, answer: None, exchanged: None };
        let reader = shared.state();
        watch.offer(&tissue, &moment);
        assert_eq!((reader.number, shared.dropped()), (0, 1));
        drop(reader);
        watch.offer(&tissue, &moment);
        let state = shared.newer(0, 0).unwrap();
        assert_eq!((state.number, state.truth.tick, state.coefficients.len()), (1, 1, model.dofs()));
        assert!(shared.newer(state.insertion, state.number).is_none());
    }

    /// An insertion that has begun and has no tick yet is not shown: a state of time 0 would be a jump back of the clock.
    #[test]
    fn an_insertion_is_not_shown_before_its_first_tick() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let tissue = TissuePlant::new(&model, None, WantedPlant::Full).unwrap();
        let shared = Arc::new(Shared::new(KNOBS));
        let insertion = || ObservedInsertion {
            body: PlanarBody { model: &model, paddle: 0 },
            mode: RunMode::FreeRun,
            period_ns: 1_000_000,
            title: String::new(),
        };
        let truth = Truth { tick: 7, time_ns: 5_000_000_000, ..Truth::default() };
        let moment = Moment { truth, time_s: 0.0, began_ns: 0, is_counted: true, answer: None, exchanged: None };
        let mut first = Watch::new(&shared, insertion());
        first.offer(&tissue, &moment);
        let seen = shared.newer(0, 0).unwrap();
        drop(first);
        let mut second = Watch::new(&shared, insertion());
        for (insertion, number) in [(0, 0), (seen.insertion, seen.number)] {
            assert!(shared.newer(insertion, number).is_none());
        }
        second.offer(&tissue, &moment);
        let state = shared.newer(seen.insertion, seen.number).unwrap();
        assert_eq!((state.insertion, state.number, state.truth.tick), (seen.insertion + 1, 1, 7));
    }

    /// What the controller says after the last state that was left is told all the same.
    #[test]
    fn the_last_words_of_an_insertion_are_not_lost() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let tissue = TissuePlant::new(&model, None, WantedPlant::Full).unwrap();
        let shared = Arc::new(Shared::new(KNOBS));
        let insertion = ObservedInsertion {
            body: PlanarBody { model: &model, paddle: 0 },
            mode: RunMode::Lockstep,
            period_ns: 1_000_000,
            title: String::new(),
        };
        let mut watch = Watch::new(&shared, insertion);
        let says = |tick: u64, mode: Mode| {
            let command = PaddleCommand { tick, state: mode as u32, ..PaddleCommand::default() };
            let inputs = Inputs { tick, time_ns: tick * 1_000_000, ..Inputs::default() };
            let truth = Truth { tick, time_ns: inputs.time_ns, ..Truth::default() };
            let exchanged = Some(ControllerTick { inputs, command });
            Moment { truth, time_s: 0.0, began_ns: 0, is_counted: true, answer: None, exchanged }
        };
        watch.offer(&tissue, &says(1, Mode::Run));
        // At once: no state is due for them.
        watch.offer(&tissue, &says(2, Mode::Hold));
        watch.offer(&tissue, &says(3, Mode::Safe));
        let before = shared.newer(0, 0).unwrap();
        assert_eq!((before.changes.len(), before.truth.tick), (1, 1));
        drop(watch);
        let after = shared.newer(before.insertion, before.number).unwrap();
        let times: Vec<u64> = after.changes.iter().map(|(time_ns, _)| time_ns / 1_000_000).collect();
        assert_eq!((times, after.truth.tick), (vec![1, 2, 3], 1));
    }
}
