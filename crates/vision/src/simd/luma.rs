//! Colors to luma.

use super::dispatch;

/// Pixels that are worked on at once.
const LANES: usize = 32;

/// Rec. 601 luma (0.299 R + 0.587 G + 0.114 B) in 16-bit fixed point, rounded.
#[inline(always)]
pub fn luma_of([red, green, blue]: [u8; 3]) -> u8 {
    ((19_595 * u32::from(red) + 38_470 * u32::from(green) + 7_471 * u32::from(blue) + 32_768) >> 16) as u8
}

dispatch! {
    /// The luma of red, green and blue of each pixel into `luma`, as far as both go.
    luma, luma_kernel, (rgb: &[[u8; 3]], luma: &mut [u8])
}

#[inline(always)]
fn luma_kernel(rgb: &[[u8; 3]], luma: &mut [u8]) {
    let (blocks, rest) = rgb.as_chunks::<LANES>();
    let (luma_blocks, luma_rest) = luma.as_chunks_mut::<LANES>();
    for (rgb, luma) in blocks.iter().zip(luma_blocks) {
        for lane in 0..LANES {
            luma[lane] = luma_of(rgb[lane]);
        }
    }
    rest.iter().zip(luma_rest).for_each(|(rgb, luma)| *luma = luma_of(*rgb));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_pixel_gets_its_luma(pixels in prop::collection::vec(any::<[u8; 3]>(), 0..100)) {
            let mut together = vec![0; pixels.len()];
            luma(&pixels, &mut together);
            prop_assert_eq!(together, pixels.into_iter().map(luma_of).collect::<Vec<_>>());
        }
    }
}
