//! Descriptors to bytes.

use super::MemoryError;
use crate::vocabulary::PrincipalComponents;
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd::LinearMap;

/// Directions with less than this share of the largest variance hold nothing but rounding.
const LEAST_VARIANCE: f64 = 1e-9;

/// At most this many descriptors, drawn at random, tell the principal components.
const N_SAMPLED: usize = 20_000;

/// The share of numbers that are cut off at the ends of a byte, so that the others are rounded less.
const SHARE_CUT: f64 = 0.001;

/// How descriptors are kept: their principal components, each scaled by the fourth root of its variance's
/// reciprocal ("half whitening": common directions count less, rare ones are not blown up), brought to unit
/// length and rounded to whole numbers from -127 to 127.
#[derive(Clone, Debug)]
pub struct Coding {
    components: Matrix,
    offsets: Vec<f32>,
    scale: f32,
    map: LinearMap,
}

impl Coding {
    /// Fits the principal components to a sample of the rows of `frames`, at most `n_dimensions` of them.
    ///
    /// # Errors
    /// No descriptor at all, or all the same.
    pub(super) fn fit(frames: &[&Matrix], n_dimensions: usize, seed: u64) -> Result<Self, MemoryError> {
        let sample = draw(frames, N_SAMPLED, seed);
        let found = PrincipalComponents::of(&sample);
        let largest = found.variances.first().copied().unwrap_or(0.0);
        let is_used = |&(variance, _): &(&f64, &Vec<f64>)| *variance > largest * LEAST_VARIANCE;
        let used = found.variances.iter().zip(&found.directions).filter(is_used).take(n_dimensions);
        let (mut components, mut offsets) = (Matrix::new(sample.n_cols()), Vec::new());
        for (variance, direction) in used {
            let factor = 1.0 / variance.sqrt().sqrt();
            let scaled: Vec<f64> = direction.iter().map(|value| value * factor).collect();
            offsets.push(scaled.iter().zip(&found.mean).map(|(a, b)| a * b).sum::<f64>() as f32);
            components.push_row(&scaled.iter().map(|&value| value as f32).collect::<Vec<_>>());
        }
        if offsets.is_empty() {
            return Err(MemoryError::NothingToTell);
        }
        let mut coding = Self::new(components, offsets, 1.0);
        let mut sizes: Vec<f32> = coding.unit_rows(&sample).iter().map(|value| value.abs()).collect();
        sizes.sort_by(f32::total_cmp);
        let n_cut = (sizes.len() as f64 * SHARE_CUT) as usize;
        coding.scale = 127.0 / sizes[sizes.len() - 1 - n_cut].max(1.0 / 127.0);
        Ok(coding)
    }

    fn new(components: Matrix, offsets: Vec<f32>, scale: f32) -> Self {
        let map = LinearMap::new(components.as_slice(), &offsets, components.n_cols());
        Self { components, offsets, scale, map }
    }

    /// The coding with these [`Coding::components`], [`Coding::offsets`] and [`Coding::scale`].
    pub(super) fn from_parts(components: Matrix, offsets: Vec<f32>, scale: f32) -> Result<Self, MemoryError> {
        let fits = components.n_rows() == offsets.len()
            && (1..=super::MAX_DIMENSIONS).contains(&offsets.len())
            && (1..=super::MAX_INPUTS).contains(&components.n_cols());
        if !fits {
            return Err(MemoryError::damaged("its components have another shape than their offsets"));
        }
        let are_finite = components.as_slice().iter().chain(&offsets).all(|value| value.is_finite());
        // As fitting gives them.
        if !are_finite || !(1.0..=127.0 * 127.0).contains(&scale) {
            return Err(MemoryError::damaged("its components or their scale are out of range"));
        }
        Ok(Self::new(components, offsets, scale))
    }

    /// The numbers of a descriptor.
    pub fn n_inputs(&self) -> usize {
        self.components.n_cols()
    }

    /// The bytes that are kept of a descriptor.
    pub fn n_dimensions(&self) -> usize {
        self.components.n_rows()
    }

    /// The scaled directions, one a row.
    pub fn components(&self) -> &Matrix {
        &self.components
    }

    /// What is taken from a descriptor's product with each direction: that of the mean.
    pub fn offsets(&self) -> &[f32] {
        &self.offsets
    }

    /// The whole number that stands for one.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// The bytes of each row, row after row.
    ///
    /// # Panics
    /// When the rows, if any, have another width than [`Coding::n_inputs`].
    pub fn code(&self, descriptors: &Matrix) -> Vec<i8> {
        // What is out of range becomes the nearest number, and what is none 0.
        let round = |value: f32| (value * self.scale + 0.5f32.copysign(value)).clamp(-127.0, 127.0) as i8;
        self.unit_rows(descriptors).into_iter().map(round).collect()
    }

    /// The components of each row at unit length, or zeros.
    fn unit_rows(&self, descriptors: &Matrix) -> Vec<f32> {
        if descriptors.n_rows() == 0 {
            return Vec::new();
        }
        assert_eq!(descriptors.n_cols(), self.n_inputs(), "descriptors of another width");
        let mut rows = self.map.apply(descriptors.as_slice());
        for row in rows.chunks_exact_mut(self.n_dimensions()) {
            let length = row.iter().map(|value| value * value).sum::<f32>().sqrt();
            let factor = if length > 0.0 { 1.0 / length } else { 0.0 };
            row.iter_mut().for_each(|value| *value *= factor);
        }
        rows
    }
}

/// At most `n_wanted` rows of all frames, drawn without replacement, in their order.
fn draw(frames: &[&Matrix], n_wanted: usize, seed: u64) -> Matrix {
    let rows: Vec<&[f32]> = frames.iter().flat_map(|frame| frame.rows()).collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut chosen = index::sample(&mut random, rows.len(), n_wanted.min(rows.len())).into_vec();
    chosen.sort_unstable();
    let mut sample = Matrix::new(rows.first().map_or(0, |row| row.len()));
    chosen.iter().for_each(|&row_idx| sample.push_row(rows[row_idx]));
    sample
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    fn frame(n_rows: usize, width: usize) -> Matrix {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut rows = Matrix::new(width);
        for _ in 0..n_rows {
            let row: Vec<f32> = (0..width).map(|i| random.random_range(-1.0..1.0) / (i + 1) as f32).collect();
            let length = row.iter().map(|value| value * value).sum::<f32>().sqrt();
            rows.push_row(&row.iter().map(|value| value / length).collect::<Vec<_>>());
        }
        rows
    }

    #[test]
    fn bytes_keep_the_distances_of_half_whitened_components() {
        let frame = frame(300, 12);
        let coding = Coding::fit(&[&frame], 12, 1).unwrap();
        let (rows, codes) = (coding.unit_rows(&frame), coding.code(&frame));
        let pairs = || (0..300usize).zip((0..300usize).map(|idx| idx * 7 % 300));
        for (a, b) in pairs() {
            let exact: f32 = (0..12).map(|i| (rows[a * 12 + i] - rows[b * 12 + i]).powi(2)).sum();
            let rounded: i32 =
                (0..12).map(|i| (i32::from(codes[a * 12 + i]) - i32::from(codes[b * 12 + i])).pow(2)).sum();
            let rounded = rounded as f32 / coding.scale().powi(2);
            assert!((exact - rounded).abs() < 0.02 + 0.05 * exact, "{exact} {rounded}");
        }
        // The variance that is left falls as its fourth root's square did: by less than before.
        let variance = |i: usize| (0..300).map(|row| rows[row * 12 + i].powi(2)).sum::<f32>();
        let raw = PrincipalComponents::of(&frame).variances;
        assert!(variance(0) / variance(11) < (raw[0] / raw[11]).sqrt() as f32 * 1.5);
    }

    #[test]
    fn fewer_dimensions_are_the_first_ones() {
        let frame = frame(200, 8);
        let coding = Coding::fit(&[&frame], 3, 1).unwrap();
        assert_eq!((coding.n_inputs(), coding.n_dimensions()), (8, 3));
        assert_eq!(coding.code(&frame).len(), 600);
        assert!(coding.code(&Matrix::new(0)).is_empty());
    }

    #[test]
    fn what_tells_nothing_apart_is_refused() {
        assert!(Coding::fit(&[], 4, 1).is_err());
        assert!(Coding::fit(&[&Matrix::new(5)], 4, 1).is_err());
        let same = Matrix::from_vec([0.6f32, 0.8].repeat(9), 2).unwrap();
        assert!(Coding::fit(&[&same], 4, 1).is_err());
    }

    #[test]
    fn parts_of_unknown_origin_are_checked() {
        let coding = Coding::fit(&[&frame(200, 8)], 3, 1).unwrap();
        let with = |components: &Matrix, offsets: &[f32], scale| {
            Coding::from_parts(components.clone(), offsets.to_vec(), scale)
        };
        let (components, offsets) = (coding.components(), coding.offsets());
        let again = with(components, offsets, coding.scale()).unwrap();
        assert_eq!(again.code(&frame(50, 8)), coding.code(&frame(50, 8)));
        assert!(with(components, &offsets[1..], 200.0).is_err());
        assert!(with(&Matrix::new(8), &[], 200.0).is_err());
        assert!(with(components, &[f32::NAN; 3], 200.0).is_err());
        assert!(with(components, offsets, 0.0).is_err());
        assert!(with(components, offsets, f32::INFINITY).is_err());
    }
}
