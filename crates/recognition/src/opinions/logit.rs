//! Conditional logistic regression with weights that are not negative and stay near what is known of them.

/// Above this no weight is fitted.
const MAX_WEIGHT: f64 = 10.0;

const MAX_STEPS: usize = 50;

/// One observation: one of several classes, and what each part of the evidence says of them.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    /// The class that it was.
    pub(crate) label: usize,
    /// How much it counts.
    pub(crate) weight: f64,
    /// One number a class by each part that says something: to be weighed, summed and taken as logarithms of odds.
    pub(crate) by_part: Vec<Option<Vec<f64>>>,
}

/// What is known of a weight before anything was observed: a Gaussian.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prior {
    pub(crate) mean: f64,
    /// Its standard deviation.
    pub(crate) spread: f64,
}

/// The weights from 0 to [`MAX_WEIGHT`], one a part, under which the classes of all cases were most probable, with a
/// Gaussian prior, by Newton's method on the weights that are not at a bound (Bertsekas, "Projected Newton Methods for
/// Optimization Problems with Simple Constraints", 1982). Without cases they are those of the prior.
pub(crate) fn fit(cases: &[Case], prior: &[Prior]) -> Vec<f64> {
    let mut weights: Vec<f64> = prior.iter().map(|prior| prior.mean).collect();
    let mut cost = Slope::at(cases, &weights, prior);
    for _ in 0..MAX_STEPS {
        let step = cost.newton_step(&weights);
        let tried = std::iter::successors(Some(1.0), |share: &f64| Some(share / 2.0))
            .take_while(|&share| share > 1e-6)
            .map(|share| {
                let moved = weights.iter().zip(&step).map(|(w, d)| (w + share * d).clamp(0.0, MAX_WEIGHT));
                let moved: Vec<f64> = moved.collect();
                let slope = Slope::at(cases, &moved, prior);
                (moved, slope)
            })
            .find(|(_, slope)| slope.cost < cost.cost - 1e-9);
        let Some((moved, slope)) = tried else { break };
        (weights, cost) = (moved, slope);
    }
    weights
}

/// Minus the logarithm of how probable the cases are, with the prior, and how it changes with the weights.
struct Slope {
    cost: f64,
    gradient: Vec<f64>,
    /// Row by row.
    hessian: Vec<Vec<f64>>,
}

impl Slope {
    fn at(cases: &[Case], weights: &[f64], prior: &[Prior]) -> Self {
        let n = weights.len();
        let mut slope = Self { cost: 0.0, gradient: vec![0.0; n], hessian: vec![vec![0.0; n]; n] };
        for idx in 0..n {
            let off = weights[idx] - prior[idx].mean;
            let precision = prior[idx].spread.powi(-2);
            slope.cost += precision * off * off / 2.0;
            slope.gradient[idx] = precision * off;
            slope.hessian[idx][idx] = precision;
        }
        cases.iter().for_each(|case| slope.add(case, weights));
        slope
    }

    fn add(&mut self, case: &Case, weights: &[f64]) {
        let parts = || case.by_part.iter().enumerate();
        let present = || parts().filter_map(|(idx, logs)| Some((idx, logs.as_ref()?)));
        // A single part is the answer whatever it counts.
        let Some(n_classes) = present().nth(1).map(|(_, logs)| logs.len()) else { return };
        let mut sums = vec![0.0; n_classes];
        for (idx, logs) in present() {
            sums.iter_mut().zip(logs).for_each(|(sum, log)| *sum += weights[idx] * log);
        }
        let probabilities = softmax(&sums);
        self.cost -= case.weight * probabilities[case.label].max(f64::MIN_POSITIVE).ln();
        let mean = |logs: &[f64]| logs.iter().zip(&probabilities).map(|(log, p)| log * p).sum::<f64>();
        for (row, logs) in present() {
            let of_row = mean(logs);
            self.gradient[row] += case.weight * (of_row - logs[case.label]);
            for (column, others) in present() {
                let products = logs.iter().zip(others).zip(&probabilities).map(|((a, b), p)| a * b * p);
                self.hessian[row][column] += case.weight * (products.sum::<f64>() - of_row * mean(others));
            }
        }
    }

    /// Where the gradient points out of the bounds, nowhere.
    fn newton_step(&self, weights: &[f64]) -> Vec<f64> {
        let is_held = |idx: usize| {
            (weights[idx] <= 0.0 && self.gradient[idx] > 0.0)
                || (weights[idx] >= MAX_WEIGHT && self.gradient[idx] < 0.0)
        };
        let free: Vec<usize> = (0..weights.len()).filter(|&idx| !is_held(idx)).collect();
        let mut rows: Vec<Vec<f64>> = free
            .iter()
            .map(|&row| {
                let of_free = free.iter().map(|&column| self.hessian[row][column]);
                of_free.chain([-self.gradient[row]]).collect()
            })
            .collect();
        let solved = solve(&mut rows);
        let mut step = vec![0.0; weights.len()];
        free.into_iter().zip(solved).for_each(|(idx, part)| step[idx] = part);
        step
    }
}

/// Solves equations of a positive definite matrix, the right side in the last column, by elimination.
fn solve(rows: &mut [Vec<f64>]) -> Vec<f64> {
    let n = rows.len();
    for pivot in 0..n {
        let (above, below) = rows.split_at_mut(pivot + 1);
        let of_pivot = &above[pivot];
        for row in below {
            let factor = row[pivot] / of_pivot[pivot];
            row.iter_mut().zip(of_pivot).skip(pivot).for_each(|(value, part)| *value -= factor * part);
        }
    }
    let mut solution = vec![0.0; n];
    for row in (0..n).rev() {
        let known: f64 = (row + 1..n).map(|column| rows[row][column] * solution[column]).sum();
        solution[row] = (rows[row][n] - known) / rows[row][row];
    }
    solution
}

/// Exponentials over their sum, without overflow.
pub(crate) fn softmax(values: &[f64]) -> Vec<f64> {
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let powers: Vec<f64> = values.iter().map(|value| (value - largest).exp()).collect();
    let sum: f64 = powers.iter().sum();
    powers.into_iter().map(|power| power / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn no_other_weights_make_the_cases_more_probable() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut case = |_| {
            let label = random.random_range(0..3);
            let mut part = |noise: f64| -> Vec<f64> {
                (0..3).map(|class| f64::from(class == label) + noise * random.random::<f64>()).collect()
            };
            let by_part = vec![Some(part(1.0)), Some(part(6.0)), (label > 0).then(|| part(3.0))];
            Case { label, weight: 0.5 + label as f64, by_part }
        };
        let cases: Vec<Case> = (0..60).map(&mut case).collect();
        let prior = [0.3, 0.9, 0.5].map(|mean| Prior { mean, spread: 0.3 });
        let weights = fit(&cases, &prior);
        let best = Slope::at(&cases, &weights, &prior).cost;
        for idx in 0..3 {
            for change in [-1e-3, 1e-3] {
                let mut near = weights.clone();
                near[idx] = (near[idx] + change).max(0.0);
                let cost = Slope::at(&cases, &near, &prior).cost;
                assert!(cost >= best - 1e-9, "{weights:?}, {idx} by {change}");
            }
        }
    }
}
