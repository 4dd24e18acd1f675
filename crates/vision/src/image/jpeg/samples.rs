//! Planes of samples to the luma and the colors of the frame.

use super::frame::{Component, Frame};
use super::{Colors, ImageError, unsupported};
use crate::simd::luma_of;

/// A plane cut to the pixels of the frame.
struct Plane {
    width: usize,
    height: usize,
    samples: Vec<u8>,
}

/// All pixels, row after row.
pub(super) struct Pixels {
    pub luma: Vec<u8>,
    /// Red, green and blue of each.
    pub colors: Option<Vec<u8>>,
}

/// What the planes show: the luma that is stored or that of the colors, and those where they are wanted.
pub(super) fn pixels(
    frame: &mut Frame,
    colors: Colors,
    side: usize,
    with_colors: bool,
) -> Result<Pixels, ImageError> {
    let size = frame.size_at(side);
    let mut planes = Vec::new();
    for component_idx in 0..frame.components.len() {
        if frame.components[component_idx].is_needed() {
            planes.push(full_plane(frame, component_idx, size)?);
        }
    }
    let mut planes = planes.into_iter();
    let (Some(first), second, third, key) = (planes.next(), planes.next(), planes.next(), planes.next())
    else {
        return Ok(Pixels { luma: Vec::new(), colors: None });
    };
    let (Some(second), Some(third)) = (second, third) else {
        let colors = colored(frame, &first, size);
        return Ok(Pixels { luma: first, colors });
    };
    let inks = first.iter().zip(&second).zip(&third).map(|((&a, &b), &c)| [a, b, c]);
    let Some(key) = key else { return Ok(of_rgb(inks, with_colors)) };
    // What printers would leave of white, as Adobe's programs store it.
    let printed = |([a, b, c], key): ([u8; 3], &u8)| {
        let left = match colors {
            Colors::Ycck => rgb_of([a, b, c]),
            _ => [255 - a, 255 - b, 255 - c],
        };
        left.map(|ink| key - product(ink, *key))
    };
    Ok(of_rgb(inks.zip(&key).map(printed), with_colors))
}

/// Pixels of which red, green and blue are known.
fn of_rgb(rgb: impl ExactSizeIterator<Item = [u8; 3]>, with_colors: bool) -> Pixels {
    if !with_colors {
        return Pixels { luma: rgb.map(luma_of).collect(), colors: None };
    }
    let mut luma = Vec::with_capacity(rgb.len());
    let mut colors = vec![0; 3 * rgb.len()];
    for (color, rgb) in colors.as_chunks_mut().0.iter_mut().zip(rgb) {
        *color = rgb;
        luma.push(luma_of(rgb));
    }
    Pixels { luma, colors: Some(colors) }
}

/// Red, green and blue of pixels of this luma; `None` without planes that color it.
fn colored(frame: &mut Frame, luma: &[u8], size: [usize; 2]) -> Option<Vec<u8>> {
    let is_color = |&idx: &usize| frame.components[idx].is_wanted && frame.components[idx].only_colors;
    let idxs: Vec<usize> = (0..frame.components.len()).filter(is_color).collect();
    let &[blue, red] = idxs.as_slice() else { return None };
    // What planes of sizes that do not fit are good for is not known.
    let blue = full_plane(frame, blue, size).ok()?;
    let red = full_plane(frame, red, size).ok()?;
    let mut colors = vec![0; 3 * luma.len()];
    let samples = luma.iter().zip(&blue).zip(&red);
    for (color, ((&luma, &blue), &red)) in colors.as_chunks_mut().0.iter_mut().zip(samples) {
        *color = rgb_of([luma, blue, red]);
    }
    Some(colors)
}

/// `a` times `b`, where 255 is one.
fn product(a: u8, b: u8) -> u8 {
    let product = u32::from(a) * u32::from(b) + 128;
    (((product >> 8) + product) >> 8) as u8
}

/// Red, green and blue of a pixel in the colors of JPEG.
fn rgb_of([luma, blue, red]: [u8; 3]) -> [u8; 3] {
    let (luma, blue, red) = (i32::from(luma), i32::from(blue) - 128, i32::from(red) - 128);
    let half = 32_768;
    [
        luma + ((91_881 * red + half) >> 16),
        luma + ((-22_554 * blue - 46_802 * red + half) >> 16),
        luma + ((116_130 * blue + half) >> 16),
    ]
    .map(|value| value.clamp(0, 255) as u8)
}

/// The plane of a component with as many samples as the frame has pixels.
fn full_plane(frame: &mut Frame, component_idx: usize, size: [usize; 2]) -> Result<Vec<u8>, ImageError> {
    let factors = frame.factors;
    let component = &mut frame.components[component_idx];
    let (across, down) = (factors.across / component.factors.across, factors.down / component.factors.down);
    let is_whole = |all: usize, own: usize| all.is_multiple_of(own);
    if !is_whole(factors.across, component.factors.across) || !is_whole(factors.down, component.factors.down)
    {
        let format = "a JPEG whose planes have sizes that are no multiples of each other";
        return Err(unsupported(format, "save it with one of the usual samplings, such as 4:2:0"));
    }
    let own_size = [
        (size[0] * component.factors.across).div_ceil(factors.across),
        (size[1] * component.factors.down).div_ceil(factors.down),
    ];
    let plane = cut(component, own_size);
    let is_fine = component.side > 1;
    let plane = match (across, down) {
        (1, 1) => plane,
        (2, 1) if is_fine && plane.width > 2 => doubled_across(&plane),
        (1, 2) if is_fine => doubled_down(&plane),
        (2, 2) if is_fine && plane.width > 2 => doubled(&plane),
        _ => repeated(&plane, across, down),
    };
    Ok(cut_samples(plane, size).samples)
}

fn cut(component: &mut Component, size: [usize; 2]) -> Plane {
    let [width, height] = component.n_padded.map(|n_blocks| n_blocks * component.side);
    cut_samples(Plane { width, height, samples: std::mem::take(&mut component.samples) }, size)
}

/// The upper left part of a plane.
fn cut_samples(mut plane: Plane, [width, height]: [usize; 2]) -> Plane {
    if width < plane.width {
        for y in 1..height {
            plane.samples.copy_within(y * plane.width..y * plane.width + width, y * width);
        }
    }
    plane.samples.truncate(width * height);
    Plane { width, height, samples: plane.samples }
}

fn repeated(plane: &Plane, across: usize, down: usize) -> Plane {
    let (width, height) = (plane.width * across, plane.height * down);
    let rows = (0..height).map(|y| &plane.samples[y / down * plane.width..][..plane.width]);
    let samples = rows.flat_map(|row| row.iter().flat_map(|&sample| std::iter::repeat_n(sample, across)));
    Plane { width, height, samples: samples.collect() }
}

/// Fills a row twice as long as `row`: three parts of the nearest number, one of the next. The numbers are divided by
/// 2 to the power of `shift`, those mixed with the left and the right neighbor rounded by `rounding`.
fn widen(row: &[u16], shift: u32, rounding: [u16; 2], wide: &mut [u8]) {
    let mixed =
        |nearest: u16, other: u16, side: usize| ((3 * nearest + other + rounding[side]) >> shift) as u8;
    if let ([first, ..], [.., last]) = (row, row) {
        wide[0] = mixed(*first, *first, 0);
        wide[2 * row.len() - 1] = mixed(*last, *last, 1);
    }
    for (pair, neighbors) in wide[1..].as_chunks_mut().0.iter_mut().zip(row.windows(2)) {
        *pair = [mixed(neighbors[0], neighbors[1], 1), mixed(neighbors[1], neighbors[0], 0)];
    }
}

fn doubled_across(plane: &Plane) -> Plane {
    let mut samples = vec![0; 2 * plane.samples.len()];
    let mut numbers = vec![0; plane.width];
    let rows = plane.samples.chunks_exact(plane.width);
    for (row, wide) in rows.zip(samples.chunks_exact_mut(2 * plane.width)) {
        numbers.iter_mut().zip(row).for_each(|(number, &sample)| *number = u16::from(sample));
        widen(&numbers, 2, [1, 2], wide);
    }
    Plane { width: 2 * plane.width, height: plane.height, samples }
}

/// For each row of a plane twice as high: its nearest row and the next.
fn row_pairs(plane: &Plane) -> impl Iterator<Item = (&[u8], &[u8])> {
    let row = |y: usize| &plane.samples[y * plane.width..][..plane.width];
    (0..2 * plane.height).map(move |y| {
        let nearest = y / 2;
        let other = if y % 2 == 0 { nearest.saturating_sub(1) } else { (nearest + 1).min(plane.height - 1) };
        (row(nearest), row(other))
    })
}

fn doubled_down(plane: &Plane) -> Plane {
    let mut samples = Vec::with_capacity(2 * plane.samples.len());
    for (y, (nearest, other)) in row_pairs(plane).enumerate() {
        let rounding = if y % 2 == 0 { 1 } else { 2 };
        let mixed =
            |(&near, &far): (&u8, &u8)| ((3 * u32::from(near) + u32::from(far) + rounding) >> 2) as u8;
        samples.extend(nearest.iter().zip(other).map(mixed));
    }
    Plane { width: plane.width, height: 2 * plane.height, samples }
}

fn doubled(plane: &Plane) -> Plane {
    let mut samples = vec![0; 4 * plane.samples.len()];
    let mut sums = vec![0; plane.width];
    for ((nearest, other), wide) in row_pairs(plane).zip(samples.chunks_exact_mut(2 * plane.width)) {
        for ((sum, &near), &far) in sums.iter_mut().zip(nearest).zip(other) {
            *sum = 3 * u16::from(near) + u16::from(far);
        }
        widen(&sums, 4, [8, 7], wide);
    }
    Plane { width: 2 * plane.width, height: 2 * plane.height, samples }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane() -> Plane {
        Plane { width: 3, height: 2, samples: vec![0, 100, 200, 40, 140, 240] }
    }

    #[test]
    fn doubling_keeps_corners_and_mixes_between() {
        assert_eq!(doubled_across(&plane()).samples[..6], [0, 25, 75, 125, 175, 200]);
        let column: Vec<u8> = doubled_down(&plane()).samples.chunks(3).map(|row| row[0]).collect();
        assert_eq!(column, [0, 10, 30, 40]);
        let both = doubled(&plane());
        assert_eq!((both.width, both.height), (6, 4));
        assert_eq!((both.samples[0], both.samples[23]), (0, 240));
        assert_eq!(both.samples[7], 35);
    }

    #[test]
    fn repeating_and_cutting() {
        let large = repeated(&plane(), 4, 3);
        assert_eq!((large.width, large.height, large.samples.len()), (12, 6, 72));
        assert_eq!(cut_samples(large, [5, 4]).samples[14..], [100, 40, 40, 40, 40, 140]);
    }

    #[test]
    fn inks_are_taken_from_white() {
        assert_eq!(product(255, 255), 255);
        assert_eq!(rgb_of([100, 128, 128]), [100, 100, 100]);
        assert_eq!(rgb_of([76, 85, 255]), [254, 0, 0]);
    }
}
