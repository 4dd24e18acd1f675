//! What callers read of what happened: from the service's own types to those that travel.

use super::problem::{Kind, Problem};
use super::recognize::{Seen, Timings};
use super::registry::{Failure, STABLE, ServedModel, State, Versions};
use crate::model::Evidence;
use crate::protocol::rest::{
    Answer, BatchResult, FailureInfo, KeypointEvidence, KindInfo, ModelInfo, ModelName, RecognizeQuery,
    RoomProbability, TimingsMs, VersionInfo, VersionState,
};
use std::sync::Arc;
use std::time::Duration;

/// How many hexadecimal digits of a model's digest an answer carries.
const DIGEST_PREFIX: usize = 16;

impl Answer {
    /// What a caller reads of what was seen.
    pub fn new(seen: Seen, query: &RecognizeQuery, request_id: &str) -> Self {
        let served = &seen.served;
        let places = served.model.places();
        let recognition = &seen.recognition;
        Self {
            room: places[recognition.place_idx].clone(),
            known: recognition.known,
            probability: recognition.probabilities[recognition.place_idx],
            probabilities: rooms(places, &recognition.probabilities, query.top),
            model: ModelName::from(&**served),
            keypoints: recognition.n_keypoints,
            timings_ms: TimingsMs::from(seen.timings),
            request_id: request_id.to_owned(),
            robot: query.robot.clone(),
            captured_at: query.captured_at.clone(),
            evidence: seen.evidence.map(|all| all.into_iter().map(KeypointEvidence::from).collect()),
        }
    }
}

/// The `top` most probable rooms, or all, the most probable first.
pub fn rooms(places: &[String], probabilities: &[f32], top: Option<usize>) -> Vec<RoomProbability> {
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|&a, &b| probabilities[b].total_cmp(&probabilities[a]));
    order.truncate(top.unwrap_or(usize::MAX));
    let room = |idx: usize| RoomProbability { room: places[idx].clone(), probability: probabilities[idx] };
    order.into_iter().map(room).collect()
}

impl From<&ServedModel> for ModelName {
    fn from(served: &ServedModel) -> Self {
        Self {
            name: served.name.clone(),
            version: served.version,
            epoch: served.epoch,
            digest: served.digest.chars().take(DIGEST_PREFIX).collect(),
        }
    }
}

impl BatchResult {
    /// What a caller reads of one frame of a batch.
    pub fn new(result: Result<Answer, Problem>, request_id: &str) -> Self {
        result.map_or_else(|problem| Self::Error(problem.body(request_id)), Self::Answer)
    }
}

impl From<Kind> for KindInfo {
    fn from(kind: Kind) -> Self {
        Self {
            r#type: kind.uri(),
            title: kind.title().to_owned(),
            status: kind.status().as_u16(),
            advice: kind.advice().to_owned(),
        }
    }
}

/// Milliseconds, to the microsecond.
pub fn ms(duration: Duration) -> f64 {
    (duration.as_secs_f64() * 1e6).round() / 1e3
}

impl From<Timings> for TimingsMs {
    fn from(timings: Timings) -> Self {
        Self {
            queue: ms(timings.queue),
            decode: ms(timings.decode),
            features: ms(timings.features),
            classify: ms(timings.classify),
        }
    }
}

impl From<Evidence> for KeypointEvidence {
    fn from(evidence: Evidence) -> Self {
        Self { x: evidence.x, y: evidence.y, word: evidence.word_idx, weight: evidence.weight }
    }
}

impl ModelInfo {
    /// What a caller reads of one model.
    pub fn new(name: &str, versions: &Versions) -> Self {
        Self {
            name: name.to_owned(),
            serving: versions.serving.as_ref().map(|served| served.version),
            versions: versions
                .states
                .iter()
                .rev()
                .map(|(&number, state)| VersionInfo::new(number, state, versions))
                .collect(),
        }
    }
}

impl VersionInfo {
    /// What a caller reads of one version, its card left out.
    pub fn new(version: u64, state: &State, versions: &Versions) -> Self {
        let mut info = Self {
            version,
            state: VersionState::Discovered,
            labels: Vec::new(),
            failure: None,
            epoch: None,
            digest: None,
            rooms: None,
            card: None,
        };
        match state {
            State::Discovered(_) => {}
            State::Failed(failure) => {
                info.state = VersionState::Failed;
                info.failure = Some(FailureInfo::from(failure));
            }
            State::Ready(served) => {
                info.state = VersionState::Ready;
                if versions.serving.as_ref().is_some_and(|serving| Arc::ptr_eq(serving, served)) {
                    info.labels = vec![STABLE.to_owned()];
                }
                info.epoch = Some(served.epoch);
                info.digest = Some(served.digest.clone());
                info.rooms = Some(served.model.places().to_vec());
            }
        }
        info
    }

    /// The same with the model's card.
    pub fn with_card(version: u64, state: &State, versions: &Versions) -> Self {
        let card = match state {
            State::Ready(served) => serde_json::to_value(served.model.card()).ok(),
            State::Discovered(_) | State::Failed(_) => None,
        };
        Self { card, ..Self::new(version, state, versions) }
    }
}

impl From<&Failure> for FailureInfo {
    fn from(failure: &Failure) -> Self {
        Self { stage: failure.stage.to_string(), reason: failure.reason.clone() }
    }
}
