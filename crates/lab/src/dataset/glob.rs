//! Patterns with `*` and `?`.

/// Whether all of `name` matches `pattern`: `*` stands for any characters, `?` for exactly one.
///
/// On a mismatch only the last `*` is tried again, so time is at most the product of the lengths.
pub fn matches(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    let (mut pattern_idx, mut name_idx) = (0, 0);
    let mut last_star = None;
    while name_idx < name.len() {
        match pattern.get(pattern_idx) {
            Some('*') => {
                last_star = Some((pattern_idx, name_idx));
                pattern_idx += 1;
            }
            Some(&wanted) if wanted == '?' || wanted == name[name_idx] => {
                pattern_idx += 1;
                name_idx += 1;
            }
            _ => {
                let Some((star_idx, star_end)) = last_star else { return false };
                last_star = Some((star_idx, star_end + 1));
                pattern_idx = star_idx + 1;
                name_idx = star_end + 1;
            }
        }
    }
    pattern[pattern_idx..].iter().all(|&rest| rest == '*')
}

#[cfg(test)]
mod tests {
    use super::matches;
    use proptest::prelude::*;

    #[test]
    fn matches_whole_names() {
        assert!(matches("*cloudy1", "saarbruecken/part_b/seq3_cloudy1"));
        assert!(!matches("*cloudy1", "seq3_cloudy12"));
        assert!(!matches("cloudy1", "seq3_cloudy1"));
        assert!(matches("seq?_night?", "seq3_night2"));
        assert!(!matches("seq?", "seq"));
        assert!(matches("*", ""));
        assert!(matches("", ""));
        assert!(!matches("", "a"));
    }

    /// The definition, one case a line.
    fn matches_by_definition(pattern: &[char], name: &[char]) -> bool {
        match (pattern, name) {
            ([], _) => name.is_empty(),
            (['*', rest @ ..], _) => (0..=name.len()).any(|skip| matches_by_definition(rest, &name[skip..])),
            (['?', pattern @ ..], [_, name @ ..]) => matches_by_definition(pattern, name),
            ([wanted, pattern @ ..], [found, name @ ..]) => {
                wanted == found && matches_by_definition(pattern, name)
            }
            (_, []) => false,
        }
    }

    proptest! {
        #[test]
        fn agrees_with_the_definition(pattern in "[ab?*]{0,7}", name in "[ab]{0,9}") {
            let chars = |text: &str| text.chars().collect::<Vec<_>>();
            prop_assert_eq!(
                matches(&pattern, &name),
                matches_by_definition(&chars(&pattern), &chars(&name))
            );
        }
    }
}
