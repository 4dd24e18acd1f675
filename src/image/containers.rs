//! The chunks of PNG and WebP: what is handed to their decoders, and what is read beside.

use super::{ImageError, exif, unsupported};
use image::metadata::Orientation;

/// What PNG files begin with.
const PNG_START: usize = 8;

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
    let (mut in_exif, mut in_xmp) = (None, None);
    while let Some((head, _)) = rest.split_first_chunk::<8>() {
        let [a, b, c, d, kind @ ..] = *head;
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        let chunk = &rest[..rest.len().min(length.saturating_add(12))];
        let content = chunk.get(8..8 + length).unwrap_or_default();
        match &kind {
            b"IHDR" | b"PLTE" | b"IDAT" | b"IEND" => pixels.extend(chunk),
            b"eXIf" => in_exif = in_exif.or_else(|| exif::in_exif(content)),
            b"iTXt" => {
                let xmp = content.strip_prefix(b"XML:com.adobe.xmp\0\0");
                in_xmp = in_xmp.or_else(|| exif::in_xmp(xmp?));
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
    Ok(Pixels { bytes: pixels, orientation: in_exif.or(in_xmp) })
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
