//! The product of two long rows of numbers.

use super::dispatch;

/// Running sums; the order in which products are added is part of what is promised.
const LANES: usize = 8;

dispatch! {
    /// The sum of the products of numbers at the same place, in `f64`: number i is added to running sum i modulo 8,
    /// what is left after the last eight to a ninth, and these are added in order. As far as the shorter row goes.
    dot, dot_kernel, (left: &[f32], right: &[f32], product: &mut f64)
}

#[inline(always)]
fn dot_kernel(left: &[f32], right: &[f32], product: &mut f64) {
    let (left_chunks, left_rest) = left.as_chunks::<LANES>();
    let (right_chunks, right_rest) = right.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (left, right) in left_chunks.iter().zip(right_chunks) {
        for lane in 0..LANES {
            sums[lane] += f64::from(left[lane]) * f64::from(right[lane]);
        }
    }
    let rest: f64 = left_rest.iter().zip(right_rest).map(|(l, r)| f64::from(*l) * f64::from(*r)).sum();
    *product = sums.iter().sum::<f64>() + rest;
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn products_are_the_same_bit_for_bit_on_every_cpu(
            pairs in prop::collection::vec((-2.0f32..2.0, -2.0f32..2.0), 0..100),
        ) {
            let (left, right): (Vec<f32>, Vec<f32>) = pairs.iter().copied().unzip();
            let (mut fast, mut plain) = (7.0, 8.0);
            dot(&left, &right, &mut fast);
            dot_kernel(&left, &right, &mut plain);
            prop_assert_eq!(fast.to_bits(), plain.to_bits());
            let n_whole = pairs.len() / LANES * LANES;
            let sum = |from: usize, to: usize, step: usize| -> f64 {
                (from..to).step_by(step).map(|i| f64::from(left[i]) * f64::from(right[i])).sum()
            };
            let expected = (0..LANES).map(|lane| sum(lane, n_whole, LANES)).sum::<f64>() + sum(n_whole, pairs.len(), 1);
            prop_assert_eq!(plain, expected);
        }
    }
}
