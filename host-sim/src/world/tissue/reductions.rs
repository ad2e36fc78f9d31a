//! Reduced models that insertions share.

use std::sync::{Arc, Mutex, PoisonError};

use model_offline::model::{Pose, TissueModel};
use model_offline::parallel;
use model_offline::reduction::along_path::{AlongPath, PathOptions};
use model_offline::reduction::online::ReducedModel;
use model_offline::reduction::{TrainingError, TrainingReport, train};
use nalgebra::Vector2;

use super::attachment::{Attachment, Insertion};

/// What training found.
type Trained = Result<(Arc<ReducedModel>, TrainingReport), TrainingError>;

/// Reduced models of one tissue, each trained when it is first asked for: insertions that differ in table, mode or loop
/// alone share theirs. Refusals are remembered too.
#[derive(Debug, Default)]
pub struct Reductions {
    pub(super) states: Mutex<Vec<(Attachment, Trained)>>,
    paths: Mutex<Vec<(PathKey, Learnt)>>,
}

/// What a path depends on besides the tissue.
type PathKey = (Attachment, Insertion);

/// What learning a path found.
type Learnt = Result<Arc<AlongPath>, TrainingError>;

impl Reductions {
    /// The one for this attachment; `model` is the same at every call.
    pub(super) fn of(&self, model: &TissueModel, attachment: Attachment) -> Trained {
        let known = || self.states.lock().unwrap_or_else(PoisonError::into_inner);
        let found = known().iter().find(|(of, _)| *of == attachment).map(|(_, trained)| trained.clone());
        found.unwrap_or_else(|| {
            // Without the lock: a thread that waits for others to train may be given another insertion meanwhile, which
            // asks here as well.
            let trained = train(model, attachment.paddle, &attachment.training(model));
            known().push((attachment, trained.clone()));
            trained
        })
    }
}

impl Reductions {
    /// The path of an insertion; `model` is the same at every call.
    pub(super) fn path(&self, model: &TissueModel, attachment: Attachment, insertion: &Insertion) -> Learnt {
        let Insertion { trajectory, duration_s, plan } = insertion;
        let key = (attachment, insertion.clone());
        let known = || self.paths.lock().unwrap_or_else(PoisonError::into_inner);
        let found = known().iter().find(|(of, _)| *of == key).map(|(_, learnt)| learnt.clone());
        found.unwrap_or_else(|| {
            let way = |time: f64| {
                let depth = trajectory.at(time).depth;
                let paddle = if attachment.held { Vector2::zeros() } else { plan.at(depth) };
                Pose { paddle, ..model.pose_at(time, depth) }
            };
            // A hundredth of the insertion, however long it waits before or rests after.
            let finest = PathOptions::new(*duration_s).in_steps_of(0.01 * trajectory.insertion_s());
            let options = finest
                .and_then(|options| options.following(&model.scene().motion))
                .map(|options| PathOptions { steered: !attachment.held, threads: parallel::available(), ..options });
            let learnt = options.and_then(|options| AlongPath::learn(model, attachment.paddle, &way, &options));
            let learnt = learnt.map(Arc::new);
            known().push((key, learnt.clone()));
            learnt
        })
    }
}
