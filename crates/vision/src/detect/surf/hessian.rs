//! Maxima of box-filtered determinants in one octave of scales.

use crate::detect::Keypoint;
use crate::image::Integral;
use crate::simd;

/// The scale of a filter whose lobes are one pixel: a side of 9, with lobes of 3, stands for a sigma of 1.2.
const SCALE_OF_LOBE: f32 = 1.2 / 3.0;

/// Filters of growing size, and how densely the image is sampled for them.
pub(super) struct Octave {
    /// Pixels from one sample to the next: 1, 2, 4, ...
    step: usize,
    n_layers: usize,
}

/// Determinants round a sample: layers, rows, columns.
type Cube = [[[f32; 3]; 3]; 3];

impl Octave {
    /// The first octave has index 0.
    pub(super) fn new(octave_idx: usize, n_layers: usize) -> Self {
        Self { step: 1 << octave_idx, n_layers }
    }

    /// How many pixels a sample looks at to each side, its neighbors included.
    pub(super) fn reach(&self) -> usize {
        self.margin(self.n_layers - 2)
    }

    /// Calls `found` with each keypoint whose determinant exceeds `threshold` and that of its neighbors;
    /// columns count from the table's first.
    pub(super) fn detect(&self, integral: &Integral, threshold: f32, mut found: impl FnMut(Keypoint)) {
        let stride = integral.stride();
        let height = integral.sums().len() / stride - 1;
        let mut responses = ResponseRows::new(self.n_layers, stride + 2 * self.step);
        let mut peaks = vec![[0; simd::PEAK_BLOCK]; stride.div_ceil(simd::PEAK_BLOCK)];
        for (row_idx, y) in (0..height).step_by(self.step).enumerate() {
            for layer in 0..self.n_layers {
                responses.compute(integral, self.lobe(layer), (layer, row_idx, y));
            }
            for layer in self.middle_layers() {
                let margin = self.margin(layer);
                // The row before is the middle one.
                if y < margin + self.step || y + margin >= height + self.step {
                    continue;
                }
                let layers = [layer - 1, layer, layer + 1].map(|layer| responses.around(layer, row_idx));
                simd::mark_peaks(&layers, self.step, threshold, &mut peaks);
                for_each_peak(&peaks, |peak| {
                    let x = peak + self.step;
                    if x < margin || x + margin >= stride - 1 || !x.is_multiple_of(self.step) {
                        return;
                    }
                    let columns = [x - self.step, x, x + self.step];
                    let cube = layers.map(|rows| rows.map(|row| columns.map(|column| row[column])));
                    if let Some(offset) = summit(&cube) {
                        let place = [x, y - self.step, self.lobe(layer)];
                        found(self.keypoint(place, offset, cube[1][1][1]));
                    }
                });
            }
        }
    }

    /// Lobes of 3, 5, 7, 9 in the first octave; 5, 9, 13, 17 in the second; 9, 17, 25, 33 in the third.
    fn lobe(&self, layer: usize) -> usize {
        2 * self.step * (layer + 1) + 1
    }

    /// The layers that have neighbors and are none of the octave before.
    fn middle_layers(&self) -> impl Iterator<Item = usize> {
        let before = if self.step == 1 { 0 } else { self.step * (self.n_layers - 1) + 1 };
        let lobe = |layer| self.lobe(layer);
        let first = (1..self.n_layers).find(|&layer| lobe(layer) > before).unwrap_or(self.n_layers);
        first..self.n_layers - 1
    }

    /// How far from the edge the filters round a sample of a middle layer lie in the image.
    fn margin(&self, layer: usize) -> usize {
        3 * self.lobe(layer + 1) / 2 + self.step
    }

    /// From a place (column, row, lobe) and where in steps from it the summit lies.
    fn keypoint(&self, place: [usize; 3], offset: [f32; 3], response: f32) -> Keypoint {
        let [x, y, lobe] = place.map(|number| number as f32);
        let step = self.step as f32;
        Keypoint {
            scale: SCALE_OF_LOBE * (lobe + 2.0 * step * offset[2]),
            ..Keypoint::new(x + step * offset[0], y + step * offset[1], response)
        }
    }
}

/// The last three rows of determinants of each layer.
struct ResponseRows {
    /// Layer after layer, three rows each, turned round.
    rows: Vec<[Vec<f32>; 3]>,
    differences: Vec<u32>,
}

impl ResponseRows {
    /// `n_columns`, rounded up to whole blocks of peaks and the columns beside them.
    fn new(n_layers: usize, n_columns: usize) -> Self {
        let n_columns = n_columns + simd::PEAK_BLOCK;
        let rows = || std::array::from_fn(|_| vec![0.0; n_columns]);
        Self { rows: (0..n_layers).map(|_| rows()).collect(), differences: vec![0; 3 * n_columns] }
    }

    /// Fills row `row_idx` of a layer with the determinants of the image's row `y`. What has no filter in
    /// the image means nothing.
    fn compute(&mut self, integral: &Integral, lobe: usize, (layer, row_idx, y): (usize, usize, usize)) {
        let (sums, stride) = (integral.sums(), integral.stride());
        let (half, width, height) = (3 * lobe / 2, stride - 1, sums.len() / stride - 1);
        if y < half || y + half >= height || width <= 2 * half {
            return;
        }
        let responses = &mut self.rows[layer][row_idx % 3][half..width - half];
        simd::hessian_row(simd::FilterRow { sums, stride, y, lobe }, &mut self.differences, responses);
    }

    /// The three rows of a layer up to `row_idx`, from top to bottom.
    fn around(&self, layer: usize, row_idx: usize) -> [&[f32]; 3] {
        [row_idx + 1, row_idx + 2, row_idx].map(|row_idx| &self.rows[layer][row_idx % 3][..])
    }
}

/// Calls `visit` with the index of each peak, in order.
fn for_each_peak(peaks: &[[u8; simd::PEAK_BLOCK]], mut visit: impl FnMut(usize)) {
    for (block_idx, block) in peaks.iter().enumerate().filter(|(_, block)| u128::from_ne_bytes(**block) != 0)
    {
        for lane in (0..simd::PEAK_BLOCK).filter(|&lane| block[lane] != 0) {
            visit(block_idx * simd::PEAK_BLOCK + lane);
        }
    }
}

/// The highest point of the parabola through the samples: columns, rows and layers from the middle one.
/// Brown and Lowe, "Invariant features from interest point groups", BMVC 2002. `None` when it is more than
/// a step away.
fn summit(cube: &Cube) -> Option<[f32; 3]> {
    let at = |dx: usize, dy: usize, ds: usize| f64::from(cube[ds][dy][dx]);
    let center = at(1, 1, 1);
    let slope = [
        (at(2, 1, 1) - at(0, 1, 1)) / 2.0,
        (at(1, 2, 1) - at(1, 0, 1)) / 2.0,
        (at(1, 1, 2) - at(1, 1, 0)) / 2.0,
    ];
    let xx = at(2, 1, 1) + at(0, 1, 1) - 2.0 * center;
    let yy = at(1, 2, 1) + at(1, 0, 1) - 2.0 * center;
    let ss = at(1, 1, 2) + at(1, 1, 0) - 2.0 * center;
    let xy = (at(2, 2, 1) - at(2, 0, 1) - at(0, 2, 1) + at(0, 0, 1)) / 4.0;
    let xs = (at(2, 1, 2) - at(2, 1, 0) - at(0, 1, 2) + at(0, 1, 0)) / 4.0;
    let ys = (at(1, 2, 2) - at(1, 2, 0) - at(1, 0, 2) + at(1, 0, 0)) / 4.0;
    let columns = [[xx, xy, xs], [xy, yy, ys], [xs, ys, ss]];
    // Cramer's rule.
    let determinant = triple_product(columns);
    let offset: [f64; 3] = std::array::from_fn(|idx| {
        let mut replaced = columns;
        replaced[idx] = slope.map(|slope| -slope);
        triple_product(replaced) / determinant
    });
    offset.iter().all(|offset| offset.abs() <= 1.0).then(|| offset.map(|offset| offset as f32))
}

/// The determinant of three vectors.
fn triple_product([a, b, c]: [[f64; 3]; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use proptest::prelude::*;

    /// All determinants of a filter, row after row; those whose filter reaches beyond the image are `None`.
    fn determinants(image: &Image, lobe: usize) -> Vec<Option<f32>> {
        let (width, height) = (image.width(), image.height());
        let integral = Integral::new(image, 0);
        let (sums, stride, half) = (integral.sums(), integral.stride(), 3 * lobe / 2);
        let mut all = vec![None; width * height];
        let rows = if width > 2 * half { half..height.saturating_sub(half) } else { 0..0 };
        for y in rows {
            let mut row = vec![0.0; width - 2 * half];
            let filter = simd::FilterRow { sums, stride, y, lobe };
            simd::hessian_row(filter, &mut vec![0; 3 * stride], &mut row);
            row.iter().enumerate().for_each(|(idx, &value)| all[y * width + half + idx] = Some(value));
        }
        all
    }

    fn naive(octave: &Octave, image: &Image, threshold: f32) -> Vec<Keypoint> {
        let (width, height, step) = (image.width(), image.height(), octave.step);
        let layers: Vec<_> =
            (0..octave.n_layers).map(|layer| determinants(image, octave.lobe(layer))).collect();
        let mut keypoints = Vec::new();
        for y in (step..height.saturating_sub(step)).filter(|y| y.is_multiple_of(step)) {
            for layer in octave.middle_layers() {
                for x in (step..width.saturating_sub(step)).filter(|x| x.is_multiple_of(step)) {
                    let at = |ds: usize, dy: usize, dx: usize| {
                        layers[layer + ds - 1][(y + dy * step - step) * width + x + dx * step - step]
                    };
                    let all = || (0..27).map(|idx| at(idx / 9, idx / 3 % 3, idx % 3));
                    let Some(own) = at(1, 1, 1).filter(|&own| own > threshold) else { continue };
                    if all().any(|value| value.is_none())
                        || all().flatten().filter(|&value| value >= own).count() > 1
                    {
                        continue;
                    }
                    let cube =
                        [0, 1, 2].map(|ds| [0, 1, 2].map(|dy| [0, 1, 2].map(|dx| at(ds, dy, dx).unwrap())));
                    if let Some(offset) = summit(&cube) {
                        keypoints.push(octave.keypoint([x, y, octave.lobe(layer)], offset, own));
                    }
                }
            }
        }
        keypoints
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

        #[test]
        fn maxima_are_those_of_whole_maps(
            (width, height) in (1usize..70, 1usize..60), n_layers in 3usize..=6, octave_idx in 0usize..3,
            random in prop::collection::vec(any::<u8>(), 70 * 60),
        ) {
            let image = Image::from_pixels(width, height, random[..width * height].to_vec()).unwrap();
            let octave = Octave::new(octave_idx, n_layers);
            let mut found = Vec::new();
            octave.detect(&Integral::new(&image, 0), 1.0, |keypoint| found.push(keypoint));
            prop_assert_eq!(found, naive(&octave, &image, 1.0));
        }
    }

    #[test]
    fn the_summit_of_a_parabola_is_found() {
        let top = [0.3f32, -0.4, 0.2];
        let value = |x: f32, y: f32, s: f32| {
            let (x, y, s) = (x - top[0], y - top[1], s - top[2]);
            5.0 - x * x - 2.0 * y * y - s * s - 0.5 * x * y + 0.3 * y * s
        };
        let at = |idx: usize| idx as f32 - 1.0;
        let cube = [0, 1, 2].map(|s| [0, 1, 2].map(|y| [0, 1, 2].map(|x| value(at(x), at(y), at(s)))));
        for (found, expected) in summit(&cube).unwrap().iter().zip(top) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
        assert_eq!(summit(&[[[1.0; 3]; 3]; 3]), None, "a plane has no summit");
    }

    #[test]
    fn octaves_have_the_filters_of_the_paper() {
        let sides = |octave_idx| {
            let octave = Octave::new(octave_idx, 4);
            [0, 1, 2, 3].map(|layer| 3 * octave.lobe(layer))
        };
        assert_eq!([0, 1, 2].map(sides), [[9, 15, 21, 27], [15, 27, 39, 51], [27, 51, 75, 99]]);
        for n_layers in 3..=6 {
            let octaves = (0..5).map(|octave_idx| Octave::new(octave_idx, n_layers));
            let lobes: Vec<usize> = octaves
                .flat_map(|o| o.middle_layers().map(|layer| o.lobe(layer)).collect::<Vec<_>>())
                .collect();
            assert!(lobes.is_sorted_by(|a, b| a < b), "{lobes:?}");
        }
    }
}
