//! Names that callers give to robots, and other short texts of theirs.

use crate::problem::Problem;

const MAX_TEXT_BYTES: usize = 64;

/// Texts that are sent back and logged are short, and have no character that cannot be seen: none that ends a
/// line, reorders a text or makes two names look alike.
pub fn check_name(name: &str, text: Option<&str>) -> Result<(), Problem> {
    match text {
        Some(text)
            if text.trim() != text || text.is_empty() || text.len() > MAX_TEXT_BYTES || !is_visible(text) =>
        {
            Err(Problem::query(format!(
                "`{name}` must be 1 to {MAX_TEXT_BYTES} bytes of characters that can be seen; leave it out for none"
            )))
        }
        _ => Ok(()),
    }
}

/// Whether Rust would print the text as it is (quotes and backslashes it escapes for another reason), and has no
/// letter that looks like nothing.
fn is_visible(text: &str) -> bool {
    let looks_like_nothing = |letter: char| {
        matches!(
            letter,
            '\u{34f}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}' | '\u{2800}' | '\u{3164}'
        ) || matches!(letter, '\u{fe00}'..='\u{fe0e}' | '\u{ffa0}' | '\u{e0100}'..='\u{e01ef}')
    };
    let text = text.replace(['"', '\'', '\\'], "-");
    text.escape_debug().eq(text.chars()) && !text.contains(looks_like_nothing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_what_they_look_like() {
        let is_taken = |text: &str| check_name("robot", Some(text)).is_ok();
        for good in [
            "wall-e",
            "R2 D2",
            "caf\u{e9}",
            "cafe\u{301}",
            "\u{43c}\u{430}\u{448}\u{430}",
            "\u{1f916}",
            "it's \"x\" \\",
        ] {
            assert!(is_taken(good), "{good:?}");
        }
        for bad in [
            "",
            "a\nb",
            "a\u{7f}",
            "a\u{ad}b",
            "wall\u{200b}-e",
            "a\u{202e}b",
            "a\u{2028}b",
            "a\u{2066}b",
            "\u{feff}a",
            "\u{301}a",
            "a\u{e0041}",
            "wall-e ",
            " wall-e",
            "wall-e\u{3164}",
            "wall\u{2800}e",
            &"x".repeat(65),
        ] {
            assert!(!is_taken(bad), "{bad:?}");
        }
    }
}
