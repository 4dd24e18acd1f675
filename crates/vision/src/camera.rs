//! The kind of camera a frame comes from, and where its pixels are valid.

mod mirror;

pub use mirror::Mirror;

use crate::image::{Image, Region};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// How a camera projects the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraKind {
    /// An ordinary lens.
    Perspective,
    /// A full panorama, longitude by latitude; the left and right edges meet.
    Equirectangular,
    /// A camera that looks up into a curved mirror.
    Omnidirectional,
}

impl CameraKind {
    /// Whether turning the robot only moves what it sees across the frame.
    pub fn sees_all_around(self) -> bool {
        self != Self::Perspective
    }
}

/// A camera as a model knows it. Nothing is detected or described outside its valid region.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// How it projects.
    pub projection: Projection,
    /// Parts of the frame that always show the robot itself.
    pub mask: Option<Mask>,
}

/// A [`CameraKind`] with the numbers it needs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Projection {
    /// An ordinary lens.
    Perspective,
    /// A full panorama; the left and right edges meet.
    Equirectangular,
    /// A mirror seen from below.
    Omnidirectional(Mirror),
}

impl Projection {
    /// The kind of camera.
    pub fn kind(&self) -> CameraKind {
        match self {
            Self::Perspective => CameraKind::Perspective,
            Self::Equirectangular => CameraKind::Equirectangular,
            Self::Omnidirectional(_) => CameraKind::Omnidirectional,
        }
    }
}

/// Which pixels of a frame show the world. It is stretched over frames of any size.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask(Image);

impl Mask {
    /// Takes a picture whose dark pixels (below 128) hide the robot.
    pub fn new(picture: Image) -> Self {
        Self(picture)
    }

    /// The picture: dark pixels are hidden.
    pub fn picture(&self) -> &Image {
        &self.0
    }
}

impl Camera {
    /// A camera without a mask.
    pub fn new(projection: Projection) -> Self {
        Self { projection, mask: None }
    }

    /// The valid region of a frame of `width` x `height` pixels.
    pub fn view(&self, width: usize, height: usize) -> View {
        let wraps = self.projection == Projection::Equirectangular;
        let hidden = self.mask.as_ref().map(|mask| HiddenCount::new(&mask.0, (width, height), wraps));
        let visible = Region { left: 0, top: 0, right: width, bottom: height };
        View { width, height, projection: self.projection, visible, hidden }
    }
}

/// The valid region of frames of one size.
#[derive(Clone, Debug)]
pub struct View {
    width: usize,
    height: usize,
    projection: Projection,
    visible: Region,
    hidden: Option<HiddenCount>,
}

/// Where something lies in what a camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// From the left edge (0) to the right (1); `None` where the camera sees all around, and it changes with every turn
    /// of the robot.
    pub across: Option<f32>,
    /// From the upper edge (0) to the lower (1); in a mirror from the inner rim to the outer.
    pub down: f32,
}

impl View {
    /// The same, where nothing beyond `visible` was seen by the camera.
    pub fn within(self, visible: Region) -> Self {
        Self { visible, ..self }
    }

    /// The frame's width in pixels.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// The frame's height in pixels.
    #[inline]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Whether the left and right edges of the frame meet.
    #[inline]
    pub fn wraps(&self) -> bool {
        self.projection == Projection::Equirectangular
    }

    /// A column in the frame: where the edges meet, one beyond an edge is moved by whole turns.
    #[inline]
    pub fn column(&self, x: f32) -> f32 {
        if self.wraps() { x.rem_euclid(self.width as f32) } else { x }
    }

    /// Whether all pixels nearer than `margin` to (x, y) are valid.
    ///
    /// In masked frames the square round the circle must be valid.
    #[inline]
    pub fn contains(&self, x: f32, y: f32, margin: f32) -> bool {
        self.in_frame(x, y, margin)
            && self.in_mirror(x, y, margin)
            && self.hidden.as_ref().is_none_or(|hidden| hidden.none(x, y, margin))
    }

    /// Sets each of `outside` to 0 where [`View::contains`] holds, else to 255: for the positions `start`,
    /// `start + step`, `start + 2 step` and so on.
    pub fn mark_outside(&self, start: (f32, f32), step: (f32, f32), margin: f32, outside: &mut [u8]) {
        let position = |idx: usize| (start.0 + idx as f32 * step.0, start.1 + idx as f32 * step.1);
        if let Some(are_valid) = self.line_is_valid(start, step, outside.len(), margin) {
            outside.fill(if are_valid { 0 } else { 255 });
        } else {
            for (idx, outside) in outside.iter_mut().enumerate() {
                let (x, y) = position(idx);
                // No branch between the two: the compiler then works on several positions at once.
                *outside = if self.in_frame(x, y, margin) & self.in_mirror(x, y, margin) { 0 } else { 255 };
            }
        }
        if let Some(hidden) = &self.hidden {
            for (idx, outside) in outside.iter_mut().enumerate() {
                let (x, y) = position(idx);
                *outside |= if hidden.none(x, y, margin) { 0 } else { 255 };
            }
        }
    }

    /// Whether the frame and the mirror hold all of `n` positions on a line, or the mirror none of them, where its ends
    /// and the place that is nearest to the mirror's center tell.
    fn line_is_valid(&self, start: (f32, f32), step: (f32, f32), n: usize, margin: f32) -> Option<bool> {
        // Far more than rounding makes of it, in pixels.
        const SLACK: f32 = 0.01;
        let n_steps = n.saturating_sub(1) as f32;
        let at = |n_steps: f32| (start.0 + n_steps * step.0, start.1 + n_steps * step.1);
        let end = at(n_steps);
        let is_in_frame = [start, end].into_iter().all(|(x, y)| self.in_frame(x, y, margin + SLACK));
        let Projection::Omnidirectional(mirror) = self.projection else {
            return is_in_frame.then_some(true);
        };
        let width = self.width as f32;
        let center = (mirror.center_x * width, mirror.center_y * width);
        let radius = |(x, y): (f32, f32)| {
            let (dx, dy) = (x - center.0, y - center.1);
            (dx * dx + dy * dy).sqrt()
        };
        let to_center = (center.0 - start.0) * step.0 + (center.1 - start.1) * step.1;
        let foot = to_center / (step.0 * step.0 + step.1 * step.1);
        let least = radius(at(foot.clamp(0.0, n_steps)));
        let most = radius(start).max(radius(end));
        let (inner, outer) = (mirror.inner_radius * width + margin, mirror.outer_radius * width - margin);
        if least > outer + SLACK || most < inner - SLACK {
            return Some(false);
        }
        (is_in_frame && least > inner + SLACK && most < outer - SLACK).then_some(true)
    }

    /// Whether every pixel of the frame is valid.
    pub fn is_whole_frame(&self) -> bool {
        let visible = self.visible;
        let is_visible =
            visible.right - visible.left == self.width && visible.bottom - visible.top == self.height;
        is_visible && self.hidden.is_none() && !matches!(self.projection, Projection::Omnidirectional(_))
    }

    /// The kind of camera.
    pub fn kind(&self) -> CameraKind {
        self.projection.kind()
    }

    /// How the camera projects.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// Where (x, y) is between the inner (0) and the outer rim (1) of the mirror; 0 for cameras without one.
    pub fn ring_share(&self, x: f32, y: f32) -> f32 {
        let Projection::Omnidirectional(mirror) = self.projection else { return 0.0 };
        let radius = mirror.polar(x, y, self.width).2 / self.width as f32;
        (radius - mirror.inner_radius) / (mirror.outer_radius - mirror.inner_radius)
    }

    /// Where (x, y) lies in what the camera sees, whatever the size of the frame.
    pub fn spot(&self, x: f32, y: f32) -> Spot {
        let down = y / self.height as f32;
        match self.kind() {
            CameraKind::Perspective => Spot { across: Some(x / self.width as f32), down },
            CameraKind::Equirectangular => Spot { across: None, down },
            CameraKind::Omnidirectional => Spot { across: None, down: self.ring_share(x, y) },
        }
    }

    /// The unit vector from the mirror center to (x, y); `None` for cameras without a mirror and in the
    /// center itself.
    pub fn radial_direction(&self, x: f32, y: f32) -> Option<(f32, f32)> {
        let Projection::Omnidirectional(mirror) = self.projection else { return None };
        let (dx, dy, radius) = mirror.polar(x, y, self.width);
        (radius > 0.0).then(|| (dx / radius, dy / radius))
    }

    #[inline]
    fn in_frame(&self, x: f32, y: f32, margin: f32) -> bool {
        let Region { left, top, right, bottom } = self.visible;
        let wraps = self.wraps() & (left == 0) & (right == self.width);
        let columns = wraps | ((x - margin >= left as f32) & (x + margin + 1.0 <= right as f32));
        columns & (y - margin >= top as f32) & (y + margin + 1.0 <= bottom as f32)
    }

    #[inline]
    fn in_mirror(&self, x: f32, y: f32, margin: f32) -> bool {
        let Projection::Omnidirectional(mirror) = self.projection else { return true };
        let (dx, dy, width) = (
            x - mirror.center_x * self.width as f32,
            y - mirror.center_y * self.width as f32,
            self.width as f32,
        );
        let squared = dx * dx + dy * dy;
        let (inner, outer) = (mirror.inner_radius * width + margin, mirror.outer_radius * width - margin);
        (squared >= inner * inner) & (outer >= 0.0) & (squared <= outer * outer)
    }
}

/// A summed-area table of hidden pixels: whether a square is free of them in constant time.
#[derive(Clone, Debug)]
struct HiddenCount {
    width: usize,
    height: usize,
    wraps: bool,
    /// `(width + 1) * (height + 1)` sums; the first row and column are zero.
    sums: Vec<u32>,
}

impl HiddenCount {
    fn new(mask: &Image, (width, height): (usize, usize), wraps: bool) -> Self {
        let stride = width + 1;
        let mut sums = vec![0; stride * (height + 1)];
        for y in 0..height {
            let mask_row = mask.row(y * mask.height() / height);
            let mut row_sum = 0;
            for x in 0..width {
                row_sum += u32::from(mask_row[x * mask.width() / width] < 128);
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row_sum;
            }
        }
        Self { width, height, wraps, sums }
    }

    fn none(&self, x: f32, y: f32, margin: f32) -> bool {
        let low = |center: f32| (center - margin).floor().max(0.0) as usize;
        let high = |center: f32, end: usize| (((center + margin).ceil() + 1.0).max(0.0) as usize).min(end);
        let rows = low(y).min(self.height)..high(y, self.height);
        if !self.wraps {
            return self.none_in(low(x).min(self.width)..high(x, self.width), rows);
        }
        let first = (x - margin).floor();
        let n_columns = ((x + margin).ceil() + 1.0 - first).clamp(0.0, self.width as f32) as usize;
        let left = (first.rem_euclid(self.width as f32) as usize).min(self.width);
        let beyond = (left + n_columns).saturating_sub(self.width);
        self.none_in(left..left + n_columns - beyond, rows.clone()) && self.none_in(0..beyond, rows)
    }

    fn none_in(&self, columns: Range<usize>, rows: Range<usize>) -> bool {
        let sum = |x: usize, y: usize| self.sums[y * (self.width + 1) + x];
        sum(columns.end, rows.end) + sum(columns.start, rows.start)
            == sum(columns.start, rows.end) + sum(columns.end, rows.start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn omnidirectional() -> Camera {
        let mirror = Mirror { center_x: 0.5, center_y: 0.375, inner_radius: 0.1, outer_radius: 0.3 };
        Camera::new(Projection::Omnidirectional(mirror))
    }

    #[test]
    fn the_mirror_is_a_ring_that_scales_with_the_frame() {
        for width in [100, 640] {
            let view = omnidirectional().view(width, width * 3 / 4);
            let (center_x, center_y, unit) = (width as f32 * 0.5, width as f32 * 0.375, width as f32);
            assert!(!view.contains(center_x, center_y, 0.0), "own reflection");
            assert!(view.contains(center_x + 0.2 * unit, center_y, 0.09 * unit));
            assert!(!view.contains(center_x + 0.2 * unit, center_y, 0.11 * unit));
            assert!(!view.contains(center_x, center_y - 0.31 * unit, 0.0), "beyond the rim");
        }
    }

    #[test]
    fn directions_point_away_from_the_mirror_center() {
        let view = omnidirectional().view(200, 150);
        assert_eq!(view.radial_direction(140.0, 75.0), Some((1.0, 0.0)));
        assert_eq!(view.radial_direction(100.0, 35.0), Some((0.0, -1.0)));
        assert_eq!(view.radial_direction(100.0, 75.0), None);
        assert_eq!(Camera::new(Projection::Perspective).view(9, 9).radial_direction(1.0, 1.0), None);
    }

    proptest! {
        #[test]
        fn marking_a_line_equals_asking_for_each_position(
            start in (-20.0f32..120.0, -20.0f32..100.0), step in (-1.5f32..1.5, -1.5f32..1.5), n in 1usize..90,
            is_whole_step: bool, margin in 0.0f32..4.0, kind in 0usize..5,
        ) {
            let mask = Image::from_pixels(3, 1, vec![0, 255, 255]).unwrap();
            let camera = [
                omnidirectional(),
                Camera { mask: Some(Mask::new(mask)), ..omnidirectional() },
                Camera::new(Projection::Equirectangular),
                Camera::new(Projection::Perspective),
                Camera::new(Projection::Omnidirectional(Mirror {
                    center_x: 0.6, center_y: 0.3, inner_radius: 0.01, outer_radius: 0.02,
                })),
            ][kind].clone();
            let view = camera.view(100, 75);
            let step = if is_whole_step { (step.0.round(), step.1.round()) } else { step };
            let mut outside = vec![7; n];
            view.mark_outside(start, step, margin, &mut outside);
            for (idx, outside) in outside.into_iter().enumerate() {
                let (x, y) = (start.0 + idx as f32 * step.0, start.1 + idx as f32 * step.1);
                prop_assert_eq!(outside, if view.contains(x, y, margin) { 0 } else { 255 });
            }
        }
    }

    #[test]
    fn only_panoramas_wrap() {
        let panorama = Camera::new(Projection::Equirectangular).view(20, 10);
        assert!(panorama.contains(0.0, 5.0, 3.0) && !panorama.contains(5.0, 0.0, 3.0));
        assert!(!Camera::new(Projection::Perspective).view(20, 10).contains(0.0, 5.0, 3.0));
    }

    #[test]
    fn masks_hide_across_the_seam_of_a_panorama() {
        let mask = Image::from_pixels(4, 1, vec![0, 255, 255, 255]).unwrap();
        let camera = Camera { projection: Projection::Equirectangular, mask: Some(Mask::new(mask)) };
        let view = camera.view(40, 20);
        assert!(view.contains(36.0, 10.0, 3.0) && !view.contains(37.0, 10.0, 3.0));
        assert!(
            view.contains(-4.0, 10.0, 3.0)
                && !view.contains(-3.0, 10.0, 3.0)
                && !view.contains(41.0, 10.0, 1.0)
        );
        assert!(!view.contains(20.0, 10.0, 30.0), "all columns");
    }

    #[test]
    fn nothing_is_valid_where_rows_are_missing() {
        let visible = Region { left: 0, top: 0, right: 20, bottom: 6 };
        let view = Camera::new(Projection::Equirectangular).view(20, 10).within(visible);
        assert!(!view.is_whole_frame());
        assert!(view.contains(0.0, 5.0, 0.0) && view.contains(0.0, 3.0, 2.0));
        assert!(!view.contains(9.0, 6.0, 0.0) && !view.contains(9.0, 4.0, 2.0));
        assert!(view.within(Region { bottom: 10, ..visible }).is_whole_frame());
    }

    #[test]
    fn masks_hide_and_stretch() {
        let mask = Image::from_pixels(4, 2, vec![255, 255, 255, 0, 255, 255, 255, 255]).unwrap();
        let camera = Camera { projection: Projection::Perspective, mask: Some(Mask::new(mask)) };
        let view = camera.view(40, 20);
        for y in 0..20 {
            for x in 0..40 {
                let expected = !(x >= 30 && y < 10);
                assert_eq!(view.contains(x as f32, y as f32, 0.0), expected, "{x} {y}");
            }
        }
        assert!(view.contains(26.0, 5.0, 3.0) && !view.contains(27.0, 5.0, 3.0));
    }
}
