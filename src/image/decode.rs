//! Untrusted bytes to luma. The only caller of image decoders.

use super::{Image, ImageError, Limits};
use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, ImageDecoder, ImageFormat, ImageReader};
use std::io::Cursor;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

/// A progressive JPEG repeats its whole area once a scan; real ones have about ten.
const MAX_SCANS: usize = 64;

/// Bytes a pixel that decoding a JPEG takes at most: three planes of 16-bit coefficients, the samples, the
/// output.
const JPEG_MEMORY_PER_PIXEL: u64 = 12;

pub(super) fn decode(bytes: &[u8], limits: &Limits) -> Result<Image, ImageError> {
    if bytes.len() > limits.max_bytes {
        let n_bytes = bytes.len();
        return Err(ImageError::TooLarge(format!("{n_bytes} bytes; the limit is {}", limits.max_bytes)));
    }
    match image::guess_format(bytes) {
        Ok(ImageFormat::Jpeg) => decode_jpeg(bytes, limits),
        Ok(format @ (ImageFormat::Png | ImageFormat::WebP | ImageFormat::Bmp | ImageFormat::Pnm)) => {
            decode_other(bytes, format, limits)
        }
        _ => Err(ImageError::UnknownFormat),
    }
}

/// Straight to luma: the color planes are neither upsampled nor converted.
fn decode_jpeg(bytes: &[u8], limits: &Limits) -> Result<Image, ImageError> {
    let options = DecoderOptions::default()
        .set_max_width(limits.max_side as usize)
        .set_max_height(limits.max_side as usize)
        .jpeg_set_max_scans(MAX_SCANS)
        .jpeg_set_out_colorspace(ColorSpace::Luma)
        .set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    if let Err(error) = decoder.decode_headers() {
        // The limits are one reason: a decoder that allows any size tells a large frame from a damaged one.
        let any_size = DecoderOptions::default().set_max_width(usize::MAX).set_max_height(usize::MAX);
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), any_size);
        if decoder.decode_headers().is_ok() {
            check_jpeg_size(&decoder, limits)?;
        }
        return Err(ImageError::Damaged(error.to_string()));
    }
    check_jpeg_size(&decoder, limits)?;
    if !matches!(decoder.input_colorspace(), Some(ColorSpace::YCbCr | ColorSpace::Luma)) {
        return decode_other(bytes, ImageFormat::Jpeg, limits);
    }
    let (width, height) = decoder.dimensions().ok_or_else(|| damaged("no dimensions"))?;
    let pixels = decoder.decode().map_err(|error| ImageError::Damaged(error.to_string()))?;
    let orientation = decoder.exif().and_then(|exif| Orientation::from_exif_chunk(exif));
    let luma = Image::from_pixels(width, height, pixels).ok_or_else(|| damaged("missing pixels"))?;
    Ok(match orientation {
        None | Some(Orientation::NoTransforms) => luma,
        Some(orientation) => oriented(luma, orientation)?,
    })
}

fn check_jpeg_size(decoder: &JpegDecoder<ZCursor<&[u8]>>, limits: &Limits) -> Result<(), ImageError> {
    let (width, height) = decoder.dimensions().ok_or_else(|| damaged("no dimensions"))?;
    let (width, height) = (width as u64, height as u64);
    check_size(width, height, width * height * JPEG_MEMORY_PER_PIXEL, limits)
}

fn decode_other(bytes: &[u8], format: ImageFormat, limits: &Limits) -> Result<Image, ImageError> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut decoder_limits = image::Limits::default();
    decoder_limits.max_alloc = Some(limits.max_memory);
    reader.limits(decoder_limits);
    let mut decoder = reader.into_decoder().map_err(|error| ImageError::Damaged(error.to_string()))?;
    let (width, height) = decoder.dimensions();
    // Decoded samples, their 8-bit RGB copy, and luma.
    let memory = decoder.total_bytes().saturating_add(u64::from(width) * u64::from(height) * 4);
    check_size(u64::from(width), u64::from(height), memory, limits)?;
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let decoded =
        DynamicImage::from_decoder(decoder).map_err(|error| ImageError::Damaged(error.to_string()))?;
    let pixels = match decoded {
        DynamicImage::ImageLuma8(luma) => luma.into_raw(),
        other => other.into_rgb8().as_raw().as_chunks().0.iter().map(|&rgb| luma_of(rgb)).collect(),
    };
    let luma = Image::from_pixels(width as usize, height as usize, pixels)
        .ok_or_else(|| damaged("missing pixels"))?;
    oriented(luma, orientation)
}

/// Rec. 601 luma in 16-bit fixed point, rounded.
fn luma_of([red, green, blue]: [u8; 3]) -> u8 {
    ((19_595 * u32::from(red) + 38_470 * u32::from(green) + 7_471 * u32::from(blue) + 32_768) >> 16) as u8
}

fn check_size(width: u64, height: u64, memory: u64, limits: &Limits) -> Result<(), ImageError> {
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

fn oriented(luma: Image, orientation: Orientation) -> Result<Image, ImageError> {
    let buffer = GrayImage::from_raw(luma.width as u32, luma.height as u32, luma.pixels)
        .ok_or_else(|| damaged("missing pixels"))?;
    let mut turned = DynamicImage::ImageLuma8(buffer);
    turned.apply_orientation(orientation);
    let (width, height) = (turned.width() as usize, turned.height() as usize);
    Image::from_pixels(width, height, turned.into_luma8().into_raw()).ok_or_else(|| damaged("missing pixels"))
}

fn damaged(detail: &str) -> ImageError {
    ImageError::Damaged(detail.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::jpeg::JpegEncoder;
    use image::{ExtendedColorType, ImageEncoder, RgbImage};
    use proptest::prelude::*;

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
        // A TIFF header, little-endian, with one entry: tag 0x0112, SHORT, count 1.
        let exif = [
            b'I',
            b'I',
            42,
            0,
            8,
            0,
            0,
            0,
            1,
            0,
            0x12,
            1,
            3,
            0,
            1,
            0,
            0,
            0,
            orientation,
            0,
            0,
            0,
            0,
            0,
            0,
            0,
        ];
        let mut bytes = Vec::new();
        let mut encoder = JpegEncoder::new_with_quality(&mut bytes, 95);
        encoder.set_exif_metadata(exif.to_vec()).unwrap();
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
    fn exif_orientation_is_applied() {
        let upright = Image::decode(&jpeg_with_orientation(1), &Limits::default()).unwrap();
        let turned = Image::decode(&jpeg_with_orientation(6), &Limits::default()).unwrap();
        assert_eq!((turned.width(), turned.height()), (24, 40));
        for (x, y) in [(0, 0), (39, 0), (7, 23)] {
            assert_eq!(turned.row(x)[23 - y], upright.row(y)[x]);
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
            let cut = &bytes[..bytes.len() * 3 / 4];
            let result = Image::decode(cut, &Limits::default());
            assert!(matches!(result, Err(ImageError::Damaged(_))), "{format:?}: {result:?}");
        }
    }

    #[test]
    fn other_bytes_are_no_image() {
        for bytes in [&b""[..], b"hello", b"GIF89a\x01\0\x01\0"] {
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
