use super::*;
use crate::classify::svm::coupling::class_pairs;
use crate::classify::svm::tests::{Set, bags};
use crate::classify::svm::{Config, KernelConfig};
use proptest::prelude::*;

const GOLDENS: [(&str, &str); 3] = [
    (
        include_str!("../../../../tests/golden/libsvm_linear.model"),
        include_str!("../../../../tests/golden/libsvm_linear.json"),
    ),
    (
        include_str!("../../../../tests/golden/libsvm_rbf.model"),
        include_str!("../../../../tests/golden/libsvm_rbf.json"),
    ),
    (
        include_str!("../../../../tests/golden/libsvm_sigmoid.model"),
        include_str!("../../../../tests/golden/libsvm_sigmoid.json"),
    ),
];

/// What LIBSVM said of its own model; made by `tests/golden/libsvm_models.py`.
#[derive(serde::Deserialize)]
struct Golden {
    rows: Vec<Vec<f32>>,
    labels: Vec<i32>,
    decision_values: Vec<Vec<f32>>,
    #[serde(default)]
    probabilities: Vec<Vec<f32>>,
}

fn assert_near(found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-3, "{found} and {expected}");
    }
}

#[test]
fn files_of_libsvm_give_its_decision_values_and_probabilities() {
    for (text, golden) in GOLDENS {
        let golden: Golden = serde_json::from_str(golden).unwrap();
        let model = LibsvmModel::parse(text, Some(6)).unwrap();
        assert_eq!(model.labels, [3, 1, 12, -5]);
        for (row, expected) in golden.rows.iter().zip(&golden.decision_values) {
            assert_near(&model.svm.decision_values(row), expected);
        }
        assert_eq!(model.calibration.is_some(), !golden.probabilities.is_empty());
        for (row, expected) in golden.rows.iter().zip(&golden.probabilities) {
            let calibration = model.calibration.as_ref().unwrap();
            let found = calibration.probabilities(&model.svm.decision_values(row));
            // LIBSVM couples pairs to a larger tolerance.
            found.iter().zip(expected).for_each(|(found, expected)| assert!((found - expected).abs() < 0.01));
        }
    }
}

#[test]
fn training_on_the_rows_of_libsvm_gives_its_decision_values() {
    let kernels = [
        (KernelFunction::Linear, 5.0),
        (KernelFunction::Rbf { gamma: Some(0.7) }, 10.0),
        (KernelFunction::Sigmoid { gamma: Some(0.02), coef0: -1.0 }, 20.0),
    ];
    for ((text, golden), (kernel, c)) in GOLDENS.into_iter().zip(kernels) {
        let golden: Golden = serde_json::from_str(golden).unwrap();
        let names = LibsvmModel::parse(text, Some(6)).unwrap().labels;
        let label = |name| names.iter().position(|other| other == name).unwrap();
        let labels: Vec<usize> = golden.labels.iter().map(label).collect();
        let rows = Matrix::from_vec(golden.rows.concat(), 6).unwrap();
        let machines = Config { scheme: Scheme::OneVsOne, c, tolerance: 1e-6, ..Config::default() };
        let svm = KernelSvm::train(&rows, &labels, 4, &KernelConfig { kernel, machines }).unwrap();
        for (row, expected) in rows.rows().zip(&golden.decision_values) {
            assert_near(&svm.decision_values(row), expected);
        }
    }
}

#[test]
fn what_is_written_is_read_again() {
    for (text, _) in GOLDENS {
        let model = LibsvmModel::parse(text, Some(6)).unwrap();
        assert_eq!(LibsvmModel::parse(&model.to_text().unwrap(), Some(6)).unwrap(), model);
    }
    let Set { rows, labels, n_classes } = bags(31, 60, 3, 1.5);
    let machines = Config { scheme: Scheme::OneVsOne, ..Config::default() };
    let config = KernelConfig { machines, ..KernelConfig::default() };
    let svm = KernelSvm::train(&rows, &labels, n_classes, &config).unwrap();
    let model = LibsvmModel { svm, labels: vec![0, 1, 2], calibration: None };
    let text = model.to_text().unwrap();
    let again = LibsvmModel::parse(&text, Some(rows.n_cols())).unwrap();
    for row in rows.rows() {
        assert_near(&again.svm.decision_values(row), &model.svm.decision_values(row));
    }
    assert_eq!(again.to_text().unwrap(), text);
}

#[test]
fn libsvm_reads_what_is_written() {
    let (text, golden) = GOLDENS[1];
    let golden: Golden = serde_json::from_str(golden).unwrap();
    let text = LibsvmModel::parse(text, None).unwrap().to_text().unwrap();
    let model = libsvm_rs::io::load_model_from_reader(text.as_bytes()).unwrap();
    for (row, expected) in golden.rows.iter().zip(&golden.decision_values) {
        let nodes = crate::classify::svm::tests::libsvm_nodes(row);
        let values = crate::classify::svm::tests::libsvm_decision_values(&model, &nodes);
        assert_near(&values.iter().map(|&value| value as f32).collect::<Vec<_>>(), expected);
    }
}

#[test]
fn pairs_are_counted_in_their_order() {
    for n_classes in 2..9 {
        for (expected, (first, second)) in class_pairs(n_classes).enumerate() {
            assert_eq!(pair_idx(first, second, n_classes), expected);
            assert_eq!(pair_idx(second, first, n_classes), expected);
        }
    }
}

#[test]
fn errors_name_the_line_and_what_is_wrong() {
    let text = GOLDENS[1].0;
    let error = |from: &str, to: &str| {
        let text = text.replacen(from, to, 1);
        LibsvmModel::parse(&text, None).unwrap_err().to_string()
    };
    for (from, to, expected) in [
        ("c_svc", "nu_svc", "line 1: svm_type is nu_svc"),
        ("rbf", "polynomial", "line 2: kernel_type is polynomial"),
        ("gamma", "gama", "line 3: a header line begins with one of"),
        ("gamma 0.6", "gamma -0.6", "gamma is -0.7"),
        ("nr_class 4", "nr_class 18446744073709551615", "line 7: label needs numbers in range"),
        ("rho", "label 1\nlabel", "line 7: a second label"),
        ("rho 0", "rho nan", "line 6: rho needs numbers in range, 6 of them"),
        ("probA -", "probA ", "line 8: a probA that is not negative"),
        ("total_sv 48", "total_sv 47", "line 11: total_sv, nr_sv and the number of lines"),
        ("nr_sv 12", "nr_sv 18446744073709551615", "line 11: total_sv, nr_sv and the number of lines"),
        ("SV\n", "", "line 11: a header line begins"),
        ("SV\n1.5", "SV\nx", "line 12: a support vector begins with 3 finite coefficients"),
        (" 1:", " 0:", "line 12: a feature is index:value"),
        (" 2:", " 1:", "line 12: a feature is index:value"),
        (" 5:", " 99999999999:", "line 11: 48 x 99999999999 numbers are too many"),
    ] {
        let found = error(from, to);
        assert!(found.contains(expected), "{found}");
    }
    assert!(LibsvmModel::parse(text, Some(5)).unwrap_err().to_string().contains("rows have 5"));
    assert!(LibsvmModel::parse("", None).unwrap_err().to_string().contains("ends before the line SV"));
}

#[test]
fn what_the_files_cannot_hold_is_not_written() {
    let Set { rows, labels, n_classes } = bags(32, 30, 3, 1.0);
    let write = |kernel, scheme, labels_in_file: Vec<i32>| {
        let config = KernelConfig { kernel, machines: Config { scheme, ..Config::default() } };
        let svm = KernelSvm::train(&rows, &labels, n_classes, &config).unwrap();
        LibsvmModel { svm, labels: labels_in_file, calibration: None }.to_text()
    };
    let named = vec![7, 8, 9];
    assert!(write(KernelFunction::Linear, Scheme::OneVsOne, named.clone()).is_ok());
    for (kernel, scheme, labels) in [
        (KernelFunction::Linear, Scheme::OneVsAll, named.clone()),
        (KernelFunction::HistogramIntersection, Scheme::OneVsOne, named),
        (KernelFunction::Linear, Scheme::OneVsOne, vec![7]),
    ] {
        assert!(matches!(write(kernel, scheme, labels), Err(LibsvmError::NotWritable(_))));
    }
}

proptest! {
    #[test]
    fn any_text_is_refused_or_read(text in "[a-zA-Z0-9_ :.\\-\n]{0,300}") {
        let _ = LibsvmModel::parse(&text, None);
    }

    #[test]
    fn damaged_files_are_refused_or_answer(
        golden_idx in 0_usize..3,
        damage in prop::collection::vec((any::<prop::sample::Index>(), 0_u8..128), 1..6),
    ) {
        let mut bytes = GOLDENS[golden_idx].0.as_bytes().to_vec();
        for (index, byte) in damage {
            let room = index.index(bytes.len());
            bytes[room] = byte;
        }
        if let Ok(model) = LibsvmModel::parse(std::str::from_utf8(&bytes).unwrap(), None) {
            let values = model.svm.decision_values(&vec![0.5; model.svm.n_features()]);
            prop_assert!(values.iter().all(|value| value.is_finite()));
        }
    }
}
