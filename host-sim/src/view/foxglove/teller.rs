//! What one client is told.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

use model_offline::output::space_picture::SpaceGeometry;
use nalgebra::SMatrix;
use serde::Serialize;

use super::protocol::{self, ClientRequest, Wanted};
use crate::record::export::csv::Series;
use crate::record::export::foxglove::{Scenery, SpaceStage, Stage};
use crate::record::export::messages::{self, MessageSink};
use crate::view::body::{ShownBody, SpaceShown};
use crate::view::shared::{Shared, ViewState};
use crate::world::truth::Truth;

/// Why a client's request is not granted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum SubscriptionRefusal {
    /// Anything else.
    #[error("not understood: clients may subscribe and unsubscribe, and change nothing")]
    Unknown,
    /// It was not advertised.
    #[error("no such channel")]
    Channel,
    /// One of each is enough.
    #[error("the channel, or the number of the subscription, is taken already")]
    Taken,
    /// It was never asked for.
    #[error("no such subscription")]
    Subscription,
}

/// A subscription to a topic.
#[derive(Clone, Copy, Debug)]
struct Subscription {
    id: u32,
    /// When what was told last was published, ns.
    last_ns: Option<u64>,
}

/// Messages that are due, for whom has subscribed to them.
#[derive(Debug, Default)]
struct Due {
    subscriptions: BTreeMap<&'static str, Subscription>,
    waiting: Vec<Vec<u8>>,
}

impl Due {
    /// Whether something of this topic that is published at this time, ns, is wanted, and new.
    fn is_wanted(&self, topic: &str, published_ns: u64) -> bool {
        self.subscriptions.get(topic).is_some_and(|s| s.last_ns.is_none_or(|last_ns| last_ns < published_ns))
    }
}

impl MessageSink for Due {
    type Refusal = Infallible;

    fn take(
        &mut self,
        topic: &'static str,
        [logged_ns, published_ns]: [u64; 2],
        message: &impl Serialize,
    ) -> Result<(), Infallible> {
        if self.is_wanted(topic, published_ns)
            && let Some(subscription) = self.subscriptions.get_mut(topic)
        {
            subscription.last_ns = Some(published_ns);
            self.waiting.extend(protocol::data(subscription.id, logged_ns, message));
        }
        Ok(())
    }
}

/// An insertion's scene.
#[derive(Debug)]
enum ShownStage {
    Plane { stage: Box<Stage>, orthogonal: SMatrix<f64, 2, 1>, unit: String },
    Space { stage: Box<SpaceStage<'static>>, body: Arc<SpaceShown>, scale: f64 },
}

impl ShownStage {
    fn new(body: &ShownBody) -> Self {
        match body {
            ShownBody::Plane(model, paddle) => Self::Plane {
                stage: Box::new(Stage::new(model.scene(), *paddle)),
                orthogonal: model.scene().needle.orthogonal(),
                unit: model.scene().length_unit.clone(),
            },
            ShownBody::Space(body) => Self::Space {
                stage: Box::new(SpaceStage::new(SpaceGeometry::new(&body.model), &body.paddles, &[])),
                body: Arc::clone(body),
                scale: 0.0,
            },
        }
    }

    fn tell(&mut self, due: &mut Due, state: &ViewState, began_ns: u64) -> Result<(), Infallible> {
        match self {
            Self::Plane { stage, orthogonal, unit } => {
                tell_scene(due, &state.truth, stage.as_ref(), began_ns)?;
                tell_samples(due, state, &Series { orthogonal, paddles: 1, length: unit })
            }
            Self::Space { stage, body, scale } => {
                tell_scene(due, &state.truth, stage.as_ref(), began_ns)?;
                let time_ns = state.truth.time_ns;
                // To find it takes a while. Where the table does not reach there is none to show.
                if due.is_wanted("/scene/body", time_ns)
                    && let Some(now) = body.state(&state.truth)
                {
                    messages::body(due, time_ns, &stage.seen(time_ns, &now, scale))?;
                }
                let scene = body.model.scene();
                let orthogonal = scene.needle.orthogonal();
                let series =
                    Series { orthogonal: &orthogonal, paddles: body.paddles.len(), length: &scene.length_unit };
                tell_samples(due, state, &series)
            }
        }
    }
}

fn tell_scene(due: &mut Due, truth: &Truth, stage: &dyn Scenery, began_ns: u64) -> Result<(), Infallible> {
    if ["/tf", "/scene/rest"].into_iter().any(|topic| due.is_wanted(topic, began_ns)) {
        messages::at_rest(due, began_ns, stage)?;
    }
    if messages::MOVING.into_iter().any(|topic| due.is_wanted(topic, truth.time_ns)) {
        messages::at_tick(due, truth, stage)?;
    }
    Ok(())
}

fn tell_samples<const D: usize, const N: usize>(
    due: &mut Due,
    state: &ViewState,
    series: &Series<'_, D, N>,
) -> Result<(), Infallible> {
    if let Some(exchanged) = &state.exchanged {
        let (inputs, command) = (&exchanged.inputs, &exchanged.command);
        messages::samples::<_, D>(due, inputs)?;
        messages::command(due, (inputs.tick, inputs.time_ns), command, series)?;
    }
    messages::truth(due, &state.truth, series)?;
    if let Some(moment) = &state.needle {
        let ago_ns = ((state.time_s - moment.since_start_s) * 1e9).round() as u64;
        messages::forces(due, state.truth.time_ns.saturating_sub(ago_ns), &moment.reading)?;
    }
    state.changes.iter().try_for_each(|(time_ns, said)| messages::log(due, *time_ns, *said))
}

/// Tells one client what it has subscribed to.
#[derive(Debug)]
pub(super) struct Teller {
    shared: Arc<Shared>,
    insertion: u64,
    number: u64,
    /// The first time of the present insertion that was seen, ns.
    began_ns: u64,
    stage: Option<ShownStage>,
    due: Due,
    /// Whether somebody subscribed since the last look, and is to be told what there is.
    is_awaited: bool,
}

impl Teller {
    pub(super) fn new(shared: Arc<Shared>) -> Self {
        Self { shared, insertion: 0, number: 0, began_ns: 0, stage: None, due: Due::default(), is_awaited: false }
    }

    /// Whether nothing new will come.
    pub(super) fn is_over(&self) -> bool {
        self.shared.is_over()
    }

    /// Does what a client asks for.
    pub(super) fn hear(&mut self, text: &str) -> Result<(), SubscriptionRefusal> {
        match serde_json::from_str(text).map_err(|_| SubscriptionRefusal::Unknown)? {
            ClientRequest::Subscribe { subscriptions } => {
                // What can be done is done; what is said is the first that cannot.
                let done: Vec<_> = subscriptions.into_iter().map(|wanted| self.subscribe(wanted)).collect();
                done.into_iter().collect()
            }
            ClientRequest::Unsubscribe { subscription_ids } => {
                let known = self.due.subscriptions.len();
                self.due.subscriptions.retain(|_, subscription| !subscription_ids.contains(&subscription.id));
                let gone = known - self.due.subscriptions.len();
                if gone == subscription_ids.len() { Ok(()) } else { Err(SubscriptionRefusal::Subscription) }
            }
        }
    }

    fn subscribe(&mut self, Wanted { id, channel_id }: Wanted) -> Result<(), SubscriptionRefusal> {
        let subscriptions = &mut self.due.subscriptions;
        let topic = protocol::topic(channel_id).ok_or(SubscriptionRefusal::Channel)?;
        if subscriptions.contains_key(topic) || subscriptions.values().any(|known| known.id == id) {
            return Err(SubscriptionRefusal::Taken);
        }
        subscriptions.insert(topic, Subscription { id, last_ns: None });
        self.is_awaited = true;
        Ok(())
    }

    /// The messages of the newest state, where it is new or somebody waits for it: one of each topic, and lines of the log.
    pub(super) fn look(&mut self) -> Vec<Vec<u8>> {
        let is_awaited = std::mem::take(&mut self.is_awaited);
        let Some(state) = self.shared.newer(self.insertion, if is_awaited { 0 } else { self.number }) else {
            return Vec::new();
        };
        let time_ns = state.truth.time_ns;
        if state.insertion != self.insertion {
            self.stage = state.body.as_ref().map(ShownStage::new);
            self.began_ns = time_ns;
            self.due.subscriptions.values_mut().for_each(|subscription| subscription.last_ns = None);
        }
        (self.insertion, self.number) = (state.insertion, state.number);
        self.due.waiting.push(protocol::time(time_ns));
        if let Some(stage) = &mut self.stage {
            let Ok(()) = stage.tell(&mut self.due, &state, self.began_ns);
        }
        std::mem::take(&mut self.due.waiting)
    }
}
