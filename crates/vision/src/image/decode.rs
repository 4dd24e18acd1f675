//! Untrusted bytes to luma and colors. The only caller of image decoders.

use super::format::{self, Format};
use super::{Gap, Image, ImageError, Limits, Region, jpeg, other};
use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, RgbImage};
use std::panic::{UnwindSafe, catch_unwind};

/// Reads a frame of any format, with its colors or without.
pub(super) fn decode(bytes: &[u8], limits: &Limits, with_colors: bool) -> Result<Image, ImageError> {
    if bytes.len() > limits.max_bytes {
        let n_bytes = bytes.len();
        return Err(ImageError::TooLarge(format!("{n_bytes} bytes; the limit is {}", limits.max_bytes)));
    }
    let format = format::guess(bytes)?;
    contained(|| match format {
        Format::Jpeg => decode_jpeg(bytes, limits, with_colors),
        format => other::decode(bytes, format, limits, with_colors),
    })
}

/// A defect of a decoder costs the frame that brings it out, not the training that the frame is part of.
fn contained(decode: impl FnOnce() -> Result<Image, ImageError> + UnwindSafe) -> Result<Image, ImageError> {
    catch_unwind(decode).unwrap_or(Err(ImageError::Broken))
}

fn decode_jpeg(bytes: &[u8], limits: &Limits, with_colors: bool) -> Result<Image, ImageError> {
    let picture = jpeg::decode(bytes, limits, with_colors)?;
    let mut image = Image::from_pixels(picture.width, picture.height, picture.luma)
        .ok_or_else(|| damaged("missing pixels"))?;
    image.colors = picture.colors;
    image.reduction = picture.reduction;
    image.gap = picture.gap;
    oriented(image, picture.orientation.unwrap_or(Orientation::NoTransforms))
}

/// Checks what a frame will take before anything is allocated for it.
pub(super) fn check_size(width: u64, height: u64, memory: u64, limits: &Limits) -> Result<(), ImageError> {
    let too_large = |detail: String| Err(ImageError::TooLarge(detail));
    if width == 0 || height == 0 {
        return Err(damaged("it has no pixels"));
    }
    if width.max(height) > u64::from(limits.max_side) {
        return too_large(format!("{width} x {height}; the longest side may be {}", limits.max_side));
    }
    if width * height > limits.max_pixels {
        return too_large(format!("{width} x {height}; the limit is {} pixels", limits.max_pixels));
    }
    if memory > limits.max_memory {
        return too_large(format!("decoding takes {memory} bytes; the limit is {}", limits.max_memory));
    }
    Ok(())
}

/// Turns a picture as its camera was held.
pub(super) fn oriented(image: Image, orientation: Orientation) -> Result<Image, ImageError> {
    if orientation == Orientation::NoTransforms {
        return Ok(image);
    }
    let size = [image.width, image.height];
    let (reduction, gap) = (image.reduction, image.gap);
    let missing = || damaged("missing pixels");
    let turned = |mut picture: DynamicImage| {
        picture.apply_orientation(orientation);
        picture
    };
    let [width, height] = size.map(|side| side as u32);
    let colors = image.colors.map(|colors| RgbImage::from_raw(width, height, colors).ok_or_else(missing));
    let colors = colors.transpose()?.map(|colors| turned(colors.into()).into_rgb8().into_raw());
    let pixels = turned(GrayImage::from_raw(width, height, image.pixels).ok_or_else(missing)?.into());
    let (width, height) = (pixels.width() as usize, pixels.height() as usize);
    let mut image = Image::from_pixels(width, height, pixels.into_luma8().into_raw()).ok_or_else(missing)?;
    image.colors = colors;
    image.reduction = reduction;
    image.gap = gap.map(|gap| Gap { visible: turned_region(gap.visible, size, orientation), ..gap });
    Ok(image)
}

/// Where a region of a picture of `width` x `height` pixels comes to lie.
fn turned_region(region: Region, [width, height]: [usize; 2], orientation: Orientation) -> Region {
    use Orientation as O;
    let Region { left, top, right, bottom } = region;
    let (across, down) = match orientation {
        O::NoTransforms => (left..right, top..bottom),
        O::FlipHorizontal => (width - right..width - left, top..bottom),
        O::Rotate180 => (width - right..width - left, height - bottom..height - top),
        O::FlipVertical => (left..right, height - bottom..height - top),
        O::Rotate90FlipH => (top..bottom, left..right),
        O::Rotate90 => (height - bottom..height - top, left..right),
        O::Rotate270FlipH => (height - bottom..height - top, width - right..width - left),
        O::Rotate270 => (top..bottom, width - right..width - left),
    };
    Region { left: across.start, top: down.start, right: across.end, bottom: down.end }
}

pub(super) fn damaged(detail: &str) -> ImageError {
    ImageError::Damaged(detail.to_owned())
}

pub(super) fn unsupported(format: &str, advice: &str) -> ImageError {
    ImageError::Unsupported { format: format.to_owned(), advice: advice.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::super::exif::tests::exif;
    use super::*;
    use image::codecs::jpeg::JpegEncoder;
    use image::{ExtendedColorType, ImageEncoder, ImageFormat, RgbImage};
    use proptest::prelude::*;
    use std::io::Cursor;

    /// A smooth picture that survives JPEG well.
    fn picture(width: u32, height: u32) -> RgbImage {
        RgbImage::from_fn(width, height, |x, y| {
            image::Rgb([(x * 255 / width) as u8, (y * 255 / height) as u8, 90])
        })
    }

    fn encoded(format: ImageFormat) -> Vec<u8> {
        let mut bytes = Vec::new();
        let picture = DynamicImage::ImageRgb8(picture(40, 24));
        let picture = if format == ImageFormat::Pnm { picture.to_luma8().into() } else { picture };
        picture.write_to(&mut Cursor::new(&mut bytes), format).unwrap();
        bytes
    }

    fn jpeg_with_orientation(orientation: u8) -> Vec<u8> {
        let exif = exif(orientation, true, false);
        let mut bytes = Vec::new();
        let mut encoder = JpegEncoder::new_with_quality(&mut bytes, 95);
        encoder.set_exif_metadata(exif).unwrap();
        encoder.write_image(picture(40, 24).as_raw(), 40, 24, ExtendedColorType::Rgb8).unwrap();
        bytes
    }

    #[test]
    fn every_format_gives_the_same_picture() {
        let reference = Image::decode(&encoded(ImageFormat::Png), &Limits::default()).unwrap();
        assert_eq!((reference.width(), reference.height()), (40, 24));
        for format in [ImageFormat::Jpeg, ImageFormat::WebP, ImageFormat::Bmp, ImageFormat::Pnm] {
            let image = Image::decode(&encoded(format), &Limits::default()).unwrap();
            assert_eq!((image.width(), image.height()), (40, 24), "{format:?}");
            let differences = image.pixels().iter().zip(reference.pixels());
            let largest = differences.map(|(&a, &b)| a.abs_diff(b)).max().unwrap();
            // PGM was written with the encoder's own luma weights, JPEG is lossy.
            assert!(largest <= if format == ImageFormat::Pnm { 40 } else { 6 }, "{format:?}: {largest}");
        }
    }

    #[test]
    fn every_format_gives_the_same_colors() {
        let reference = picture(40, 24);
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP, ImageFormat::Bmp] {
            let bytes = encoded(format);
            let image = Image::decode_with_colors(&bytes, &Limits::default()).unwrap();
            let differences = image.colors().unwrap().iter().zip(reference.as_raw());
            let largest = differences.map(|(&a, &b)| a.abs_diff(b)).max().unwrap();
            assert!(largest <= if format == ImageFormat::Jpeg { 12 } else { 0 }, "{format:?}: {largest}");
            let plain = Image::decode(&bytes, &Limits::default()).unwrap();
            assert_eq!(Image { colors: None, ..image }, plain);
        }
        let gray = Image::decode_with_colors(&encoded(ImageFormat::Pnm), &Limits::default()).unwrap();
        assert_eq!(gray.colors(), None);
        assert_eq!(gray.clone().with_colors(vec![0; 3]), None);
        // Decoded samples and luma, but no colors beside them.
        let limits = Limits { max_memory: 40 * 24 * 4, ..Limits::default() };
        assert_eq!(Image::decode_with_colors(&encoded(ImageFormat::Png), &limits).unwrap().colors(), None);
    }

    #[test]
    fn samples_of_every_depth_have_colors() {
        let reference = DynamicImage::ImageRgb8(picture(40, 24));
        for picture in [
            DynamicImage::from(reference.to_rgba8()),
            DynamicImage::from(reference.to_rgb16()),
            DynamicImage::from(reference.to_rgba16()),
        ] {
            let mut bytes = Vec::new();
            picture.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
            let image = Image::decode_with_colors(&bytes, &Limits::default()).unwrap();
            assert_eq!(image.colors(), Some(reference.as_bytes()), "{:?}", picture.color());
        }
    }

    #[test]
    fn exif_orientation_is_applied() {
        let upright = Image::decode(&jpeg_with_orientation(1), &Limits::default()).unwrap();
        let turned = Image::decode(&jpeg_with_orientation(6), &Limits::default()).unwrap();
        assert_eq!((turned.width(), turned.height()), (24, 40));
        for (x, y) in [(0, 0), (39, 0), (7, 23)] {
            assert_eq!(turned.row(x)[23 - y], upright.row(y)[x]);
        }
        let colors = |orientation: u8| {
            let bytes = jpeg_with_orientation(orientation);
            Image::decode_with_colors(&bytes, &Limits::default()).unwrap().colors().unwrap().to_vec()
        };
        for (x, y) in [(0, 0), (39, 0), (7, 23)] {
            assert_eq!(colors(6)[3 * (24 * x + 23 - y)..][..3], colors(1)[3 * (40 * y + x)..][..3]);
        }
    }

    #[test]
    fn absurd_sizes_are_refused_before_allocation() {
        let mut png = encoded(ImageFormat::Png);
        png[16..24].copy_from_slice(&[0, 0, 0xEA, 0x60, 0, 0, 0xEA, 0x60]);
        let ihdr_crc = crc32(&png[12..29]);
        png[29..33].copy_from_slice(&ihdr_crc.to_be_bytes());
        assert!(matches!(Image::decode(&png, &Limits::default()), Err(ImageError::TooLarge(_))));

        let mut jpeg = encoded(ImageFormat::Jpeg);
        let frame_header = jpeg.windows(2).position(|marker| marker == [0xFF, 0xC0]).unwrap();
        jpeg[frame_header + 5..frame_header + 9].copy_from_slice(&[0xEA, 0x60, 0xEA, 0x60]);
        assert!(matches!(Image::decode(&jpeg, &Limits::default()), Err(ImageError::TooLarge(_))));

        let pgm = b"P5 60000 60000 255\n";
        assert!(matches!(Image::decode(pgm, &Limits::default()), Err(ImageError::TooLarge(_))));
        let few_bytes = Limits { max_bytes: 10, ..Limits::default() };
        assert!(matches!(Image::decode(pgm, &few_bytes), Err(ImageError::TooLarge(_))));
    }

    #[test]
    fn truncation_is_damage() {
        for format in [ImageFormat::Jpeg, ImageFormat::Png, ImageFormat::WebP, ImageFormat::Pnm] {
            let bytes = encoded(format);
            let cut = &bytes[..bytes.len() / 2];
            let result = Image::decode(cut, &Limits::default());
            assert!(matches!(result, Err(ImageError::Damaged(_))), "{format:?}: {result:?}");
        }
    }

    #[test]
    fn a_panic_costs_the_frame_alone() {
        let result = contained(|| panic!("a defect that a test brings out"));
        assert_eq!(result, Err(ImageError::Broken));
    }

    #[test]
    fn regions_are_turned_with_their_pixels() {
        let region = Region { left: 0, top: 1, right: 4, bottom: 2 };
        for number in 1..=8 {
            let orientation = Orientation::from_exif(number).unwrap();
            let mut image = Image::from_pixels(4, 3, vec![9, 9, 9, 9, 0, 1, 2, 3, 9, 9, 9, 9]).unwrap();
            image.gap = Some(Gap { damaged_rows: 2, visible: region });
            let turned = oriented(image, orientation).unwrap();
            let visible = turned.visible().unwrap();
            for y in 0..turned.height() {
                for x in 0..turned.width() {
                    let is_in = (visible.left..visible.right).contains(&x)
                        && (visible.top..visible.bottom).contains(&y);
                    assert_eq!(turned.row(y)[x] < 9, is_in, "{number}: {x} {y}");
                }
            }
        }
    }

    #[test]
    fn other_bytes_are_no_image() {
        for bytes in [&b""[..], b"hello"] {
            assert_eq!(Image::decode(bytes, &Limits::default()), Err(ImageError::UnknownFormat));
        }
    }

    proptest! {
        #[test]
        fn damaged_bytes_never_panic(
            format in prop::sample::select(vec![
                ImageFormat::Jpeg, ImageFormat::Png, ImageFormat::WebP, ImageFormat::Bmp, ImageFormat::Pnm,
            ]),
            edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
            length in any::<prop::sample::Index>(),
        ) {
            let mut bytes = encoded(format);
            for (position, value) in edits {
                let position = position.index(bytes.len());
                bytes[position] = value;
            }
            bytes.truncate(length.index(bytes.len()) + 1);
            let limits = Limits { max_pixels: 1 << 20, ..Limits::default() };
            if let Ok(image) = Image::decode(&bytes, &limits) {
                prop_assert_eq!(image.pixels().len(), image.width() * image.height());
            }
        }
    }

    /// CRC-32 as PNG's chunks carry it, bit by bit.
    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 * (crc & 1)))
        })
    }
}
