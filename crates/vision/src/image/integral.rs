//! Summed-area tables: the sum of any upright rectangle of pixels from four numbers.

use super::Image;

/// The summed-area table of an image.
///
/// Sums wrap round at 2^32. What is computed from them is right as long as it fits itself: rectangles of up
/// to sixteen million pixels.
#[derive(Clone, Debug)]
pub struct Integral {
    stride: usize,
    sums: Vec<u32>,
}

impl Integral {
    /// The table of `image`, continued periodically by `seam` columns on its left and on its right.
    pub fn new(image: &Image, seam: usize) -> Self {
        let (width, height) = (image.width(), image.height());
        let stride = width + 2 * seam + 1;
        let mut sums = vec![0u32; stride * (height + 1)];
        // The column of the image that the first column of the table continues.
        let first = (width - seam % width) % width;
        let mut continued = Vec::with_capacity(if seam > 0 { stride } else { 0 });
        for y in 0..height {
            let (above, below) = sums[y * stride..][..2 * stride].split_at_mut(stride);
            let mut pixels = image.row(y);
            if seam > 0 {
                continued.clear();
                continued.extend(pixels[first..].iter().chain(pixels.iter().cycle()).take(stride - 1));
                pixels = &continued;
            }
            let mut row_sum = 0u32;
            for ((below, above), &pixel) in below[1..].iter_mut().zip(&above[1..]).zip(pixels) {
                row_sum = row_sum.wrapping_add(u32::from(pixel));
                *below = above.wrapping_add(row_sum);
            }
        }
        Self { stride, sums }
    }

    /// The columns of the image with both seams, and one more: as many numbers as a row of sums has.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Row after row: number `y * stride + x` is the sum of the pixels above row `y` and left of column `x`,
    /// seams counted. There is one row more than the image has.
    pub fn sums(&self) -> &[u32] {
        &self.sums
    }

    /// The two Haar wavelets of a square that reaches `half` pixels from its center: its right half minus
    /// its left half, and its lower half minus its upper half. The center is the upper left corner of pixel
    /// (`column`, `row`), seams counted. Panics when the square reaches beyond the table.
    pub fn haar(&self, column: usize, row: usize, half: usize) -> (i32, i32) {
        let columns_of = |row: usize| {
            let sums = &self.sums[row * self.stride..][..self.stride];
            [sums[column - half], sums[column], sums[column + half]]
        };
        let [top, middle, bottom] = [row - half, row, row + half].map(columns_of);
        let [left, center, right] = [0, 1, 2].map(|idx| bottom[idx].wrapping_sub(top[idx]));
        let [upper, across, lower] = [top, middle, bottom].map(|sums| sums[2].wrapping_sub(sums[0]));
        (second_difference(left, center, right), second_difference(upper, across, lower))
    }
}

/// (last - middle) - (middle - first).
fn second_difference(first: u32, middle: u32, last: u32) -> i32 {
    last.wrapping_add(first).wrapping_sub(middle.wrapping_mul(2)).cast_signed()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn wavelets_are_sums_over_halves(
            (width, rest) in (1usize..12, 0usize..6), seam in 0usize..30, half in 1usize..4,
            (x, y) in (any::<usize>(), any::<usize>()), pixels in prop::collection::vec(any::<u8>(), 144),
        ) {
            let height = 2 * half + rest;
            let image = Image::from_pixels(width, height, pixels[..width * height].to_vec()).unwrap();
            let integral = Integral::new(&image, seam);
            prop_assert_eq!(integral.stride(), width + 2 * seam + 1);
            prop_assert_eq!(integral.sums().len(), integral.stride() * (height + 1));
            prop_assume!(integral.stride() > 2 * half);
            let (x, y) = (half + x % (integral.stride() - 2 * half), half + y % (rest + 1));
            let sum = |columns: std::ops::Range<usize>, rows: std::ops::Range<usize>| -> i32 {
                rows.flat_map(|row| columns.clone().map(move |column| (column, row)))
                    .map(|(column, row)| i32::from(image.row(row)[(column + seam * width - seam) % width]))
                    .sum()
            };
            let (columns, rows) = (x - half..x + half, y - half..y + half);
            let dx = sum(x..x + half, rows.clone()) - sum(x - half..x, rows);
            let dy = sum(columns.clone(), y..y + half) - sum(columns, y - half..y);
            prop_assert_eq!(integral.haar(x, y, half), (dx, dy));
        }
    }
}
