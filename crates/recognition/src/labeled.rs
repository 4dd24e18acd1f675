//! Rows with the class of each: what classifiers are trained on.

use roomsight_vision::matrix::Matrix;

/// Why rows and labels are nothing to train on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the texts say it")]
pub enum LabeledError {
    #[error("at least two classes are needed, {n_classes} given: add rows of another class")]
    TooFewClasses { n_classes: usize },
    #[error("class {class_idx} has no row to train on: add rows of it, or leave the class out")]
    EmptyClass { class_idx: usize },
    #[error("{n_labels} labels for {n_rows} rows: every row needs exactly one")]
    LabelCount { n_labels: usize, n_rows: usize },
    #[error(
        "row {row_idx} has label {label}, but of {n_classes} classes the last is one less: mend the labels"
    )]
    UnknownLabel { row_idx: usize, label: usize, n_classes: usize },
    #[error("row {row_idx} holds a number that is not finite: remove the row or mend its features")]
    NotFinite { row_idx: usize },
}

/// That there are two classes or more.
pub fn check_n_classes(n_classes: usize) -> Result<(), LabeledError> {
    if n_classes < 2 { Err(LabeledError::TooFewClasses { n_classes }) } else { Ok(()) }
}

/// That each row is finite and has a label below `n_classes`.
pub fn check_rows(rows: &Matrix, labels: &[usize], n_classes: usize) -> Result<(), LabeledError> {
    check_n_classes(n_classes)?;
    if labels.len() != rows.n_rows() {
        return Err(LabeledError::LabelCount { n_labels: labels.len(), n_rows: rows.n_rows() });
    }
    if let Some(row_idx) = labels.iter().position(|&label| label >= n_classes) {
        return Err(LabeledError::UnknownLabel { row_idx, label: labels[row_idx], n_classes });
    }
    check_finite_rows(rows)
}

/// That no row holds a number that is not finite.
pub fn check_finite_rows(rows: &Matrix) -> Result<(), LabeledError> {
    match rows.rows().position(|row| row.iter().any(|value| !value.is_finite())) {
        Some(row_idx) => Err(LabeledError::NotFinite { row_idx }),
        None => Ok(()),
    }
}

/// That no class is without a row.
pub fn check_every_class_has_rows(labels: &[usize], n_classes: usize) -> Result<(), LabeledError> {
    match (0..n_classes).find(|class_idx| !labels.contains(class_idx)) {
        Some(class_idx) => Err(LabeledError::EmptyClass { class_idx }),
        None => Ok(()),
    }
}
