//! Whether a frame shows a room that was trained at all: how familiar it is to the opinions, whatever room they name.
//!
//! Scores of a list of answers tell more of whether any is right than the best answer's alone (Boiman et al., 2008,
//! and McCann and Lowe, 2012, use the like to tell rooms apart); here they are weighed by a logistic regression that was fitted on
//! frames of rooms that were left out of training in turn.

use crate::classify::svm::most_probable;
use crate::file::arrays::{Array, Arrays, require};
use crate::file::error::FormatError;
use crate::model::config::Config;
use crate::opinions::logit::{Case, Prior};
use crate::opinions::{OpinionConfig, Said, Sign, logit};

/// What the pool of all opinions tells of how familiar a frame is: the probability of the answer, and the share of
/// opinions that would answer the same.
const POOL_SIGNS: [Sign; 2] =
    [Sign { name: "probability", prior_weight: 0.5 }, Sign { name: "agreement", prior_weight: 0.3 }];

/// How far a fitted weight typically lies from the prior one.
const PRIOR_SPREAD: f64 = 0.5;

/// How far the odds of typical frames of trained rooms lie from the prior ones, as a logarithm.
const OFFSET_SPREAD: f64 = 3.0;

/// Where nothing is known: the logarithm of the odds that the most typical frame of a trained room is new.
const PRIOR_OFFSET: f64 = -1.5;

/// Standard deviations beyond which a sign says no more.
const MOST_DEVIATIONS: f64 = 6.0;

/// A sign that is always the same has this standard deviation.
const LEAST_DEVIATION: f64 = 1e-6;

/// No number of a file is larger.
const LARGEST: f64 = 1e12;

/// How probable it is that a frame shows a place that was never trained, as if every other frame did.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Novelty {
    /// In the order of [`signs_of`].
    scales: Vec<Scale>,
    /// The logarithm of the odds of a frame whose signs are those of the average frame of trained rooms.
    offset: f64,
}

/// What a sign counts.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Scale {
    /// Over frames of trained rooms.
    mean: f64,
    /// Over frames of trained rooms; positive.
    deviation: f64,
    /// The logarithm of odds a deviation.
    weight: f64,
}

impl Scale {
    /// Of what was observed; a sign that never was counts nothing.
    fn of(values: &[f64], prior_weight: f64) -> Self {
        if values.is_empty() {
            return Self { mean: 0.0, deviation: 1.0, weight: 0.0 };
        }
        let n_values = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n_values;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n_values;
        Self { mean, deviation: variance.sqrt().max(LEAST_DEVIATION), weight: prior_weight }
    }
}

/// The signs of a frame: those of each opinion, and those of the pool; none of an opinion that saw nothing.
pub(crate) type Signs = Vec<Option<f64>>;

/// A frame that was decided by opinions that were not trained on it.
#[derive(Clone, Debug)]
pub(crate) struct Observed {
    pub(crate) signs: Signs,
    /// Whether its room was left out.
    pub(crate) is_new: bool,
}

/// The signs of a frame of which opinions said `said`, each for these rooms, and all together this. Most depend a little on how many
/// rooms there are; where rooms are left out there are fewer, for frames of trained rooms as for others.
pub(crate) fn signs_of(
    config: &Config,
    said: &[Option<Said>],
    by_opinion: &[Option<Vec<f32>>],
    pooled: &[f32],
) -> Signs {
    let room_idx = most_probable(pooled);
    let votes = || by_opinion.iter().flatten().map(|probabilities| most_probable(probabilities));
    let n_same = votes().filter(|&vote| vote == room_idx).count();
    let of_opinion = |(said, opinion): (&Option<Said>, &OpinionConfig)| match said {
        Some(said) => said.signs.iter().map(|&sign| Some(f64::from(sign))).collect(),
        None => vec![None; opinion.signs().len()],
    };
    let mut signs: Signs = said.iter().zip(config.opinions.values()).flat_map(of_opinion).collect();
    signs.push(Some(f64::from(pooled[room_idx])));
    signs.push(Some(n_same as f64 / votes().count().max(1) as f64));
    signs
}

/// All signs of models of this configuration.
fn all_signs(config: &Config) -> impl Iterator<Item = Sign> {
    config.opinions.values().flat_map(OpinionConfig::signs).copied().chain(POOL_SIGNS)
}

impl Novelty {
    /// Fits what signs count to frames of trained rooms and of others, which count alike however many there are.
    /// `None` without any of trained rooms; without any of others it is the prior.
    pub(crate) fn fit(config: &Config, observed: &[Observed]) -> Option<Self> {
        let known = || observed.iter().filter(|observed| !observed.is_new);
        let n_known = known().count();
        if n_known == 0 {
            return None;
        }
        let mut novelty = Self { scales: Vec::new(), offset: PRIOR_OFFSET };
        for (sign_idx, sign) in all_signs(config).enumerate() {
            let values: Vec<f64> = known().filter_map(|observed| observed.signs[sign_idx]).collect();
            novelty.scales.push(Scale::of(&values, sign.prior_weight));
        }
        let n_new = observed.len() - n_known;
        if n_new > 0 {
            novelty.weigh(observed, n_new as f64 / n_known as f64);
        }
        Some(novelty)
    }

    /// Fits weights and offset; a frame of a trained room counts `of_known`, another 1.
    fn weigh(&mut self, observed: &[Observed], of_known: f64) {
        let case = |Observed { signs, is_new }: &Observed| {
            let deviations = self.deviations(signs);
            let part = |deviation: Option<f64>| deviation.map(|deviation| vec![deviation, 0.0]);
            // An offset may have either sign.
            let offsets = [Some(1.0), Some(-1.0)].map(part);
            Case {
                label: usize::from(*is_new),
                weight: if *is_new { 1.0 } else { of_known },
                by_part: deviations.map(part).chain(offsets).collect(),
            }
        };
        let cases: Vec<Case> = observed.iter().map(case).collect();
        let prior = self.scales.iter().map(|scale| Prior { mean: scale.weight, spread: PRIOR_SPREAD });
        let offset = |mean| Prior { mean, spread: OFFSET_SPREAD };
        let prior: Vec<Prior> = prior.chain([offset(-PRIOR_OFFSET), offset(0.0)]).collect();
        let weights = logit::fit(&cases, &prior);
        let n = self.scales.len();
        self.scales.iter_mut().zip(&weights).for_each(|(scale, &weight)| scale.weight = weight);
        self.offset = weights[n + 1] - weights[n];
    }

    /// How many standard deviations each sign that counts is above the mean.
    fn deviations(&self, signs: &Signs) -> impl Iterator<Item = Option<f64>> {
        let deviation = |(scale, sign): (&Scale, &Option<f64>)| {
            sign.filter(|_| scale.weight > 0.0)
                .map(|sign| ((sign - scale.mean) / scale.deviation).clamp(-MOST_DEVIATIONS, MOST_DEVIATIONS))
        };
        self.scales.iter().zip(signs).map(deviation)
    }

    /// Of a frame, from 0 to 1.
    pub(crate) fn of(&self, signs: &Signs) -> f32 {
        let weighed = self.deviations(signs).zip(&self.scales);
        let familiar: f64 = weighed.filter_map(|(deviation, scale)| Some(deviation? * scale.weight)).sum();
        (1.0 / (1.0 + (familiar - self.offset).exp())) as f32
    }

    /// What each sign counts, by its name.
    #[cfg(test)]
    fn weights(&self) -> Vec<f64> {
        self.scales.iter().map(|scale| scale.weight).collect()
    }

    pub(crate) fn to_arrays(&self) -> Vec<Array> {
        let of = |part: fn(&Scale) -> f64| self.scales.iter().map(part).collect::<Vec<_>>();
        vec![
            Array::doubles("novelty.means", &of(|scale| scale.mean)),
            Array::doubles("novelty.deviations", &of(|scale| scale.deviation)),
            Array::doubles("novelty.weights", &of(|scale| scale.weight)),
            Array::doubles("novelty.offset", &[self.offset]),
        ]
    }

    /// One of unknown origin that fits the configuration; `None` where the file holds none.
    pub(crate) fn from_arrays(config: &Config, file: &Arrays) -> Result<Option<Self>, FormatError> {
        if !file.has("novelty.offset") {
            return Ok(None);
        }
        let n_signs = all_signs(config).count();
        let doubles = |name| {
            let values = file.doubles(name)?;
            // So that no sum of them overflows.
            let are_sensible = values.iter().all(|value| value.abs() <= LARGEST);
            require(are_sensible, "what tells new places is out of range")?;
            Ok::<_, FormatError>(values)
        };
        let (means, deviations) = (doubles("novelty.means")?, doubles("novelty.deviations")?);
        let (weights, offset) = (doubles("novelty.weights")?, doubles("novelty.offset")?);
        let are_all = [&means, &deviations, &weights].iter().all(|values| values.len() == n_signs);
        require(are_all && offset.len() == 1, "what tells new places is of other opinions")?;
        let have_spread = deviations.iter().all(|&deviation| deviation >= LEAST_DEVIATION);
        require(have_spread, "what tells new places has no spread")?;
        let scales = means.into_iter().zip(deviations).zip(weights);
        let scale = |((mean, deviation), weight)| Scale { mean, deviation, weight };
        Ok(Some(Self { scales: scales.map(scale).collect(), offset: offset[0] }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The default model has one opinion of machines: two signs, and two of the pool.
    const N_SIGNS: usize = 4;

    /// Frames whose first sign is smaller where the place is new, and whose others say nothing.
    fn observed(n: usize) -> Vec<Observed> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut one = |idx: usize| {
            let is_new = idx.is_multiple_of(4);
            let mut signs: Signs = (0..N_SIGNS).map(|_| Some(random.random::<f64>())).collect();
            signs[0] = Some(random.random::<f64>() + if is_new { 0.0 } else { 0.8 });
            signs[1] = (!idx.is_multiple_of(3)).then_some(0.5);
            Observed { signs, is_new }
        };
        (0..n).map(&mut one).collect()
    }

    #[test]
    fn what_tells_new_places_counts_and_what_does_not_counts_little() {
        let config = Config::default();
        let observed = observed(400);
        let novelty = Novelty::fit(&config, &observed).unwrap();
        let weights = novelty.weights();
        assert!(weights[0] > 1.0 && weights[2] < 0.4 && weights[3] < 0.4, "{weights:?}");
        let is_right = |observed: &&Observed| (novelty.of(&observed.signs) > 0.5) == observed.is_new;
        assert!(observed.iter().filter(is_right).count() > 330);
        let strange = vec![Some(-1e9), None, Some(0.5), Some(0.5)];
        assert!(novelty.of(&strange) > 0.99);
        let arrays = novelty.to_arrays();
        assert_eq!(arrays.len(), 4);
    }

    #[test]
    fn a_sign_that_no_trained_room_ever_showed_counts_nothing() {
        let config = Config::default();
        let mut observed = observed(400);
        observed.iter_mut().for_each(|observed| observed.signs[0] = observed.is_new.then_some(3.0));
        let novelty = Novelty::fit(&config, &observed).unwrap();
        assert!(novelty.weights()[0] < 1e-3, "{:?}", novelty.weights());
        let rest = [None, Some(0.5), Some(0.5)];
        let of = |first| novelty.of(&[&[first], &rest[..]].concat());
        assert!((of(Some(3.0)) - of(None)).abs() < 0.01 && (of(Some(-1e3)) - of(None)).abs() < 0.01);
    }

    #[test]
    fn without_left_out_rooms_it_is_the_prior_and_without_frames_there_is_none() {
        let config = Config::default();
        let mut observed = observed(40);
        observed.retain(|observed| !observed.is_new);
        let novelty = Novelty::fit(&config, &observed).unwrap();
        let typical: Signs = novelty.scales.iter().map(|scale| Some(scale.mean)).collect();
        assert!((novelty.of(&typical) - 0.18).abs() < 0.01, "{}", novelty.of(&typical));
        assert_eq!(Novelty::fit(&config, &[]), None);
    }
}
