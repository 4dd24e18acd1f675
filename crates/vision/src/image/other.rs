//! PNG, WebP, BMP and PNM to luma and colors.

use super::format::Format;
use super::{Image, ImageError, Limits, check_size, containers, damaged, oriented, unsupported};
use crate::simd::{self, luma_of};
use image::metadata::Orientation;
use image::{ColorType, ImageDecoder, ImageFormat, ImageReader};
use std::borrow::Cow;
use std::io::Cursor;

/// Depths that cameras have, for pictures whose 16 bits are more than there is to say.
const DEPTHS: [u32; 4] = [8, 10, 12, 14];

/// Pictures of fewer pixels do not tell the depth of their camera.
const MIN_PIXELS_OF_DEPTH: usize = 256;

/// Reads a picture of a format that is not JPEG.
pub(super) fn decode(
    bytes: &[u8],
    format: Format,
    limits: &Limits,
    with_colors: bool,
) -> Result<Image, ImageError> {
    let (bytes, orientation) = match format {
        Format::Png => {
            let pixels = containers::pixels_of_png(bytes)?;
            (Cow::Owned(pixels.bytes), pixels.orientation)
        }
        Format::WebP => (Cow::Borrowed(bytes), containers::orientation_of_webp(bytes)),
        Format::Pnm if matches!(bytes.get(1), Some(b'1'..=b'3')) => {
            (Cow::Owned(without_comments(bytes)), None)
        }
        _ => (Cow::Borrowed(bytes), None),
    };
    let format = match format {
        Format::Png => ImageFormat::Png,
        Format::WebP => ImageFormat::WebP,
        Format::Bmp => ImageFormat::Bmp,
        Format::Jpeg | Format::Pnm => ImageFormat::Pnm,
    };
    let mut reader = ImageReader::with_format(Cursor::new(&bytes), format);
    let mut decoder_limits = image::Limits::default();
    decoder_limits.max_alloc = Some(limits.max_memory);
    reader.limits(decoder_limits);
    let decoder = reader.into_decoder().map_err(refused)?;
    let (width, height) = decoder.dimensions();
    let n_pixels = u64::from(width) * u64::from(height);
    // Decoded samples and luma.
    let memory = decoder.total_bytes().saturating_add(n_pixels);
    check_size(u64::from(width), u64::from(height), memory, limits)?;
    let color_type = decoder.color_type();
    let mut samples =
        vec![0; usize::try_from(decoder.total_bytes()).map_err(|_| damaged("it is too large"))?];
    decoder.read_image(&mut samples).map_err(refused)?;
    let has_room = memory.saturating_add(n_pixels.saturating_mul(3)) <= limits.max_memory;
    let colors = if with_colors && has_room { colors(&samples, color_type) } else { None };
    let luma = luma(samples, color_type).ok_or_else(|| damaged("it has samples of an unknown kind"))?;
    let mut image =
        Image::from_pixels(width as usize, height as usize, luma).ok_or_else(|| damaged("missing pixels"))?;
    image.colors = colors;
    oriented(image, orientation.unwrap_or(Orientation::NoTransforms))
}

/// What a decoder's refusal is.
fn refused(error: image::ImageError) -> ImageError {
    match error {
        image::ImageError::Unsupported(error) => {
            unsupported(&format!("a picture of this kind ({error})"), "convert it to JPEG or PNG")
        }
        image::ImageError::Limits(error) => ImageError::TooLarge(error.to_string()),
        error => damaged(&error.to_string()),
    }
}

/// A plain PNM without its comments, which the decoder takes in the head alone.
fn without_comments(bytes: &[u8]) -> Vec<u8> {
    let lines = bytes.split_inclusive(|&byte| matches!(byte, b'\n' | b'\r'));
    let told = lines.flat_map(|line| line.split(|&byte| byte == b'#').next().into_iter().chain([&b"\n"[..]]));
    told.flatten().copied().collect()
}

/// The upper half of a sample of 16 bits.
fn high_byte(sample: [u8; 2]) -> u8 {
    (u16::from_ne_bytes(sample) >> 8) as u8
}

/// Red, green and blue of decoded samples, whatever they say of transparency; `None` where they are gray.
fn colors(samples: &[u8], color_type: ColorType) -> Option<Vec<u8>> {
    Some(match color_type {
        ColorType::Rgb8 => samples.to_vec(),
        ColorType::Rgba8 => samples.as_chunks().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect(),
        ColorType::Rgb16 => samples.as_chunks().0.iter().map(|&sample| high_byte(sample)).collect(),
        ColorType::Rgba16 => {
            let of_pixel = |&[a, b, c, d, e, f, _, _]: &[u8; 8]| [[a, b], [c, d], [e, f]].map(high_byte);
            samples.as_chunks().0.iter().flat_map(of_pixel).collect()
        }
        _ => return None,
    })
}

/// Luma of decoded samples, whatever they say of transparency.
fn luma(samples: Vec<u8>, color_type: ColorType) -> Option<Vec<u8>> {
    Some(match color_type {
        ColorType::L8 => samples,
        ColorType::La8 => samples.as_chunks::<2>().0.iter().map(|&[luma, _]| luma).collect(),
        ColorType::Rgb8 => {
            let pixels = samples.as_chunks().0;
            let mut luma = vec![0; pixels.len()];
            simd::luma(pixels, &mut luma);
            luma
        }
        ColorType::Rgba8 => samples.as_chunks().0.iter().map(|&[r, g, b, _]| luma_of([r, g, b])).collect(),
        ColorType::L16 => scaled(samples.as_chunks().0.iter().map(|&luma| u16::from_ne_bytes(luma))),
        ColorType::La16 => scaled(
            samples.as_chunks::<4>().0.iter().map(|&[high, low, _, _]| u16::from_ne_bytes([high, low])),
        ),
        ColorType::Rgb16 => {
            let of_pixel = |&[a, b, c, d, e, f]: &[u8; 6]| luma_of([[a, b], [c, d], [e, f]].map(high_byte));
            samples.as_chunks().0.iter().map(of_pixel).collect()
        }
        ColorType::Rgba16 => {
            let of_pixel =
                |&[a, b, c, d, e, f, _, _]: &[u8; 8]| luma_of([[a, b], [c, d], [e, f]].map(high_byte));
            samples.as_chunks().0.iter().map(of_pixel).collect()
        }
        _ => return None,
    })
}

/// 16-bit luma to 8 bits. Cameras of 10 or 12 bits write their numbers as they are: where all fit one of the
/// usual depths they are taken to be of it, so that such a picture is not black.
fn scaled(luma: impl ExactSizeIterator<Item = u16> + Clone) -> Vec<u8> {
    let n_bits = u16::BITS - luma.clone().max().unwrap_or(0).leading_zeros();
    let depth = match luma.len() {
        0..MIN_PIXELS_OF_DEPTH => u16::BITS,
        _ => DEPTHS.into_iter().find(|&depth| n_bits <= depth).unwrap_or(u16::BITS),
    };
    luma.map(|sample| (sample >> (depth - 8)) as u8).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_of_plain_pictures_are_passed_over() {
        let bytes = b"P1 # one\n2 # two\n2\n# pixels 1 1\n1 0\n0 1\n";
        let image = decode(bytes, Format::Pnm, &Limits::default(), true).unwrap();
        assert_eq!(image.pixels(), [0, 255, 255, 0]);
        assert_eq!(image.colors(), None);
    }

    #[test]
    fn numbers_of_twelve_bits_are_not_black() {
        let ramp = |largest: u32| (0..256).map(move |idx| (largest * idx / 255) as u16).collect::<Vec<u16>>();
        for (largest, brightest) in
            [(65_535, 255), (40_000, 156), (4_095, 255), (3_000, 187), (1_023, 255), (255, 255)]
        {
            assert_eq!(scaled(ramp(largest).into_iter()).last(), Some(&brightest), "{largest}");
        }
        assert_eq!(scaled(ramp(4_095)[..255].iter().copied()).last(), Some(&15));
        assert!(scaled([0u16; 0].into_iter()).is_empty());
    }
}
