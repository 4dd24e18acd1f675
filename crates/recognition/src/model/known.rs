//! Which answers a robot may act on: thresholds on probability and novelty that keep a promise.

use crate::opinions::calibration::CalibrationConfig;
use std::collections::BTreeMap;

/// How often a frame shows a place that was never trained, as far as the promise is concerned.
const SHARE_NEW: f64 = 0.05;

/// Answers that a threshold is judged by beside those that were held out, so that one or two that happened to be right
/// promise nothing.
const N_ASSUMED: f64 = 5.0;

/// These were right as often as the probabilities of the others say, and at least so often, since the probabilities of small models
/// are cautious; but no oftener than is promised.
const ASSUMED_RATE: f64 = 0.9;

/// Thresholds of novelty that are tried.
pub(crate) const NOVELTIES: [f32; 12] = [1.0, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05];

/// An answer to a frame that was held out, or whose room was.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    pub(crate) probability: f32,
    /// From 0 to 1.
    pub(crate) novelty: f32,
    /// Never where the room was left out.
    pub(crate) is_right: bool,
}

/// Answers to frames that were held out, and to those whose rooms were, by numbers that tell frames from each other.
#[derive(Clone, Debug)]
pub(crate) struct Outcomes {
    pub(crate) held_out: BTreeMap<usize, Outcome>,
    pub(crate) left_out: BTreeMap<usize, Outcome>,
    /// Which answers are known.
    pub(crate) known: Option<Known>,
}

impl Outcomes {
    /// With the thresholds that are chosen by them; see [`Known::choose`].
    pub(crate) fn new(
        [held_out, left_out]: [BTreeMap<usize, Outcome>; 2],
        config: &CalibrationConfig,
    ) -> Self {
        let all = [&held_out, &left_out].map(|outcomes| outcomes.values().copied().collect::<Vec<_>>());
        let known = Known::choose(&all[0], &all[1], config);
        Self { held_out, left_out, known }
    }
}

/// An answer is known that is at least this probable, to a frame that is at most this new.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Known {
    pub(crate) least_probability: f32,
    pub(crate) most_novelty: f32,
}

impl Known {
    /// Whether an answer is; a frame of which nothing is known how new it is is not new.
    pub(crate) fn holds(&self, probability: f32, novelty: Option<f32>) -> bool {
        probability >= self.least_probability && novelty.is_none_or(|novelty| novelty <= self.most_novelty)
    }

    /// The thresholds under which most right answers are known and most frames of new places are not, of those that keep the
    /// promise of `config`: of the known answers so many are right, where one frame in twenty is of a place that was never
    /// trained. Answers that are equally probable are known together. `None` where nothing keeps it.
    pub(crate) fn choose(
        held_out: &[Outcome],
        left_out: &[Outcome],
        config: &CalibrationConfig,
    ) -> Option<Self> {
        let of_new = weight_of_new(held_out.len(), left_out.len());
        let mut outcomes: Vec<(f64, Outcome)> = held_out.iter().map(|&outcome| (1.0, outcome)).collect();
        outcomes.extend(left_out.iter().map(|&outcome| (of_new, Outcome { is_right: false, ..outcome })));
        outcomes.sort_by(|(_, a), (_, b)| b.probability.total_cmp(&a.probability));
        let mut best: Option<(f64, Self)> = None;
        for most_novelty in NOVELTIES {
            let near: Vec<(f64, Outcome)> =
                outcomes.iter().copied().filter(|(_, outcome)| outcome.novelty <= most_novelty).collect();
            let Some(least_probability) = least_probability(&near, config) else { continue };
            let known = Self { least_probability, most_novelty };
            let share = |outcomes: &[Outcome], wanted: fn(&Outcome) -> bool| {
                let wanted = || outcomes.iter().filter(|outcome| wanted(outcome));
                wanted().filter(|outcome| known.holds(outcome.probability, Some(outcome.novelty))).count()
                    as f64
                    / wanted().count().max(1) as f64
            };
            let gain = share(held_out, |outcome| outcome.is_right) - share(left_out, |_| true);
            if best.as_ref().is_none_or(|(most, _)| gain >= *most) {
                best = Some((gain, known));
            }
        }
        best.map(|(_, known)| known)
    }
}

/// What a frame of a left-out room counts beside a held-out one of a trained room.
pub(crate) fn weight_of_new(n_held_out: usize, n_left_out: usize) -> f64 {
    SHARE_NEW / (1.0 - SHARE_NEW) * n_held_out as f64 / n_left_out.max(1) as f64
}

/// The lowest probability from which on answers, the most probable first, are right often enough.
fn least_probability(outcomes: &[(f64, Outcome)], config: &CalibrationConfig) -> Option<f32> {
    let promised = f64::from(config.known_precision);
    let (mut n_answers, mut n_right, mut sum) = (0.0, 0.0, 0.0);
    let mut lowest = None;
    for equal in outcomes.chunk_by(|(_, a), (_, b)| a.probability == b.probability) {
        for (weight, Outcome { probability, is_right, .. }) in equal {
            n_answers += weight;
            n_right += if *is_right { *weight } else { 0.0 };
            sum += weight * f64::from(*probability);
        }
        let assumed_rate = ASSUMED_RATE.max(sum / n_answers).min(promised);
        let share = (n_right + N_ASSUMED * assumed_rate) / (n_answers + N_ASSUMED);
        if n_right >= N_ASSUMED && share >= promised {
            lowest = Some(equal[0].1.probability);
        }
    }
    lowest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcomes(all: &[(f32, f32, bool)], n_times: usize) -> Vec<Outcome> {
        let outcome = |&(probability, novelty, is_right)| Outcome { probability, novelty, is_right };
        all.iter().map(outcome).cycle().take(all.len() * n_times).collect()
    }

    fn choose(held_out: &[Outcome], left_out: &[Outcome], known_precision: f32) -> Option<Known> {
        let config = CalibrationConfig { known_precision, ..CalibrationConfig::default() };
        Known::choose(held_out, left_out, &config)
    }

    #[test]
    fn equally_probable_answers_are_known_together_or_not_at_all() {
        let least = |precision, answers: &[(f32, bool)]| {
            let answers: Vec<_> = answers.iter().map(|&(p, is_right)| (p, 0.0, is_right)).collect();
            choose(&outcomes(&answers, 100), &[], precision).map(|known| known.least_probability)
        };
        assert_eq!(least(0.9, &[(0.9, true), (0.9, false), (0.9, false)]), None);
        assert_eq!(least(0.9, &[(0.5, false), (0.9, true), (0.8, true), (0.8, true)]), Some(0.8));
        assert_eq!(least(0.6, &[(0.8, true), (0.7, true), (0.7, false), (0.7, false)]), Some(0.8));
        assert_eq!(least(0.9, &[(1.0, false)]), None);
        assert_eq!(least(0.9, &[]), None);
    }

    #[test]
    fn one_or_two_right_answers_promise_nothing() {
        let enough = |n_right, probability, precision| {
            choose(&outcomes(&[(probability, 0.0, true)], n_right), &[], precision).is_some()
        };
        assert!(!enough(2, 0.8, 0.95) && !enough(4, 0.8, 0.95) && enough(5, 0.8, 0.95));
        assert!(!enough(5, 0.8, 0.99) && enough(60, 0.8, 0.99));
        assert!(!enough(4, 0.99, 0.95) && enough(5, 0.99, 0.95));
        assert!(!enough(4, 0.8, 0.5) && enough(5, 0.8, 0.5));
        let mostly_wrong = [(0.8, 0.0, true), (0.8, 0.0, false), (0.8, 0.0, false)];
        assert_eq!(choose(&outcomes(&mostly_wrong, 5), &[], 0.5), None);
    }

    #[test]
    fn where_sure_answers_to_left_out_rooms_would_break_the_promise_novelty_decides() {
        let held_out = outcomes(&[(0.9, 0.1, true), (0.9, 0.6, true)], 100);
        let left_out = outcomes(&[(0.9, 0.6, false)], 50);
        let known = choose(&held_out, &left_out, 0.95).unwrap();
        assert!((0.1..0.6).contains(&known.most_novelty), "{known:?}");
        assert!(known.holds(0.9, Some(0.1)) && !known.holds(0.9, Some(0.6)) && !known.holds(0.5, None));
        // Where they are unsure it does not matter.
        let left_out = outcomes(&[(0.4, 0.6, false)], 50);
        assert!(choose(&held_out, &left_out, 0.95).unwrap().holds(0.9, Some(0.6)));
    }
}
