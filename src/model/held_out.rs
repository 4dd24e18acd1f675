//! How frames were decided by opinions that were not trained on them: what probabilities and weights rest on.

use super::arrays::{Array, Arrays, require};
use super::calibration::{Calibration, HeldOutValues, Way};
use super::format::FormatError;
use super::opinion::OpinionConfig;
use super::pool::{self, Judged, Vote, pooled};
use super::{CalibrationConfig, Config, TrainError};
use crate::matrix::Matrix;
use crate::svm::{Scheme, most_probable};

/// The most frames that a model file keeps: a few hundred KiB an opinion for a dozen rooms.
const MAX_KEPT: usize = 4096;

/// The decision values for a frame by opinions trained without it.
#[derive(Clone, Debug)]
pub(super) struct Decided {
    /// The room that it shows.
    pub(super) label: usize,
    /// Those of each opinion that saw something; at least one did.
    pub(super) values: Vec<Option<Vec<f32>>>,
}

/// How opinions are calibrated and weighed.
#[derive(Clone, Debug)]
pub(super) struct Fusion {
    pub(super) calibrations: Vec<Calibration>,
    pub(super) weights: Vec<f64>,
    /// See [`pool::fit_doubt`].
    pub(super) doubt: f64,
}

/// Below this share of frames that the best opinion is right on, held-out drives show other parts of the rooms than those that
/// trained: they say nothing of how much opinions count.
pub(super) const TELLABLE: f64 = 0.5;

impl Fusion {
    /// Fits both to the decisions of the opinions of `config`, in its order. An opinion that saw nothing in any frame
    /// is calibrated on those of `otherwise`.
    pub(super) fn fit(
        config: &Config,
        n_places: usize,
        decided: &[&Decided],
        otherwise: &[&Decided],
    ) -> Result<Self, TrainError> {
        let given = config.given_weights();
        let calibrate = |(opinion_idx, opinion): (usize, &OpinionConfig)| {
            let way = opinion.way();
            // Where weights are fitted, they do what a slope would do as well.
            if given.is_none() && matches!(way, Way::Softmax { .. }) {
                return Calibration::usual(way, n_places, &config.calibration);
            }
            let mut held_out = values_of(decided, opinion_idx, way.n_values(n_places));
            if held_out.labels.is_empty() {
                held_out = values_of(otherwise, opinion_idx, way.n_values(n_places));
            }
            Calibration::fit(way, &held_out, n_places, &config.calibration)
        };
        let calibrations: Vec<Calibration> =
            config.opinions.values().enumerate().map(calibrate).collect::<Result<_, _>>()?;
        if let Some(weights) = given {
            return Ok(Self { calibrations, weights, doubt: 0.0 });
        }
        let judged: Vec<Judged> = decided.iter().map(|decided| judged(decided, &calibrations)).collect();
        let prior = config.prior_weights();
        let weights = if most_right(&judged) < TELLABLE { prior } else { pool::fit_weights(&judged, &prior) };
        let doubt = rounded(pool::fit_doubt(&judged, &weights, n_places));
        let weights = weights.into_iter().map(rounded).collect();
        Ok(Self { calibrations, weights, doubt })
    }

    /// One probability a room; the same for all where no opinion counts that saw something.
    pub(super) fn probabilities(&self, decided: &Decided, n_places: usize) -> Vec<f32> {
        let Judged { by_opinion, .. } = judged(decided, &self.calibrations);
        let votes = by_opinion.into_iter().zip(&self.weights);
        let votes =
            votes.filter_map(|(probabilities, &weight)| Some(Vote { weight, probabilities: probabilities? }));
        let probabilities = pool::doubted(pooled(votes), self.doubt);
        if probabilities.is_empty() { vec![1.0 / n_places as f32; n_places] } else { probabilities }
    }
}

/// So short that it is read as it was written.
fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// The share of the frames that the best opinion is right on; none of no frame.
fn most_right(judged: &[Judged]) -> f64 {
    let n_opinions = judged.first().map_or(0, |judged| judged.by_opinion.len());
    let n_right = |opinion_idx: usize| {
        let is_right = |judged: &&Judged| {
            judged.by_opinion[opinion_idx].as_ref().is_some_and(|p| most_probable(p) == judged.label)
        };
        judged.iter().filter(is_right).count()
    };
    let most = (0..n_opinions).map(n_right).max().unwrap_or_default();
    most as f64 / judged.len().max(1) as f64
}

fn values_of(decided: &[&Decided], opinion_idx: usize, n_values: usize) -> HeldOutValues {
    let mut held_out = HeldOutValues { values: Matrix::new(n_values), labels: Vec::new() };
    for decided in decided {
        if let Some(values) = &decided.values[opinion_idx] {
            held_out.values.push_row(values);
            held_out.labels.push(decided.label);
        }
    }
    held_out
}

fn judged(decided: &Decided, calibrations: &[Calibration]) -> Judged {
    let by_opinion = decided.values.iter().zip(calibrations);
    let by_opinion =
        by_opinion.map(|(values, calibration)| Some(calibration.probabilities(values.as_ref()?)));
    Judged { label: decided.label, by_opinion: by_opinion.collect() }
}

/// Decisions that a model keeps, to be joined by those on later frames.
#[derive(Clone, Debug, Default)]
pub(super) struct HeldOutFrames(Vec<Decided>);

impl HeldOutFrames {
    pub(super) fn new(decided: Vec<Decided>) -> Self {
        Self(decided)
    }

    pub(super) fn push(&mut self, decided: Decided) {
        self.0.push(decided);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Decided> {
        self.0.iter()
    }

    /// The same among `n_places` rooms, where room i of before is the room `of_earlier[i]` (ascending).
    pub(super) fn renumbered(&self, config: &Config, of_earlier: &[usize], n_places: usize) -> Self {
        let ways = || config.opinions.values().map(OpinionConfig::way);
        let renumber = |decided: &Decided| {
            let values = decided.values.iter().zip(ways());
            let spread = |(values, way): (&Option<Vec<f32>>, Way)| {
                Some(spread_out(way, of_earlier, n_places, values.as_ref()?))
            };
            Decided { label: of_earlier[decided.label], values: values.map(spread).collect() }
        };
        Self(self.0.iter().map(renumber).collect())
    }

    /// The same among the rooms that are left, given by their numbers before (ascending); without the frames of others.
    pub(super) fn narrowed(&self, config: &Config, left: &[usize]) -> Self {
        let narrow = |decided: &Decided| {
            let label = left.binary_search(&decided.label).ok()?;
            let values = decided.values.iter().zip(config.opinions.values());
            let narrow = |(values, opinion): (&Option<Vec<f32>>, &OpinionConfig)| {
                Some(narrowed(opinion.way(), left, values.as_ref()?))
            };
            Some(Decided { label, values: values.map(narrow).collect() })
        };
        Self(self.0.iter().filter_map(narrow).collect())
    }

    /// At most [`MAX_KEPT`] of the frames. Every other one goes as often as needed, so that all drives are
    /// still heard, earlier ones with fewer frames.
    pub(super) fn thinned(mut self) -> Self {
        while self.0.len() > MAX_KEPT {
            self.0 = self.0.into_iter().step_by(2).collect();
        }
        self
    }

    pub(super) fn labels(&self) -> Array {
        Array::counts(LABELS, self.0.iter().map(|decided| decided.label).collect::<Vec<_>>().into_iter())
    }

    /// The decision values of an opinion; not-a-number where it saw nothing.
    pub(super) fn values_of(&self, opinion_idx: usize, n_values: usize) -> Array {
        let mut rows = Matrix::new(n_values);
        for decided in &self.0 {
            match &decided.values[opinion_idx] {
                Some(values) => rows.push_row(values),
                None => rows.push_row(&vec![f32::NAN; n_values]),
            }
        }
        Array::matrix(VALUES, &rows)
    }

    /// `None` where the file holds none; else frames of unknown origin that fit the rooms. `arrays` gives those of an
    /// opinion.
    pub(super) fn from_arrays<'a>(
        config: &'a Config,
        n_places: usize,
        file: &Arrays<'a>,
        arrays: impl Fn(&'a str) -> Arrays<'a>,
    ) -> Result<Option<Self>, FormatError> {
        if !file.has(LABELS) {
            return Ok(None);
        }
        let labels = file.counts(LABELS)?;
        require(labels.iter().all(|&label| label < n_places), "its held-out frames are of no room")?;
        let mut by_opinion = Vec::new();
        for (name, opinion) in &config.opinions {
            let values = arrays(name).matrix(VALUES)?;
            require(
                values.n_cols() == opinion.way().n_values(n_places),
                "its held-out frames are of other machines",
            )?;
            require(
                values.n_rows() == labels.len(),
                "its held-out frames have other numbers of frames and rooms",
            )?;
            by_opinion.push(values);
        }
        let mut frames = Vec::with_capacity(labels.len());
        for (frame_idx, &label) in labels.iter().enumerate() {
            let mut values = Vec::with_capacity(by_opinion.len());
            for rows in &by_opinion {
                let row = rows.row(frame_idx);
                let is_there = !row.iter().all(|value| value.is_nan());
                require(
                    !is_there || row.iter().all(|value| value.is_finite()),
                    "its held-out frames are not finite",
                )?;
                values.push(is_there.then(|| row.to_vec()));
            }
            require(values.iter().any(Option::is_some), "its held-out frames show nothing")?;
            frames.push(Decided { label, values });
        }
        Ok(Some(Self(frames)))
    }
}

const LABELS: &str = "held_out.labels";
const VALUES: &str = "held_out.values";

/// An answer to a held-out frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome {
    pub(super) probability: f32,
    pub(super) is_right: bool,
}

/// The lowest probability from which on answers were right often enough, if there is one; those of equal
/// probability count together.
pub(super) fn known_probability(mut answers: Vec<Outcome>, config: &CalibrationConfig) -> Option<f32> {
    answers.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let (mut n_answers, mut n_correct) = (0, 0);
    let mut lowest = None;
    for equal in answers.chunk_by(|a, b| a.probability == b.probability) {
        n_answers += equal.len();
        n_correct += equal.iter().filter(|answer| answer.is_right).count();
        if n_correct as f32 >= config.known_precision * n_answers as f32 {
            lowest = Some(equal[0].probability);
        }
    }
    lowest
}

/// Decision values among the classes `present` (ascending), as they are among all. The machine of a class that
/// was not trained says a clear no (-1); a machine for a pair with such a class is undecided (0). Where there is a value a
/// room, it is the least of the others'.
pub(super) fn spread_out(way: Way, present: &[usize], n_classes: usize, values: &[f32]) -> Vec<f32> {
    let trained = |class: usize| present.binary_search(&class).ok();
    let among_all = |absent: f32| {
        (0..n_classes).map(|class| trained(class).map_or(absent, |machine| values[machine])).collect()
    };
    match way {
        Way::Softmax { .. } => among_all(values.iter().copied().fold(f32::INFINITY, f32::min)),
        Way::Sigmoids(Scheme::OneVsAll) => among_all(-1.0),
        Way::Sigmoids(Scheme::OneVsOne) => pairs(n_classes)
            .map(|(a, b)| match (trained(a), trained(b)) {
                (Some(a), Some(b)) => values[machine_of((a, b), present.len())],
                _ => 0.0,
            })
            .collect(),
    }
}

/// Decision values among the classes `left` (ascending) of those that they are among.
fn narrowed(way: Way, left: &[usize], values: &[f32]) -> Vec<f32> {
    match way {
        Way::Softmax { .. } | Way::Sigmoids(Scheme::OneVsAll) => {
            left.iter().map(|&class| values[class]).collect()
        }
        Way::Sigmoids(Scheme::OneVsOne) => {
            // n (n - 1) / 2 machines.
            let n_classes = (1 + 8 * values.len()).isqrt().div_ceil(2);
            pairs(left.len()).map(|(a, b)| values[machine_of((left[a], left[b]), n_classes)]).collect()
        }
    }
}

fn pairs(n_classes: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n_classes).flat_map(move |a| (a + 1..n_classes).map(move |b| (a, b)))
}

/// The machine that tells class `a` from a later class `b`.
fn machine_of((a, b): (usize, usize), n_classes: usize) -> usize {
    a * (2 * n_classes - a - 1) / 2 + b - a - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equally_probable_answers_are_known_together_or_not_at_all() {
        let least = |known_precision, answers: &[(f32, bool)]| {
            let config = CalibrationConfig { known_precision, ..CalibrationConfig::default() };
            let outcome = |&(probability, is_right)| Outcome { probability, is_right };
            known_probability(answers.iter().map(outcome).collect(), &config)
        };
        assert_eq!(least(0.9, &[(0.9, true), (0.9, false), (0.9, false)]), None);
        assert_eq!(least(0.9, &[(0.5, false), (0.9, true), (0.8, true), (0.8, true)]), Some(0.8));
        assert_eq!(least(0.6, &[(0.8, true), (0.7, true), (0.7, false), (0.7, false)]), Some(0.8));
        assert_eq!(least(0.9, &[(1.0, false)]), None);
        assert_eq!(least(0.9, &[]), None);
    }

    #[test]
    fn thinning_keeps_frames_of_the_whole_time() {
        let frame = |idx: usize| Decided { label: idx % 3, values: vec![Some(vec![idx as f32, 0.0])] };
        let kept = HeldOutFrames::new((0..10_000).map(frame).collect()).thinned();
        let time = |decided: &Decided| decided.values[0].as_ref().unwrap()[0];
        let times: Vec<f32> = kept.iter().map(time).collect();
        assert_eq!(times.len(), 2500);
        assert!(times.windows(2).all(|pair| pair[1] - pair[0] == 4.0));
        assert!(kept.iter().all(|decided| time(decided) as usize % 3 == decided.label));
        assert_eq!(kept.thinned().0.len(), 2500);
    }

    #[test]
    fn a_new_class_leaves_the_others_their_machines() {
        let one_vs_all = Way::Sigmoids(Scheme::OneVsAll);
        assert_eq!(spread_out(one_vs_all, &[0, 2], 3, &[0.5, 0.7]), [0.5, -1.0, 0.7]);
        let one_vs_one = Way::Sigmoids(Scheme::OneVsOne);
        let among_four = spread_out(one_vs_one, &[0, 1, 3], 4, &[0.1, 0.2, 0.3]);
        assert_eq!(among_four, [0.1, 0.0, 0.2, 0.0, 0.3, 0.0], "01 02 03 12 13 23");
        assert_eq!(narrowed(one_vs_one, &[0, 1, 3], &among_four), [0.1, 0.2, 0.3]);
        let softmax = Way::Softmax { prior_slope: 1.0 };
        assert_eq!(spread_out(softmax, &[0, 2], 3, &[0.5, 0.7]), [0.5, 0.5, 0.7]);
        assert_eq!(narrowed(softmax, &[0, 2], &[0.5, 0.1, 0.7]), [0.5, 0.7]);
    }
}
