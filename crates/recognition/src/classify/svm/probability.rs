//! From decision values to probabilities.
//!
//! Each machine gets a sigmoid: the probability of its positive class at decision value f is
//! 1 / (1 + exp(-(slope f + offset))) (Platt, "Probabilistic Outputs for Support Vector Machines", 1999,
//! where A = -slope and B = -offset), fitted by Newton's method with backtracking (Lin, Lin and Weng,
//! "A Note on Platt's Probabilistic Outputs for Support Vector Machines", 2007).
//!
//! Two departures: the slope is held above a small positive limit, so that held-out rows that contradict
//! a machine make it unsure instead of turning its answer around; and a machine that has no held-out row
//! of one of its sides takes the mean sigmoid of the others.

use super::coupling::couple;
use super::{Machine, Scheme, SvmError, check_finite, check_n_classes, check_rows, check_shape, to_f32};
use roomsight_vision::matrix::Matrix;

/// The smallest slope: how much the log-odds change at least over one margin, or over the range of the
/// held-out decision values if that is wider.
const MIN_SLOPE: f64 = 0.1;

const MAX_STEPS: usize = 100;

/// Turns decision values into probabilities: one sigmoid a machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    scheme: Scheme,
    n_classes: usize,
    slopes: Vec<f32>,
    offsets: Vec<f32>,
}

impl Calibration {
    /// Fits the sigmoids to `decision_values` (n x n_machines) of rows that the SVM was **not** trained
    /// on; row i is of class `labels[i]` < `n_classes`. Classes may be without rows.
    ///
    /// # Errors
    /// Fewer than two classes, a label too many or out of range, a number of columns other than
    /// [`Scheme::n_machines`], decision values that are not finite.
    pub fn fit(
        scheme: Scheme,
        decision_values: &Matrix,
        labels: &[usize],
        n_classes: usize,
    ) -> Result<Self, SvmError> {
        let samples = Samples::of_machines(scheme, decision_values, labels, n_classes)?;
        let fitted: Vec<Option<Sigmoid>> =
            samples.into_iter().map(|samples| samples.scaled().fit()).collect();
        let fallback = Sigmoid::mean(&fitted);
        let sigmoids = fitted.into_iter().map(|sigmoid| sigmoid.unwrap_or(fallback));
        let (slopes, offsets) = sigmoids.map(Sigmoid::to_f32).unzip();
        Self::from_parts(scheme, n_classes, slopes, offsets)
    }

    /// As [`Calibration::fit`], but with the same sigmoid for all machines. With one machine a class, the
    /// most probable class is then always the one of the largest decision value: held-out rows can make the
    /// answers less sure, but never change them.
    ///
    /// # Errors
    /// As [`Calibration::fit`].
    pub fn fit_shared(
        scheme: Scheme,
        decision_values: &Matrix,
        labels: &[usize],
        n_classes: usize,
    ) -> Result<Self, SvmError> {
        let samples = Samples::of_machines(scheme, decision_values, labels, n_classes)?;
        let n_machines = samples.len();
        let shared = samples.into_iter().reduce(Samples::joined).and_then(|samples| samples.scaled().fit());
        let (slope, offset) = shared.unwrap_or_else(|| Sigmoid::mean(&[])).to_f32();
        Self::from_parts(scheme, n_classes, vec![slope; n_machines], vec![offset; n_machines])
    }

    /// Puts a calibration together from its arrays, as [`Calibration::slopes`] and
    /// [`Calibration::offsets`] gave them.
    ///
    /// # Errors
    /// Arrays whose lengths do not agree with `scheme` and `n_classes`, numbers that are not finite, or
    /// slopes that are not positive.
    pub fn from_parts(
        scheme: Scheme,
        n_classes: usize,
        slopes: Vec<f32>,
        offsets: Vec<f32>,
    ) -> Result<Self, SvmError> {
        check_n_classes(n_classes)?;
        let expected = scheme.n_machines(n_classes);
        check_shape("slopes", slopes.len(), expected)?;
        check_shape("offsets", offsets.len(), expected)?;
        for (machine_idx, (slope, offset)) in slopes.iter().zip(&offsets).enumerate() {
            check_finite("slopes", machine_idx, &[*slope])?;
            check_finite("offsets", machine_idx, &[*offset])?;
            if *slope <= 0.0 {
                let reason = "they are not positive";
                return Err(SvmError::Damaged { name: "slopes", machine_idx, reason });
            }
        }
        Ok(Self { scheme, n_classes, slopes, offsets })
    }

    /// One probability a class, summing to 1, for the finite decision values of one row. The answer is
    /// [`most_probable`] of them. Panics when there is not one decision value a machine.
    pub fn probabilities(&self, decision_values: &[f32]) -> Vec<f32> {
        assert_eq!(decision_values.len(), self.slopes.len(), "decision values of other machines");
        let sigmoids = self.slopes.iter().zip(&self.offsets);
        let log_odds: Vec<f64> = sigmoids
            .zip(decision_values)
            .map(|((slope, offset), value)| f64::from(*slope) * f64::from(*value) + f64::from(*offset))
            .collect();
        let probabilities = match self.scheme {
            Scheme::OneVsAll => normalized(&log_odds),
            Scheme::OneVsOne => {
                let pairs: Vec<f64> = log_odds.iter().map(|z| 1.0 / (1.0 + (-z).exp())).collect();
                couple(&pairs, self.n_classes)
            }
        };
        probabilities.into_iter().map(|probability| probability as f32).collect()
    }

    /// How the machines are put together.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// The number of classes.
    pub fn n_classes(&self) -> usize {
        self.n_classes
    }

    /// The slope of each machine's sigmoid, positive, in log-odds a unit of decision value.
    pub fn slopes(&self) -> &[f32] {
        &self.slopes
    }

    /// The offset of each machine's sigmoid: the log-odds at decision value zero.
    pub fn offsets(&self) -> &[f32] {
        &self.offsets
    }
}

/// The index of the largest probability, the first of equal ones; 0 of none.
pub fn most_probable(probabilities: &[f32]) -> usize {
    let mut best = (f32::NEG_INFINITY, 0);
    for (class_idx, &probability) in probabilities.iter().enumerate() {
        if probability > best.0 {
            best = (probability, class_idx);
        }
    }
    best.1
}

/// The sigmoids of `log_odds`, divided by their sum. In logarithms, because all of them may be too small
/// for a floating-point number.
fn normalized(log_odds: &[f64]) -> Vec<f64> {
    let logs: Vec<f64> = log_odds.iter().map(|&z| -log_one_plus_exp(-z)).collect();
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let scaled: Vec<f64> = logs.iter().map(|log| (log - largest).exp()).collect();
    let sum: f64 = scaled.iter().sum();
    scaled.iter().map(|value| value / sum).collect()
}

/// ln(1 + exp(x)), without overflow.
fn log_one_plus_exp(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Sigmoid {
    slope: f64,
    offset: f64,
}

impl Sigmoid {
    /// The mean of the fitted ones; without any the decision value is taken for the log-odds.
    fn mean(fitted: &[Option<Self>]) -> Self {
        let n = fitted.iter().flatten().count() as f64;
        if n == 0.0 {
            return Self { slope: 1.0, offset: 0.0 };
        }
        let mean = |part: fn(&Self) -> f64| fitted.iter().flatten().map(part).sum::<f64>() / n;
        Self { slope: mean(|sigmoid| sigmoid.slope), offset: mean(|sigmoid| sigmoid.offset) }
    }

    fn to_f32(self) -> (f32, f32) {
        (to_f32(self.slope).max(f32::MIN_POSITIVE), to_f32(self.offset))
    }
}

/// What one sigmoid is fitted to.
struct Samples {
    /// Decision values over `scale`: at most 1 in magnitude.
    values: Vec<f64>,
    positive: Vec<bool>,
    scale: f64,
}

impl Samples {
    /// One a machine, not yet scaled.
    fn of_machines(
        scheme: Scheme,
        decision_values: &Matrix,
        labels: &[usize],
        n_classes: usize,
    ) -> Result<Vec<Self>, SvmError> {
        check_rows(decision_values, labels, n_classes)?;
        check_shape("decision values", decision_values.n_cols(), scheme.n_machines(n_classes))?;
        let of = |(machine_idx, machine): (usize, Machine)| {
            let (values, positive): (Vec<f64>, Vec<bool>) = decision_values
                .rows()
                .zip(labels)
                .filter_map(|(row, &label)| Some((f64::from(row[machine_idx]), machine.side(label)?)))
                .unzip();
            Self { values, positive, scale: 1.0 }
        };
        Ok(scheme.machines(n_classes).into_iter().enumerate().map(of).collect())
    }

    fn joined(mut self, other: Self) -> Self {
        self.values.extend(other.values);
        self.positive.extend(other.positive);
        self
    }

    fn scaled(mut self) -> Self {
        self.scale = self.values.iter().fold(1.0, |scale: f64, value| scale.max(value.abs()));
        self.values.iter_mut().for_each(|value| *value /= self.scale);
        self
    }

    /// `None` when there is no sample of one side.
    fn fit(&self) -> Option<Sigmoid> {
        let n_positive = self.positive.iter().filter(|&&is_positive| is_positive).count() as f64;
        let n_negative = self.positive.len() as f64 - n_positive;
        if n_positive == 0.0 || n_negative == 0.0 {
            return None;
        }
        // Platt's targets: as if one more row of each side had been seen on the wrong one.
        let (high, low) = ((n_positive + 1.0) / (n_positive + 2.0), 1.0 / (n_negative + 2.0));
        let targets: Vec<f64> =
            self.positive.iter().map(|&is_positive| if is_positive { high } else { low }).collect();
        let prior = Sigmoid { slope: 0.0, offset: ((n_positive + 1.0) / (n_negative + 1.0)).ln() };
        let mut fitted = self.minimize(&targets, prior, true);
        if fitted.slope < MIN_SLOPE {
            fitted = self.minimize(&targets, Sigmoid { slope: MIN_SLOPE, ..prior }, false);
        }
        Some(Sigmoid { slope: fitted.slope / self.scale, ..fitted })
    }

    /// Newton's method with backtracking from `sigmoid`, with the slope free or fixed.
    fn minimize(&self, targets: &[f64], mut sigmoid: Sigmoid, slope_is_free: bool) -> Sigmoid {
        /// Keeps the Hessian regular.
        const RIDGE: f64 = 1e-12;
        let mut loss = self.loss(targets, sigmoid);
        for _ in 0..MAX_STEPS {
            let (mut g_slope, mut g_offset) = (0.0, 0.0);
            let (mut h_slope, mut h_offset, mut h_mixed) = (RIDGE, RIDGE, 0.0);
            for (&value, &target) in self.values.iter().zip(targets) {
                let p = 1.0 / (1.0 + (-(sigmoid.slope * value + sigmoid.offset)).exp());
                let curvature = p * (1.0 - p);
                g_slope += value * (p - target);
                g_offset += p - target;
                h_slope += value * value * curvature;
                h_mixed += value * curvature;
                h_offset += curvature;
            }
            if !slope_is_free {
                (g_slope, h_mixed) = (0.0, 0.0);
            }
            if g_slope.abs() < 1e-7 && g_offset.abs() < 1e-7 {
                break;
            }
            let determinant = h_slope * h_offset - h_mixed * h_mixed;
            let d_slope = -(h_offset * g_slope - h_mixed * g_offset) / determinant;
            let d_offset = -(h_slope * g_offset - h_mixed * g_slope) / determinant;
            let descent = g_slope * d_slope + g_offset * d_offset;
            let tried = std::iter::successors(Some(1.0), |step| Some(step / 2.0))
                .take_while(|&step| step >= 1e-10)
                .map(|step| {
                    let slope = sigmoid.slope + step * d_slope;
                    let next = Sigmoid { slope, offset: sigmoid.offset + step * d_offset };
                    (step, next, self.loss(targets, next))
                })
                .find(|(step, _, next_loss)| *next_loss < loss + 1e-4 * step * descent);
            let Some((_, next, next_loss)) = tried else { break };
            (sigmoid, loss) = (next, next_loss);
        }
        sigmoid
    }

    /// The cross entropy between `targets` and the probabilities.
    fn loss(&self, targets: &[f64], sigmoid: Sigmoid) -> f64 {
        let log_odds = self.values.iter().map(|value| sigmoid.slope * value + sigmoid.offset);
        log_odds.zip(targets).map(|(z, target)| log_one_plus_exp(z) - target * z).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labeled::LabeledError;
    use proptest::prelude::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Decision values of two machines that are each other's negative; larger for the first class by
    /// `distance` on average.
    fn two_classes(seed: u64, n_rows: usize, distance: f32) -> (Matrix, Vec<usize>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let labels: Vec<usize> = (0..n_rows).map(|row_idx| usize::from(row_idx % 3 == 0)).collect();
        let mut values = Matrix::new(2);
        for &label in &labels {
            let value = rng.random::<f32>() * 2.0 - if label == 0 { 0.5 } else { 0.5 + distance };
            values.push_row(&[value, -value]);
        }
        (values, labels)
    }

    #[test]
    fn the_sigmoid_is_that_of_libsvm() {
        for seed in 0..5 {
            let (values, labels) = two_classes(seed, 150, 0.8);
            let calibration = Calibration::fit(Scheme::OneVsAll, &values, &labels, 2).unwrap();
            for machine_idx in 0..2 {
                let column: Vec<f64> = values.rows().map(|row| f64::from(row[machine_idx])).collect();
                let targets: Vec<f64> =
                    labels.iter().map(|&label| if label == machine_idx { 1.0 } else { -1.0 }).collect();
                let (a, b) = libsvm_rs::probability::sigmoid_train(&column, &targets);
                assert!((f64::from(calibration.slopes()[machine_idx]) + a).abs() < 1e-3);
                assert!((f64::from(calibration.offsets()[machine_idx]) + b).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn held_out_rows_that_contradict_do_not_turn_the_answer_around() {
        let (values, labels) = two_classes(0, 150, -3.0);
        for (scheme, n_machines) in [(Scheme::OneVsAll, 2), (Scheme::OneVsOne, 1)] {
            let mut columns = Matrix::new(n_machines);
            values.rows().for_each(|row| columns.push_row(&row[..n_machines]));
            let calibration = Calibration::fit(scheme, &columns, &labels, 2).unwrap();
            assert!(calibration.slopes().iter().all(|&slope| slope > 0.0));
            let first = |value: f32| calibration.probabilities(&[value, -value][..n_machines])[0];
            assert!(first(2.0) > first(0.0) && first(0.0) > first(-2.0));
            assert!(first(2.0) - first(-2.0) < 0.2, "it is unsure");
        }
    }

    #[test]
    fn a_shared_sigmoid_never_changes_the_answer() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut values = Matrix::new(4);
        let labels: Vec<usize> = (0..80).map(|row_idx| row_idx % 4).collect();
        labels.iter().for_each(|_| values.push_row(&std::array::from_fn::<f32, 4, _>(|_| rng.random())));
        let calibration = Calibration::fit_shared(Scheme::OneVsAll, &values, &labels, 4).unwrap();
        for row in values.rows() {
            assert_eq!(most_probable(&calibration.probabilities(row)), most_probable(row));
        }
    }

    #[test]
    fn a_class_without_held_out_rows_takes_the_mean_sigmoid() {
        let (two, labels) = two_classes(1, 90, 1.0);
        let mut values = Matrix::new(3);
        two.rows().for_each(|row| values.push_row(&[row[0], row[1], -1.0]));
        let calibration = Calibration::fit(Scheme::OneVsAll, &values, &labels, 3).unwrap();
        let slopes = calibration.slopes();
        assert!((slopes[2] - (slopes[0] + slopes[1]) / 2.0).abs() < 1e-6);
        assert_eq!(most_probable(&calibration.probabilities(&[-1.0, -1.0, 2.0])), 2);
    }

    #[test]
    fn without_any_held_out_row_the_largest_decision_value_wins() {
        let calibration = Calibration::fit(Scheme::OneVsAll, &Matrix::new(3), &[], 3).unwrap();
        assert_eq!(most_probable(&calibration.probabilities(&[-1.0, -0.5, -2.0])), 1);
    }

    #[test]
    fn equal_decision_values_give_the_share_of_rows() {
        for value in [0.0, -3.0, 1e30] {
            let values = Matrix::from_vec(vec![value; 40], 1).unwrap();
            let labels: Vec<usize> = (0..40).map(|row_idx| usize::from(row_idx >= 30)).collect();
            let calibration = Calibration::fit(Scheme::OneVsOne, &values, &labels, 2).unwrap();
            let probability = calibration.probabilities(&[value])[0];
            assert!((probability - 0.75).abs() < 0.03, "{value}: {probability}");
        }
    }

    #[test]
    fn bad_held_out_sets_and_damaged_parts_are_refused() {
        let (values, labels) = two_classes(2, 30, 1.0);
        let fit = |values, labels, n_classes| Calibration::fit(Scheme::OneVsAll, values, labels, n_classes);
        assert!(matches!(
            fit(&values, &labels, 1),
            Err(SvmError::Labeled(LabeledError::TooFewClasses { .. }))
        ));
        assert!(matches!(fit(&values, &labels, 3), Err(SvmError::WrongShape { .. })));
        assert!(matches!(
            fit(&values, &labels[1..], 2),
            Err(SvmError::Labeled(LabeledError::LabelCount { .. }))
        ));
        let mut broken = values.clone();
        broken.row_mut(7)[0] = f32::NAN;
        assert_eq!(fit(&broken, &labels, 2), Err(SvmError::Labeled(LabeledError::NotFinite { row_idx: 7 })));

        let fitted = fit(&values, &labels, 2).unwrap();
        let from = |slopes: &[f32], offsets: &[f32]| {
            Calibration::from_parts(Scheme::OneVsAll, 2, slopes.to_vec(), offsets.to_vec())
        };
        assert_eq!(from(fitted.slopes(), fitted.offsets()).unwrap(), fitted);
        assert!(matches!(from(&[1.0], &[0.0, 0.0]), Err(SvmError::WrongShape { name: "slopes", .. })));
        assert!(matches!(from(&[1.0, 1.0], &[0.0]), Err(SvmError::WrongShape { name: "offsets", .. })));
        for bad in [-1.0, 0.0, f32::NAN, f32::INFINITY] {
            assert!(matches!(from(&[1.0, bad], &[0.0, 0.0]), Err(SvmError::Damaged { machine_idx: 1, .. })));
        }
    }

    #[test]
    fn a_row_that_every_machine_rejects_goes_to_the_one_that_rejects_it_least() {
        let calibration = Calibration::from_parts(Scheme::OneVsAll, 3, vec![1.0; 3], vec![0.0; 3]).unwrap();
        assert_eq!(calibration.probabilities(&[-2e30, -1e30, -3e30]), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn the_first_of_equal_probabilities_is_the_most_probable() {
        assert_eq!(most_probable(&[0.2, 0.4, 0.4]), 1);
        assert_eq!(most_probable(&[0.5, 0.5]), 0);
    }

    /// Any finite number; small ones, at which sigmoids are not flat, half of the time.
    fn finite() -> impl Strategy<Value = f32> {
        prop_oneof![-20.0_f32..20.0, proptest::num::f32::NORMAL]
    }

    proptest! {
        #[test]
        fn probabilities_are_a_distribution(
            n_classes in 2_usize..8,
            one_vs_one in any::<bool>(),
            numbers in proptest::collection::vec((finite(), finite(), finite()), 28),
        ) {
            let scheme = if one_vs_one { Scheme::OneVsOne } else { Scheme::OneVsAll };
            let used = &numbers[..scheme.n_machines(n_classes)];
            let slopes = used.iter().map(|numbers| numbers.0.abs().max(f32::MIN_POSITIVE)).collect();
            let offsets = used.iter().map(|numbers| numbers.1).collect();
            let values: Vec<f32> = used.iter().map(|numbers| numbers.2).collect();
            let calibration = Calibration::from_parts(scheme, n_classes, slopes, offsets).unwrap();
            let probabilities = calibration.probabilities(&values);
            prop_assert_eq!(probabilities.len(), n_classes);
            prop_assert!(probabilities.iter().all(|p| (0.0..=1.0).contains(p)), "{:?}", probabilities);
            prop_assert!((probabilities.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{:?}", probabilities);
        }

        #[test]
        fn fitting_any_finite_values_gives_finite_sigmoids(
            rows in proptest::collection::vec((finite(), finite(), finite(), 0_usize..3), 0..30),
            one_vs_one in any::<bool>(),
        ) {
            let scheme = if one_vs_one { Scheme::OneVsOne } else { Scheme::OneVsAll };
            let mut values = Matrix::new(3);
            rows.iter().for_each(|row| values.push_row(&[row.0, row.1, row.2]));
            let labels: Vec<usize> = rows.iter().map(|row| row.3).collect();
            let calibration = Calibration::fit(scheme, &values, &labels, 3);
            prop_assert!(calibration.is_ok(), "{:?}", calibration);
        }
    }
}
