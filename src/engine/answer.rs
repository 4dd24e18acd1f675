//! What callers read of what was seen in a frame.

use super::recognize::{Reasons, Seen};
use super::told::{by_probability, unknown};
use crate::problem::Problem;
use roomsight_protocol::rest::{
    Answer, BatchResult, FramePose, KeypointEvidence, ModelName, NearestFrame, RecognizeQuery, TimingsMs,
};
use roomsight_recognition::model::{Evidence, NearFrame, Pose, PoseEstimate};

/// What a caller reads of what was seen.
pub fn answer(seen: Seen, query: &RecognizeQuery, request_id: &str) -> Answer {
    let served = &seen.served;
    let rooms = served.model.rooms();
    let recognition = &seen.recognition;
    let Why { evidence, nearest, pose } = seen.why.map_or_else(Why::default, |why| Why::of(why, rooms));
    Answer {
        room: rooms[recognition.room_idx].clone(),
        known: recognition.known,
        unknown: recognition.unknown.map(unknown),
        novelty: recognition.novelty,
        probability: recognition.probabilities[recognition.room_idx],
        probabilities: by_probability(rooms, &recognition.probabilities, query.top),
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
    fn of(Reasons { evidence, nearest, pose }: Reasons, rooms: &[String]) -> Self {
        let near = |NearFrame { opinion, name, drive, room_idx, nearness, points, .. }: NearFrame| {
            NearestFrame { opinion, frame: name, drive, room: rooms[room_idx].clone(), nearness, points }
        };
        let posed = |PoseEstimate { pose: Pose { x, y, angle }, radius }| FramePose { x, y, angle, radius };
        Self {
            evidence: Some(evidence.into_iter().map(keypoint_evidence).collect()),
            nearest: Some(nearest.into_iter().map(near).collect()),
            pose: pose.map(posed),
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

fn keypoint_evidence(Evidence { opinion, x, y, word_idx, frame, weight }: Evidence) -> KeypointEvidence {
    KeypointEvidence { opinion, x, y, word: word_idx, frame, weight }
}
