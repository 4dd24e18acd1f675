//! How frames were decided by opinions that were not trained on them: what probabilities and weights rest on.

use crate::classify::svm::{Scheme, most_probable};
use crate::file::arrays::{Array, Arrays, require};
use crate::file::error::FormatError;
use crate::model::config::Config;
use crate::model::known::Outcome;
use crate::model::novelty;
use crate::model::novelty::Signs;
use crate::opinions::calibration::{Calibration, HeldOutValues, Way};
use crate::opinions::error::TrainError;
use crate::opinions::pool::Judged;
use crate::opinions::{OpinionConfig, Said, pool};
use roomsight_vision::matrix::Matrix;

/// The most frames that a model file keeps: a few hundred KiB an opinion for a dozen rooms.
const MAX_KEPT: usize = 4096;

/// What opinions that were trained without a frame say of it.
#[derive(Clone, Debug)]
pub(crate) struct Decided {
    /// The room that it shows.
    pub(crate) label: usize,
    /// By each opinion that saw something; at least one did.
    pub(crate) said: Vec<Option<Said>>,
}

/// How opinions are calibrated and weighed.
#[derive(Clone, Debug)]
pub(crate) struct Fusion {
    pub(crate) calibrations: Vec<Calibration>,
    pub(crate) weights: Vec<f64>,
    /// See [`pool::fit_doubt`].
    pub(crate) doubt: f64,
}

/// Below this share of frames that the best opinion is right on, held-out drives show other parts of the rooms than those that
/// trained: they say nothing of how much opinions count.
pub(crate) const TELLABLE: f64 = 0.5;

/// Whether being right on so many frames more, and on so many less, is more than a standard error (McNemar, "Note on the sampling
/// error of the difference between correlated proportions or percentages", Psychometrika 1947).
pub(crate) fn is_clear_gain(gained: f64, lost: f64) -> bool {
    gained > lost && (gained - lost).powi(2) > gained + lost
}

impl Fusion {
    /// Fits both to the decisions of the opinions of `config`, in its order. An opinion that saw nothing in any frame
    /// is calibrated on those of `otherwise`.
    pub(crate) fn fit(
        config: &Config,
        n_rooms: usize,
        decided: &[&Decided],
        otherwise: &[&Decided],
    ) -> Result<Self, TrainError> {
        let given = config.given_weights();
        let calibrate = |(opinion_idx, opinion): (usize, &OpinionConfig)| {
            let way = opinion.way();
            // Where weights are fitted, they do what a slope would do as well.
            if given.is_none() && matches!(way, Way::Softmax { .. }) {
                return Calibration::usual(way, n_rooms, &config.calibration);
            }
            let mut held_out = values_of(decided, opinion_idx, way.n_values(n_rooms));
            if held_out.labels.is_empty() {
                held_out = values_of(otherwise, opinion_idx, way.n_values(n_rooms));
            }
            Calibration::fit(way, &held_out, n_rooms, &config.calibration)
        };
        let calibrations: Vec<Calibration> =
            config.opinions.values().enumerate().map(calibrate).collect::<Result<_, _>>()?;
        if let Some(weights) = given {
            return Ok(Self { calibrations, weights, doubt: 0.0 });
        }
        let judged: Vec<Judged> = decided.iter().map(|decided| judged(decided, &calibrations)).collect();
        let prior = config.prior_weights();
        let weights = if most_right(&judged) < TELLABLE { prior } else { pool::fit_weights(&judged, &prior) };
        let doubt = rounded(pool::fit_doubt(&judged, &weights, n_rooms));
        let weights = weights.into_iter().map(rounded).collect();
        Ok(Self { calibrations, weights, doubt })
    }

    /// What is answered to a frame that was decided so.
    pub(crate) fn answer(&self, config: &Config, decided: &Decided, n_rooms: usize) -> Answer {
        let Judged { by_opinion, .. } = judged(decided, &self.calibrations);
        let probabilities = pool::answer(&by_opinion, &self.weights, self.doubt, n_rooms);
        let signs = novelty::signs_of(config, &decided.said, &by_opinion, &probabilities);
        Answer { label: decided.label, probabilities, signs }
    }
}

/// What is answered to a held-out frame.
#[derive(Clone, Debug)]
pub(crate) struct Answer {
    /// The room that it shows.
    pub(crate) label: usize,
    /// One a room; the same for all where no opinion counts that saw something.
    pub(crate) probabilities: Vec<f32>,
    /// How familiar it is.
    pub(crate) signs: Signs,
}

impl Answer {
    /// Of how much use it is that the answer is told, where the frame is that new.
    pub(crate) fn outcome(&self, novelty: Option<f32>) -> Outcome {
        let room_idx = most_probable(&self.probabilities);
        Outcome {
            probability: self.probabilities[room_idx],
            novelty: novelty.unwrap_or_default(),
            is_right: room_idx == self.label,
        }
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
        if let Some(said) = &decided.said[opinion_idx] {
            held_out.values.push_row(&said.values);
            held_out.labels.push(decided.label);
        }
    }
    held_out
}

fn judged(decided: &Decided, calibrations: &[Calibration]) -> Judged {
    let by_opinion = decided.said.iter().zip(calibrations);
    let by_opinion =
        by_opinion.map(|(said, calibration)| Some(calibration.probabilities(&said.as_ref()?.values)));
    Judged { label: decided.label, by_opinion: by_opinion.collect() }
}

/// Decisions that a model keeps, to be joined by those on later frames.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldOutFrames(Vec<Decided>);

impl HeldOutFrames {
    pub(crate) fn new(decided: Vec<Decided>) -> Self {
        Self(decided)
    }

    pub(crate) fn push(&mut self, decided: Decided) {
        self.0.push(decided);
    }

    /// What some of the opinions say of the frames, by the frames' numbers, where one of them saw something.
    pub(crate) fn by(&self, opinion_idxs: &[usize]) -> Vec<(usize, Decided)> {
        let by_some = |(number, decided): (usize, &Decided)| {
            let said: Vec<Option<Said>> = opinion_idxs.iter().map(|&idx| decided.said[idx].clone()).collect();
            let is_seen = said.iter().any(Option::is_some);
            is_seen.then_some((number, Decided { label: decided.label, said }))
        };
        self.0.iter().enumerate().filter_map(by_some).collect()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Decided> {
        self.0.iter()
    }

    /// The same among `n_rooms` rooms, where room i of before is the room `of_earlier[i]` (ascending).
    pub(crate) fn renumbered(&self, config: &Config, of_earlier: &[usize], n_rooms: usize) -> Self {
        let ways = || config.opinions.values().map(OpinionConfig::way);
        let renumber = |decided: &Decided| {
            let said = decided.said.iter().zip(ways());
            let spread = |(said, way): (&Option<Said>, Way)| {
                let said = said.as_ref()?;
                Some(said.with_values(spread_out(way, of_earlier, n_rooms, &said.values)))
            };
            Decided { label: of_earlier[decided.label], said: said.map(spread).collect() }
        };
        Self(self.0.iter().map(renumber).collect())
    }

    /// The same among the rooms that are left, given by their numbers before (ascending); without the frames of others.
    pub(crate) fn narrowed(&self, config: &Config, left: &[usize]) -> Self {
        let narrow = |decided: &Decided| {
            let label = left.binary_search(&decided.label).ok()?;
            let said = decided.said.iter().zip(config.opinions.values());
            let narrow = |(said, opinion): (&Option<Said>, &OpinionConfig)| {
                let said = said.as_ref()?;
                Some(said.with_values(narrowed(opinion.way(), left, &said.values)))
            };
            Some(Decided { label, said: said.map(narrow).collect() })
        };
        Self(self.0.iter().filter_map(narrow).collect())
    }

    /// At most [`MAX_KEPT`] of the frames. Every other one goes as often as needed, so that all drives are
    /// still heard, earlier ones with fewer frames.
    pub(crate) fn thinned(mut self) -> Self {
        while self.0.len() > MAX_KEPT {
            self.0 = self.0.into_iter().step_by(2).collect();
        }
        self
    }

    /// All of it, what is of an opinion under its name.
    pub(crate) fn to_arrays(&self, names: &Names, config: &Config, n_rooms: usize) -> Vec<Array> {
        if self.0.is_empty() {
            return Vec::new();
        }
        let labels: Vec<usize> = self.0.iter().map(|decided| decided.label).collect();
        let mut arrays = vec![Array::counts(names.labels, labels.into_iter())];
        for (opinion_idx, (name, opinion)) in config.opinions.iter().enumerate() {
            let rows = |n_cols, part: fn(&Said) -> &[f32]| {
                let mut rows = Matrix::new(n_cols);
                for decided in &self.0 {
                    match &decided.said[opinion_idx] {
                        Some(said) => rows.push_row(part(said)),
                        None => rows.push_row(&vec![f32::NAN; n_cols]),
                    }
                }
                rows
            };
            let values = rows(opinion.way().n_values(n_rooms), |said| &said.values);
            let signs = rows(opinion.signs().len(), |said| &said.signs);
            let parts = [Array::matrix(names.values, &values), Array::matrix(names.signs, &signs)];
            arrays.extend(parts.map(|array| array.of_opinion(name)));
        }
        arrays
    }

    /// Frames of unknown origin that fit the rooms, none where the file holds none. `arrays` gives those of an opinion.
    pub(crate) fn from_arrays<'a>(
        names: &Names,
        config: &'a Config,
        n_rooms: usize,
        file: &Arrays<'a>,
        arrays: impl Fn(&'a str) -> Arrays<'a>,
    ) -> Result<Self, FormatError> {
        if !file.has(names.labels) {
            return Ok(Self::default());
        }
        let labels = file.counts(names.labels)?;
        require(labels.iter().all(|&label| label < n_rooms), "its held-out frames are of no room")?;
        let mut by_opinion = Vec::new();
        for (name, opinion) in &config.opinions {
            let arrays = arrays(name);
            let values = arrays.matrix(names.values)?;
            let n_values = opinion.way().n_values(n_rooms);
            require(values.n_cols() == n_values, "its held-out frames are of other machines")?;
            let mut said = read_rows(&values, labels.len())?;
            // Files of before this was kept have none.
            if arrays.has(names.signs) {
                let signs = arrays.matrix(names.signs)?;
                require(signs.n_cols() == opinion.signs().len(), "its held-out frames have other signs")?;
                for (said, signs) in said.iter_mut().zip(read_rows(&signs, labels.len())?) {
                    require(said.is_some() == signs.is_some(), "its held-out frames are seen in part")?;
                    said.iter_mut().zip(signs).for_each(|(said, signs)| said.signs = signs.values);
                }
            } else {
                let none = vec![0.0; opinion.signs().len()];
                said.iter_mut().flatten().for_each(|said| said.signs.clone_from(&none));
            }
            by_opinion.push(said.into_iter());
        }
        let mut frames = Vec::with_capacity(labels.len());
        for label in labels {
            let said: Vec<Option<Said>> = by_opinion.iter_mut().map(|rows| rows.next().flatten()).collect();
            require(said.iter().any(Option::is_some), "its held-out frames show nothing")?;
            frames.push(Decided { label, said });
        }
        Ok(Self(frames))
    }
}

/// What the arrays of frames are called.
pub(crate) struct Names {
    labels: &'static str,
    values: &'static str,
    signs: &'static str,
}

/// Of frames that the rooms were trained without.
pub(crate) const HELD_OUT: Names =
    Names { labels: "held_out.labels", values: "held_out.values", signs: "held_out.signs" };

/// Of frames whose rooms were left out.
pub(crate) const LEFT_OUT: Names =
    Names { labels: "left_out.labels", values: "left_out.values", signs: "left_out.signs" };

/// One row a frame; not-a-number where nothing was seen.
fn read_rows(rows: &Matrix, n_frames: usize) -> Result<Vec<Option<Said>>, FormatError> {
    require(rows.n_rows() == n_frames, "its held-out frames have other numbers of frames and rooms")?;
    let read = |row: &[f32]| {
        let is_there = !row.iter().all(|value| value.is_nan());
        let is_finite = row.iter().all(|value| value.is_finite());
        require(!is_there || is_finite, "its held-out frames are not finite")?;
        Ok(is_there.then(|| Said { values: row.to_vec(), signs: Vec::new() }))
    };
    rows.rows().map(read).collect()
}

/// Decision values among the classes `present` (ascending), as they are among all. The machine of a class that
/// was not trained says a clear no (-1); a machine for a pair with such a class is undecided (0). Where there is a value a
/// room, it is the least of the others'.
pub(crate) fn spread_out(way: Way, present: &[usize], n_classes: usize, values: &[f32]) -> Vec<f32> {
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
    fn thinning_keeps_frames_of_the_whole_time() {
        let said = |idx: usize| Said { values: vec![idx as f32, 0.0], signs: Vec::new() };
        let frame = |idx: usize| Decided { label: idx % 3, said: vec![Some(said(idx))] };
        let kept = HeldOutFrames::new((0..10_000).map(frame).collect()).thinned();
        let time = |decided: &Decided| decided.said[0].as_ref().unwrap().values[0];
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
