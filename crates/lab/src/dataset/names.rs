//! Names of rooms, drives and splits: how they are kept, and which look the same.

use icu_normalizer::ComposingNormalizerBorrowed;

/// The longest name, in bytes: what file systems take for one of theirs.
const MAX_NAME_BYTES: usize = 255;

/// A name as it is kept: without spaces around it, and its letters composed (Unicode NFC), so that `ü` is one
/// name whether a Mac wrote it as one character or as two.
pub fn settled(name: &str) -> String {
    ComposingNormalizerBorrowed::new_nfc().normalize(name.trim()).into_owned()
}

/// Why a settled name cannot be one, and what to do.
pub fn fault(name: &str) -> Option<&'static str> {
    if name.is_empty() {
        Some("the name of its room is empty: name it")
    } else if name.chars().any(char::is_control) {
        Some("its room or drive has a line break or control character in its name: rename it")
    } else if name.len() > MAX_NAME_BYTES {
        Some("its room or drive has a name of more than 255 bytes: shorten it")
    } else {
        None
    }
}

/// Equal for names that people, or systems that ignore case, take for one: case, the kind of spaces, and what
/// cannot be seen do not count.
pub fn look(name: &str) -> String {
    let plain = ComposingNormalizerBorrowed::new_nfkc().normalize(name).to_lowercase();
    let visible: String = plain.chars().filter(|&character| !is_invisible(character)).collect();
    visible.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A name in an error text: what differs unseen is written as its code.
pub fn spelled(name: &str) -> String {
    let spell = |character: char| {
        let is_plain = character == ' ' || (!is_invisible(character) && !character.is_whitespace());
        let code = character.escape_debug().to_string();
        if is_plain && !code.starts_with("\\u") { character.to_string() } else { code_of(character) }
    };
    format!("`{}`", name.chars().map(spell).collect::<String>())
}

fn code_of(character: char) -> String {
    character.escape_unicode().to_string()
}

/// Soft hyphens, joiners, marks of direction and the like.
fn is_invisible(character: char) -> bool {
    matches!(character,
        '\u{ad}' | '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_are_kept_composed_and_without_spaces_around() {
        assert_eq!(settled(" Ku\u{308}che\u{a0}"), "K\u{fc}che");
        assert_eq!(settled("living  room"), "living  room");
        assert_eq!(settled(" \t"), "");
    }

    #[test]
    fn what_cannot_be_told_apart_looks_the_same() {
        for (left, right) in [
            ("Kitchen", "kitchen"),
            ("K\u{dc}CHE", "k\u{fc}che"),
            ("living\u{a0}room", "living  room"),
            ("hall\u{200b}", "hall"),
        ] {
            assert_eq!(look(left), look(right), "{left} {right}");
        }
        assert_ne!(look("room_1"), look("room 1"));
        assert_ne!(look("room 1"), look("room 11"));
    }

    #[test]
    fn what_differs_unseen_is_spelled_out() {
        assert_eq!(spelled("hall "), "`hall `");
        assert_eq!(spelled("Ku\u{308}che"), "`Ku\\u{308}che`");
        assert_eq!(spelled("K\u{fc}che"), "`K\u{fc}che`");
        assert_eq!(spelled("a\u{200b}b\u{a0}"), "`a\\u{200b}b\\u{a0}`");
    }

    #[test]
    fn names_that_cannot_be_one_are_told() {
        for name in ["", "a\nb", "\u{1b}[31m", &"x".repeat(256)] {
            assert!(fault(name).is_some(), "{name:?}");
        }
        assert_eq!(fault("living room (2)"), None);
    }

    proptest! {
        #[test]
        fn a_settled_name_stays_and_looks_as_before(name in "\\PC{0,20}") {
            prop_assert_eq!(settled(&settled(&name)), settled(&name));
            prop_assert_eq!(look(&settled(&name)), look(&name));
        }
    }
}
