//! What the word "known" is worth: how often known answers are right, how many right answers are known, and whether places that were
//! never trained are called unknown.

use super::Rate;
use serde::Serialize;

/// Bins of probability, of the expected calibration error.
pub const N_BINS: usize = 15;

/// One answer, as far as trust in it is concerned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trusted {
    /// The probability of the answered room.
    pub probability: f32,
    /// Whether it is known.
    pub known: bool,
    /// How probable a new place is, of models that can tell.
    pub novelty: Option<f32>,
    /// Whether the answer is right.
    pub is_right: bool,
    /// Whether the frame shows a room that the model was not trained on.
    pub is_new: bool,
}

/// What the word "known" is worth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Knowledge {
    /// Known answers, and those of them that are right. Frames of rooms that were never trained are not among them.
    pub known: Rate,
    /// Right answers, and those of them that are known.
    pub right_known: Rate,
    /// Frames of rooms that were never trained, and those of them that are unknown.
    pub new_unknown: Rate,
    /// How probable it is that a frame of a room that was never trained has a higher novelty than one of a trained room
    /// (the area under the receiver operating characteristic); none where there are no frames of both.
    pub auroc: Option<f64>,
    /// The expected calibration error over [`N_BINS`] bins of equal width (Naeini, Cooper and Hauskrecht, "Obtaining
    /// Well Calibrated Probabilities Using Bayesian Binning", AAAI 2015), of frames of trained rooms.
    pub calibration_error: Option<f64>,
    /// The reliability diagram behind it: the bins that have answers.
    pub reliability: Vec<Bin>,
}

/// Answers of about the same probability.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// The mean of their probabilities.
    pub probability: f64,
    /// How many are right.
    pub rate: Rate,
}

impl Knowledge {
    /// Counts answers.
    pub fn new(answers: &[Trusted]) -> Self {
        let trained = || answers.iter().filter(|answer| !answer.is_new);
        let new = || answers.iter().filter(|answer| answer.is_new);
        let right = || trained().filter(|answer| answer.is_right);
        let known = || trained().filter(|answer| answer.known);
        let reliability = reliability(trained());
        let n_trained = trained().count();
        let error = |bin: &Bin| {
            bin.rate.n_frames as f64 / n_trained as f64
                * (bin.rate.rate.unwrap_or_default() - bin.probability).abs()
        };
        Self {
            known: Rate::new(known().filter(|answer| answer.is_right).count(), known().count()),
            right_known: Rate::new(right().filter(|answer| answer.known).count(), right().count()),
            new_unknown: Rate::new(new().filter(|answer| !answer.known).count(), new().count()),
            auroc: auroc(
                &new().filter_map(|answer| answer.novelty).collect::<Vec<_>>(),
                &trained().filter_map(|answer| answer.novelty).collect::<Vec<_>>(),
            ),
            calibration_error: (n_trained > 0).then(|| reliability.iter().map(error).sum()),
            reliability,
        }
    }
}

fn reliability<'a>(answers: impl Iterator<Item = &'a Trusted>) -> Vec<Bin> {
    let mut bins = [(0.0, 0, 0); N_BINS];
    for answer in answers {
        let bin = (answer.probability * N_BINS as f32) as usize;
        let (sum, n_right, n) = &mut bins[bin.min(N_BINS - 1)];
        *sum += f64::from(answer.probability);
        *n_right += usize::from(answer.is_right);
        *n += 1;
    }
    let bin = |(sum, n_right, n): (f64, usize, usize)| Bin {
        probability: sum / n as f64,
        rate: Rate::new(n_right, n),
    };
    bins.into_iter().filter(|(_, _, n)| *n > 0).map(bin).collect()
}

/// The probability that one of `positive` is larger than one of `negative`, ties counting half.
fn auroc(positive: &[f32], negative: &[f32]) -> Option<f64> {
    if positive.is_empty() || negative.is_empty() {
        return None;
    }
    let mut sorted = negative.to_vec();
    sorted.sort_by(f32::total_cmp);
    let smaller = |value: &f32| {
        let below = sorted.partition_point(|other| other < value);
        let not_above = sorted.partition_point(|other| other <= value);
        (below + not_above) as f64 / 2.0
    };
    Some(positive.iter().map(smaller).sum::<f64>() / (positive.len() * negative.len()) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_right_and_new_answers_are_counted() {
        let answer = |probability, known, novelty, is_right, is_new| Trusted {
            probability,
            known,
            novelty: Some(novelty),
            is_right,
            is_new,
        };
        let knowledge = Knowledge::new(&[
            answer(0.9, true, 0.1, true, false),
            answer(0.9, true, 0.2, false, false),
            answer(0.5, false, 0.4, true, false),
            answer(0.9, false, 0.9, false, true),
            answer(0.9, true, 0.2, false, true),
        ]);
        assert_eq!(knowledge.known, Rate::new(1, 2));
        assert_eq!(knowledge.right_known, Rate::new(1, 2));
        assert_eq!(knowledge.new_unknown, Rate::new(1, 2));
        // Of six pairs, 0.9 beats three, 0.2 beats one and ties with one.
        assert_eq!(knowledge.auroc, Some(4.5 / 6.0));
        let error = 2.0 / 3.0 * (0.9 - 0.5) + 1.0 / 3.0 * (1.0 - 0.5);
        assert!((knowledge.calibration_error.unwrap() - error).abs() < 1e-6);
        assert_eq!(knowledge.reliability.len(), 2);
    }

    #[test]
    fn without_frames_nothing_is_said() {
        let nothing = Knowledge::new(&[]);
        assert_eq!((nothing.auroc, nothing.calibration_error), (None, None));
        assert_eq!(nothing.known, Rate::new(0, 0));
    }
}
