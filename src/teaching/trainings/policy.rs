//! What follows from labels by itself: a training, and how far its model goes. It stops before anything serves unless
//! people have said otherwise.

use super::publish::Trainer;
use crate::repository::{Canary, Change};
use crate::teaching::{TeachingError, Who};
use roomsight_protocol::audit::Deed;
use roomsight_protocol::training::{
    LearningPolicy, PublishAs, PublishedVersion, TrainingInfo, TrainingJson, TrainingState,
};
use roomsight_protocol::version_id::is_name;

/// The names of rules in the database.
const POLICY: &str = "learning";
const LABELED: &str = "labeled_since_training";

/// Who does what the policy says.
const POLICY_ITSELF: Who = Who("policy");

/// The share of the robots that a canary answers which came by itself.
const CANARY_SHARE: f64 = 0.1;

impl Trainer {
    /// What follows from labels by itself.
    ///
    /// # Errors
    /// A database that cannot be read.
    pub fn policy(&self) -> Result<LearningPolicy, TeachingError> {
        self.teaching.trainings.store.rule(POLICY)
    }

    /// Lets something else follow.
    ///
    /// # Errors
    /// A policy that names no data set or no model.
    pub fn set_policy(&self, policy: &LearningPolicy) -> Result<(), TeachingError> {
        let names = [(&policy.set, "set"), (&policy.model, "model")];
        for (name, what) in names {
            if name.as_deref().is_some_and(|name| !is_name(name)) || policy.train_after > 0 && name.is_none()
            {
                return Err(TeachingError::Invalid(format!("`{what}` must be a name, to train by itself")));
            }
        }
        self.teaching.trainings.store.set_rule(POLICY, policy)
    }

    /// Takes note that frames of the inbox were labelled; where there are enough of them a training begins. What goes wrong with
    /// that is told by the log, since the labels are there.
    pub fn labeled(&self, set: &str, n_frames: usize) {
        if let Err(error) = self.count_labels(set, n_frames) {
            tracing::warn!(%error, "no training follows from the labels");
        }
    }

    fn count_labels(&self, set: &str, n_frames: usize) -> Result<(), TeachingError> {
        let store = &self.teaching.trainings.store;
        let policy = self.policy()?;
        let (Some(wanted_set), Some(model)) = (&policy.set, &policy.model) else { return Ok(()) };
        if policy.train_after == 0 || wanted_set != set {
            return Ok(());
        }
        let n_labeled = store.rule::<u64>(LABELED)? + n_frames as u64;
        store.set_rule(LABELED, &n_labeled)?;
        if n_labeled < policy.train_after || self.teaching.trainings.is_busy() {
            return Ok(());
        }
        let (set, model) = (wanted_set.clone(), model.clone());
        let wanted = TrainingJson { set, model, effort: policy.effort, camera: policy.camera };
        let info = self.begin(POLICY_ITSELF, &wanted)?;
        self.teaching.audit.note(
            POLICY_ITSELF,
            Deed::Train,
            &wanted.model,
            &format!("training {} after {n_labeled} labels", info.id),
        );
        store.set_rule(LABELED, &0)
    }

    /// Lets a model that was trained by the policy go as far as that says.
    pub(super) fn ended(&self, info: &TrainingInfo) {
        if info.by != POLICY_ITSELF.0 || info.state != TrainingState::Done {
            return;
        }
        if let Err(error) = self.go_on(info) {
            tracing::warn!(training = info.id, %error, "the policy does not go on with what was trained");
        }
    }

    fn go_on(&self, info: &TrainingInfo) -> Result<(), TeachingError> {
        let as_what = self.policy()?.publish;
        if as_what == PublishAs::Nothing {
            return Ok(());
        }
        let PublishedVersion { name, version } = self.publish(info.id, false)?;
        let target = format!("{name}/{version}");
        self.teaching.audit.note(POLICY_ITSELF, Deed::Publish, &target, &format!("training {}", info.id));
        let change = match as_what {
            PublishAs::Nothing => return Ok(()),
            PublishAs::Shadow => Change::Shadow(Some(version)),
            PublishAs::Canary => Change::Canary(Some(Canary { version, share: CANARY_SHARE })),
            PublishAs::Stable => Change::Activate(version),
        };
        self.engine.registry.change(&name, change, None)?;
        let said = serde_json::to_value(as_what)?;
        self.teaching.audit.note(POLICY_ITSELF, Deed::Policy, &target, said.as_str().unwrap_or_default());
        Ok(())
    }
}
