use super::kernel::Kernel;
use super::smo::{self, Problem};
use super::*;
use libsvm_rs::predict::predict_values;
use libsvm_rs::{KernelType, SvmNode, SvmParameter, SvmProblem, SvmType};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use roomsight_vision::matrix::Matrix;

/// A training set, row i of class i modulo the number of classes.
pub(super) struct Set {
    pub(super) rows: Matrix,
    pub(super) labels: Vec<usize>,
    pub(super) n_classes: usize,
}

/// Bag-like rows (some zeros, sum 1) around one center a class. Classes overlap as `noise` grows.
pub(super) fn bags(seed: u64, n_rows: usize, n_classes: usize, noise: f32) -> Set {
    const N_WORDS: usize = 13;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let centers: Vec<[f32; N_WORDS]> = (0..n_classes).map(|_| rng.random()).collect();
    let labels: Vec<usize> = (0..n_rows).map(|row_idx| row_idx % n_classes).collect();
    let mut rows = Matrix::new(N_WORDS);
    for &label in &labels {
        let mut row = centers[label].map(|word| (word - 0.5 + noise * (rng.random::<f32>() - 0.5)).max(0.0));
        let sum = row.iter().sum::<f32>().max(1e-3);
        row.iter_mut().for_each(|word| *word /= sum);
        rows.push_row(&row);
    }
    Set { rows, labels, n_classes }
}

/// Makes every tenth row equal to an earlier one, mostly of another class.
pub(super) fn with_duplicates(mut set: Set) -> Set {
    for row_idx in (10..set.rows.n_rows()).step_by(10) {
        let earlier = set.rows.row(row_idx - 7).to_vec();
        set.rows.row_mut(row_idx).copy_from_slice(&earlier);
    }
    set
}

pub(super) fn libsvm_nodes(row: &[f32]) -> Vec<SvmNode> {
    (1..).zip(row).map(|(index, &value)| SvmNode { index, value: f64::from(value) }).collect()
}

/// Trains LIBSVM's port, our oracle, to a tight tolerance.
fn libsvm(rows: &Matrix, labels: &[f64], c: f64, weight: Vec<(i32, f64)>) -> libsvm_rs::SvmModel {
    libsvm_rs::set_quiet(true);
    let problem = SvmProblem { labels: labels.to_vec(), instances: rows.rows().map(libsvm_nodes).collect() };
    let parameter = SvmParameter {
        svm_type: SvmType::CSvc,
        kernel_type: KernelType::Linear,
        c,
        weight,
        eps: 1e-6,
        ..SvmParameter::default()
    };
    libsvm_rs::train::svm_train(&problem, &parameter)
}

pub(super) fn libsvm_decision_values(model: &libsvm_rs::SvmModel, nodes: &[SvmNode]) -> Vec<f64> {
    let mut values = vec![0.0; model.nr_class * (model.nr_class - 1) / 2];
    predict_values(model, nodes, &mut values);
    values
}

/// 1/2 a'Qa - e'a, from the signed multipliers, in f64 throughout.
fn objective(rows: &Matrix, multipliers: &[f64]) -> f64 {
    let mut weights = vec![0.0; rows.n_cols()];
    for (row, multiplier) in rows.rows().zip(multipliers) {
        weights.iter_mut().zip(row).for_each(|(weight, x)| *weight += multiplier * f64::from(*x));
    }
    let quadratic: f64 = weights.iter().map(|weight| weight * weight).sum();
    quadratic / 2.0 - multipliers.iter().map(|multiplier| multiplier.abs()).sum::<f64>()
}

fn tight(scheme: Scheme, c: f64) -> Config {
    Config { scheme, c, tolerance: 1e-6, ..Config::default() }
}

#[test]
fn binary_objective_and_decision_values_equal_those_of_libsvm() {
    for seed in 0..4 {
        for (noise, c) in [(0.2, 0.1), (0.2, 100.0), (1.0, 1.0), (2.0, 0.1), (2.0, 10.0), (2.0, 100.0)] {
            let Set { rows, labels, .. } = with_duplicates(bags(seed, 90, 2, noise));
            let positive: Vec<bool> = labels.iter().map(|&label| label == 0).collect();
            let targets: Vec<f64> = positive.iter().map(|&p| if p { 1.0 } else { -1.0 }).collect();
            let problem = Problem {
                positive: &positive,
                c_positive: c,
                c_negative: c,
                tolerance: 1e-6,
                shrinking: false,
            };
            let ours = smo::solve(&Kernel::new(&rows, KernelFunction::Linear).unwrap(), &problem).unwrap();

            let model = libsvm(&rows, &targets, c, vec![]);
            let mut theirs = vec![0.0; rows.n_rows()];
            for (&index, &coefficient) in model.sv_indices.iter().zip(&model.sv_coef[0]) {
                theirs[index - 1] = coefficient;
            }
            let (ours_at, theirs_at) = (objective(&rows, &ours.multipliers), objective(&rows, &theirs));
            assert!(
                (ours_at - theirs_at).abs() <= 1e-4 * theirs_at.abs(),
                "seed {seed}, noise {noise}, c {c}: {ours_at} and {theirs_at}"
            );
            assert!(ours.multipliers.iter().sum::<f64>().abs() < 1e-9 * c * rows.n_rows() as f64);
            for (multiplier, positive) in ours.multipliers.iter().zip(positive) {
                let alpha = if positive { *multiplier } else { -multiplier };
                assert!((0.0..=c).contains(&alpha));
            }
            let weights = linear::collapse(&ours, &rows);
            for row in rows.rows() {
                let value = function::dot(&weights, row) - ours.rho;
                let expected = libsvm_decision_values(&model, &libsvm_nodes(row))[0];
                assert!((value - expected).abs() < 2e-3, "{value} and {expected}");
            }
        }
    }
}

#[test]
fn one_vs_one_decision_values_equal_those_of_libsvm() {
    for (seed, c) in [(5, 0.1), (6, 10.0), (7, 100.0)] {
        let set = with_duplicates(bags(seed, 120, 4, 1.5));
        let svm =
            LinearSvm::train(&set.rows, &set.labels, set.n_classes, &tight(Scheme::OneVsOne, c)).unwrap();
        let labels: Vec<f64> = set.labels.iter().map(|&label| label as f64).collect();
        let model = libsvm(&set.rows, &labels, c, vec![]);
        assert_eq!(model.label, [0, 1, 2, 3]);
        for row in set.rows.rows() {
            for (value, expected) in
                svm.decision_values(row).iter().zip(libsvm_decision_values(&model, &libsvm_nodes(row)))
            {
                assert!((f64::from(*value) - expected).abs() < 2e-3, "{value} and {expected}");
            }
        }
    }
}

#[test]
fn balanced_one_vs_all_equals_libsvm_with_weights() {
    let set = with_duplicates(bags(8, 100, 5, 1.5));
    let config = Config { class_weights: ClassWeights::Balanced, ..tight(Scheme::OneVsAll, 10.0) };
    let svm = LinearSvm::train(&set.rows, &set.labels, set.n_classes, &config).unwrap();
    for class_idx in 0..set.n_classes {
        let labels: Vec<f64> =
            set.labels.iter().map(|&label| if label == class_idx { 1.0 } else { -1.0 }).collect();
        // A fifth of the rows is positive: n / (2 n_side) is 5/2 and 5/8.
        let model = libsvm(&set.rows, &labels, 10.0, vec![(1, 2.5), (-1, 0.625)]);
        let sign = f64::from(model.label[0]);
        assert_eq!(svm.n_support_vectors()[class_idx], model.sv.len());
        for row in set.rows.rows() {
            let value = f64::from(svm.decision_values(row)[class_idx]);
            let expected = sign * libsvm_decision_values(&model, &libsvm_nodes(row))[0];
            assert!((value - expected).abs() < 2e-3, "{value} and {expected}");
        }
    }
}

#[test]
fn equal_rows_of_different_classes_still_converge() {
    let rows = Matrix::from_vec([0.25, 0.75].repeat(8), 2).unwrap();
    let labels = [0, 1, 0, 1, 0, 1, 1, 1];
    for scheme in [Scheme::OneVsAll, Scheme::OneVsOne] {
        let svm = LinearSvm::train(&rows, &labels, 2, &tight(scheme, 1.0)).unwrap();
        assert!(svm.decision_values(rows.row(0))[0] < 0.0, "the majority wins");
    }
}

#[test]
fn any_number_of_threads_trains_the_same_machine() {
    let set = with_duplicates(bags(9, 150, 5, 2.0));
    for scheme in [Scheme::OneVsAll, Scheme::OneVsOne] {
        let train = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            let config = Config { scheme, ..Config::default() };
            pool.install(|| LinearSvm::train(&set.rows, &set.labels, set.n_classes, &config).unwrap())
        };
        assert_eq!(train(1), train(2));
    }
}

#[test]
fn a_trained_machine_recognizes_its_rows() {
    let set = bags(10, 100, 5, 0.3);
    for scheme in [Scheme::OneVsAll, Scheme::OneVsOne] {
        let config = Config { scheme, c: 100.0, ..Config::default() };
        let svm = LinearSvm::train(&set.rows, &set.labels, set.n_classes, &config).unwrap();
        let mut decision_values = Matrix::new(scheme.n_machines(set.n_classes));
        set.rows.rows().for_each(|row| decision_values.push_row(&svm.decision_values(row)));
        let calibration = Calibration::fit(scheme, &decision_values, &set.labels, set.n_classes).unwrap();
        let answers: Vec<usize> =
            decision_values.rows().map(|values| most_probable(&calibration.probabilities(values))).collect();
        assert_eq!(answers, set.labels);
    }
}

#[test]
fn bad_training_sets_are_refused() {
    let set = bags(11, 12, 3, 1.0);
    let train = |rows: &Matrix, labels: &[usize], n_classes, config: &Config| {
        LinearSvm::train(rows, labels, n_classes, config).unwrap_err()
    };
    let config = Config::default();
    assert_eq!(
        train(&set.rows, &[0; 12], 1, &config),
        SvmError::Labeled(LabeledError::TooFewClasses { n_classes: 1 })
    );
    assert_eq!(
        train(&set.rows, &set.labels, 4, &config),
        SvmError::Labeled(LabeledError::EmptyClass { class_idx: 3 })
    );
    assert_eq!(
        train(&set.rows, &set.labels, usize::MAX, &config),
        SvmError::Labeled(LabeledError::EmptyClass { class_idx: 3 })
    );
    assert_eq!(
        train(&set.rows, &set.labels[1..], 3, &config),
        SvmError::Labeled(LabeledError::LabelCount { n_labels: 11, n_rows: 12 })
    );
    assert_eq!(
        train(&set.rows, &set.labels, 2, &config),
        SvmError::Labeled(LabeledError::UnknownLabel { row_idx: 2, label: 2, n_classes: 2 })
    );
    for value in [f32::NAN, f32::INFINITY] {
        let mut rows = set.rows.clone();
        rows.row_mut(4)[3] = value;
        assert_eq!(
            train(&rows, &set.labels, 3, &config),
            SvmError::Labeled(LabeledError::NotFinite { row_idx: 4 })
        );
    }
    let mut rows = set.rows.clone();
    rows.row_mut(4)[3] = 1e30;
    assert_eq!(train(&rows, &set.labels, 3, &config), SvmError::TooLarge { row_idx: 4 });
    for c in [0.0, -1.0, f64::INFINITY] {
        let config = Config { c, ..Config::default() };
        assert_eq!(train(&set.rows, &set.labels, 3, &config), SvmError::NotPositive { name: "c", value: c });
    }
}

#[test]
fn parts_make_the_same_machine_and_damaged_ones_are_refused() {
    let set = bags(12, 30, 3, 1.0);
    let svm = LinearSvm::train(&set.rows, &set.labels, 3, &Config::default()).unwrap();
    let parts = || (svm.weights().clone(), svm.rho().to_vec(), svm.n_support_vectors().to_vec());
    let from = |n_classes, (weights, rho, counts)| {
        LinearSvm::from_parts(Scheme::OneVsAll, n_classes, weights, rho, counts)
    };
    assert_eq!(from(3, parts()).unwrap(), svm);
    assert!(matches!(from(4, parts()), Err(SvmError::WrongShape { name: "weights", .. })));
    assert!(matches!(from(1, parts()), Err(SvmError::Labeled(LabeledError::TooFewClasses { .. }))));
    let (weights, mut rho, counts) = parts();
    rho[2] = f32::NAN;
    assert!(matches!(from(3, (weights, rho, counts)), Err(SvmError::Damaged { machine_idx: 2, .. })));
    let (mut weights, rho, counts) = parts();
    weights.row_mut(1)[0] = f32::INFINITY;
    assert!(matches!(from(3, (weights, rho, counts)), Err(SvmError::Damaged { machine_idx: 1, .. })));
    let (weights, rho, mut counts) = parts();
    counts.pop();
    assert!(matches!(from(3, (weights, rho, counts)), Err(SvmError::WrongShape { .. })));
}

#[test]
fn configuration_has_defaults_and_refuses_unknown_fields() {
    assert_eq!(serde_json::from_str::<Config>("{}").unwrap(), Config::default());
    let config: Config =
        serde_json::from_str(r#"{"scheme": "one_vs_one", "class_weights": "balanced"}"#).unwrap();
    assert_eq!((config.scheme, config.class_weights), (Scheme::OneVsOne, ClassWeights::Balanced));
    assert!(serde_json::from_str::<Config>(r#"{"C": 1}"#).is_err());
}

proptest! {
    #[test]
    fn decision_values_are_finite(
        weights in proptest::collection::vec(proptest::num::f32::NORMAL, 6),
        rho in proptest::collection::vec(proptest::num::f32::NORMAL, 2),
        row in proptest::collection::vec(proptest::num::f32::NORMAL, 3),
    ) {
        let weights = Matrix::from_vec(weights, 3).unwrap();
        let svm = LinearSvm::from_parts(Scheme::OneVsAll, 2, weights, rho, vec![0; 2]).unwrap();
        prop_assert!(svm.decision_values(&row).iter().all(|value| value.is_finite()));
    }
}
