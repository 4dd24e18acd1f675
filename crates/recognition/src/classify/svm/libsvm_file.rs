//! Model files of LIBSVM: one-vs-one C-SVC with the linear, RBF or sigmoid kernel.
//!
//! A header of `key values` lines up to the line `SV`; then one support vector a line, grouped by class: for
//! each other class its coefficient in that pair, then `index:value` of the features other than zero,
//! indices from 1 (Chang and Lin, "LIBSVM: A Library for Support Vector Machines", 2011, and its README).

#[cfg(test)]
mod tests;

use super::{Calibration, DualSvm, KernelFunction, KernelSvm, Scheme, SvmError, check_n_classes};
use roomsight_vision::matrix::Matrix;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The most numbers that the support vectors, or their coefficients, of a file may come to: 256 MiB.
const MAX_NUMBERS: usize = 1 << 26;

const KEYS: [&str; 12] = [
    "svm_type",
    "kernel_type",
    "degree",
    "gamma",
    "coef0",
    "nr_class",
    "total_sv",
    "rho",
    "label",
    "probA",
    "probB",
    "nr_sv",
];

/// Why a model file was not read or not written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LibsvmError {
    /// A line that cannot be understood.
    #[error("line {line}: {reason}")]
    Line {
        /// Counted from 1.
        line: usize,
        /// What is wrong, and what was expected.
        reason: String,
    },
    /// The lines can be understood, but make no SVM.
    #[error("the file holds no usable SVM: {0}")]
    Svm(#[from] SvmError),
    /// The SVM has no form in these files.
    #[error("LIBSVM's files cannot hold {0}: train a one-vs-one SVM with the linear, RBF or sigmoid kernel")]
    NotWritable(&'static str),
}

/// What a model file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct LibsvmModel {
    /// The machines; one-vs-one.
    pub svm: KernelSvm,
    /// The label of each class in the file.
    pub labels: Vec<i32>,
    /// From decision values to probabilities, where the file has it.
    pub calibration: Option<Calibration>,
}

impl LibsvmModel {
    /// Reads the text of a model file, of any origin. Files leave out features that are zero; so
    /// `n_features` is the width of a row where it is known, or the largest index is.
    ///
    /// # Errors
    /// Anything that is not such a model; support vectors wider than `n_features`; probabilities that fall
    /// as decision values rise; more than about 67 million numbers, zeros included.
    pub fn parse(text: &str, n_features: Option<usize>) -> Result<Self, LibsvmError> {
        let mut lines = (1..).zip(text.lines());
        let header = Header::read(&mut lines)?;
        let kernel = header.kernel()?;
        let n_classes: usize = header.one("nr_class", parsed)?;
        let labels = header.many("label", n_classes, parsed)?;
        check_n_classes(n_classes).map_err(SvmError::from)?;
        let n_machines = Scheme::OneVsOne.n_machines(n_classes);
        let rho = header.many("rho", n_machines, number)?;
        let class_sizes: Vec<usize> = header.many("nr_sv", n_classes, parsed)?;
        let calibration = header.calibration(n_classes)?;

        let support = SparseRows::read(lines, n_classes - 1)?;
        let n_support = header.one("total_sv", parsed::<usize>)?;
        let total = class_sizes.iter().try_fold(0_usize, |sum, &size| sum.checked_add(size));
        if support.n_rows() != n_support || total != Some(n_support) {
            let found = support.n_rows();
            let reason = format!("total_sv, nr_sv and the number of lines after SV, {found}, must agree");
            return Err(LibsvmError::Line { line: header.end_line, reason });
        }
        let support_vectors = support.to_matrix(n_features, header.end_line)?;
        check_size(n_machines, n_support, header.end_line)?;
        let mut coefficients = Matrix::zeros(n_machines, n_support);
        let classes =
            class_sizes.iter().enumerate().flat_map(|(class, &size)| std::iter::repeat_n(class, size));
        for (support_idx, class) in classes.enumerate() {
            let of_others = support.coefficients[support_idx * (n_classes - 1)..].iter();
            for (other, &coefficient) in (0..n_classes).filter(|&other| other != class).zip(of_others) {
                coefficients.row_mut(pair_idx(class, other, n_classes))[support_idx] = coefficient;
            }
        }
        let machines = DualSvm::from_parts(Scheme::OneVsOne, n_classes, coefficients, rho)?;
        Ok(Self { svm: KernelSvm::from_parts(kernel, support_vectors, machines)?, labels, calibration })
    }

    /// The text of a model file.
    ///
    /// # Errors
    /// One machine a class, a kernel that LIBSVM has not, labels or a calibration for other classes.
    pub fn to_text(&self) -> Result<String, LibsvmError> {
        let machines = self.svm.machines();
        let n_classes = machines.n_classes();
        if machines.scheme() != Scheme::OneVsOne {
            return Err(LibsvmError::NotWritable("one machine a class"));
        }
        if self.labels.len() != n_classes {
            return Err(LibsvmError::NotWritable("labels of other classes"));
        }
        let (kernel_type, parameters) = match self.svm.kernel() {
            KernelFunction::Linear => ("linear", String::new()),
            KernelFunction::Rbf { gamma } => ("rbf", format!("gamma {gamma}\n")),
            KernelFunction::Sigmoid { gamma, coef0 } => {
                ("sigmoid", format!("gamma {gamma}\ncoef0 {coef0}\n"))
            }
            KernelFunction::ChiSquared { .. } | KernelFunction::HistogramIntersection => {
                return Err(LibsvmError::NotWritable("this kernel"));
            }
        };
        let blocks: Vec<Vec<String>> = (0..n_classes).map(|class| self.lines_of_class(class)).collect();
        let class_sizes: Vec<usize> = blocks.iter().map(Vec::len).collect();
        let mut text =
            format!("svm_type c_svc\nkernel_type {kernel_type}\n{parameters}nr_class {n_classes}\n");
        // Writing to a string cannot fail.
        let _ = writeln!(text, "total_sv {}", class_sizes.iter().sum::<usize>());
        let _ = writeln!(text, "rho {}\nlabel {}", joined(machines.rho()), joined(&self.labels));
        if let Some(calibration) = &self.calibration {
            if calibration.scheme() != Scheme::OneVsOne || calibration.n_classes() != n_classes {
                return Err(LibsvmError::NotWritable("a calibration of other machines"));
            }
            let negated = |numbers: &[f32]| joined(&Vec::from_iter(numbers.iter().map(|number| -number)));
            let (prob_a, prob_b) = (negated(calibration.slopes()), negated(calibration.offsets()));
            let _ = writeln!(text, "probA {prob_a}\nprobB {prob_b}");
        }
        let _ = writeln!(text, "nr_sv {}\nSV", joined(&class_sizes));
        blocks.iter().flatten().for_each(|line| text.push_str(line));
        Ok(text)
    }

    /// The lines of the support vectors of a class: those that speak for it against some other class.
    fn lines_of_class(&self, class: usize) -> Vec<String> {
        let coefficients = self.svm.machines().coefficients();
        let n_classes = self.labels.len();
        let line = |(support_idx, row): (usize, &[f32])| {
            let others = (0..n_classes).filter(|&other| other != class);
            let of_others: Vec<f32> = others
                .map(|other| {
                    let coefficient = coefficients.row(pair_idx(class, other, n_classes))[support_idx];
                    // The first class of a pair is the positive one.
                    if (coefficient > 0.0) == (class < other) { coefficient } else { 0.0 }
                })
                .collect();
            let features = (1..).zip(row).filter(|(_, value)| **value != 0.0);
            let features: String = features.map(|(index, value)| format!(" {index}:{value}")).collect();
            let is_support = of_others.iter().any(|&coefficient| coefficient != 0.0);
            is_support.then(|| format!("{}{features}\n", joined(&of_others)))
        };
        self.svm.support_vectors().rows().enumerate().filter_map(line).collect()
    }
}

/// The place of a pair of classes in the order of [`Scheme::OneVsOne`].
fn pair_idx(class: usize, other: usize, n_classes: usize) -> usize {
    let (first, second) = (class.min(other), class.max(other));
    first * (2 * n_classes - first - 1) / 2 + second - first - 1
}

fn joined(values: &[impl ToString]) -> String {
    values.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
}

fn check_size(n_rows: usize, n_cols: usize, line: usize) -> Result<(), LibsvmError> {
    match n_rows.checked_mul(n_cols) {
        Some(n_numbers) if n_numbers <= MAX_NUMBERS => Ok(()),
        _ => {
            let reason = format!("{n_rows} x {n_cols} numbers are too many, {MAX_NUMBERS} are allowed");
            Err(LibsvmError::Line { line, reason })
        }
    }
}

/// A number that is finite as `f32`.
fn number(text: &str) -> Option<f32> {
    text.parse().ok().filter(|number: &f32| number.is_finite())
}

fn parsed<T: std::str::FromStr>(text: &str) -> Option<T> {
    text.parse().ok()
}

/// The lines before `SV`, by key.
struct Header<'t> {
    fields: BTreeMap<&'t str, (usize, &'t str)>,
    /// The line `SV`.
    end_line: usize,
}

impl<'t> Header<'t> {
    fn read(lines: &mut impl Iterator<Item = (usize, &'t str)>) -> Result<Self, LibsvmError> {
        let mut fields = BTreeMap::new();
        let mut last_line = 0;
        for (line, text) in lines {
            let (key, values) = text.trim().split_once(char::is_whitespace).unwrap_or((text.trim(), ""));
            if key == "SV" {
                return Ok(Self { fields, end_line: line });
            }
            if !KEYS.contains(&key) {
                let reason = format!("a header line begins with one of {}, or is SV", KEYS.join(", "));
                return Err(LibsvmError::Line { line, reason });
            }
            if fields.insert(key, (line, values)).is_some() {
                return Err(LibsvmError::Line { line, reason: format!("a second {key}") });
            }
            last_line = line;
        }
        Err(LibsvmError::Line { line: last_line + 1, reason: "the file ends before the line SV".to_owned() })
    }

    fn get(&self, key: &str) -> Result<(usize, &'t str), LibsvmError> {
        let missing = || LibsvmError::Line { line: self.end_line, reason: format!("no {key} before SV") };
        self.fields.get(key).copied().ok_or_else(missing)
    }

    fn many<T>(&self, key: &str, n: usize, parse: fn(&str) -> Option<T>) -> Result<Vec<T>, LibsvmError> {
        let (line, text) = self.get(key)?;
        let values: Option<Vec<T>> = text.split_whitespace().map(parse).collect();
        values.filter(|values| values.len() == n).ok_or_else(|| {
            let reason = format!("{key} needs numbers in range, {n} of them");
            LibsvmError::Line { line, reason }
        })
    }

    fn one<T: Copy>(&self, key: &str, parse: fn(&str) -> Option<T>) -> Result<T, LibsvmError> {
        self.many(key, 1, parse).map(|values| values[0])
    }

    fn kernel(&self) -> Result<KernelFunction, LibsvmError> {
        let (line, svm_type) = self.get("svm_type")?;
        if svm_type.trim() != "c_svc" {
            let reason = format!("svm_type is {}: only c_svc can be read", svm_type.trim());
            return Err(LibsvmError::Line { line, reason });
        }
        let (line, kernel_type) = self.get("kernel_type")?;
        match kernel_type.trim() {
            "linear" => Ok(KernelFunction::Linear),
            "rbf" => Ok(KernelFunction::Rbf { gamma: self.one("gamma", parsed)? }),
            "sigmoid" => {
                let (gamma, coef0) = (self.one("gamma", parsed)?, self.one("coef0", parsed)?);
                Ok(KernelFunction::Sigmoid { gamma, coef0 })
            }
            other => {
                let reason = format!("kernel_type is {other}: only linear, rbf and sigmoid can be read");
                Err(LibsvmError::Line { line, reason })
            }
        }
    }

    /// LIBSVM's probability is 1 / (1 + exp(A f + B)) at decision value f.
    fn calibration(&self, n_classes: usize) -> Result<Option<Calibration>, LibsvmError> {
        if !self.fields.contains_key("probA") && !self.fields.contains_key("probB") {
            return Ok(None);
        }
        let n_machines = Scheme::OneVsOne.n_machines(n_classes);
        let negated = |key| -> Result<Vec<f32>, LibsvmError> {
            Ok(self.many(key, n_machines, number)?.into_iter().map(|value| -value).collect())
        };
        let (slopes, offsets) = (negated("probA")?, negated("probB")?);
        if slopes.iter().any(|&slope| slope <= 0.0) {
            let reason = "a probA that is not negative contradicts its machine: remove probA and probB";
            return Err(LibsvmError::Line { line: self.get("probA")?.0, reason: reason.to_owned() });
        }
        Ok(Some(Calibration::from_parts(Scheme::OneVsOne, n_classes, slopes, offsets)?))
    }
}

/// The lines after `SV`, as large as they are in the file.
#[derive(Default)]
struct SparseRows {
    /// As many a row as there are other classes.
    coefficients: Vec<f32>,
    /// Index from 0, and value.
    features: Vec<(usize, f32)>,
    /// Where the features of each row end.
    ends: Vec<usize>,
}

impl SparseRows {
    fn read<'t>(lines: impl Iterator<Item = (usize, &'t str)>, n_others: usize) -> Result<Self, LibsvmError> {
        let mut rows = Self::default();
        for (line, text) in lines {
            let mut words = text.split_whitespace();
            let n_before = rows.coefficients.len();
            rows.coefficients.extend(words.by_ref().take(n_others).map_while(number));
            if rows.coefficients.len() - n_before != n_others {
                let reason = format!("a support vector begins with {n_others} finite coefficients");
                return Err(LibsvmError::Line { line, reason });
            }
            let mut next_index = 0;
            for word in words {
                let feature = word.split_once(':').and_then(|(index, value)| {
                    let index = parsed::<usize>(index)?.checked_sub(1)?;
                    Some((index, number(value)?)).filter(|_| index >= next_index)
                });
                let Some(feature) = feature else {
                    let reason = "a feature is index:value, indices from 1 and rising, values finite";
                    return Err(LibsvmError::Line { line, reason: reason.to_owned() });
                };
                next_index = feature.0.saturating_add(1);
                rows.features.push(feature);
            }
            rows.ends.push(rows.features.len());
        }
        Ok(rows)
    }

    fn n_rows(&self) -> usize {
        self.ends.len()
    }

    fn to_matrix(&self, n_features: Option<usize>, line: usize) -> Result<Matrix, LibsvmError> {
        let widest = self.features.iter().map(|(index, _)| index.saturating_add(1)).max().unwrap_or(0);
        let n_cols = n_features.unwrap_or(widest.max(1));
        if widest > n_cols || n_cols == 0 {
            let reason = format!("the support vectors have {widest} features, rows have {n_cols}");
            return Err(LibsvmError::Line { line, reason });
        }
        check_size(self.n_rows(), n_cols, line)?;
        let mut matrix = Matrix::zeros(self.n_rows(), n_cols);
        let mut start = 0;
        for (row_idx, &end) in self.ends.iter().enumerate() {
            for &(index, value) in &self.features[start..end] {
                matrix.row_mut(row_idx)[index] = value;
            }
            start = end;
        }
        Ok(matrix)
    }
}
