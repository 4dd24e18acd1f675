//! How frames were decided by machines that were not trained on them: what probabilities rest on.

use super::arrays::{self, Array, require};
use super::format::FormatError;
use super::{CalibrationConfig, Sigmoids, TrainError};
use crate::matrix::Matrix;
use crate::svm::{Calibration, Scheme, most_probable};
use safetensors::SafeTensors;

/// The most frames that a model file keeps: a few hundred KiB for a dozen rooms.
const MAX_KEPT: usize = 4096;

/// Decision values of frames, and the rooms that these show.
#[derive(Clone, Debug)]
pub(super) struct HeldOutDecisions {
    /// One row a frame, one column a machine.
    values: Matrix,
    labels: Vec<usize>,
}

impl HeldOutDecisions {
    /// None yet, of so many machines.
    pub(super) fn new(n_machines: usize) -> Self {
        Self { values: Matrix::new(n_machines), labels: Vec::new() }
    }

    /// Adds a frame that shows the room `label`.
    pub(super) fn push(&mut self, values: &[f32], label: usize) {
        self.values.push_row(values);
        self.labels.push(label);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// The decision values and the room of each frame.
    fn frames(&self) -> impl Iterator<Item = (&[f32], usize)> {
        self.values.rows().zip(self.labels.iter().copied())
    }

    /// Fits the sigmoids.
    pub(super) fn calibration(
        &self,
        scheme: Scheme,
        n_places: usize,
        sigmoids: Sigmoids,
    ) -> Result<Calibration, TrainError> {
        if self.is_empty() {
            return Err(TrainError::NothingHeldOut);
        }
        let fit = match sigmoids {
            Sigmoids::PerMachine => Calibration::fit,
            Sigmoids::Shared => Calibration::fit_shared,
        };
        Ok(fit(scheme, &self.values, &self.labels, n_places)?)
    }

    /// The lowest probability from which on answers were right often enough, if there is one.
    pub(super) fn known_probability(
        &self,
        calibration: &Calibration,
        config: &CalibrationConfig,
    ) -> Option<f32> {
        let answer = |(values, label)| {
            let probabilities = calibration.probabilities(values);
            let place_idx = most_probable(&probabilities);
            (probabilities[place_idx], place_idx == label)
        };
        known_probability(self.frames().map(answer).collect(), config)
    }

    /// The same among `n_places` rooms, where room i of before is the room `of_earlier[i]` (ascending).
    pub(super) fn renumbered(&self, scheme: Scheme, of_earlier: &[usize], n_places: usize) -> Self {
        let mut renumbered = Self::new(scheme.n_machines(n_places));
        for (values, label) in self.frames() {
            renumbered.push(&spread_out(scheme, of_earlier, n_places, values), of_earlier[label]);
        }
        renumbered
    }

    /// At most [`MAX_KEPT`] of the frames. Every other one goes as often as needed, so that all drives are
    /// still heard, earlier ones with fewer frames.
    pub(super) fn thinned(mut self) -> Self {
        while self.labels.len() > MAX_KEPT {
            let mut half = Self::new(self.values.n_cols());
            self.frames().step_by(2).for_each(|(values, label)| half.push(values, label));
            self = half;
        }
        self
    }

    pub(super) fn to_arrays(&self) -> [Array; 2] {
        let labels = Array::counts("held_out.labels", self.labels.iter().copied());
        [Array::matrix("held_out.values", &self.values), labels]
    }

    /// `None` where the file holds none; else frames of unknown origin that fit so many machines and rooms.
    pub(super) fn from_arrays(
        (n_machines, n_places): (usize, usize),
        file: &SafeTensors,
    ) -> Result<Option<Self>, FormatError> {
        if !arrays::is_there(file, "held_out.values") {
            return Ok(None);
        }
        let values = arrays::read_matrix(file, "held_out.values")?;
        let labels = arrays::read_counts(file, "held_out.labels")?;
        require(values.n_cols() == n_machines, "its held-out frames are of other machines")?;
        require(
            values.n_rows() == labels.len(),
            "its held-out frames have other numbers of frames and rooms",
        )?;
        require(
            values.as_slice().iter().all(|value| value.is_finite()),
            "its held-out frames are not finite",
        )?;
        require(labels.iter().all(|&label| label < n_places), "its held-out frames are of no room")?;
        Ok(Some(Self { values, labels }))
    }
}

/// The lowest probability from which on answers were right often enough, if there is one. Answers are given by
/// their probability and whether they were right; those of equal probability count together.
pub(super) fn known_probability(mut answers: Vec<(f32, bool)>, config: &CalibrationConfig) -> Option<f32> {
    answers.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut n_answers, mut n_correct) = (0, 0);
    let mut lowest = None;
    for equal in answers.chunk_by(|a, b| a.0 == b.0) {
        n_answers += equal.len();
        n_correct += equal.iter().filter(|(_, correct)| *correct).count();
        if n_correct as f32 >= config.known_precision * n_answers as f32 {
            lowest = Some(equal[0].0);
        }
    }
    lowest
}

/// Decision values among the classes `present` (ascending), as they are among all. The machine of a class that
/// was not trained says a clear no (-1); a machine for a pair with such a class is undecided (0).
pub(super) fn spread_out(scheme: Scheme, present: &[usize], n_classes: usize, values: &[f32]) -> Vec<f32> {
    let trained = |class: usize| present.binary_search(&class).ok();
    match scheme {
        Scheme::OneVsAll => {
            (0..n_classes).map(|class| trained(class).map_or(-1.0, |machine| values[machine])).collect()
        }
        Scheme::OneVsOne => {
            let n_present = present.len();
            let machine = |a: usize, b: usize| a * (2 * n_present - a - 1) / 2 + b - a - 1;
            (0..n_classes)
                .flat_map(|a| (a + 1..n_classes).map(move |b| (a, b)))
                .map(|(a, b)| match (trained(a), trained(b)) {
                    (Some(a), Some(b)) => values[machine(a, b)],
                    _ => 0.0,
                })
                .collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equally_probable_answers_are_known_together_or_not_at_all() {
        let least = |known_precision, answers: &[(f32, bool)]| {
            let config = CalibrationConfig { known_precision, ..CalibrationConfig::default() };
            known_probability(answers.to_vec(), &config)
        };
        assert_eq!(least(0.9, &[(0.9, true), (0.9, false), (0.9, false)]), None);
        assert_eq!(least(0.9, &[(0.5, false), (0.9, true), (0.8, true), (0.8, true)]), Some(0.8));
        assert_eq!(least(0.6, &[(0.8, true), (0.7, true), (0.7, false), (0.7, false)]), Some(0.8));
        assert_eq!(least(0.9, &[(1.0, false)]), None);
        assert_eq!(least(0.9, &[]), None);
    }

    #[test]
    fn thinning_keeps_frames_of_the_whole_time() {
        let mut held_out = HeldOutDecisions::new(2);
        (0..10_000).for_each(|idx| held_out.push(&[idx as f32, 0.0], idx % 3));
        let kept = held_out.thinned();
        let times: Vec<f32> = kept.frames().map(|(values, _)| values[0]).collect();
        assert_eq!(times.len(), 2500);
        assert!(times.windows(2).all(|pair| pair[1] - pair[0] == 4.0));
        assert!(kept.frames().all(|(values, label)| values[0] as usize % 3 == label));
        assert_eq!(kept.thinned().labels.len(), 2500);
    }

    #[test]
    fn a_new_class_leaves_the_others_their_machines() {
        assert_eq!(spread_out(Scheme::OneVsAll, &[0, 2], 3, &[0.5, 0.7]), [0.5, -1.0, 0.7]);
        let among_three = spread_out(Scheme::OneVsOne, &[0, 1, 3], 4, &[0.1, 0.2, 0.3]);
        assert_eq!(among_three, [0.1, 0.0, 0.2, 0.0, 0.3, 0.0], "01 02 03 12 13 23");
    }
}
