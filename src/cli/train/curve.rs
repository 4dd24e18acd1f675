//! How much more frames would help: the slope of the learning curve over the frames that are there.

use roomsight_recognition::model::{
    Candidate, HeldOut, Model, Sample, TrainError, TrainingStep, Unit, answer_held_out,
};
use serde::Serialize;
use std::collections::BTreeMap;

/// Fewer frames in all tell no slope.
const LEAST_FRAMES: usize = 40;

/// Where the share of wrong answers falls by less than this power of the number of frames, more of the same hardly help.
const LEAST_SLOPE: f64 = 0.1;

/// More than so many times the frames that are there is no advice.
const MOST_TIMES: f64 = 10.0;

/// Held-out rates with half of the frames, and with all, on the same frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct LearningCurve {
    /// Of models trained on every other frame of each room and drive.
    pub rate_of_half: f64,
    /// Of models trained on all.
    pub rate_of_all: f64,
}

impl LearningCurve {
    /// Trains on half of the frames beside, and compares. `None` where there are too few frames to tell.
    ///
    /// # Errors
    /// What cannot be trained on half of the frames.
    pub(super) fn measure(
        samples: &[Sample],
        model: &Model,
        held_out: &[HeldOut],
        progress: impl FnMut(TrainingStep),
    ) -> Result<Option<Self>, TrainError> {
        let mut n_of_drive: BTreeMap<(&str, &str), usize> = BTreeMap::new();
        let is_in_half = |idx: &usize| {
            let n_before = n_of_drive.entry((&samples[*idx].room, &samples[*idx].sequence)).or_default();
            *n_before += 1;
            *n_before % 2 == 1
        };
        let of_rooms = (0..samples.len()).filter(|&idx| !samples[idx].is_elsewhere());
        let half: Vec<usize> = of_rooms.filter(is_in_half).collect();
        if 2 * half.len() < LEAST_FRAMES {
            return Ok(None);
        }
        let candidate = Candidate { name: String::new(), config: model.config().clone() };
        let of_half: Vec<&Sample> = half.iter().map(|&idx| &samples[idx]).collect();
        let answers = answer_held_out(&of_half, &[candidate], Unit::Drives, progress)?;
        let answered_by_all: BTreeMap<usize, usize> =
            held_out.iter().map(|answer| (answer.sample_idx, answer.recognition.room_idx)).collect();
        let pairs: Vec<[bool; 2]> = answers
            .held_out
            .iter()
            .filter_map(|answer| {
                let sample_idx = half[answer.sample_idx];
                let room = &samples[sample_idx].room;
                let by_all = &model.rooms()[*answered_by_all.get(&sample_idx)?];
                Some([answers.rooms[answer.recognition.room_idx] == *room, by_all == room])
            })
            .collect();
        let rate =
            |which: usize| pairs.iter().filter(|pair| pair[which]).count() as f64 / pairs.len().max(1) as f64;
        Ok((!pairs.is_empty()).then(|| Self { rate_of_half: rate(0), rate_of_all: rate(1) }))
    }

    /// By which power of the number of frames the share of wrong answers falls (Hestness et al., "Deep Learning Scaling is
    /// Predictable, Empirically", 2017, find such laws for many tasks).
    fn slope(&self) -> f64 {
        ((1.0 - self.rate_of_half).max(1e-3) / (1.0 - self.rate_of_all).max(1e-3)).log2()
    }

    /// Whether more frames like those that are there make it better.
    pub(super) fn is_rising(&self) -> bool {
        self.slope() >= LEAST_SLOPE
    }

    /// How many frames more a room needs, which is answered at `rate` with `n_frames`, until it is at `wanted`. `None` where it
    /// is not foreseen.
    pub(super) fn n_more(&self, n_frames: usize, rate: f64, wanted: f64) -> Option<usize> {
        let times = ((1.0 - rate) / (1.0 - wanted)).powf(1.0 / self.slope());
        let is_foreseen = self.is_rising() && (1.0..=MOST_TIMES).contains(&times);
        is_foreseen.then(|| (n_frames as f64 * (times - 1.0)).ceil() as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fell_with_twice_the_frames_falls_on() {
        // Half as many errors with twice as many frames: an error in four becomes one in eight with as many again.
        let curve = LearningCurve { rate_of_half: 0.6, rate_of_all: 0.8 };
        assert_eq!(curve.n_more(30, 0.75, 0.875), Some(30));
        assert_eq!(curve.n_more(30, 0.6, 0.8), Some(30));
        assert!(curve.is_rising() && curve.n_more(30, 0.0, 0.99).is_none(), "too far");
        let flat = LearningCurve { rate_of_half: 0.8, rate_of_all: 0.8 };
        assert!(!flat.is_rising() && flat.n_more(30, 0.75, 0.8).is_none());
        let perfect = LearningCurve { rate_of_half: 1.0, rate_of_all: 1.0 };
        assert!(!perfect.is_rising());
    }
}
