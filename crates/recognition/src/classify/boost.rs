//! AdaBoost over rows of numbers (bags): Freund and Schapire, "A decision-theoretic generalization of on-line
//! learning and an application to boosting", JCSS 55, 1997, with decision stumps, one class against all
//! others.
//!
//! Each round t takes the stump h_t (a feature above a threshold, or not) of least weighted error e_t; it
//! counts a_t = ln((1 - e_t) / e_t) / 2. The weight of row i, of side y_i = 1 or -1, is multiplied by
//! exp(-a_t y_i h_t(x_i)). The decision value of x is the sum of a_t h_t(x), about half the log-odds of the
//! class (Friedman, Hastie, Tibshirani, "Additive logistic regression", Annals of Statistics 28, 2000).

use crate::labeled::{LabeledError, check_every_class_has_rows, check_n_classes, check_rows};
use rayon::prelude::*;
use roomsight_vision::matrix::Matrix;
use serde::{Deserialize, Serialize};

/// The most rounds, so that a configuration cannot ask for more memory than there is.
const MAX_ROUNDS: usize = 10_000;

/// What to train.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Stumps a class, from 1 to 10,000. There are fewer where a stump makes no error or none is better
    /// than chance.
    pub n_rounds: usize,
}

impl Default for Config {
    fn default() -> Self {
        Self { n_rounds: 200 }
    }
}

impl Config {
    /// That the number of rounds is in range.
    pub fn check(&self) -> Result<(), BoostError> {
        if (1..=MAX_ROUNDS).contains(&self.n_rounds) {
            return Ok(());
        }
        Err(BoostError::Rounds { n_rounds: self.n_rounds })
    }
}

/// Why no ensembles were made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the texts say it")]
pub enum BoostError {
    #[error("n_rounds must be from 1 to {MAX_ROUNDS}, not {n_rounds}")]
    Rounds { n_rounds: usize },
    #[error(transparent)]
    Labeled(#[from] LabeledError),
    #[error("stump {stump_idx} of class {class_idx} is damaged: {reason}")]
    Damaged { class_idx: usize, stump_idx: usize, reason: &'static str },
}

/// Boosted stumps: one ensemble a class.
#[derive(Clone, Debug, PartialEq)]
pub struct Boost {
    n_features: usize,
    ensembles: Vec<Vec<Stump>>,
}

/// Votes by one feature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stump {
    /// Which feature.
    pub feature_idx: usize,
    /// The vote is positive for features above it.
    pub threshold: f32,
    /// What a positive vote adds and a negative one takes away; itself negative where small features speak
    /// for the class.
    pub weight: f32,
}

impl Boost {
    /// Trains on `rows` (n x n_features), where row i is of class `labels[i]` < `n_classes`.
    ///
    /// The result depends on the arguments only, not on the number of threads.
    ///
    /// # Errors
    /// Fewer than two classes, a class without rows, a label too many or out of range, features that are
    /// not finite, rounds out of range.
    pub fn train(
        rows: &Matrix,
        labels: &[usize],
        n_classes: usize,
        config: &Config,
    ) -> Result<Self, BoostError> {
        check(rows, labels, n_classes, config)?;
        let features: Vec<SortedFeature> = (0..rows.n_cols())
            .into_par_iter()
            .map(|feature_idx| SortedFeature::new(rows, feature_idx))
            .collect();
        let train_class = |class_idx: usize| {
            let sides: Vec<f64> =
                labels.iter().map(|&label| if label == class_idx { 1.0 } else { -1.0 }).collect();
            boost(rows, &features, &sides, config.n_rounds)
        };
        Ok(Self { n_features: rows.n_cols(), ensembles: (0..n_classes).map(train_class).collect() })
    }

    /// Puts a machine together from its ensembles, as [`Boost::ensembles`] gave them.
    ///
    /// # Errors
    /// Fewer than two classes, stumps of features that there are not, numbers that are not finite.
    pub fn from_parts(n_features: usize, ensembles: Vec<Vec<Stump>>) -> Result<Self, BoostError> {
        check_n_classes(ensembles.len())?;
        for (class_idx, stumps) in ensembles.iter().enumerate() {
            for (stump_idx, stump) in stumps.iter().enumerate() {
                let damaged = |reason| Err(BoostError::Damaged { class_idx, stump_idx, reason });
                if stump.feature_idx >= n_features {
                    return damaged("it has no such feature");
                }
                if !(stump.threshold.is_finite() && stump.weight.is_finite()) {
                    return damaged("its numbers are not finite");
                }
            }
        }
        Ok(Self { n_features, ensembles })
    }

    /// One decision value a class, positive for rows like its own. Panics when `row` has not
    /// [`Boost::n_features`] numbers.
    pub fn decision_values(&self, row: &[f32]) -> Vec<f32> {
        assert_eq!(row.len(), self.n_features, "a row of another width");
        let vote = |stump: &Stump| f64::from(stump.weight) * stump.vote(row);
        self.ensembles.iter().map(|stumps| stumps.iter().map(vote).sum::<f64>() as f32).collect()
    }

    /// The number of classes.
    pub fn n_classes(&self) -> usize {
        self.ensembles.len()
    }

    /// The number of features of a row.
    pub fn n_features(&self) -> usize {
        self.n_features
    }

    /// The stumps of each class, in the order of the rounds.
    pub fn ensembles(&self) -> &[Vec<Stump>] {
        &self.ensembles
    }
}

impl Stump {
    /// 1 or -1.
    fn vote(&self, row: &[f32]) -> f64 {
        if row[self.feature_idx] > self.threshold { 1.0 } else { -1.0 }
    }
}

fn check(rows: &Matrix, labels: &[usize], n_classes: usize, config: &Config) -> Result<(), BoostError> {
    config.check()?;
    check_rows(rows, labels, n_classes)?;
    Ok(check_every_class_has_rows(labels, n_classes)?)
}

/// The rows by one feature, the largest first, without those of the smallest value: no threshold lies
/// below them. Most words are in few frames, so that this leaves little of a bag.
struct SortedFeature(Vec<SortedRow>);

struct SortedRow {
    row_idx: u32,
    /// Whether the next row has a smaller value: a threshold may lie between the two.
    is_last: bool,
    /// Between this value and the next smaller one.
    threshold: f32,
}

/// A stump without its weight.
#[derive(Clone, Copy)]
struct Split {
    feature_idx: usize,
    threshold: f32,
    /// Whether features above the threshold speak for the class.
    is_positive_above: bool,
    error: f64,
}

impl SortedFeature {
    fn new(rows: &Matrix, feature_idx: usize) -> Self {
        let mut values: Vec<(f32, u32)> =
            (0u32..).zip(rows.rows()).map(|(idx, row)| (row[feature_idx], idx)).collect();
        values.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let smallest = values.last().map_or(0.0, |last| last.0);
        let pairs = values.windows(2).take_while(|pair| pair[0].0 > smallest);
        Self(pairs.map(|pair| SortedRow::new(pair[0], pair[1].0)).collect())
    }

    /// The split of least error. `signed_weights` are those of the rows, negative for rows of other classes.
    fn best_split(&self, feature_idx: usize, signed_weights: &[f64], positive_weight: f64) -> Option<Split> {
        let mut above = 0.0;
        let (mut highest, mut lowest) = ((f64::NEG_INFINITY, 0.0), (f64::INFINITY, 0.0));
        for row in &self.0 {
            above += signed_weights[row.row_idx as usize];
            if row.is_last {
                highest = if above > highest.0 { (above, row.threshold) } else { highest };
                lowest = if above < lowest.0 { (above, row.threshold) } else { lowest };
            }
        }
        // Errors are rows of the class below the threshold and others above it; or all but these.
        let for_class = Split {
            feature_idx,
            threshold: highest.1,
            is_positive_above: true,
            error: positive_weight - highest.0,
        };
        let against = Split {
            feature_idx,
            threshold: lowest.1,
            is_positive_above: false,
            error: 1.0 - (positive_weight - lowest.0),
        };
        (!self.0.is_empty()).then_some(if against.error < for_class.error { against } else { for_class })
    }
}

impl SortedRow {
    fn new((value, row_idx): (f32, u32), next: f32) -> Self {
        // Halved first, the sum cannot overflow; between neighboring numbers there is no middle.
        let middle = value / 2.0 + next / 2.0;
        let threshold = if next <= middle && middle < value { middle } else { next };
        Self { row_idx, is_last: value > next, threshold }
    }
}

/// The stumps that tell the rows of side 1 from those of side -1.
fn boost(rows: &Matrix, features: &[SortedFeature], sides: &[f64], n_rounds: usize) -> Vec<Stump> {
    let n_rows = sides.len() as f64;
    let mut weights = vec![1.0 / n_rows; sides.len()];
    let mut stumps = Vec::new();
    for _ in 0..n_rounds {
        let signed: Vec<f64> = weights.iter().zip(sides).map(|(weight, side)| weight * side).collect();
        let positive_weight = signed.iter().filter(|&&weight| weight > 0.0).sum();
        let best = features
            .par_iter()
            .enumerate()
            .filter_map(|(feature_idx, feature)| feature.best_split(feature_idx, &signed, positive_weight))
            .min_by(|a, b| a.error.total_cmp(&b.error).then(a.feature_idx.cmp(&b.feature_idx)));
        let Some(split) = best.filter(|split| split.error < 0.5) else { break };
        // A stump without errors would count without limit: it counts as if half a row were wrong.
        let error = split.error.max(0.5 / n_rows);
        let weight = 0.5 * ((1.0 - error) / error).ln();
        let weight = if split.is_positive_above { weight } else { -weight };
        let stump =
            Stump { feature_idx: split.feature_idx, threshold: split.threshold, weight: weight as f32 };
        stumps.push(stump);
        if error > split.error {
            break;
        }
        for ((row, weight_of_row), side) in rows.rows().zip(&mut weights).zip(sides) {
            *weight_of_row *= (-weight * side * stump.vote(row)).exp();
        }
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= total);
    }
    stumps
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{Rng, SeedableRng};

    fn matrix(rows: &[Vec<f32>]) -> Matrix {
        Matrix::from_vec(rows.concat(), rows[0].len()).unwrap()
    }

    /// Three classes that no single feature tells apart.
    fn sample(n_rows: usize) -> (Matrix, Vec<usize>) {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let labels: Vec<usize> = (0..n_rows).map(|row_idx| row_idx % 3).collect();
        let mut rows = Matrix::new(12);
        for &label in &labels {
            let row: Vec<f32> = (0..12)
                .map(|feature| {
                    let center = if feature % 3 == label { 0.5 } else { 0.0 };
                    let value: f32 = center + random.random_range(-1.0..1.0);
                    value.max(0.0)
                })
                .collect();
            rows.push_row(&row);
        }
        (rows, labels)
    }

    fn weighted_error(rows: &Matrix, sides: &[f64], weights: &[f64], stump: &Stump) -> f64 {
        let is_wrong =
            |idx: &usize| stump.vote(rows.row(*idx)) * sides[*idx] * f64::from(stump.weight.signum()) < 0.0;
        (0..sides.len()).filter(is_wrong).map(|idx| weights[idx]).sum()
    }

    /// The least error of any stump, by trying all that differ on the rows.
    fn naive_least_error(rows: &Matrix, sides: &[f64], weights: &[f64]) -> f64 {
        let mut least = f64::INFINITY;
        for feature_idx in 0..rows.n_cols() {
            let values: Vec<f32> = rows.rows().map(|row| row[feature_idx]).collect();
            let largest = values.iter().copied().fold(f32::MIN, f32::max);
            for &threshold in values.iter().filter(|&&value| value < largest) {
                for weight in [1.0, -1.0] {
                    let stump = Stump { feature_idx, threshold, weight };
                    least = least.min(weighted_error(rows, sides, weights, &stump));
                }
            }
        }
        least
    }

    proptest! {
        #[test]
        fn each_round_takes_the_best_stump_and_weights_as_the_paper_does(
            n_features in 1usize..5, values in prop::collection::vec(0u8..6, 4 * 30),
            labels in prop::collection::vec(0usize..3, 6..30),
        ) {
            prop_assume!((0..3).all(|class_idx| labels.contains(&class_idx)));
            let values = values[..n_features * labels.len()].iter().map(|&value| f32::from(value)).collect();
            let rows = Matrix::from_vec(values, n_features).unwrap();
            let boost = Boost::train(&rows, &labels, 3, &Config { n_rounds: 8 }).unwrap();
            for (class_idx, stumps) in boost.ensembles().iter().enumerate() {
                let sides: Vec<f64> = labels.iter().map(|&label| if label == class_idx { 1.0 } else { -1.0 }).collect();
                let mut weights = vec![1.0 / labels.len() as f64; labels.len()];
                for stump in stumps {
                    let error = weighted_error(&rows, &sides, &weights, stump);
                    prop_assert!((error - naive_least_error(&rows, &sides, &weights)).abs() < 1e-6);
                    let counted = error.max(0.5 / labels.len() as f64);
                    let expected = 0.5 * ((1.0 - counted) / counted).ln();
                    prop_assert!((f64::from(stump.weight.abs()) - expected).abs() < 1e-5);
                    for (idx, weight) in weights.iter_mut().enumerate() {
                        *weight *= (-f64::from(stump.weight) * sides[idx] * stump.vote(rows.row(idx))).exp();
                    }
                    let total: f64 = weights.iter().sum();
                    weights.iter_mut().for_each(|weight| *weight /= total);
                }
                let is_done = stumps.len() == 8
                    || naive_least_error(&rows, &sides, &weights) > 0.5 - 1e-6
                    || stumps.last().is_some_and(|stump| f64::from(stump.weight.abs()) > 0.5 * (2.0 * labels.len() as f64 - 1.5).ln());
                prop_assert!(is_done, "class {class_idx} stopped after {} rounds", stumps.len());
            }
        }
    }

    #[test]
    fn rows_that_were_not_trained_on_are_told_apart() {
        let (rows, labels) = sample(900);
        let (train, test) = rows.as_slice().split_at(600 * 12);
        let [train, test] = [train, test].map(|part| Matrix::from_vec(part.to_vec(), 12).unwrap());
        let right = |n_rounds| {
            let boost = Boost::train(&train, &labels[..600], 3, &Config { n_rounds }).unwrap();
            let best = |row: &[f32]| {
                let values = boost.decision_values(row);
                (0..3).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap()
            };
            test.rows().zip(&labels[600..]).filter(|(row, label)| best(row) == **label).count()
        };
        let (few, many) = (right(1), right(100));
        assert!(many > 225 && many > few + 30, "{few}, {many} of 300");
    }

    #[test]
    fn any_number_of_threads_gives_the_same_stumps() {
        let (rows, labels) = sample(200);
        let train = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| Boost::train(&rows, &labels, 3, &Config { n_rounds: 40 }).unwrap())
        };
        assert_eq!(train(1), train(5));
    }

    #[test]
    fn a_stump_without_errors_ends_the_ensemble() {
        let rows = matrix(&[vec![1.0, 0.0], vec![1.0, 2.0], vec![1.0, 0.5], vec![1.0, 3.0]]);
        let boost = Boost::train(&rows, &[0, 1, 0, 1], 2, &Config::default()).unwrap();
        let weight = (0.5 * 7.0f64.ln()) as f32;
        let stump = Stump { feature_idx: 1, threshold: 1.25, weight };
        assert_eq!(boost.ensembles(), [vec![Stump { weight: -weight, ..stump }], vec![stump]]);
        assert_eq!(boost.decision_values(&[0.0, 1.0]), [weight, -weight]);
    }

    #[test]
    fn rows_that_are_all_the_same_decide_nothing() {
        let rows = matrix(&[vec![1.0], vec![1.0]]);
        let boost = Boost::train(&rows, &[0, 1], 2, &Config::default()).unwrap();
        assert_eq!(boost.decision_values(&[5.0]), [0.0, 0.0]);
    }

    #[test]
    fn parts_make_the_same_machine_and_damage_is_refused() {
        let (rows, labels) = sample(60);
        let boost = Boost::train(&rows, &labels, 3, &Config { n_rounds: 5 }).unwrap();
        assert_eq!(Boost::from_parts(12, boost.ensembles().to_vec()).as_ref(), Ok(&boost));
        let stump = boost.ensembles()[1][2];
        for bad in [
            Stump { feature_idx: 12, ..stump },
            Stump { threshold: f32::NAN, ..stump },
            Stump { weight: f32::INFINITY, ..stump },
        ] {
            let mut ensembles = boost.ensembles().to_vec();
            ensembles[1][2] = bad;
            let refused = Boost::from_parts(12, ensembles);
            assert!(matches!(refused, Err(BoostError::Damaged { class_idx: 1, stump_idx: 2, .. })));
        }
        assert_eq!(
            Boost::from_parts(12, Vec::new()),
            Err(BoostError::Labeled(LabeledError::TooFewClasses { n_classes: 0 }))
        );
    }

    #[test]
    fn what_cannot_be_trained_on_is_refused() {
        let rows = matrix(&[vec![0.0], vec![1.0]]);
        let config = Config::default();
        let train =
            |labels: &[usize], n_classes| Boost::train(&rows, labels, n_classes, &config).unwrap_err();
        assert_eq!(train(&[0, 0], 1), BoostError::Labeled(LabeledError::TooFewClasses { n_classes: 1 }));
        assert_eq!(train(&[0], 2), BoostError::Labeled(LabeledError::LabelCount { n_labels: 1, n_rows: 2 }));
        assert_eq!(train(&[0, 0], 2), BoostError::Labeled(LabeledError::EmptyClass { class_idx: 1 }));
        assert_eq!(
            train(&[0, 2], 2),
            BoostError::Labeled(LabeledError::UnknownLabel { row_idx: 1, label: 2, n_classes: 2 })
        );
        let infinite = matrix(&[vec![0.0], vec![f32::INFINITY]]);
        assert_eq!(
            Boost::train(&infinite, &[0, 1], 2, &config),
            Err(BoostError::Labeled(LabeledError::NotFinite { row_idx: 1 }))
        );
        let no_rounds = Boost::train(&rows, &[0, 1], 2, &Config { n_rounds: 0 });
        assert_eq!(no_rounds, Err(BoostError::Rounds { n_rounds: 0 }));
    }
}
