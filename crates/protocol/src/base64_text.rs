//! Base64 as people's libraries write it.
//!
//! Beside the form of RFC 4648 there are lines of 64 or 76 characters (MIME, PEM, `base64` of coreutils,
//! Python's `encodebytes`), the alphabet for addresses, text without the `=` at its end, and the
//! `data:image/jpeg;base64,` that a browser's canvas puts before it. All of them mean the same bytes.

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

/// The standard alphabet, with or without padding.
const ENGINE: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Why a text is not base64.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
pub enum Base64Error {
    /// A character that base64 does not have.
    #[error("it has the character {0:?}; send the text of the image's base64 alone")]
    Character(char),
    /// Too few or too many characters.
    #[error("it ends in the middle; send all of it")]
    Cut,
}

/// The bytes that a text stands for.
///
/// # Errors
/// A text that is no base64 of any kind.
pub fn decode(text: &str) -> Result<Vec<u8>, Base64Error> {
    let text = without_data_prefix(text);
    // Nearly all texts are in the standard form already, and are not copied.
    if let Ok(bytes) = ENGINE.decode(text) {
        return Ok(bytes);
    }
    let plain = standard(text)?;
    ENGINE.decode(plain).map_err(|_| Base64Error::Cut)
}

/// The longest text that `n_bytes` need in any of the forms: one with a line break, as JSON writes it, after
/// every 64 characters.
pub fn longest(n_bytes: usize) -> usize {
    let n_characters = n_bytes.div_ceil(3) * 4;
    n_characters + n_characters / 64 * r"\r\n".len() + "data:image/x-portable-graymap;base64,".len()
}

/// What follows the head of a `data:` URI, where there is one.
fn without_data_prefix(text: &str) -> &str {
    let Some((head, data)) = text.split_once(',') else { return text };
    let head = head.trim_start();
    let is_data = head.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"));
    if is_data && head.to_ascii_lowercase().ends_with(";base64") { data } else { text }
}

/// The same text without white space and in the standard alphabet.
fn standard(text: &str) -> Result<String, Base64Error> {
    let character = |character: char| match character {
        '-' => Ok('+'),
        '_' => Ok('/'),
        'A'..='Z' | 'a'..='z' | '0'..='9' | '+' | '/' | '=' => Ok(character),
        other => Err(Base64Error::Character(other)),
    };
    text.chars().filter(|character| !character.is_ascii_whitespace()).map(character).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use base64::prelude::{BASE64_STANDARD, BASE64_STANDARD_NO_PAD, BASE64_URL_SAFE, BASE64_URL_SAFE_NO_PAD};
    use proptest::prelude::*;

    fn in_lines(text: &str, length: usize, end: &str) -> String {
        let lines: Vec<&str> =
            text.as_bytes().chunks(length).map(|line| std::str::from_utf8(line).unwrap()).collect();
        lines.join(end) + end
    }

    proptest! {
        #[test]
        fn every_way_of_writing_means_the_same_bytes(bytes: Vec<u8>) {
            let standard = BASE64_STANDARD.encode(&bytes);
            let ways = [
                BASE64_STANDARD_NO_PAD.encode(&bytes),
                BASE64_URL_SAFE.encode(&bytes),
                BASE64_URL_SAFE_NO_PAD.encode(&bytes),
                in_lines(&standard, 76, "\n"),
                in_lines(&BASE64_URL_SAFE_NO_PAD.encode(&bytes), 64, "\r\n"),
                format!("data:image/jpeg;base64,{standard}"),
                format!(" DATA:image/png;name=a;Base64, {standard}"),
                standard,
            ];
            for way in ways {
                prop_assert_eq!(decode(&way), Ok(bytes.clone()), "{}", way);
                prop_assert!(serde_json::to_string(&way).unwrap().len() <= longest(bytes.len()) + 16);
            }
        }

        #[test]
        fn any_text_is_base64_or_refused(text: String) {
            let _ = decode(&text);
        }
    }

    #[test]
    fn what_is_no_base64_is_told() {
        assert_eq!(decode("/9j/4AAQ..."), Err(Base64Error::Character('.')));
        assert_eq!(decode("b'/9j/4AAQ'"), Err(Base64Error::Character('\'')));
        assert_eq!(decode("data:image/jpeg,/9j/"), Err(Base64Error::Character(':')));
        assert_eq!(decode("/9j/4"), Err(Base64Error::Cut));
        assert_eq!(decode("/9=j"), Err(Base64Error::Cut));
        assert_eq!(decode(""), Ok(Vec::new()));
    }
}
