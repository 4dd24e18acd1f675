//! Vectors of locally aggregated descriptors: Jegou, Douze, Schmid, Perez, "Aggregating local descriptors into a
//! compact image representation", 2010. For each word, how its descriptors differ from it, summed; with signed square
//! roots (Jegou et al., "Aggregating local image descriptors into compact codes", 2012) and each word scaled to unit
//! length (Arandjelovic and Zisserman, "All about VLAD", 2013).

use roomsight_vision::matrix::Matrix;

/// Sums residuals: `blocks` gives the blocks of [`Matrix::n_cols`] numbers that each descriptor, whose word is given
/// beside it, is added to, of which there are `n_blocks`. The row is of unit length, or zero where nothing differs.
pub(super) fn vlad<Blocks: Iterator<Item = usize>>(
    descriptors: &Matrix,
    words: &[u32],
    centers: &Matrix,
    n_blocks: usize,
    blocks: impl Fn(usize) -> Blocks,
) -> Vec<f32> {
    let width = centers.n_cols();
    let mut row = vec![0.0; n_blocks * width];
    let mut residual = vec![0.0; width];
    for (descriptor_idx, (descriptor, &word)) in descriptors.rows().zip(words).enumerate() {
        let center = centers.row(word as usize);
        residual
            .iter_mut()
            .zip(descriptor.iter().zip(center))
            .for_each(|(out, (value, mean))| *out = value - mean);
        for block in blocks(descriptor_idx) {
            let sums = &mut row[block * width..][..width];
            sums.iter_mut().zip(&residual).for_each(|(sum, difference)| *sum += difference);
        }
    }
    row.iter_mut().for_each(|value| *value = value.abs().sqrt().copysign(*value));
    row.chunks_exact_mut(width.max(1)).for_each(scale_to_unit);
    scale_to_unit(&mut row);
    row
}

/// Zeros stay zeros.
fn scale_to_unit(values: &mut [f32]) {
    let length = values.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>().sqrt();
    if length > 0.0 {
        values.iter_mut().for_each(|value| *value = (f64::from(*value) / length) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_are_summed_a_word_and_scaled() {
        let centers = Matrix::from_vec(vec![0.0, 0.0, 1.0, 0.0, 0.0, 1.0], 2).unwrap();
        let descriptors = Matrix::from_vec(vec![0.01, 0.04, 0.0, -0.4, 0.75, 0.0], 2).unwrap();
        let row = vlad(&descriptors, &[0, 0, 1], &centers, 3, |_| 0..1);
        // All in the first block: (0.01 - 0.25, 0.04 - 0.4), the roots of which are 0.4899 and 0.6.
        let length = 0.6f32.sqrt();
        for (value, expected) in
            row.iter().zip([-(0.24f32.sqrt()) / length, -0.6 / length, 0.0, 0.0, 0.0, 0.0])
        {
            assert!((value - expected).abs() < 1e-6, "{row:?}");
        }
        // Each in its own: two words of the same weight.
        let row = vlad(&descriptors, &[0, 0, 1], &centers, 3, |idx| [0, 0, 1][idx]..[0, 0, 1][idx] + 1);
        let half = 0.5f32.sqrt();
        let first = [0.1 / 0.37f32.sqrt() * half, -0.6 / 0.37f32.sqrt() * half];
        for (value, expected) in row.iter().zip([first[0], first[1], -half, 0.0, 0.0, 0.0]) {
            assert!((value - expected).abs() < 1e-6, "{row:?}");
        }
    }

    #[test]
    fn words_themselves_give_zeros() {
        let centers = Matrix::from_vec(vec![0.6, 0.8], 2).unwrap();
        assert_eq!(vlad(&centers, &[0], &centers, 1, |_| 0..1), [0.0, 0.0]);
        assert_eq!(vlad(&Matrix::new(2), &[], &centers, 1, |_| 0..1), [0.0, 0.0]);
    }
}
