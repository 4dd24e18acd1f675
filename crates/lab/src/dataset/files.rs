//! What all readers need from the file system: bounded reads, text of any encoding that is told, names in order.

use super::Problem;
use std::cmp::Ordering;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// The longest label file or manifest that is read, in bytes: a line for each of a million frames.
pub const MAX_LABEL_BYTES: u64 = 64 << 20;

/// How names of pictures of the formats that are read end, in lower case.
const PICTURE_ENDINGS: [&str; 10] = ["bmp", "jfif", "jpe", "jpeg", "jpg", "pgm", "png", "pnm", "ppm", "webp"];

/// Whether a file is called a picture by its ending.
pub fn is_picture_ending(ending: &str) -> bool {
    PICTURE_ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// Reads a regular file of at most `max_bytes`; its size is checked first.
pub fn read_bounded(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    // Before opening: opening a pipe would wait for its writer.
    let metadata = fs::metadata(path)?;
    if !metadata.is_file() {
        return Err(io::Error::other("not a regular file"));
    }
    if metadata.len() == 0 {
        return Err(io::Error::other("an empty file"));
    }
    if metadata.len() > max_bytes {
        let reason = format!("{} bytes long, at most {max_bytes} are read", metadata.len());
        return Err(io::Error::other(reason));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(max_bytes).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a label file or manifest: text, bounded, not empty. It is UTF-8, or UTF-16 that begins with a mark
/// (BOM), as spreadsheets write it.
pub fn read_labels(path: &Path) -> Result<String, Problem> {
    let fail = |reason: String| Problem::new(path, reason);
    let bytes = read_bounded(path, MAX_LABEL_BYTES).map_err(|error| fail(error.to_string()))?;
    let text = decode(&bytes).map_err(fail)?;
    if text.trim().is_empty() { Err(fail("empty: it labels no frame".to_owned())) } else { Ok(text) }
}

/// Text without its mark.
fn decode(bytes: &[u8]) -> Result<String, String> {
    match bytes {
        [0xff, 0xfe, rest @ ..] => decode_utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => decode_utf16(rest, u16::from_be_bytes),
        _ => decode_utf8(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)),
    }
}

fn decode_utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String, String> {
    let (units, rest) = bytes.as_chunks();
    let text = char::decode_utf16(units.iter().copied().map(unit)).collect::<Result<_, _>>().ok();
    text.filter(|_| rest.is_empty())
        .ok_or_else(|| "not the UTF-16 that its first bytes say: save it as UTF-8".to_owned())
}

fn decode_utf8(bytes: &[u8]) -> Result<String, String> {
    match std::str::from_utf8(bytes) {
        Ok(text) if text.contains('\0') => {
            Err("not text, or UTF-16 without a mark: save it as UTF-8".to_owned())
        }
        Ok(text) => Ok(text.to_owned()),
        Err(error) => {
            let line = 1 + bytes[..error.valid_up_to()].iter().filter(|&&byte| byte == b'\n').count();
            Err(format!("not UTF-8 text (line {line}): save it as UTF-8"))
        }
    }
}

/// The last part of a path, as text.
pub fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Orders names as people do: numbers by value, so that `frame_9` comes before `frame_10`.
pub fn natural_order(left: &str, right: &str) -> Ordering {
    runs(left).cmp(runs(right)).then_with(|| left.cmp(right))
}

/// Runs of digits, leading zeros stripped, with their length, and of other characters, with 0.
fn runs(name: &str) -> impl Iterator<Item = (usize, &[u8])> {
    name.as_bytes().chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit()).map(|run| {
        if run.iter().all(u8::is_ascii_digit) {
            let n_zeros = run.iter().take_while(|&&digit| digit == b'0').count();
            (1 + run.len() - n_zeros, &run[n_zeros..])
        } else {
            (0, run)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_in_names_count_by_value() {
        let mut names = ["f10", "f9", "f009b", "e", "f", "f1.5", "f1.10"];
        names.sort_by(|left, right| natural_order(left, right));
        assert_eq!(names, ["e", "f", "f1.5", "f1.10", "f9", "f009b", "f10"]);
    }

    #[test]
    fn text_is_read_in_the_encodings_that_say_what_they_are() {
        let utf16 = |mark: [u8; 2], bytes: fn(u16) -> [u8; 2]| {
            [&mark[..], &"a;\u{fc}\n".encode_utf16().flat_map(bytes).collect::<Vec<u8>>()].concat()
        };
        for bytes in [
            "a;\u{fc}\n".as_bytes().to_vec(),
            "\u{feff}a;\u{fc}\n".as_bytes().to_vec(),
            utf16([0xff, 0xfe], u16::to_le_bytes),
            utf16([0xfe, 0xff], u16::to_be_bytes),
        ] {
            assert_eq!(decode(&bytes).as_deref(), Ok("a;\u{fc}\n"), "{bytes:x?}");
        }
        assert!(decode(b"a\nb\nK\xfcche").unwrap_err().contains("line 3"));
        assert!(decode(b"f\0i\0").unwrap_err().contains("UTF-16 without"));
        assert!(decode(b"\xff\xfea").unwrap_err().contains("UTF-16"));
        assert!(decode(b"\xff\xfe\0\xd8").unwrap_err().contains("UTF-16"), "half a pair");
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes: Vec<u8>, mark in 0..3usize) {
            let mark = [&b""[..], b"\xff\xfe", b"\xfe\xff"][mark];
            let _ = decode(&[mark, &bytes].concat());
        }

        #[test]
        fn natural_order_is_numeric_on_numbers(left: u32, right: u32) {
            prop_assert_eq!(natural_order(&left.to_string(), &right.to_string()), left.cmp(&right));
        }
    }
}
