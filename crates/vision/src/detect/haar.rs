//! Haar wavelets at any place of a frame: what SURF takes directions and descriptors from.

use crate::camera::View;
use crate::image::{Image, Integral};

/// Haar wavelets over the valid region of a frame.
pub(crate) struct HaarSampler<'a> {
    integral: Integral,
    view: &'a View,
    /// See [`Integral::new`]; 0 where the frame's edges do not meet.
    seam: usize,
}

impl<'a> HaarSampler<'a> {
    /// For wavelets that reach at most `max_half` pixels from their center.
    pub(crate) fn new(image: &Image, view: &'a View, max_half: usize) -> Self {
        // Wavelets that reach further than the frame is high are in no valid region.
        let seam = if view.wraps() { max_half.min(image.height()) + 2 } else { 0 };
        Self { integral: Integral::new(image, seam), view, seam }
    }

    /// Whether all wavelets that reach `half` pixels lie in the valid region whose centers are nearer than `radius`
    /// to (x, y): [`HaarSampler::response_inside`] then is their response.
    pub(crate) fn contains_all(&self, x: f32, y: f32, radius: f32, half: usize) -> bool {
        // One pixel more than what each asks for, as sums of floats are rounded.
        self.view.contains(self.view.column(x), y, radius + half as f32 + 2.0)
    }

    /// By how much the right half of the square round (x, y) is brighter than its left half, and the lower
    /// half than the upper, in sums of gray values. The square reaches `half` pixels from its center. Zero
    /// where it is not in the valid region.
    pub(crate) fn response(&self, x: f32, y: f32, half: usize) -> (f32, f32) {
        // Centers are rounded to the nearest corner of a pixel.
        if !self.view.contains(self.view.column(x), y, half as f32 + 1.0) {
            return (0.0, 0.0);
        }
        self.response_inside(x, y, half)
    }

    /// The same where the square is known to be in the valid region.
    #[inline]
    pub(crate) fn response_inside(&self, x: f32, y: f32, half: usize) -> (f32, f32) {
        let x = self.view.column(x);
        let (dx, dy) = self.integral.haar(x as usize + 1 + self.seam, y as usize + 1, half);
        (dx as f32, dy as f32)
    }
}
