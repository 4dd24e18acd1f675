//! Products of many vectors with the same few, in floats that are always summed in the same order.

use super::dispatch;

/// Outputs that are worked on at once.
const LANES: usize = 16;

/// Weights of a linear map, and what is taken from its outputs.
#[derive(Clone, Debug)]
pub struct LinearMap {
    /// Block after block of outputs; within a block, input after input.
    weights: Vec<[f32; LANES]>,
    /// A block of outputs after the other.
    offsets: Vec<[f32; LANES]>,
    n_inputs: usize,
    n_outputs: usize,
}

impl LinearMap {
    /// Output o is the sum of `weights[o * n_inputs + i]` times input i, less `offsets[o]`.
    ///
    /// # Panics
    /// When the numbers of weights and offsets do not fit.
    pub fn new(weights: &[f32], offsets: &[f32], n_inputs: usize) -> Self {
        let n_outputs = offsets.len();
        assert_eq!(
            weights.len(),
            n_inputs * n_outputs,
            "a linear map with weights for another number of inputs"
        );
        let n_blocks = n_outputs.div_ceil(LANES);
        let mut map = Self {
            weights: vec![[0.0; LANES]; n_blocks * n_inputs],
            offsets: vec![[0.0; LANES]; n_blocks],
            n_inputs,
            n_outputs,
        };
        for (output_idx, (row, &offset)) in weights.chunks_exact(n_inputs.max(1)).zip(offsets).enumerate() {
            let (block_idx, lane) = (output_idx / LANES, output_idx % LANES);
            map.offsets[block_idx][lane] = offset;
            let block = &mut map.weights[block_idx * n_inputs..][..n_inputs];
            block.iter_mut().zip(row).for_each(|(lanes, &weight)| lanes[lane] = weight);
        }
        map
    }

    /// The outputs for each row of `n_inputs` numbers in `rows`, row after row.
    pub fn apply(&self, rows: &[f32]) -> Vec<f32> {
        let n_rows = rows.len().checked_div(self.n_inputs).unwrap_or(0);
        let mut outputs = vec![0.0; n_rows * self.n_outputs];
        apply(self, rows, &mut outputs);
        outputs
    }
}

dispatch! {
    /// The outputs of a map for each row into `outputs`.
    apply, apply_kernel, (map: &LinearMap, rows: &[f32], outputs: &mut [f32])
}

#[inline(always)]
fn apply_kernel(map: &LinearMap, rows: &[f32], outputs: &mut [f32]) {
    let n_inputs = map.n_inputs.max(1);
    for (row, outputs) in rows.chunks_exact(n_inputs).zip(outputs.chunks_exact_mut(map.n_outputs.max(1))) {
        let blocks = map.weights.chunks_exact(n_inputs).zip(&map.offsets);
        for ((weights, offsets), outputs) in blocks.zip(outputs.chunks_mut(LANES)) {
            let mut sums = [0.0; LANES];
            for (&input, weights) in row.iter().zip(weights) {
                for lane in 0..LANES {
                    sums[lane] += input * weights[lane];
                }
            }
            outputs
                .iter_mut()
                .zip(sums)
                .zip(offsets)
                .for_each(|((output, sum), offset)| *output = sum - offset);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_cpu_computes_the_same_bits(
            n_inputs in 1usize..40, n_outputs in 1usize..40, n_rows in 0usize..5,
            values in prop::collection::vec(-1.0f32..1.0, 1800),
        ) {
            let (weights, rest) = values.split_at(n_inputs * n_outputs);
            let map = LinearMap::new(weights, &values[..n_outputs], n_inputs);
            let rows = &rest[..n_rows * n_inputs];
            let mut plain = vec![0.0; n_rows * n_outputs];
            apply_kernel(&map, rows, &mut plain);
            prop_assert_eq!(&map.apply(rows), &plain);
            for (idx, &output) in plain.iter().enumerate() {
                let (row, weights) = (&rows[idx / n_outputs * n_inputs..], &weights[idx % n_outputs * n_inputs..]);
                let sum = (0..n_inputs).fold(0.0, |sum, i| sum + row[i] * weights[i]);
                prop_assert_eq!(output, sum - values[idx % n_outputs]);
            }
        }
    }
}
