//! Frames in which there is nothing to see.

use roomsight_vision::camera::View;
use roomsight_vision::image::Image;

/// Why nothing can be seen in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// Hardly a pixel is brighter than black.
    Dark,
    /// Something is right before the lens: a dim smear without an edge.
    Covered,
    /// Bright, and without an edge: a blank wall, or light straight into the lens.
    Flat,
}

/// Pixels from one that is looked at to the next.
const STEP: usize = 8;

/// Pixels to the neighbor that it is compared with.
const NEIGHBOR: usize = 4;

/// Nothing is brighter in a dark frame, but for one pixel in fifty.
const DARK: u8 = 24;

/// What lies right before a lens is dimmer on average.
const DIM: u64 = 110;

/// How much brighter or darker than a neighbor a pixel is at an edge. Noise of cameras and of JPEG stays below.
const EDGE: u8 = 12;

/// So many pixels per thousand are at edges where anything can be seen.
const LEAST_EDGES: usize = 2;

impl Flaw {
    /// That of a frame, where it has one; `view` says what the camera shows.
    pub fn of(image: &Image, view: &View) -> Option<Self> {
        let mut histogram = [0usize; 256];
        let (mut n_pixels, mut n_edges, mut sum) = (0, 0, 0u64);
        // So that edges at multiples of eight, as of blocks of JPEG and of test pictures, lie between neighbors.
        let first = STEP - NEIGHBOR / 2;
        let columns = (first..image.width().saturating_sub(NEIGHBOR)).step_by(STEP);
        let mut outside = vec![0; columns.len()];
        for y in (0..image.height()).step_by(STEP) {
            let row = image.row(y);
            let (start, step) = ((first as f32, y as f32), (STEP as f32, 0.0));
            view.mark_outside(start, step, NEIGHBOR as f32, &mut outside);
            for (x, _) in columns.clone().zip(&outside).filter(|(_, outside)| **outside == 0) {
                let pixel = row[x];
                n_pixels += 1;
                sum += u64::from(pixel);
                histogram[usize::from(pixel)] += 1;
                n_edges += usize::from(pixel.abs_diff(row[x + NEIGHBOR]) >= EDGE);
            }
        }
        let brighter: usize = histogram[usize::from(DARK)..].iter().sum();
        if n_pixels == 0 {
            return None;
        }
        if brighter * 50 <= n_pixels {
            return Some(Self::Dark);
        }
        if n_edges * 1000 >= LEAST_EDGES * n_pixels {
            return None;
        }
        Some(if sum < DIM * n_pixels as u64 { Self::Covered } else { Self::Flat })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use roomsight_vision::camera::{Camera, Projection};

    fn flaw(pixel: impl Fn(usize, usize) -> u8) -> Option<Flaw> {
        let (width, height) = (160, 120);
        let pixels = (0..width * height).map(|idx| pixel(idx % width, idx / width)).collect();
        let image = Image::from_pixels(width, height, pixels).unwrap();
        Flaw::of(&image, &Camera::new(Projection::Perspective).view(width, height))
    }

    #[test]
    fn what_shows_nothing_is_told_apart() {
        assert_eq!(flaw(|_, _| 3), Some(Flaw::Dark));
        assert_eq!(flaw(|x, y| if (x, y) == (40, 40) { 255 } else { 8 }), Some(Flaw::Dark), "a lamp");
        assert_eq!(flaw(|x, y| (30 + x / 8 + y / 6 + (x * 7 + y * 3) % 5) as u8), Some(Flaw::Covered));
        assert_eq!(flaw(|x, _| (200 + x / 16) as u8), Some(Flaw::Flat));
        assert_eq!(flaw(|x, y| if x / 16 % 2 == y / 16 % 2 { 40 } else { 60 }), None, "a dim room");
    }
}
