//! Area averaging, for frames larger than the working size.

use super::Image;
use fast_image_resize::images::{TypedImage, TypedImageRef};
use fast_image_resize::pixels::{InnerPixel, U8, U8x3};
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions, Resizer};

pub(super) fn shrink_to(image: &Image, longest_side: usize) -> Option<Image> {
    let longest = image.width.max(image.height);
    if longest <= longest_side.max(1) {
        return None;
    }
    let scaled = |side: usize| ((side * longest_side + longest / 2) / longest).max(1);
    let size = [scaled(image.width), scaled(image.height)];
    Image::from_pixels(size[0], size[1], averaged::<U8>(image, &image.pixels, size)?)
}

pub(super) fn thumbnail(image: &Image, width: usize) -> Option<Image> {
    let width = width.clamp(1, image.width);
    let size = [width, ((image.height * width + image.width / 2) / image.width).max(1)];
    let small = Image::from_pixels(size[0], size[1], averaged::<U8>(image, &image.pixels, size)?)?;
    match image.colors() {
        Some(colors) => small.with_colors(averaged::<U8x3>(image, colors, size)?),
        None => Some(small),
    }
}

/// Numbers of the pixels of an image for one of this width and height.
fn averaged<P: InnerPixel + fast_image_resize::PixelTrait>(
    image: &Image,
    pixels: &[u8],
    [width, height]: [usize; 2],
) -> Option<Vec<u8>> {
    let source = TypedImageRef::<P>::from_buffer(image.width as u32, image.height as u32, pixels).ok()?;
    let mut averaged = vec![0; width * height * P::size()];
    let mut target = TypedImage::<P>::from_buffer(width as u32, height as u32, &mut averaged).ok()?;
    let area_average = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Box));
    Resizer::new().resize_typed(&source, &mut target, &area_average).ok()?;
    Some(averaged)
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
    fn a_thumbnail_is_that_wide_and_keeps_colors() {
        let image = Image::from_pixels(4, 2, vec![0; 8]).unwrap();
        let colors = [[10, 0, 200], [30, 0, 200]].repeat(4).concat();
        let small = image.with_colors(colors).unwrap().thumbnail(2).unwrap();
        assert_eq!((small.width(), small.height()), (2, 1));
        assert_eq!(small.colors(), Some(&[20, 0, 200, 20, 0, 200][..]));
        let tall = Image::from_pixels(1, 300, vec![9; 300]).unwrap().thumbnail(20).unwrap();
        assert_eq!((tall.width(), tall.height(), tall.colors()), (1, 300, None), "it never grows");
    }

    #[test]
    fn small_frames_stay_and_thin_ones_keep_a_row() {
        assert!(Image::from_pixels(4, 2, vec![0; 8]).unwrap().shrink_to(4).is_none());
        let thin = Image::from_pixels(1000, 1, vec![7; 1000]).unwrap().shrink_to(10).unwrap();
        assert_eq!((thin.width(), thin.height(), thin.pixels()), (10, 1, &[7; 10][..]));
    }
}
