//! Neighbors on a circle round every pixel of a window, interpolated.

use super::region::Window;
use crate::simd::Taps;

/// What the weights of a neighbor sum to.
const ONE: u16 = 256;

/// Evenly spread neighbors on a circle.
pub(super) struct NeighborCircle {
    neighbors: Vec<Neighbor>,
    /// How many pixels beyond the region the circle reads.
    margin: usize,
}

/// Where a neighbor lies, and how the four pixels round that place are weighted (they sum to [`ONE`]).
struct Neighbor {
    column: isize,
    row: isize,
    weights: [u16; 4],
}

impl NeighborCircle {
    /// The first neighbor lies to the right, the others follow counterclockwise.
    pub(super) fn new(n_neighbors: usize, radius: f32) -> Self {
        let neighbor = |idx: usize| {
            let angle = std::f64::consts::TAU * idx as f64 / n_neighbors as f64;
            Neighbor::at(f64::from(radius) * angle.cos(), -f64::from(radius) * angle.sin())
        };
        Self { neighbors: (0..n_neighbors).map(neighbor).collect(), margin: margin(radius) }
    }

    /// One neighbor of every pixel of the region: rows of the window's side one after the other, the
    /// region's pixels at the start of each. What lies between two rows of the region means nothing.
    pub(super) fn neighbors<'a>(&self, neighbor_idx: usize, window: &'a Window) -> Taps<'a> {
        self.taps(&self.neighbors[neighbor_idx], window.pixels(), window.side())
    }

    /// The same of any `pixels` in rows of `stride`, of which as many as the circle reads beyond lie round the
    /// pixels that have neighbors.
    pub(super) fn neighbors_in<'a>(&self, neighbor_idx: usize, pixels: &'a [u8], stride: usize) -> Taps<'a> {
        self.taps(&self.neighbors[neighbor_idx], pixels, stride)
    }

    /// The pixels themselves, laid out as their [`NeighborCircle::neighbors`].
    pub(super) fn centers<'a>(&self, window: &'a Window) -> Taps<'a> {
        self.taps(&Neighbor { column: 0, row: 0, weights: [ONE, 0, 0, 0] }, window.pixels(), window.side())
    }

    fn taps<'a>(&self, neighbor: &Neighbor, pixels: &'a [u8], stride: usize) -> Taps<'a> {
        let row = self.margin.wrapping_add_signed(neighbor.row);
        let start = row * stride + self.margin.wrapping_add_signed(neighbor.column);
        Taps { above: &pixels[start..], below: &pixels[start + stride..], weights: neighbor.weights }
    }
}

/// How many pixels beyond the region a circle of this radius reads, interpolation included.
pub(super) fn margin(radius: f32) -> usize {
    radius.ceil() as usize + 1
}

impl Neighbor {
    fn at(dx: f64, dy: f64) -> Self {
        // Round off what trigonometry leaves of whole numbers.
        let to_grid = |value: f64| (value * 4096.0).round() / 4096.0;
        let (dx, dy) = (to_grid(dx), to_grid(dy));
        let (column, row) = (dx.floor(), dy.floor());
        let (right, bottom) = (dx - column, dy - row);
        let weight = |share: f64| (share * f64::from(ONE)).round() as u16;
        let mut others = [right * (1.0 - bottom), (1.0 - right) * bottom, right * bottom].map(weight);
        // Of a neighbor almost on a pixel of these, the three may be rounded to more than there is.
        let excess = others.iter().sum::<u16>().saturating_sub(ONE);
        if let Some(largest) = others.iter_mut().max() {
            *largest -= excess;
        }
        let [top_right, bottom_left, bottom_right] = others;
        let top_left = ONE - top_right - bottom_left - bottom_right;
        Self {
            column: column as isize,
            row: row as isize,
            weights: [top_left, top_right, bottom_left, bottom_right],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};
    use crate::describe::Region;
    use crate::detect::Keypoint;
    use crate::image::Image;

    #[test]
    fn weights_sum_to_one_at_any_radius() {
        for step in 0..70_000 {
            let circle = NeighborCircle::new(6, 1.0 + step as f32 * 1e-4);
            let sums = circle.neighbors.iter().map(|neighbor| neighbor.weights.iter().sum::<u16>());
            assert!(sums.into_iter().all(|sum| sum == ONE), "{step}");
        }
    }

    #[test]
    fn neighbors_of_a_plane_surface_are_where_the_circle_says() {
        let image = Image::from_pixels(80, 60, (0..80 * 60).map(|i| (i % 80 + 2 * (i / 80)) as u8).collect());
        let image = image.unwrap();
        let view = Camera::new(Projection::Perspective).view(80, 60);
        let region = Region { side: 7, ..Region::default() };
        for (n_neighbors, radius) in [(6, 2.0f32), (8, 1.0), (8, 2.5)] {
            let circle = NeighborCircle::new(n_neighbors, radius);
            let mut window = Window::new(&region, margin(radius));
            window.take(&image, &Keypoint::new(40.0, 30.0, 0.0), &view);
            for neighbor_idx in 0..n_neighbors {
                let taps = circle.neighbors(neighbor_idx, &window);
                let angle = std::f32::consts::TAU * neighbor_idx as f32 / n_neighbors as f32;
                for (x, y) in [(0, 0), (6, 0), (3, 5), (6, 6)] {
                    let expected = (37 + x) as f32
                        + radius * angle.cos()
                        + 2.0 * ((27 + y) as f32 - radius * angle.sin());
                    let start = y * window.side() + x;
                    let pixels = [&taps.above[start..], &taps.below[start..]].map(|row| [row[0], row[1]]);
                    let weighted = pixels.as_flattened().iter().zip(taps.weights);
                    let sum: f32 =
                        weighted.map(|(&pixel, weight)| f32::from(pixel) * f32::from(weight)).sum();
                    let value = sum / f32::from(ONE);
                    assert!((value - expected).abs() < 0.05, "{value} {expected}");
                }
            }
        }
    }
}
