//! The square round a keypoint that is described, and its pixels.

use crate::camera::View;
use crate::detect::Keypoint;
use crate::image::Image;
use crate::simd;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The longest side that a region may have, in pixels.
pub(super) const MAX_SIDE: usize = 255;

/// The square round a keypoint that is described. Its size is not published; sides of 24 to 48 pixels do
/// about as well on held-out frames (docs/RESULTS.md).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Region {
    /// Its side in pixels.
    pub side: usize,
    /// How much its pixels count.
    pub weighting: Weighting,
    /// Whether the side is that at scale 1, and grows with the scale of a keypoint up to 255 pixels; else it is the
    /// same for all.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub scaled: bool,
}

impl Default for Region {
    fn default() -> Self {
        Self { side: 32, weighting: Weighting::Uniform, scaled: false }
    }
}

/// How much the pixels of a region count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// All the same.
    Uniform,
    /// By a Gaussian round the keypoint whose sigma is half the side.
    Gaussian,
}

impl Region {
    /// What is wrong with the parameters, if anything.
    pub(super) fn check(&self, n_cells: usize) -> Result<(), String> {
        if self.side < n_cells || self.side > MAX_SIDE {
            return Err(format!(
                "a region's side must be from {n_cells} to {MAX_SIDE} pixels, not {}",
                self.side
            ));
        }
        Ok(())
    }

    /// Its side round a keypoint, in pixels, at least one a cell.
    pub(super) fn side_at(&self, keypoint: &Keypoint, n_cells: usize) -> usize {
        if !self.scaled {
            return self.side;
        }
        ((self.side as f32 * keypoint.scale).round() as usize).clamp(n_cells, MAX_SIDE)
    }

    /// The keypoints with a region of the same side, each with the index of its row, and that region.
    pub(super) fn by_side<'a>(
        &self,
        keypoints: &'a [Keypoint],
        n_cells: usize,
    ) -> impl Iterator<Item = (Self, Vec<(usize, &'a Keypoint)>)> {
        let mut by_side: BTreeMap<usize, Vec<(usize, &Keypoint)>> = BTreeMap::new();
        for (row_idx, keypoint) in keypoints.iter().enumerate() {
            // Most often all are of one.
            let n_expected = if by_side.is_empty() { keypoints.len() } else { 0 };
            let of_side = by_side.entry(self.side_at(keypoint, n_cells));
            of_side.or_insert_with(|| Vec::with_capacity(n_expected)).push((row_idx, keypoint));
        }
        let region = *self;
        by_side.into_iter().map(move |(side, keypoints)| (Self { side, ..region }, keypoints))
    }

    /// Whole numbers, one a pixel, row after row.
    pub(super) fn weights(&self) -> Vec<u32> {
        let center = (self.side as f64 - 1.0) / 2.0;
        let sigma = self.side as f64 / 2.0;
        let weight = |pixel_idx: usize| {
            let (dx, dy) = ((pixel_idx % self.side) as f64 - center, (pixel_idx / self.side) as f64 - center);
            match self.weighting {
                Weighting::Uniform => 1,
                Weighting::Gaussian => {
                    (256.0 * (-(dx * dx + dy * dy) / (2.0 * sigma * sigma)).exp()).round() as u32
                }
            }
        };
        (0..self.side * self.side).map(weight).collect()
    }
}

/// The pixels of a region and of a margin round it, taken from an image; the memory is used again and again.
pub(super) struct Window {
    region_side: usize,
    margin: usize,
    /// Row after row, and as many more as are read beyond them.
    pixels: Vec<u8>,
    /// One a pixel of the region without its margin, 255 where it does not count; empty when all do.
    outside: Vec<u8>,
    /// The upright surroundings of a turned window that reaches beyond the frame.
    surroundings: Vec<u8>,
    /// See [`simd::interpolate_grid`].
    quads: Vec<u32>,
}

impl Window {
    pub(super) fn new(region: &Region, margin: usize) -> Self {
        let mut window = Self {
            region_side: region.side,
            margin,
            pixels: Vec::new(),
            outside: Vec::new(),
            surroundings: Vec::new(),
            quads: Vec::new(),
        };
        let side = window.side();
        // What is read of them for the last codes: of neighbors below and to the right.
        let n_read = window.new_codes().len() * simd::CODE_BLOCK + 2 * margin * (side + 1) + 1;
        window.pixels = vec![0; n_read.max(side * side + simd::GRID_BLOCK)];
        window
    }

    /// The side with both margins.
    pub(super) fn side(&self) -> usize {
        self.region_side + 2 * self.margin
    }

    /// Row after row of [`Window::side`] pixels; some that mean nothing follow.
    pub(super) fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// Memory for a code for each pixel of the region: rows of [`Window::side`], the region's pixels at the
    /// start of each. What else there is means nothing.
    pub(super) fn new_codes(&self) -> Vec<[u8; simd::CODE_BLOCK]> {
        let last_row = self.region_side.next_multiple_of(simd::COUNT_BLOCK);
        let n_codes = (self.region_side - 1) * self.side() + last_row;
        vec![[0; simd::CODE_BLOCK]; n_codes.div_ceil(simd::CODE_BLOCK)]
    }

    /// 0 where a pixel of the region lies, with its margin, in the valid region, else 255; `None` when all
    /// do.
    pub(super) fn outside(&self) -> Option<&[u8]> {
        (!self.outside.is_empty()).then_some(&self.outside)
    }

    /// Takes the pixels round `keypoint`, the vertical axis along the radial direction if there is one.
    pub(super) fn take(&mut self, image: &Image, keypoint: &Keypoint, view: &View) {
        let (x, y) = (keypoint.x, keypoint.y);
        let reach = (self.region_side / 2 + self.margin) as f32;
        let (down, radius) = match view.radial_direction(x, y) {
            None => {
                self.take_upright(image, keypoint, view);
                ((0.0, 1.0), reach)
            }
            Some(down) => {
                self.take_turned(image, keypoint, down);
                // Half the diagonal.
                (down, reach * std::f32::consts::SQRT_2)
            }
        };
        self.outside.clear();
        if !view.contains(x, y, radius) {
            self.mark_outside(keypoint, down, view);
        }
    }

    fn take_upright(&mut self, image: &Image, keypoint: &Keypoint, view: &View) {
        let reach = (self.region_side / 2 + self.margin) as isize;
        let corner = (keypoint.x.round() as isize - reach, keypoint.y.round() as isize - reach);
        let side = self.side();
        copy_square(image, corner, side, view.wraps(), &mut self.pixels);
    }

    /// Bilinear interpolation in fixed point: positions in 1/65536 of a pixel.
    fn take_turned(&mut self, image: &Image, keypoint: &Keypoint, (down_x, down_y): (f32, f32)) {
        let side = self.side();
        let reach = (self.region_side / 2 + self.margin) as f32;
        // Half the diagonal, and the pixels that are interpolated between.
        let half = (reach * std::f32::consts::SQRT_2).ceil() + 2.0;
        let is_inside = keypoint.x >= half
            && keypoint.y >= half
            && keypoint.x + half < image.width() as f32
            && keypoint.y + half < image.height() as f32;
        let (pixels, width, (x, y)) = if is_inside {
            (image.pixels(), image.width(), (keypoint.x, keypoint.y))
        } else {
            let corner = (keypoint.x.floor() - half, keypoint.y.floor() - half);
            let surroundings_side = 2 * half as usize + 2;
            self.surroundings.resize(surroundings_side * surroundings_side, 0);
            let whole = (corner.0 as isize, corner.1 as isize);
            copy_square(image, whole, surroundings_side, false, &mut self.surroundings);
            (&self.surroundings[..], surroundings_side, (keypoint.x - corner.0, keypoint.y - corner.1))
        };

        let fixed = |(x, y): (f32, f32)| ((x * 65_536.0) as i32, (y * 65_536.0) as i32);
        let (right_x, right_y) = (down_y, -down_x);
        let grid = simd::Grid {
            start: fixed((x - reach * (right_x + down_x), y - reach * (right_y + down_y))),
            right: fixed((right_x, right_y)),
            down: fixed((down_x, down_y)),
            side,
        };
        self.quads.resize(grid.n_quads(), 0);
        simd::interpolate_grid(pixels, width, grid, &mut self.quads, &mut self.pixels);
    }

    fn mark_outside(&mut self, keypoint: &Keypoint, down: (f32, f32), view: &View) {
        let side = self.region_side;
        let half = (side / 2) as f32;
        let right = (down.1, -down.0);
        self.outside.resize(side * side, 0);
        for (row_idx, outside) in self.outside.chunks_exact_mut(side).enumerate() {
            let along = row_idx as f32 - half;
            let start =
                (keypoint.x - half * right.0 + along * down.0, keypoint.y - half * right.1 + along * down.1);
            view.mark_outside(start, right, self.margin as f32, outside);
        }
    }
}

/// Copies the square of `side` pixels whose upper left corner is `corner`; see [`copy_rows`].
fn copy_square(image: &Image, corner: (isize, isize), side: usize, wraps: bool, square: &mut [u8]) {
    copy_rows(image, corner, side, wraps, &mut square[..side * side]);
}

/// Copies rows of `width` pixels, the first of which begins at (left, top). Beyond the image its border pixels are
/// repeated, or its columns when it `wraps`.
pub(super) fn copy_rows(
    image: &Image,
    (left, top): (isize, isize),
    width: usize,
    wraps: bool,
    rows: &mut [u8],
) {
    let (image_width, image_height) = (image.width() as isize, image.height() as isize);
    for (y, line) in (top..).zip(rows.chunks_exact_mut(width)) {
        let row = image.row(y.clamp(0, image_height - 1) as usize);
        if left >= 0 && left + width as isize <= image_width {
            line.copy_from_slice(&row[left as usize..][..width]);
            continue;
        }
        for (x, pixel) in (left..).zip(line) {
            let x = if wraps { x.rem_euclid(image_width) } else { x.clamp(0, image_width - 1) };
            *pixel = row[x as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Mirror, Projection};

    fn gradient(width: usize, height: usize) -> Image {
        let pixel = |idx: usize| (2 * (idx % width) + idx / width) as u8;
        Image::from_pixels(width, height, (0..width * height).map(pixel).collect()).unwrap()
    }

    fn keypoint(x: f32, y: f32) -> Keypoint {
        Keypoint::new(x, y, 1.0)
    }

    #[test]
    fn upright_windows_are_copies() {
        let image = gradient(60, 40);
        let view = Camera::new(Projection::Perspective).view(60, 40);
        let mut window = Window::new(&Region { side: 8, ..Region::default() }, 3);
        window.take(&image, &keypoint(30.0, 20.0), &view);
        assert_eq!(window.outside(), None);
        for (idx, &pixel) in window.pixels()[..14 * 14].iter().enumerate() {
            assert_eq!(pixel, image.row(20 - 7 + idx / 14)[30 - 7 + idx % 14]);
        }
    }

    #[test]
    fn pixels_beyond_the_frame_do_not_count() {
        let image = gradient(60, 40);
        let view = Camera::new(Projection::Perspective).view(60, 40);
        let mut window = Window::new(&Region { side: 8, ..Region::default() }, 3);
        window.take(&image, &keypoint(4.0, 20.0), &view);
        let outside = window.outside().unwrap();
        // Columns 0..8 of the frame; those nearer than the margin to its edge are out.
        let expected: Vec<u8> = (0..64).map(|idx| if idx % 8 >= 3 { 0 } else { 255 }).collect();
        assert_eq!(outside, expected);
    }

    #[test]
    fn panoramas_continue_beyond_their_edge() {
        let image = gradient(60, 40);
        let view = Camera::new(Projection::Equirectangular).view(60, 40);
        let mut window = Window::new(&Region { side: 8, ..Region::default() }, 2);
        window.take(&image, &keypoint(1.0, 20.0), &view);
        assert_eq!(window.outside(), None);
        assert_eq!(window.pixels()[0], image.row(14)[60 - 5]);
    }

    #[test]
    fn mirror_windows_turn_with_the_radial_direction() {
        // Rings round the center: along the radial axis the window shows them as rows, whatever the angle.
        let mirror = Mirror { center_x: 0.5, center_y: 0.5, inner_radius: 0.05, outer_radius: 0.5 };
        let view = Camera::new(Projection::Omnidirectional(mirror)).view(200, 200);
        let ring = |idx: usize| {
            let (dx, dy) = ((idx % 200) as f32 - 100.0, (idx / 200) as f32 - 100.0);
            (2.0 * dx.hypot(dy)) as u8
        };
        let image = Image::from_pixels(200, 200, (0..200 * 200).map(ring).collect()).unwrap();
        let mut window = Window::new(&Region { side: 8, ..Region::default() }, 1);
        for angle in [0.0f32, 0.7, 2.0, 4.0, 5.5] {
            let (x, y) = (100.0 + 50.0 * angle.cos(), 100.0 + 50.0 * angle.sin());
            window.take(&image, &keypoint(x, y), &view);
            assert_eq!(window.outside(), None);
            for (row_idx, row) in window.pixels()[..100].chunks(10).enumerate() {
                let radius = 50.0 + row_idx as f32 - 5.0;
                for &pixel in row {
                    assert!((f32::from(pixel) - 2.0 * radius).abs() < 3.0, "{angle} {row_idx} {pixel}");
                }
            }
        }
    }

    #[test]
    fn turned_windows_repeat_the_border_beyond_the_frame() {
        let mirror = Mirror { center_x: 0.5, center_y: 0.5, inner_radius: 0.0, outer_radius: 0.5 };
        let camera = Camera::new(Projection::Omnidirectional(mirror));
        let image = gradient(60, 60);
        let continued = |idx: usize| {
            let at = |position: usize| position.clamp(40, 99) - 40;
            image.row(at(idx / 140))[at(idx % 140)]
        };
        let larger = Image::from_pixels(140, 140, (0..140 * 140).map(continued).collect()).unwrap();
        let region = Region { side: 16, ..Region::default() };
        let (mut window, mut expected) = (Window::new(&region, 2), Window::new(&region, 2));
        for (x, y) in [(1.0, 1.0), (3.0, 30.0), (57.0, 12.0), (31.0, 59.0), (14.0, 14.0)] {
            window.take(&image, &keypoint(x, y), &camera.view(60, 60));
            expected.take(&larger, &keypoint(x + 40.0, y + 40.0), &camera.view(140, 140));
            for (&pixel, &expected) in window.pixels().iter().zip(expected.pixels()).take(20 * 20) {
                assert!(pixel.abs_diff(expected) <= 1, "{x} {y}: {pixel} {expected}");
            }
        }
    }

    #[test]
    fn tiny_images_are_no_problem() {
        let mirror = Mirror { center_x: 0.0, center_y: 0.0, inner_radius: 0.0, outer_radius: 4.0 };
        for projection in
            [Projection::Perspective, Projection::Equirectangular, Projection::Omnidirectional(mirror)]
        {
            for (width, height) in [(1, 1), (2, 1), (1, 5), (3, 3)] {
                let image = gradient(width, height);
                let view = Camera::new(projection).view(width, height);
                let mut window = Window::new(&Region::default(), 3);
                window.take(&image, &keypoint(width as f32 - 0.5, 0.0), &view);
                assert_eq!(window.outside().unwrap().len(), Region::default().side.pow(2));
            }
        }
    }
}
