//! Pictures that are kept: how their files are called, and what they are.

/// The digits of a picture's name: 128 bits of its BLAKE3 digest.
const NAME_DIGITS: usize = 32;

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
