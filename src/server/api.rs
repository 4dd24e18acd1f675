//! What callers read of what happened: from the service's own types to those that travel.

use super::problem::{Kind, Problem};
use super::recognize::{Reasons, Seen, Timings};
use super::registry::{
    CANARY, Entry, Failure, PREVIOUS, Registry, SHADOW, STABLE, ServedModel, Serving, Tally, Version,
};
use roomsight_protocol::rest::{
    Answer, BatchResult, FailureInfo, FramePose, KeypointEvidence, KindInfo, ModelInfo, ModelName,
    NearestFrame, NetworkInfo, RecognizeQuery, RoomProbability, ShadowInfo, TimingsMs, Unknown, VersionInfo,
};
use roomsight_recognition::model::{self, Evidence, Model, NearFrame, NetworkEntry, Pose, PoseEstimate};
use std::sync::Arc;
use std::time::Duration;

/// How many hexadecimal digits of a model's digest an answer carries.
const DIGEST_PREFIX: usize = 16;

/// What a caller reads of what was seen.
pub fn answer(seen: Seen, query: &RecognizeQuery, request_id: &str) -> Answer {
    let served = &seen.served;
    let places = served.model.places();
    let recognition = &seen.recognition;
    let Why { evidence, nearest, pose } = seen.why.map_or_else(Why::default, |why| Why::of(why, places));
    Answer {
        room: places[recognition.place_idx].clone(),
        known: recognition.known,
        unknown: recognition.unknown.map(unknown),
        novelty: recognition.novelty,
        probability: recognition.probabilities[recognition.place_idx],
        probabilities: rooms(places, &recognition.probabilities, query.top),
        model: ModelName::from(&**served),
        keypoints: recognition.n_keypoints,
        damaged_rows: seen.damaged_rows,
        timings_ms: TimingsMs::from(seen.timings),
        request_id: request_id.to_owned(),
        robot: query.robot.clone(),
        captured_at: query.captured_at.clone(),
        evidence,
        nearest,
        pose,
    }
}

/// The reasons of an answer, as they travel.
#[derive(Default)]
struct Why {
    evidence: Option<Vec<KeypointEvidence>>,
    nearest: Option<Vec<NearestFrame>>,
    pose: Option<FramePose>,
}

impl Why {
    fn of(Reasons { evidence, nearest, pose }: Reasons, places: &[String]) -> Self {
        let near = |NearFrame { opinion, name, drive, place_idx, nearness, points, .. }: NearFrame| {
            NearestFrame { opinion, frame: name, drive, room: places[place_idx].clone(), nearness, points }
        };
        let posed = |PoseEstimate { pose: Pose { x, y, angle }, radius }| FramePose { x, y, angle, radius };
        Self {
            evidence: Some(evidence.into_iter().map(keypoint_evidence).collect()),
            nearest: Some(nearest.into_iter().map(near).collect()),
            pose: pose.map(posed),
        }
    }
}

fn unknown(why: model::Unknown) -> Unknown {
    match why {
        model::Unknown::Unsure => Unknown::Unsure,
        model::Unknown::NewPlace => Unknown::NewPlace,
        model::Unknown::NoDetail => Unknown::NoDetail,
        model::Unknown::Dark => Unknown::Dark,
        model::Unknown::Covered => Unknown::Covered,
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

/// What a caller reads of one frame of a batch.
pub fn batch_result(result: Result<Answer, Problem>, request_id: &str) -> BatchResult {
    result.map_or_else(
        |problem| BatchResult::Error(problem.body(request_id)),
        |answer| BatchResult::Answer(Box::new(answer)),
    )
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

fn keypoint_evidence(Evidence { opinion, x, y, word_idx, frame, weight }: Evidence) -> KeypointEvidence {
    KeypointEvidence { opinion, x, y, word: word_idx, frame, weight }
}

/// What a caller reads of one model.
pub fn model_info(name: &str, entry: &Entry, registry: &Registry) -> ModelInfo {
    let serving = &registry.serving(name);
    let versions = entry.versions.iter().rev();
    ModelInfo {
        name: name.to_owned(),
        default: registry.default_name().as_deref() == Some(name),
        serving: serving.stable.as_ref().map(|served| served.version),
        epoch: entry.record.epoch,
        settled: entry.record.settled,
        versions: versions.map(|(&number, version)| version_info(number, version, serving)).collect(),
    }
}

/// What a caller reads of one version, its card left out.
pub fn version_info(number: u64, version: &Version, serving: &Serving) -> VersionInfo {
    let is_this = |served: &&Arc<ServedModel>| served.version == number;
    let canary = serving.canary.as_ref().filter(|(served, _)| is_this(&served));
    let shadow = serving.shadow.as_ref().filter(|shadow| is_this(&&shadow.served));
    let labels = [
        (STABLE, serving.stable.as_ref().is_some_and(|served| is_this(&served))),
        (CANARY, canary.is_some()),
        (SHADOW, shadow.is_some()),
        (PREVIOUS, serving.previous.as_ref().is_some_and(|served| is_this(&served))),
    ];
    let loaded = version.loaded();
    VersionInfo {
        version: number,
        state: version.state().name(),
        labels: labels.into_iter().filter(|(_, is_its)| *is_its).map(|(label, _)| label.to_owned()).collect(),
        failure: version.failure().map(FailureInfo::from),
        epoch: serving.answering().find(is_this).map(|served| served.epoch),
        share: canary.map(|(_, share)| *share),
        shadow: shadow.map(|shadow| ShadowInfo::from(shadow.tally())),
        digest: loaded.map(|loaded| loaded.digest.clone()),
        rooms: loaded.map(|loaded| loaded.model.places().to_vec()),
        networks: loaded.map_or_else(Vec::new, |loaded| network_infos(&loaded.model)),
        card: None,
        history: version.history(),
    }
}

/// The same with the model's card.
pub fn version_info_with_card(number: u64, version: &Version, serving: &Serving) -> VersionInfo {
    let card = version.loaded().and_then(|loaded| serde_json::to_value(loaded.model.card()).ok());
    VersionInfo { card, ..version_info(number, version, serving) }
}

/// Those that a model looks through.
pub fn network_infos(model: &Model) -> Vec<NetworkInfo> {
    let info = |NetworkEntry { name, blake3, n_bytes, .. }: NetworkEntry| NetworkInfo {
        name,
        blake3: blake3.into(),
        bytes: n_bytes,
    };
    model.network_entries().into_iter().map(info).collect()
}

impl From<Tally> for ShadowInfo {
    fn from(tally: Tally) -> Self {
        let Tally { n_compared, n_agreed, n_skipped, total_distance } = tally;
        let mean_distance = (n_compared > 0).then(|| total_distance / n_compared as f64);
        Self { compared: n_compared, agreed: n_agreed, skipped: n_skipped, mean_distance }
    }
}

impl From<&Failure> for FailureInfo {
    fn from(failure: &Failure) -> Self {
        Self { stage: failure.stage.to_string(), reason: failure.reason.clone() }
    }
}
