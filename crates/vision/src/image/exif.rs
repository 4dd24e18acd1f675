//! How a camera was held, wherever it says so.

use image::metadata::Orientation;

/// The tag of the orientation.
const ORIENTATION: u16 = 0x0112;

/// Entries of a directory that are looked at.
const MAX_ENTRIES: usize = 1024;

/// What EXIF says, with the head that JPEG gives it or without.
pub(super) fn in_exif(mut bytes: &[u8]) -> Option<Orientation> {
    // Some programs write this more than once. The sixth byte is 0, or 255 by others.
    while let Some(rest) = bytes.strip_prefix(b"Exif\0") {
        bytes = rest.get(1..)?;
    }
    in_tiff(bytes)
}

/// What XMP says, as an attribute or an element.
pub(super) fn in_xmp(bytes: &[u8]) -> Option<Orientation> {
    const NAME: &[u8] = b"tiff:Orientation";
    let at = bytes.windows(NAME.len()).position(|window| window == NAME)?;
    let value = bytes.get(at + NAME.len()..)?;
    let value = value
        .strip_prefix(b"=\"")
        .or_else(|| value.strip_prefix(b"='"))
        .or_else(|| value.strip_prefix(b">"))?;
    of_number(u32::from(value.first()?.checked_sub(b'0')?))
}

fn in_tiff(bytes: &[u8]) -> Option<Orientation> {
    let is_little = match bytes.get(..2)? {
        b"II" => true,
        b"MM" => false,
        _ => return None,
    };
    let short = |at: usize| {
        let (two, _) = bytes.get(at..)?.split_first_chunk()?;
        Some(if is_little { u16::from_le_bytes(*two) } else { u16::from_be_bytes(*two) })
    };
    let long = |at: usize| {
        let (four, _) = bytes.get(at..)?.split_first_chunk()?;
        Some(if is_little { u32::from_le_bytes(*four) } else { u32::from_be_bytes(*four) })
    };
    let directory = usize::try_from(long(4)?).ok()?;
    let n_entries = usize::from(short(directory)?).min(MAX_ENTRIES);
    let entry = (0..n_entries)
        .map(|idx| directory + 2 + 12 * idx)
        .find(|&entry| short(entry) == Some(ORIENTATION))?;
    of_number(match short(entry + 2)? {
        1 => u32::from(*bytes.get(entry + 8)?),
        3 => u32::from(short(entry + 8)?),
        4 => long(entry + 8)?,
        _ => return None,
    })
}

fn of_number(number: u32) -> Option<Orientation> {
    Orientation::from_exif(u8::try_from(number).ok()?)
}

#[cfg(test)]
pub(in crate::image) mod tests {
    use super::*;

    /// EXIF with another tag before the orientation.
    pub(in crate::image) fn exif(orientation: u8, is_little: bool, is_long: bool) -> Vec<u8> {
        let short = |n: u16| if is_little { n.to_le_bytes() } else { n.to_be_bytes() };
        let long = |n: u32| if is_little { n.to_le_bytes() } else { n.to_be_bytes() };
        let mut bytes = if is_little { b"II".to_vec() } else { b"MM".to_vec() };
        bytes.extend(short(42));
        // The directory does not follow the head at once.
        bytes.extend(long(12));
        bytes.extend([0; 4]);
        bytes.extend(short(2));
        bytes.extend([&short(0x010F)[..], &short(2), &long(4), b"abc\0"].concat());
        bytes.extend([short(ORIENTATION), short(if is_long { 4 } else { 3 })].concat());
        bytes.extend(long(1));
        if is_long {
            bytes.extend(long(orientation.into()));
        } else {
            bytes.extend([short(orientation.into()), short(0)].concat());
        }
        bytes.extend(long(0));
        bytes
    }

    #[test]
    fn cameras_write_it_in_many_ways() {
        for (is_little, is_long) in [(true, false), (true, true), (false, false), (false, true)] {
            let exif = exif(6, is_little, is_long);
            assert_eq!(in_exif(&exif), Some(Orientation::Rotate90));
            for head in [&b"Exif\0\0"[..], b"Exif\0\xFF"] {
                assert_eq!(in_exif(&[head, &exif].concat()), Some(Orientation::Rotate90));
            }
            for length in 0..exif.len() - 4 {
                let _ = in_exif(&exif[..length]);
            }
        }
        assert_eq!(
            in_exif(&[&b"Exif\0\0"[..], &exif(8, true, false)].concat()),
            Some(Orientation::Rotate270)
        );
        assert_eq!(in_exif(&exif(0, true, false)), None);
        assert_eq!(in_exif(&exif(9, true, false)), None);
        let far = b"II*\0\xFF\xFF\xFF\xFF";
        assert_eq!(in_exif(far), None);
    }

    #[test]
    fn xmp_says_it_too() {
        for xmp in ["<a tiff:Orientation=\"3\"/>", "<tiff:Orientation>3</tiff:Orientation>"] {
            assert_eq!(in_xmp(xmp.as_bytes()), Some(Orientation::Rotate180));
        }
        assert_eq!(in_xmp(b"<a tiff:Orientation=\"\"/>"), None);
        assert_eq!(in_xmp(b"tiff:Orientation"), None);
    }
}
