//! How opinions agree: their probabilities multiplied, each to the power of a weight, and how the weights are
//! fitted.

use crate::opinions::logit;
use crate::opinions::logit::{Case, Prior, softmax};

/// How far a fitted weight typically lies from what is taken for it where nothing is known. With a few held-out frames
/// weights stay near the prior ones; hundreds outvote them.
const PRIOR_SPREAD: f64 = 0.3;

/// Rounds of expectation maximization.
const MAX_STEPS: usize = 50;

/// What an opinion says of a frame.
#[derive(Clone, Debug)]
struct Vote {
    /// How much it counts.
    weight: f64,
    /// One a room.
    probabilities: Vec<f32>,
}

/// One probability a room from those of each opinion that saw something, nothing without any: their product, each
/// to the power of its weight, over the sum of the rooms (the logarithmic opinion pool; Genest and Zidek,
/// "Combining Probability Distributions: A Critique and an Annotated Bibliography", Statistical Science 1986).
/// So who is sure counts more than who is not, as in Pronobis and Caputo, "Confidence-based Cue Integration for
/// Visual Place Recognition", IROS 2007. A single opinion is the answer as it is.
fn pooled(votes: impl Iterator<Item = Vote>) -> Vec<f32> {
    let mut votes = votes.filter(|vote| vote.weight > 0.0).peekable();
    let Some(Vote { weight, probabilities: first }) = votes.next() else { return Vec::new() };
    if votes.peek().is_none() {
        return first;
    }
    let mut sums: Vec<f64> = logs(&first).map(|log| weight * log).collect();
    for Vote { weight, probabilities } in votes {
        sums.iter_mut().zip(logs(&probabilities)).for_each(|(sum, log)| *sum += weight * log);
    }
    softmax(&sums).into_iter().map(|probability| probability as f32).collect()
}

/// From minus infinity: a certain no is not the last word.
fn logs(probabilities: &[f32]) -> impl Iterator<Item = f64> {
    probabilities.iter().map(|p| f64::from(p.max(f32::MIN_POSITIVE)).ln())
}

/// The same probabilities where one in so many frames shows what was never seen, of which each room is as probable.
fn doubted(mut probabilities: Vec<f32>, doubt: f64) -> Vec<f32> {
    if doubt > 0.0 {
        let share = doubt / probabilities.len().max(1) as f64;
        probabilities.iter_mut().for_each(|p| *p = ((1.0 - doubt) * f64::from(*p) + share) as f32);
    }
    probabilities
}

/// What opinions say together: one probability a room from those of each that saw something and its weight, `doubt` of
/// it shared among all rooms. No room is more probable than another where none saw anything that counts.
pub(crate) fn answer(
    by_opinion: &[Option<Vec<f32>>],
    weights: &[f64],
    doubt: f64,
    n_rooms: usize,
) -> Vec<f32> {
    let votes = by_opinion.iter().zip(weights);
    let votes = votes
        .filter_map(|(probabilities, &weight)| Some(Vote { weight, probabilities: probabilities.clone()? }));
    let probabilities = doubted(pooled(votes), doubt);
    if probabilities.is_empty() { vec![1.0 / n_rooms as f32; n_rooms] } else { probabilities }
}

/// The share of frames that show what was never seen: that under which the rooms that frames show are most probable, by
/// expectation maximization, as if two more frames had been seen, one of each kind. Without it opinions that are sure
/// of every frame would stay so, however often they are wrong.
pub(crate) fn fit_doubt(frames: &[Judged], weights: &[f64], n_rooms: usize) -> f64 {
    if frames.is_empty() {
        return 0.0;
    }
    let of_label = |frame: &Judged| f64::from(answer(&frame.by_opinion, weights, 0.0, n_rooms)[frame.label]);
    let of_labels: Vec<f64> = frames.iter().map(of_label).collect();
    let mut doubt = 0.5;
    for _ in 0..MAX_STEPS {
        let unseen = doubt / n_rooms as f64;
        let n_unseen: f64 = of_labels.iter().map(|p| unseen / (unseen + (1.0 - doubt) * p)).sum();
        doubt = (n_unseen + 1.0) / (frames.len() as f64 + 2.0);
    }
    doubt
}

/// A held-out frame, as opinions see it.
#[derive(Clone, Debug)]
pub(crate) struct Judged {
    /// The room that it shows.
    pub(crate) label: usize,
    /// One probability a room by each opinion that saw something.
    pub(crate) by_opinion: Vec<Option<Vec<f32>>>,
}

/// The weights under which the rooms that frames show were most probable, held near `prior`; see [`logit::fit`]. Without
/// frames they are the prior ones.
pub(crate) fn fit_weights(frames: &[Judged], prior: &[f64]) -> Vec<f64> {
    let case = |judged: &Judged| Case {
        label: judged.label,
        weight: 1.0,
        by_part: judged.by_opinion.iter().map(|p| p.as_deref().map(|p| logs(p).collect())).collect(),
    };
    let prior: Vec<Prior> = prior.iter().map(|&mean| Prior { mean, spread: PRIOR_SPREAD }).collect();
    logit::fit(&frames.iter().map(case).collect::<Vec<_>>(), &prior)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn pool(votes: &[(f64, &[f32])]) -> Vec<f32> {
        let vote =
            |&(weight, probabilities): &(f64, &[f32])| Vote { weight, probabilities: probabilities.to_vec() };
        pooled(votes.iter().map(vote))
    }

    #[test]
    fn a_single_opinion_is_the_answer() {
        assert_eq!(pool(&[(1.0, &[0.1, 0.9])]), [0.1, 0.9]);
    }

    #[test]
    fn the_surer_opinion_wins() {
        let answer = pool(&[(0.5, &[0.4, 0.3, 0.3]), (0.5, &[0.05, 0.9, 0.05])]);
        assert!(answer[1] > answer[0] && (answer.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{answer:?}");
        let product = [0.4_f64 * 0.05, 0.3 * 0.9, 0.3 * 0.05].map(f64::sqrt);
        assert!((f64::from(answer[1]) - product[1] / product.iter().sum::<f64>()).abs() < 1e-6);
        let unheard = pool(&[(1.0, &[0.6, 0.3, 0.1]), (0.0, &[0.0, 0.0, 1.0])]);
        assert_eq!(unheard, [0.6, 0.3, 0.1]);
        assert!(pool(&[(0.0, &[0.6, 0.4])]).is_empty());
        assert!(pool(&[(0.5, &[1.0, 0.0, 0.0]), (0.5, &[0.0, 1.0, 0.0])]).iter().all(|p| p.is_finite()));
    }

    /// Frames of three rooms: one opinion is right three times of four, one guesses, one is often absent.
    fn frames(n: usize) -> Vec<Judged> {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut judged = |_| {
            let label = random.random_range(0..3);
            let sure_of = |room: usize| {
                let mut probabilities = vec![0.15_f32; 3];
                probabilities[room] = 0.7;
                probabilities
            };
            let right = if random.random_bool(0.75) { label } else { (label + 1) % 3 };
            let good = Some(sure_of(right));
            let guess = Some(sure_of(random.random_range(0..3)));
            let rare = random.random_bool(0.3).then(|| sure_of(label));
            Judged { label, by_opinion: vec![good, guess, rare] }
        };
        (0..n).map(&mut judged).collect()
    }

    #[test]
    fn who_is_right_counts_and_who_guesses_does_not() {
        let weights = fit_weights(&frames(400), &[0.4, 0.4, 0.4]);
        assert!(weights[0] > 0.8 && weights[1] < 0.15 && weights[2] > 0.8, "{weights:?}");
    }

    #[test]
    fn who_is_often_wrong_is_doubted() {
        let sure = |label| Judged { label, by_opinion: vec![Some(vec![0.998, 0.001, 0.001])] };
        let frames: Vec<Judged> = (0..300).map(|idx| sure(idx % 3)).collect();
        let doubt = fit_doubt(&frames, &[1.0], 3);
        let doubted = doubted(vec![0.998, 0.001, 0.001], doubt);
        assert!((doubted[0] - 1.0 / 3.0).abs() < 0.05 && (doubted.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        let right: Vec<Judged> = (0..300).map(|_| sure(0)).collect();
        assert!(fit_doubt(&right, &[1.0], 3) < 0.01);
        assert_eq!(fit_doubt(&[], &[1.0], 3), 0.0);
    }

    #[test]
    fn few_frames_leave_the_prior_and_none_are_it() {
        let prior = [0.4, 0.5, 0.6];
        assert_eq!(fit_weights(&[], &prior), prior);
        let few = fit_weights(&frames(3), &prior);
        assert!(few.iter().zip(prior).all(|(weight, prior)| (weight - prior).abs() < 0.3), "{few:?}");
    }
}
