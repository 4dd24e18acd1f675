//! Frames to what a network takes: colors at its size, the whole horizon where the camera sees all of it.
//!
//! Panoramas are cut where their edges meet, and mirrors bend what they show. A panorama, or the ring of a mirror
//! unrolled to one, goes through a network as views around the horizon or as one strip that goes on beyond both
//! edges.

use super::{ColorOrder, Input, Size};
use crate::camera::{Mirror, Projection, View};
use crate::detect::Keypoint;
use crate::image::Image;
use crate::matrix::Matrix;
use fast_image_resize::images::{TypedImage, TypedImageRef};
use fast_image_resize::pixels::U8x3;
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions, Resizer};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::f32::consts::TAU;
use std::ops::Range;

/// What is to be seen of a panorama: poles show ceiling and floor, stretched, and are left out of views.
const VIEWS_BEGIN: [usize; 2] = [1, 8];
const VIEWS_END: [usize; 2] = [7, 8];

/// The most columns and rows that a mirror is unrolled to.
const MAX_UNROLLED: [usize; 2] = [2048, 512];

/// The color of what is hidden in a frame of which nothing is to be seen.
const NEUTRAL: [u8; 3] = [128; 3];

/// How frames of cameras that see all around are given to a network. Others are seen in one piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Around {
    /// As square views in all directions, which overlap where there are more than three. Of panoramas they show
    /// what lies between an eighth and seven eighths of the height.
    Views {
        /// How many, from 1 to 64.
        n: usize,
    },
    /// As one strip of the whole horizon.
    Strip {
        /// Columns of the input at either edge that show once more what is at the other; a quarter of all at
        /// most. Cells and keypoints there are dropped. A vector counts what they show twice: that of a panorama that was
        /// turned is not quite the same, with a cosine of about 0.99 for EfficientNet-Lite0.
        border: u32,
    },
}

/// A frame as a network takes it.
#[derive(Clone, Debug)]
pub struct FrameInput<'a> {
    view: &'a View,
    size: Size,
    panes: Vec<Pane>,
    values: Vec<f32>,
}

/// A part of a frame that a network sees at once. Positions are those of a panorama, or of a mirror unrolled.
#[derive(Clone, Copy, Debug)]
struct Pane {
    /// Where its first column begins; beyond an edge where the panorama goes on there.
    left: f64,
    /// Where its first row begins.
    top: f64,
    width: f64,
    height: f64,
    /// Columns of the input at either edge that another shows as well.
    border: u32,
}

/// The pixels that panes are cut out of: a frame, or a mirror unrolled.
struct Panorama<'a> {
    width: usize,
    height: usize,
    wraps: bool,
    /// Red, green and blue of each pixel.
    colors: Cow<'a, [u8]>,
}

impl Around {
    /// What is wrong with it for inputs of `size`, if anything.
    pub fn check(&self, size: Size) -> Result<(), String> {
        match *self {
            Self::Views { n } if !(1..=64).contains(&n) => {
                Err(format!("a panorama must be seen in 1 to 64 views, not {n}"))
            }
            Self::Strip { border } if border > size.width / 4 => Err(format!(
                "a strip's border may be a quarter of the input's {} columns, not {border}",
                size.width
            )),
            _ => Ok(()),
        }
    }

    /// The parts of a panorama of `width` x `height` pixels; all of the height where `is_ring`.
    fn panes(&self, [width, height]: [usize; 2], is_ring: bool, size: Size) -> Vec<Pane> {
        match *self {
            Self::Views { n } => {
                let row = |[share, all]: [usize; 2]| height * share / all;
                let (top, bottom) = if is_ring { (0, height) } else { (row(VIEWS_BEGIN), row(VIEWS_END)) };
                let side = (bottom - top).max(1) as f64;
                let left = |idx: usize| (idx * width / n) as f64;
                let pane =
                    |idx| Pane { left: left(idx), top: top as f64, width: side, height: side, border: 0 };
                (0..n).map(pane).collect()
            }
            Self::Strip { border } => {
                let beyond = f64::from(border) * width as f64 / f64::from(size.width - 2 * border);
                let (left, width) = (-beyond, width as f64 + 2.0 * beyond);
                vec![Pane { left, top: 0.0, width, height: height as f64, border }]
            }
        }
    }
}

impl<'a> FrameInput<'a> {
    /// A frame, gray if it has no colors, at `size` pixels as `input` wants them. `view` is that of the camera for
    /// frames of this size, within what is visible of this one: what it hides becomes the mean color of the rest.
    /// Aspect ratios give way; several pixels for one of the input are averaged.
    ///
    /// Panics when `around` does not suit `size`, see [`Around::check`], and when `view` is for another size.
    pub fn of(image: &Image, view: &'a View, around: &Around, size: Size, input: &Input) -> Self {
        assert_eq!([image.width(), image.height()], [view.width(), view.height()], "a view of another size");
        assert_eq!(around.check(size), Ok(()));
        let panorama = match view.projection() {
            Projection::Omnidirectional(mirror) => unrolled(image, view, &mirror),
            Projection::Perspective | Projection::Equirectangular => shown(image, view),
        };
        let extent = [panorama.width, panorama.height];
        let panes = match view.projection() {
            Projection::Perspective => Around::Strip { border: 0 }.panes(extent, false, size),
            Projection::Equirectangular => around.panes(extent, false, size),
            Projection::Omnidirectional(_) => around.panes(extent, true, size),
        };
        let n_pixels = size.width as usize * size.height as usize;
        let mut values = vec![0.0; panes.len() * 3 * n_pixels];
        let mut colors = vec![0; 3 * n_pixels];
        for (pane, values) in panes.iter().zip(values.chunks_exact_mut(3 * n_pixels)) {
            panorama.resized(pane, size, &mut colors);
            for (color, values) in values.chunks_exact_mut(n_pixels).enumerate() {
                let channel = if input.order == ColorOrder::Bgr { 2 - color } else { color };
                let value = |byte: u8| (f32::from(byte) - input.mean[channel]) * input.scale[channel];
                let table: [f32; 256] = std::array::from_fn(|byte| value(byte as u8));
                for (value, pixel) in values.iter_mut().zip(colors.as_chunks::<3>().0) {
                    *value = table[usize::from(pixel[channel])];
                }
            }
        }
        Self { view, size, panes, values }
    }

    /// What the network is given, one after the other: `3 x height x width` numbers each.
    pub fn views(&self) -> impl ExactSizeIterator<Item = &[f32]> {
        self.values.chunks_exact(3 * self.size.width as usize * self.size.height as usize)
    }

    /// Where position (x, y) of view `view_idx` lies in the frame, both in pixels whose middles are whole numbers.
    /// `None` where the frame shows nothing, or where another position shows the same. Panics when there is no
    /// such view.
    pub fn place(&self, view_idx: usize, [x, y]: [f32; 2]) -> Option<[f32; 2]> {
        let pane = &self.panes[view_idx];
        let border = pane.border as f32;
        let is_repeated = x + 0.5 < border || x + 0.5 >= self.size.width as f32 - border;
        if is_repeated && pane.border > 0 {
            return None;
        }
        let (across, down) = self.steps(pane);
        let column = (pane.left + f64::from(x + 0.5) * across) as f32;
        let row = (pane.top + f64::from(y + 0.5) * down) as f32;
        // In a frame that was enlarged up to half a pixel beyond its edge.
        let within = |position: f32, side: usize| (position - 0.5).clamp(0.0, (side - 1) as f32);
        let [x, y] = match self.view.projection() {
            Projection::Omnidirectional(mirror) => {
                let extent = unrolled_extent(self.view, &mirror);
                position_in_ring(self.view, &mirror, extent, [column, row])
            }
            Projection::Perspective => [within(column, self.view.width()), within(row, self.view.height())],
            Projection::Equirectangular => [self.view.column(column - 0.5), within(row, self.view.height())],
        };
        self.view.contains(x, y, 0.0).then_some([x, y])
    }

    /// Keypoints that were found in view `view_idx` as keypoints of the frame, with their descriptors, a row each.
    /// Those that have no [`FrameInput::place`] are dropped.
    pub fn to_frame(
        &self,
        view_idx: usize,
        keypoints: &[Keypoint],
        descriptors: &Matrix,
    ) -> (Vec<Keypoint>, Matrix) {
        let (across, down) = self.steps(&self.panes[view_idx]);
        let enlarged = (across * down).sqrt() as f32;
        let mut placed = (Vec::with_capacity(keypoints.len()), Matrix::new(descriptors.n_cols()));
        for (keypoint, row) in keypoints.iter().zip(descriptors.rows()) {
            if let Some([x, y]) = self.place(view_idx, [keypoint.x, keypoint.y]) {
                placed.0.push(Keypoint { x, y, scale: keypoint.scale * enlarged, ..*keypoint });
                placed.1.push_row(row);
            }
        }
        placed
    }

    /// Columns and rows of the panorama for one of the input.
    fn steps(&self, pane: &Pane) -> (f64, f64) {
        (pane.width / f64::from(self.size.width), pane.height / f64::from(self.size.height))
    }
}

impl Panorama<'_> {
    /// Red, green and blue of a part of it, at `size` pixels.
    fn resized(&self, pane: &Pane, size: Size, colors: &mut [u8]) {
        // Whole columns that hold the pane and what is averaged with its edges, copied together where they go beyond
        // those of the frame.
        let reach = (pane.width / f64::from(size.width)).max(1.0);
        let (first, end) = ((pane.left - reach).floor(), (pane.left + pane.width + reach).ceil());
        let is_inside = first >= 0.0 && end <= self.width as f64;
        let (source, width, left) = if is_inside || !self.wraps {
            (Cow::Borrowed(&*self.colors), self.width, pane.left)
        } else {
            let columns = self.columns(first as i64..end as i64);
            (Cow::Owned(columns), (end - first) as usize, pane.left - first)
        };
        let area = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Bilinear)).crop(
            left,
            pane.top,
            pane.width.min(width as f64 - left),
            pane.height,
        );
        // Both have as many bytes as pixels, and the pane lies in the source.
        let resized = TypedImageRef::<U8x3>::from_buffer(width as u32, self.height as u32, &source)
            .ok()
            .zip(TypedImage::<U8x3>::from_buffer(size.width, size.height, colors).ok())
            .and_then(|(source, mut target)| Resizer::new().resize_typed(&source, &mut target, &area).ok());
        assert!(resized.is_some(), "a part of a frame does not lie in it");
    }

    /// Columns of all rows, as if the panorama went round and round.
    fn columns(&self, columns: Range<i64>) -> Vec<u8> {
        let n_columns = (columns.end - columns.start) as usize;
        let mut copied = Vec::with_capacity(3 * self.height * n_columns);
        let first = columns.start.rem_euclid(self.width as i64) as usize;
        for row in self.colors.chunks_exact(3 * self.width) {
            let (mut start, mut n_missing) = (first, n_columns);
            while n_missing > 0 {
                let n = n_missing.min(self.width - start);
                copied.extend_from_slice(&row[3 * start..3 * (start + n)]);
                (start, n_missing) = (0, n_missing - n);
            }
        }
        copied
    }
}

/// A frame with what `view` hides painted over.
fn shown<'a>(image: &'a Image, view: &View) -> Panorama<'a> {
    let mut colors = colors_of(image);
    if !view.is_whole_frame() {
        let width = image.width();
        let is_shown = |idx: usize| view.contains((idx % width) as f32, (idx / width) as f32, 0.0);
        let is_shown: Vec<bool> = (0..image.pixels().len()).map(is_shown).collect();
        paint_over(colors.to_mut(), &is_shown);
    }
    Panorama { width: image.width(), height: image.height(), wraps: view.wraps(), colors }
}

/// Red, green and blue of each pixel; all its luma where the frame has no colors.
fn colors_of(image: &Image) -> Cow<'_, [u8]> {
    match image.colors() {
        Some(colors) => Cow::Borrowed(colors),
        None => Cow::Owned(image.pixels().iter().flat_map(|&luma| [luma; 3]).collect()),
    }
}

/// Gives the mean color of the pixels that are shown to all others.
fn paint_over(colors: &mut [u8], is_shown: &[bool]) {
    let pixels = colors.as_chunks_mut::<3>().0;
    let mut sums = [0u64; 3];
    for (pixel, _) in pixels.iter().zip(is_shown).filter(|&(_, &is_shown)| is_shown) {
        sums.iter_mut().zip(pixel).for_each(|(sum, &value)| *sum += u64::from(value));
    }
    let n_shown = is_shown.iter().filter(|&&is_shown| is_shown).count() as u64;
    let mean = if n_shown == 0 { NEUTRAL } else { sums.map(|sum| ((sum + n_shown / 2) / n_shown) as u8) };
    for (pixel, _) in pixels.iter_mut().zip(is_shown).filter(|&(_, &is_shown)| !is_shown) {
        *pixel = mean;
    }
}

/// The columns and rows of a mirror unrolled: about as many as its ring has pixels.
fn unrolled_extent(view: &View, mirror: &Mirror) -> [usize; 2] {
    let width = view.width() as f32;
    let sides = [
        TAU * (mirror.inner_radius + mirror.outer_radius) / 2.0 * width,
        (mirror.outer_radius - mirror.inner_radius) * width,
    ];
    std::array::from_fn(|idx| (sides[idx].round() as usize).clamp(1, MAX_UNROLLED[idx]))
}

/// Where a position of a mirror unrolled lies in the frame, in pixels whose middles are whole numbers. Columns go
/// round clockwise from the right, rows from the outer rim, where the horizon is, to the inner one.
fn position_in_ring(view: &View, mirror: &Mirror, extent: [usize; 2], [column, row]: [f32; 2]) -> [f32; 2] {
    let width = view.width() as f32;
    let ring = mirror.outer_radius - mirror.inner_radius;
    let radius = (mirror.outer_radius - ring * row / extent[1] as f32) * width;
    let (sine, cosine) = (TAU * column / extent[0] as f32).sin_cos();
    [mirror.center_x * width + radius * cosine, mirror.center_y * width + radius * sine]
}

/// The ring of a mirror as a panorama.
fn unrolled(image: &Image, view: &View, mirror: &Mirror) -> Panorama<'static> {
    let extent = unrolled_extent(view, mirror);
    let source = colors_of(image);
    let mut colors = vec![0; 3 * extent[0] * extent[1]];
    let mut is_shown = vec![true; extent[0] * extent[1]];
    for (idx, (color, is_shown)) in colors.as_chunks_mut::<3>().0.iter_mut().zip(&mut is_shown).enumerate() {
        let middle = [(idx % extent[0]) as f32 + 0.5, (idx / extent[0]) as f32 + 0.5];
        let [x, y] = position_in_ring(view, mirror, extent, middle);
        *is_shown = view.contains(x, y, 0.0);
        if *is_shown {
            *color = interpolated(&source, [view.width(), view.height()], [x, y]);
        }
    }
    if is_shown.contains(&false) {
        paint_over(&mut colors, &is_shown);
    }
    Panorama { width: extent[0], height: extent[1], wraps: true, colors: Cow::Owned(colors) }
}

/// The color at a position in a frame, between the four pixels round it, by 256ths of a pixel.
fn interpolated(colors: &[u8], [width, height]: [usize; 2], [x, y]: [f32; 2]) -> [u8; 3] {
    const ONE: usize = 256;
    let split = |position: f32, side: usize| {
        let fixed = (position * ONE as f32).round() as usize;
        (fixed / ONE, (fixed / ONE + 1).min(side - 1), (fixed % ONE) as u32)
    };
    let ((left, right, across), (top, bottom, down)) = (split(x, width), split(y, height));
    std::array::from_fn(|color| {
        let at = |x: usize, y: usize| u32::from(colors[3 * (y * width + x) + color]);
        let row = |y: usize| at(left, y) * (ONE as u32 - across) + at(right, y) * across;
        ((row(top) * (ONE as u32 - down) + row(bottom) * down + 32_768) >> 16) as u8
    })
}

#[cfg(test)]
mod tests;
