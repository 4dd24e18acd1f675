//! What is true of each version, now and before.

use super::Failure;
use crate::repository::Fingerprint;
use roomsight_protocol::rest::{StateChange, VersionState};
use roomsight_recognition::model::{Model, Stage};
use std::collections::VecDeque;
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant, SystemTime};

/// The last states that are kept of a version.
const N_KEPT: usize = 16;

/// The longest that a version waits to be tried again whose failure may pass.
const MAX_RETRY_PAUSE: Duration = Duration::from_secs(60);

/// One version of a model.
#[derive(Clone, Debug)]
pub struct Version {
    /// How its files were when they were last looked at.
    fingerprint: Fingerprint,
    /// Its files did not change between two looks: nobody is copying it.
    is_whole: bool,
    state: State,
    history: VecDeque<(VersionState, SystemTime)>,
    /// How often in a row it failed so that it may pass.
    n_failures: u32,
    /// When it came to be what it is.
    entered_at: Instant,
}

/// What is true of a version.
#[derive(Clone, Debug)]
pub enum State {
    Discovered,
    /// It is on the way to serving.
    Trying(Stage),
    /// It can answer.
    Ready(Loaded),
    /// It gets no further frames; some are in work.
    Quiescing(Weak<Model>),
    /// It is no longer in memory.
    Unloaded,
    /// It was tried and will not serve.
    Failed(Failure),
}

/// A model in memory.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub model: Arc<Model>,
    /// The BLAKE3 digest of its file, 64 hexadecimal digits.
    pub digest: String,
}

impl Version {
    /// A version that was just found. What is there when the service starts is taken for whole.
    pub fn new(fingerprint: Fingerprint, is_whole: bool) -> Self {
        let mut version = Self {
            fingerprint,
            is_whole,
            state: State::Discovered,
            history: VecDeque::new(),
            n_failures: 0,
            entered_at: Instant::now(),
        };
        version.enter(State::Discovered);
        version
    }

    /// Looks at its files again. One that was tried in vain is tried again when they change, or where the failure may
    /// pass: at the next look, then after pauses that double.
    pub fn look(&mut self, id: &str, fingerprint: &Fingerprint) {
        self.is_whole = self.fingerprint == *fingerprint;
        if self.is_whole {
            let is_due = || self.entered_at.elapsed() >= retry_pause(self.n_failures);
            if self.failure().is_some_and(|failure| failure.may_pass) && is_due() {
                self.enter(State::Discovered);
            }
            return;
        }
        self.fingerprint = fingerprint.clone();
        self.n_failures = 0;
        if self.failure().is_some() {
            self.enter(State::Discovered);
        } else if self.loaded().is_some() {
            let what = "the files of a version changed, or their times did; the model in memory serves on";
            tracing::warn!(version = id, "{what}");
        }
    }

    /// Takes it for whole: it was published as a whole.
    pub fn mark_whole(&mut self) {
        self.is_whole = true;
    }

    /// Whether it is whole and was never in memory.
    pub fn is_new(&self) -> bool {
        self.is_whole && matches!(self.state, State::Discovered)
    }

    /// Whether it is whole, not in memory, and may work.
    pub fn is_untried(&self) -> bool {
        self.is_whole && matches!(self.state, State::Discovered | State::Unloaded)
    }

    /// What is true of it.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Lets something else be true from now on.
    pub fn enter(&mut self, state: State) {
        if self.history.len() == N_KEPT {
            self.history.pop_front();
        }
        self.history.push_back((state.name(), SystemTime::now()));
        match &state {
            State::Failed(failure) if failure.may_pass => self.n_failures += 1,
            State::Failed(_) | State::Ready(_) => self.n_failures = 0,
            _ => {}
        }
        self.state = state;
        self.entered_at = Instant::now();
    }

    /// Takes the model out of use: it is in memory until the last frame that it works on is done.
    pub fn retire(&mut self) {
        if let State::Ready(loaded) = &self.state {
            self.enter(State::Quiescing(Arc::downgrade(&loaded.model)));
        }
        self.settle();
    }

    /// Notes that the last frame is done, if it is.
    pub fn settle(&mut self) {
        if matches!(&self.state, State::Quiescing(model) if model.strong_count() == 0) {
            self.enter(State::Unloaded);
        }
    }

    /// The model, where it is in memory and can answer.
    pub fn loaded(&self) -> Option<&Loaded> {
        match &self.state {
            State::Ready(loaded) => Some(loaded),
            _ => None,
        }
    }

    /// Why it will not serve, where it was tried.
    pub fn failure(&self) -> Option<&Failure> {
        match &self.state {
            State::Failed(failure) => Some(failure),
            _ => None,
        }
    }

    /// Its last states, the oldest first.
    pub fn history(&self) -> Vec<StateChange> {
        self.history
            .iter()
            .map(|&(state, at)| StateChange { state, at: humantime::format_rfc3339_millis(at).to_string() })
            .collect()
    }
}

/// How long a version waits that failed so often in a row.
fn retry_pause(n_failures: u32) -> Duration {
    match n_failures {
        0 | 1 => Duration::ZERO,
        _ => MAX_RETRY_PAUSE.min(Duration::from_secs(1 << (n_failures - 1).min(10))),
    }
}

impl State {
    /// As callers know it.
    pub fn name(&self) -> VersionState {
        match self {
            Self::Discovered => VersionState::Discovered,
            Self::Trying(Stage::Verifying) => VersionState::Verifying,
            Self::Trying(Stage::Loading) => VersionState::Loading,
            Self::Trying(Stage::Warming) => VersionState::Warming,
            Self::Ready(_) => VersionState::Ready,
            Self::Quiescing(_) => VersionState::Quiescing,
            Self::Unloaded => VersionState::Unloaded,
            Self::Failed(_) => VersionState::Failed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_that_does_not_pass_is_tried_ever_more_rarely() {
        let fingerprint = Fingerprint(String::new());
        let mut version = Version::new(fingerprint.clone(), true);
        let mut fail_and_look = |fingerprint: &Fingerprint| {
            version.enter(State::Failed(Failure {
                may_pass: true,
                ..Failure::new(Stage::Loading, String::new())
            }));
            version.look("lab/1", fingerprint);
            version.state().name()
        };
        let states = [(); 3].map(|()| fail_and_look(&fingerprint));
        assert_eq!(states, [VersionState::Discovered, VersionState::Failed, VersionState::Failed]);
    }
}
