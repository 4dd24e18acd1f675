//! Why frames have no held-out answer, so that a rate of some of them can be trusted.

use roomsight_recognition::model::{HeldOut, Sample, Seen};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Frames without a held-out answer, for one reason.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub(super) struct NotHeldOut {
    /// Why, and what to do.
    pub reason: &'static str,
    /// At least 1.
    pub n_frames: usize,
    /// The rooms that they show, sorted.
    pub rooms: Vec<String>,
}

impl NotHeldOut {
    /// What `held_out` has no answer to. `is_addition` tells whether the samples were added to a trained model.
    pub(super) fn of(held_out: &[HeldOut], samples: &[Sample], is_addition: bool) -> Vec<Self> {
        let answered: BTreeSet<usize> = held_out.iter().map(|held_out| held_out.sample_idx).collect();
        let mut n_of_room: BTreeMap<&str, usize> = BTreeMap::new();
        for sample in samples {
            *n_of_room.entry(&sample.room).or_default() += 1;
        }
        let reason = |sample: &Sample| {
            if sample.features.seen.iter().all(Seen::is_nothing) {
                "without anything to recognize them by"
            } else if is_addition {
                "of rooms that were new to the model"
            } else if n_of_room[sample.room.as_str()] == 1 {
                "of rooms that no other frame shows: take more frames of them"
            } else {
                "held out together with all frames of every other room but one: take more frames of those"
            }
        };
        let mut by_reason: BTreeMap<&'static str, (usize, BTreeSet<&str>)> = BTreeMap::new();
        for (idx, sample) in samples.iter().enumerate() {
            if answered.contains(&idx) || sample.is_elsewhere() {
                continue;
            }
            let (n_frames, rooms) = by_reason.entry(reason(sample)).or_default();
            *n_frames += 1;
            rooms.insert(&sample.room);
        }
        let told = |(reason, (n_frames, rooms)): (_, (_, BTreeSet<&str>))| Self {
            reason,
            n_frames,
            rooms: rooms.into_iter().map(str::to_owned).collect(),
        };
        by_reason.into_iter().map(told).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use roomsight_recognition::model::{Features, LocalFeatures, Recognition};
    use roomsight_vision::detect::Keypoint;
    use roomsight_vision::matrix::Matrix;
    use std::sync::Arc;

    fn sample(room: &str, n_keypoints: usize) -> Sample {
        let keypoints = vec![Keypoint::new(0.0, 0.0, 1.0); n_keypoints];
        let descriptors = Matrix::zeros(n_keypoints, 1);
        let seen = Seen::Local(LocalFeatures { keypoints, descriptors, spots: Vec::new() });
        let features = Features { sights: Arc::default(), seen: vec![seen], scale: 1.0, flaw: None };
        Sample {
            room: room.to_owned(),
            sequence: String::new(),
            name: String::new(),
            pose: None,
            picture: None,
            features,
        }
    }

    fn answer(sample_idx: usize) -> HeldOut {
        let recognition = Recognition {
            room_idx: 0,
            known: true,
            novelty: None,
            unknown: None,
            probabilities: vec![1.0],
            n_keypoints: 1,
            is_early: false,
        };
        HeldOut { sample_idx, recognition }
    }

    #[test]
    fn each_frame_without_an_answer_is_counted_with_its_reason() {
        let samples = [sample("bath", 1), sample("hall", 0), sample("hall", 1), sample("hall", 1)];
        let told = NotHeldOut::of(&[answer(2)], &samples, false);
        let counts: Vec<usize> = told.iter().map(|told| told.n_frames).collect();
        assert_eq!(counts, [1, 1, 1], "{told:?}");
        assert!(told[0].reason.starts_with("held out together") && told[0].rooms == ["hall"], "{told:?}");
        assert!(told[1].reason.contains("no other frame shows") && told[1].rooms == ["bath"], "{told:?}");
        assert!(told[2].reason.starts_with("without anything") && told[2].rooms == ["hall"], "{told:?}");
        let added = NotHeldOut::of(&[answer(2)], &samples, true);
        assert!(
            added[0].reason.contains("new to the model") && added[0].rooms == ["bath", "hall"],
            "{added:?}"
        );
        assert_eq!(NotHeldOut::of(&[0, 1, 2, 3].map(answer), &samples, false), []);
    }
}
