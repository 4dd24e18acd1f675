//! What a picture looks like at a glance: enough to find pictures that are nearly the same, and blurred ones.

use rayon::prelude::*;
use roomsight_vision::image::Image;
use serde::{Deserialize, Serialize};

/// Cells of a thumbnail in a row, and rows.
const CELLS: [usize; 2] = [32, 24];

/// Numbers of a thumbnail.
const N_CELLS: usize = CELLS[0] * CELLS[1];

/// The standard deviation that a thumbnail is brought to.
const CONTRAST: f32 = 32.0;

/// A picture of less contrast, in gray levels, shows nothing that could be compared.
const LEAST_CONTRAST: f32 = 6.0;

/// Pictures are nearly the same whose thumbnails differ by less on average: as much as encoding anew, another size, or a little
/// more light change them, and less than a step of the camera does.
const NEAR: f32 = 1.5;

/// Sharpness is told at about this width, in pixels, so that it does not depend on how many pixels a picture has.
const SHARPNESS_WIDTH: usize = 320;

/// What a picture looks like.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Look {
    /// In pixels.
    pub width: usize,
    /// In pixels.
    pub height: usize,
    /// How much neighboring pixels differ from their mean, as a share of the contrast of the whole picture.
    pub sharpness: f32,
    /// Brightness by parts of the picture, without its mean and at one contrast; none where there is no contrast.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "thumbnail_text")]
    thumbnail: Option<[i8; N_CELLS]>,
}

/// A thumbnail as text: two hexadecimal digits a cell.
mod thumbnail_text {
    use super::N_CELLS;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(
        thumbnail: &Option<[i8; N_CELLS]>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let text = |cells: &[i8; N_CELLS]| {
            cells.iter().map(|cell| format!("{:02x}", *cell as u8)).collect::<String>()
        };
        thumbnail.as_ref().map(text).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<[i8; N_CELLS]>, D::Error> {
        let Some(text) = Option::<String>::deserialize(deserializer)? else { return Ok(None) };
        let cell = |digits: &[u8; 2]| {
            u8::from_str_radix(str::from_utf8(digits).ok()?, 16).ok().map(|cell| cell as i8)
        };
        let (digits, rest) = text.as_bytes().as_chunks();
        let cells = digits.iter().map(cell).collect::<Option<Vec<i8>>>().filter(|_| rest.is_empty());
        let cells = cells.and_then(|cells| cells.try_into().ok());
        cells.map(Some).ok_or_else(|| D::Error::custom("a thumbnail is none"))
    }
}

impl Look {
    /// That of an image.
    pub fn of(image: &Image) -> Self {
        let (width, height) = (image.width(), image.height());
        Self { width, height, sharpness: sharpness(image), thumbnail: thumbnail(image) }
    }

    /// Whether both show nearly the same picture.
    pub fn is_near(&self, other: &Self) -> bool {
        match (&self.thumbnail, &other.thumbnail) {
            (Some(a), Some(b)) => difference(a, b) < limit(),
            _ => false,
        }
    }

    /// How many times as wide as high.
    pub fn aspect(&self) -> f64 {
        self.width as f64 / self.height as f64
    }
}

/// The pairs of pictures that are nearly the same, each in the order given. Compared are those alone whose thumbnails are about
/// as much brighter on the left than on the right, which differ by no more than their parts do.
pub fn near_pairs(looks: &[&Look]) -> Vec<[usize; 2]> {
    let projection = |thumbnail: &[i8; N_CELLS]| {
        let signed = thumbnail.iter().enumerate().map(|(cell, &value)| {
            if cell % CELLS[0] < CELLS[0] / 2 { i32::from(value) } else { -i32::from(value) }
        });
        signed.sum::<i32>()
    };
    let mut sorted: Vec<(i32, usize, &[i8; N_CELLS])> = looks
        .iter()
        .enumerate()
        .filter_map(|(idx, look)| look.thumbnail.as_ref().map(|own| (projection(own), idx, own)))
        .collect();
    sorted.sort_unstable_by_key(|&(projected, idx, _)| (projected, idx));
    let pairs_of = |first: usize| {
        let (projected, idx, own) = sorted[first];
        let later = sorted[first + 1..].iter().take_while(move |(other, ..)| other - projected < limit());
        let near = later.filter(move |(_, _, other)| difference(own, other) < limit());
        near.map(move |&(_, other_idx, _)| [idx.min(other_idx), idx.max(other_idx)])
    };
    let mut pairs: Vec<[usize; 2]> = (0..sorted.len()).into_par_iter().flat_map_iter(pairs_of).collect();
    pairs.sort_unstable();
    pairs
}

/// The sum of differences below which thumbnails are near.
fn limit() -> i32 {
    (NEAR * N_CELLS as f32) as i32
}

fn difference(a: &[i8; N_CELLS], b: &[i8; N_CELLS]) -> i32 {
    a.iter().zip(b).map(|(a, b)| i32::from(a.abs_diff(*b))).sum()
}

fn thumbnail(image: &Image) -> Option<[i8; N_CELLS]> {
    let [n_columns, n_rows] = CELLS;
    if image.width() < n_columns || image.height() < n_rows {
        return None;
    }
    let mut means = [0.0_f32; N_CELLS];
    for (cell, mean) in means.iter_mut().enumerate() {
        let part = |idx: usize, n_parts: usize, size: usize| idx * size / n_parts..(idx + 1) * size / n_parts;
        let columns = part(cell % n_columns, n_columns, image.width());
        let rows = part(cell / n_columns, n_rows, image.height());
        let sum: u64 =
            rows.clone().flat_map(|y| &image.row(y)[columns.clone()]).map(|&pixel| u64::from(pixel)).sum();
        *mean = sum as f32 / (columns.len() * rows.len()) as f32;
    }
    let mean = means.iter().sum::<f32>() / N_CELLS as f32;
    let deviation = (means.iter().map(|value| (value - mean).powi(2)).sum::<f32>() / N_CELLS as f32).sqrt();
    let cell = |value: f32| ((value - mean) / deviation * CONTRAST).round().clamp(-127.0, 127.0) as i8;
    (deviation >= LEAST_CONTRAST).then(|| means.map(cell))
}

fn sharpness(image: &Image) -> f32 {
    let step = (image.width() / SHARPNESS_WIDTH).max(1);
    let (width, height) = (image.width() / step, image.height() / step);
    // The means of squares of pixels.
    let small = |x: usize, y: usize| {
        let rows = (y * step..(y + 1) * step).map(|row| &image.row(row)[x * step..(x + 1) * step]);
        rows.flatten().map(|&pixel| f32::from(pixel)).sum::<f32>() / (step * step) as f32
    };
    let pixels: Vec<f32> = (0..width * height).map(|idx| small(idx % width, idx / width)).collect();
    let mean = pixels.iter().sum::<f32>() / pixels.len() as f32;
    let contrast = pixels.iter().map(|pixel| (pixel - mean).abs()).sum::<f32>() / pixels.len() as f32;
    let (mut sum, mut n_inner) = (0.0, 0);
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let at = y * width + x;
            let around = pixels[at - 1] + pixels[at + 1] + pixels[at - width] + pixels[at + width];
            sum += (pixels[at] - around / 4.0).abs();
            n_inner += 1;
        }
    }
    sum / n_inner.max(1) as f32 / contrast.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A picture of random rectangles.
    fn picture(seed: u64) -> Image {
        let (width, height) = (320, 240);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut pixels = vec![90_u8; width * height];
        for _ in 0..60 {
            let (left, top) = (random.random_range(0..width - 40), random.random_range(0..height - 40));
            let gray = random.random_range(0..=255);
            for y in top..top + 40 {
                pixels[y * width + left..y * width + left + 40].fill(gray);
            }
        }
        Image::from_pixels(width, height, pixels).unwrap()
    }

    fn with_pixels(image: &Image, pixel: impl Fn(usize, usize) -> u8) -> Image {
        let pixels = (0..image.pixels().len()).map(|idx| pixel(idx % image.width(), idx / image.width()));
        Image::from_pixels(image.width(), image.height(), pixels.collect()).unwrap()
    }

    #[test]
    fn a_picture_that_was_changed_a_little_is_near_and_others_are_not() {
        let image = picture(1);
        let brighter = with_pixels(&image, |x, y| 20 + (f32::from(image.row(y)[x]) * 0.8) as u8);
        let moved = with_pixels(&image, |x, y| image.row(y)[(x + 12).min(319)]);
        let half = Image::from_pixels(
            160,
            120,
            (0..160 * 120).map(|idx| image.row(idx / 160 * 2)[idx % 160 * 2]).collect(),
        );
        let flat = with_pixels(&image, |_, _| 7);
        let all = [image, picture(2), brighter, moved, half.unwrap(), flat.clone(), flat];
        let looks: Vec<Look> = all.iter().map(Look::of).collect();
        let pairs = near_pairs(&looks.iter().collect::<Vec<_>>());
        assert_eq!(pairs, [[0, 2], [0, 4], [2, 4]]);
        assert!(looks[0].is_near(&looks[2]) && !looks[0].is_near(&looks[3]) && !looks[5].is_near(&looks[6]));
    }

    #[test]
    fn all_near_pairs_are_found() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let images: Vec<Image> = (0..60)
            .map(|idx| {
                let image = picture(idx / 3);
                let offset = random.random_range(0..4);
                with_pixels(&image, |x, y| image.row(y)[x].saturating_add(offset))
            })
            .collect();
        let looks: Vec<Look> = images.iter().map(Look::of).collect();
        let all = (0..60).flat_map(|a| (a + 1..60).map(move |b| [a, b]));
        let expected: Vec<[usize; 2]> = all.filter(|&[a, b]| looks[a].is_near(&looks[b])).collect();
        assert!(expected.len() >= 60);
        assert_eq!(near_pairs(&looks.iter().collect::<Vec<_>>()), expected);
    }

    #[test]
    fn a_blurred_picture_is_less_sharp() {
        let image = picture(1);
        let blurred = with_pixels(&image, |x, y| {
            let (rows, columns) =
                (y.saturating_sub(4)..(y + 5).min(240), x.saturating_sub(4)..(x + 5).min(320));
            let n = rows.len() * columns.len();
            let sum: usize = rows.flat_map(|y| &image.row(y)[columns.clone()]).map(|&p| usize::from(p)).sum();
            (sum / n) as u8
        });
        assert!(Look::of(&blurred).sharpness < 0.4 * Look::of(&image).sharpness);
        let tiny = Image::from_pixels(1, 1, vec![3]).unwrap();
        assert_eq!(Look::of(&tiny).sharpness, 0.0);
    }
}
