//! What bytes are, by how they begin.

use super::{ImageError, unsupported};

/// A format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Jpeg,
    Png,
    WebP,
    Bmp,
    Pnm,
}

const CONVERT: &str = "convert it to JPEG or PNG";
const IPHONE: &str =
    "convert it to JPEG; iPhones take JPEGs when Settings > Camera > Formats says Most Compatible";
const VIDEO: &str = "send single frames of it, as JPEG or PNG";

/// Formats that are known by name alone: how they begin, what they are called, what to do with them.
const NAMED: [(&[u8], &str, &str); 24] = [
    (b"GIF8", "a GIF", CONVERT),
    (b"II*\0", "a TIFF or a camera's raw file", CONVERT),
    (b"MM\0*", "a TIFF or a camera's raw file", CONVERT),
    (b"II+\0", "a BigTIFF", CONVERT),
    (b"MM\0+", "a BigTIFF", CONVERT),
    (b"IIU\0", "a camera's raw file", CONVERT),
    (b"FUJIFILMCCD-RAW", "a camera's raw file", CONVERT),
    (b"\xFF\x0A", "a JPEG XL", CONVERT),
    (b"\0\0\0\x0CJXL \r\n\x87\n", "a JPEG XL", CONVERT),
    (b"\xFF\x4F\xFF\x51", "a JPEG 2000", CONVERT),
    (b"\0\0\0\x0CjP  \r\n\x87\n", "a JPEG 2000", CONVERT),
    (b"\x8AMNG\r\n\x1A\n", "an MNG", CONVERT),
    (b"8BPS", "a Photoshop file", CONVERT),
    (b"\0\0\x01\0", "an icon", CONVERT),
    (b"qoif", "a QOI", CONVERT),
    (b"v/1\x01", "an OpenEXR", CONVERT),
    (b"#?RADIANCE", "a Radiance HDR", CONVERT),
    (b"#?RGBE", "a Radiance HDR", CONVERT),
    (b"DDS ", "a DDS", CONVERT),
    (b"Pf", "a PFM", CONVERT),
    (b"PF", "a PFM", CONVERT),
    (b"%PDF", "a PDF", CONVERT),
    (b"<svg", "an SVG", CONVERT),
    (b"\x1A\x45\xDF\xA3", "a video (WebM or Matroska)", VIDEO),
];

/// What the bytes are, if they can be read; else what they are, if that is known.
pub(super) fn guess(bytes: &[u8]) -> Result<Format, ImageError> {
    if bytes.starts_with(b"\xFF\xD8\xFF") {
        return Ok(Format::Jpeg);
    }
    if bytes.starts_with(b"\x89PNG\r\n\x1A\n") {
        return Ok(Format::Png);
    }
    match (bytes.get(..4), bytes.get(8..12)) {
        (Some(b"RIFF"), Some(b"WEBP")) => return Ok(Format::WebP),
        (Some(b"RIFF"), Some(b"AVI ")) => return Err(unsupported("a video (AVI)", VIDEO)),
        _ => {}
    }
    if bytes.starts_with(b"BM") {
        return Ok(Format::Bmp);
    }
    if matches!(bytes, [b'P', b'1'..=b'7', b' ' | b'\t' | b'\r' | b'\n' | b'#', ..]) {
        return Ok(Format::Pnm);
    }
    if bytes.get(4..8) == Some(b"ftyp") {
        return Err(media(bytes));
    }
    let named = NAMED.iter().find(|(start, ..)| bytes.starts_with(start));
    Err(named.map_or(ImageError::UnknownFormat, |(_, name, advice)| unsupported(name, advice)))
}

/// Names a file of the ISO's container by the brands that it claims.
fn media(bytes: &[u8]) -> ImageError {
    let length = bytes.first_chunk().map_or(0, |&length| u32::from_be_bytes(length) as usize);
    let head = &bytes[8..length.clamp(8, bytes.len().min(256))];
    let claims = |brands: &[&[u8; 4]]| head.as_chunks::<4>().0.iter().any(|brand| brands.contains(&brand));
    if claims(&[b"avif", b"avis"]) {
        unsupported("an AVIF", CONVERT)
    } else if claims(&[b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1"]) {
        unsupported("a HEIC (HEIF)", IPHONE)
    } else if claims(&[b"crx "]) {
        unsupported("a camera's raw file", CONVERT)
    } else {
        unsupported("a video (MP4 or QuickTime)", VIDEO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_named() {
        let name = |bytes: &[u8]| guess(bytes).unwrap_err().to_string();
        for (bytes, format) in [
            (&b"\0\0\0\x18ftypheic\0\0\0\0mif1heic"[..], "HEIC"),
            (b"\0\0\0\x1Cftypmif1\0\0\0\0mif1avifmiaf", "AVIF"),
            (b"\0\0\0\x14ftypisom\0\0\x02\0mp41", "video (MP4"),
            (b"GIF89a\x01\0", "GIF"),
            (b"II*\0\x08\0\0\0", "TIFF"),
            (b"\xFF\x0A\0", "JPEG XL"),
            (b"RIFF\0\0\0\0AVI LIST", "AVI"),
        ] {
            let name = name(bytes);
            assert!(name.contains(format) && name.contains("JPEG"), "{name}");
        }
        for bytes in [&b""[..], b"hello", b"P", b"P8\n", b"RIFF", b"\0\0\0\x18ftyp", b"\0\0\0\0ftypheic"] {
            assert!(guess(bytes).is_err(), "{bytes:?}");
        }
        assert_eq!(guess(b"hello"), Err(ImageError::UnknownFormat));
    }
}
