//! The chunks of PNG and WebP: what is handed to their decoders, and what is read beside.

use super::{ImageError, exif, unsupported};
use flate2::read::ZlibDecoder;
use image::metadata::Orientation;
use std::io::Read;

/// What PNG files begin with.
const PNG_START: usize = 8;
/// What PNG files end with.
const PNG_END: &[u8] = b"\0\0\0\0IEND\xAE\x42\x60\x82";
/// What a text with EXIF begins with.
const PROFILE: &[u8] = b"Raw profile type exif\0";
/// The most of such a text that is read, in bytes.
const MAX_PROFILE: usize = 256 << 10;

/// A PNG of only those chunks that make its pixels.
pub(super) struct Pixels {
    /// A PNG.
    pub bytes: Vec<u8>,
    /// What EXIF or XMP says, before the pixels or after them.
    pub orientation: Option<Orientation>,
}

/// Leaves out of a PNG what does not make luma. Texts, profiles and the like can inflate to any size, and
/// decoders inflate them.
pub(super) fn pixels_of_png(bytes: &[u8]) -> Result<Pixels, ImageError> {
    let (start, mut rest) = bytes.split_at_checked(PNG_START).unwrap_or((bytes, &[]));
    let mut pixels = Vec::with_capacity(bytes.len());
    pixels.extend(start);
    let (mut in_exif, mut in_xmp, mut profile) = (None, None, None);
    while let Some((head, _)) = rest.split_first_chunk::<8>() {
        let [a, b, c, d, kind @ ..] = *head;
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        let chunk = &rest[..rest.len().min(length.saturating_add(12))];
        let content = chunk.get(8..8 + length).unwrap_or_default();
        match &kind {
            b"IHDR" | b"PLTE" | b"IDAT" => pixels.extend(chunk),
            b"eXIf" => in_exif = in_exif.or_else(|| exif::in_exif(content)),
            b"iTXt" => {
                let xmp = content.strip_prefix(b"XML:com.adobe.xmp\0\0");
                in_xmp = in_xmp.or_else(|| exif::in_xmp(xmp?));
            }
            b"tEXt" | b"zTXt" if profile.is_none() => {
                let is_packed = kind == *b"zTXt";
                profile = content.strip_prefix(PROFILE).map(|content| Profile { is_packed, content });
            }
            b"CgBI" => {
                return Err(unsupported("a PNG for iPhone programs alone", "convert it to an ordinary PNG"));
            }
            _ => {}
        }
        if &kind == b"IEND" {
            break;
        }
        rest = &rest[chunk.len()..];
    }
    // Where only the end is missing, nothing is.
    pixels.extend(PNG_END);
    let in_profile = || profile.and_then(|profile| profile.orientation());
    Ok(Pixels { bytes: pixels, orientation: in_exif.or_else(in_profile).or(in_xmp) })
}

/// EXIF as a text, as some programs write it: its length and hexadecimal digits.
struct Profile<'a> {
    is_packed: bool,
    content: &'a [u8],
}

impl Profile<'_> {
    fn orientation(&self) -> Option<Orientation> {
        let mut text = Vec::new();
        if self.is_packed {
            // After the method of compression, of which there is one.
            let packed = ZlibDecoder::new(self.content.get(1..)?);
            packed.take(MAX_PROFILE as u64).read_to_end(&mut text).ok()?;
        } else {
            text.extend(&self.content[..self.content.len().min(MAX_PROFILE)]);
        }
        // An empty line, the name and the length come first.
        let digits = text.splitn(4, |&byte| byte == b'\n').nth(3)?;
        let digits = digits.iter().filter_map(|&digit| char::from(digit).to_digit(16));
        let digits: Vec<u8> = digits.map(|digit| digit as u8).collect();
        let bytes: Vec<u8> = digits.as_chunks::<2>().0.iter().map(|&[high, low]| (high << 4) | low).collect();
        exif::in_exif(&bytes)
    }
}

/// What EXIF or XMP of a WebP says.
pub(super) fn orientation_of_webp(bytes: &[u8]) -> Option<Orientation> {
    let mut rest = bytes.get(12..)?;
    let (mut in_exif, mut in_xmp) = (None, None);
    while let Some((head, content)) = rest.split_first_chunk::<8>() {
        let [kind @ .., a, b, c, d] = *head;
        let length = u32::from_le_bytes([a, b, c, d]) as usize;
        let content = &content[..content.len().min(length)];
        match &kind {
            b"EXIF" => in_exif = in_exif.or_else(|| exif::in_exif(content)),
            b"XMP " => in_xmp = in_xmp.or_else(|| exif::in_xmp(content)),
            _ => {}
        }
        // Chunks of an odd length are followed by a byte that fills up.
        rest = rest.get(8 + length.saturating_add(length % 2)..).unwrap_or_default();
    }
    in_exif.or(in_xmp)
}

#[cfg(test)]
mod tests {
    use super::super::exif::tests::exif;
    use super::super::{Image, ImageError, Limits};
    use super::*;
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use image::{DynamicImage, ImageFormat};
    use std::io::{Cursor, Write};

    fn png() -> Vec<u8> {
        let mut bytes = Vec::new();
        let picture = DynamicImage::new_luma8(30, 20);
        picture.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
        bytes
    }

    /// The picture with a chunk before its pixels, or behind them. Its checksum is never looked at.
    fn with_chunk(kind: &[u8; 4], content: &[u8], is_behind: bool) -> Vec<u8> {
        let png = png();
        let at = if is_behind { png.len() - 12 } else { 33 };
        let length = (content.len() as u32).to_be_bytes();
        [&png[..at], &length, kind, content, b"\0\0\0\0", &png[at..]].concat()
    }

    #[test]
    fn profiles_and_texts_do_not_reach_the_decoder() {
        for kind in [b"iCCP", b"zTXt", b"iTXt", b"tEXt", b"cHRM"] {
            let png = with_chunk(kind, &[b'x'; 3000], false);
            let pixels = pixels_of_png(&png).unwrap();
            assert!(pixels.bytes.len() < 1000 && pixels.orientation.is_none());
            assert!(Image::decode(&png, &Limits::default()).is_ok());
        }
    }

    #[test]
    fn orientation_is_read_before_the_pixels_and_behind_them() {
        let exif = exif(6, false, true);
        for is_behind in [false, true] {
            let image = Image::decode(&with_chunk(b"eXIf", &exif, is_behind), &Limits::default()).unwrap();
            assert_eq!((image.width(), image.height()), (20, 30));
        }
    }

    #[test]
    fn orientation_is_read_in_a_text_too() {
        let digits: String = exif(6, false, true).iter().map(|byte| format!("{byte:02x}")).collect();
        let text = format!("\nexif\n{:8}\n{digits}\n", digits.len() / 2);
        let mut packed = ZlibEncoder::new(vec![0], Compression::fast());
        packed.write_all(text.as_bytes()).unwrap();
        for (kind, text) in [(b"tEXt", text.into_bytes()), (b"zTXt", packed.finish().unwrap())] {
            let png = with_chunk(kind, &[PROFILE, &text].concat(), false);
            let image = Image::decode(&png, &Limits::default()).unwrap();
            assert_eq!((image.width(), image.height()), (20, 30));
        }
    }

    #[test]
    fn a_picture_without_its_end_is_whole() {
        let png = png();
        let image = Image::decode(&png[..png.len() - 12], &Limits::default()).unwrap();
        assert_eq!((image.width(), image.height()), (30, 20));
    }

    #[test]
    fn chunks_that_lie_about_their_length_end_the_picture() {
        let mut png = png();
        png[33..37].copy_from_slice(&u32::MAX.to_be_bytes());
        assert!(matches!(Image::decode(&png, &Limits::default()), Err(ImageError::Damaged(_))));
        let phone = with_chunk(b"CgBI", &[0; 4], false);
        assert!(matches!(Image::decode(&phone, &Limits::default()), Err(ImageError::Unsupported { .. })));
    }

    #[test]
    fn chunks_of_webp_are_walked_to_the_end() {
        let exif = exif(3, true, false);
        let length = (exif.len() as u32).to_le_bytes();
        let odd = [&b"RIFF\0\0\0\0WEBP"[..], b"ICCP\x03\0\0\0abc\0", b"EXIF", &length, &exif].concat();
        assert_eq!(orientation_of_webp(&odd), Some(Orientation::Rotate180));
        for end in 0..odd.len() - 4 {
            let _ = orientation_of_webp(&odd[..end]);
        }
        assert_eq!(orientation_of_webp(b"RIFF\0\0\0\0WEBPEXIF\xFF\xFF\xFF\xFFII"), None);
    }
}
