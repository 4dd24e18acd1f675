//! Pictures that are kept: how their files are called, what they are, and small ones of them.

use image::codecs::jpeg::JpegEncoder;
use image::{ImageError as EncodeError, RgbImage, imageops};
use roomsight_vision::image::{Image, ImageError, Limits};

/// The quality of small pictures, from 1 to 100.
const QUALITY: u8 = 80;

/// The digits of a picture's name: 128 bits of its BLAKE3 digest.
const NAME_DIGITS: usize = 32;

/// Why there is no small picture.
#[derive(Debug, thiserror::Error)]
pub enum SmallPictureError {
    /// The picture cannot be read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A defect of ours.
    #[error("the small picture cannot be written: {0}")]
    Encode(#[from] EncodeError),
}

/// The picture as a JPEG that is at most so many pixels wide, in colors where it has some.
///
/// # Errors
/// A picture that cannot be read within the limits.
pub fn small_picture(bytes: &[u8], width: u32, limits: &Limits) -> Result<Vec<u8>, SmallPictureError> {
    // A large JPEG is read at a part of its size; what cannot be is read whole.
    let few = Limits { max_pixels: 4 * u64::from(width).pow(2), ..*limits }.enough_for(width as usize);
    let image = match Image::decode_with_colors(bytes, &few) {
        Err(ImageError::TooLarge(_)) => Image::decode_with_colors(bytes, limits),
        read => read,
    }?;
    let [full_width, full_height] = [image.width() as u32, image.height() as u32];
    let gray = || image.pixels().iter().flat_map(|&pixel| [pixel; 3]).collect();
    let colors = image.colors().map_or_else(gray, <[u8]>::to_vec);
    // Decoded images have three colors a pixel.
    let full = RgbImage::from_raw(full_width, full_height, colors).unwrap_or_default();
    let height = (u64::from(full_height) * u64::from(width) / u64::from(full_width.max(1))).max(1) as u32;
    let small = if width < full_width { imageops::thumbnail(&full, width, height) } else { full };
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode_image(&small)?;
    Ok(bytes)
}

/// The media type of a picture, and how its files end; as bytes that may be anything where it is none of those that are read.
pub fn type_of(bytes: &[u8]) -> PictureType {
    let is_webp = bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP");
    let (media_type, extension) = match bytes {
        [0xff, 0xd8, ..] => ("image/jpeg", "jpg"),
        [0x89, b'P', b'N', b'G', ..] => ("image/png", "png"),
        [b'B', b'M', ..] => ("image/bmp", "bmp"),
        [b'P', b'2' | b'5', ..] => ("image/x-portable-graymap", "pgm"),
        _ if is_webp => ("image/webp", "webp"),
        _ => ("application/octet-stream", "bin"),
    };
    PictureType { media_type, extension }
}

/// What a picture is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureType {
    pub media_type: &'static str,
    /// Of its files, without the dot.
    pub extension: &'static str,
}

/// The name of a picture's file: its content, so that equal pictures have equal names.
pub fn file_name(bytes: &[u8]) -> String {
    let digest = blake3::hash(bytes).to_hex();
    format!("{}.{}", &digest[..NAME_DIGITS], type_of(bytes).extension)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage};
    use std::io::Cursor;

    fn red(width: u32, height: u32, format: image::ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        RgbImage::from_pixel(width, height, Rgb([200, 10, 10])).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn a_small_picture_keeps_its_colors_and_its_shape() {
        for format in [image::ImageFormat::Jpeg, image::ImageFormat::Png] {
            let small = small_picture(&red(1600, 1200, format), 160, &Limits::default()).unwrap();
            let small = image::load_from_memory(&small).unwrap().to_rgb8();
            assert_eq!(small.dimensions(), (160, 120));
            let [red, green, _] = small.get_pixel(80, 60).0;
            assert!(red > 150 && green < 60, "{red} {green}");
        }
        let as_it_is = small_picture(&red(20, 10, image::ImageFormat::Png), 160, &Limits::default()).unwrap();
        assert_eq!(image::load_from_memory(&as_it_is).unwrap().to_rgb8().dimensions(), (20, 10));
        assert!(matches!(
            small_picture(b"no picture", 160, &Limits::default()),
            Err(SmallPictureError::Image(_))
        ));
    }

    #[test]
    fn files_are_named_by_content_and_kind() {
        let (png, jpeg) = (red(4, 4, image::ImageFormat::Png), red(4, 4, image::ImageFormat::Jpeg));
        assert!(file_name(&png).ends_with(".png") && file_name(&jpeg).ends_with(".jpg"));
        assert_eq!(file_name(&png), file_name(&png.clone()));
        assert_ne!(file_name(&png), file_name(&jpeg));
        assert_eq!(type_of(b"P5 1 1").extension, "pgm");
        assert_eq!(type_of(b"RIFF\0\0\0\0WEBP").media_type, "image/webp");
        assert_eq!(type_of(b"").extension, "bin");
    }
}
