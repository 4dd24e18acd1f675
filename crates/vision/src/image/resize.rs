//! Area averaging, for frames larger than the working size.

use super::Image;
use fast_image_resize::images::{TypedImage, TypedImageRef};
use fast_image_resize::pixels::U8;
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions, Resizer};

pub(super) fn shrink_to(image: &Image, longest_side: usize) -> Option<Image> {
    let longest = image.width.max(image.height);
    if longest <= longest_side.max(1) {
        return None;
    }
    let scaled = |side: usize| ((side * longest_side + longest / 2) / longest).max(1);
    let (width, height) = (scaled(image.width), scaled(image.height));
    let source =
        TypedImageRef::<U8>::from_buffer(image.width as u32, image.height as u32, &image.pixels).ok()?;
    let mut pixels = vec![0; width * height];
    let mut target = TypedImage::<U8>::from_buffer(width as u32, height as u32, &mut pixels).ok()?;
    let area_average = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Box));
    Resizer::new().resize_typed(&source, &mut target, &area_average).ok()?;
    Image::from_pixels(width, height, pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halving_averages_blocks_of_four() {
        let image = Image::from_pixels(4, 2, vec![10, 30, 0, 0, 20, 40, 200, 100]).unwrap();
        let half = image.shrink_to(2).unwrap();
        assert_eq!((half.width(), half.height()), (2, 1));
        assert_eq!(half.pixels(), [25, 75]);
    }

    #[test]
    fn small_frames_stay_and_thin_ones_keep_a_row() {
        assert!(Image::from_pixels(4, 2, vec![0; 8]).unwrap().shrink_to(4).is_none());
        let thin = Image::from_pixels(1000, 1, vec![7; 1000]).unwrap().shrink_to(10).unwrap();
        assert_eq!((thin.width(), thin.height(), thin.pixels()), (10, 1, &[7; 10][..]));
    }
}
