//! Errors in the words of those who made the mistake: settings and values instead of fields and types.

use std::ops::Range;

/// Names are alike from this similarity on, where 1 is the same (Jaro and Winkler).
const ALIKE: f64 = 0.75;

/// What types are called by people.
const TYPES: [(&str, &str); 18] = [
    ("usize", "a whole number"),
    ("u8", "a whole number"),
    ("u16", "a whole number"),
    ("u32", "a whole number"),
    ("u64", "a whole number"),
    ("i32", "a whole number"),
    ("i64", "a whole number"),
    ("isize", "a whole number"),
    ("an integer", "a whole number"),
    ("f32", "a number"),
    ("f64", "a number"),
    ("a float", "a number"),
    ("a boolean", "true or false"),
    ("bool", "true or false"),
    ("a string", "a text"),
    ("a sequence", "a list"),
    ("a map", "a table"),
    ("a nonzero usize", "a whole number from 1"),
];

/// An error's text in such words, as far as it tells of types and fields.
pub(super) fn reworded(text: &str) -> String {
    renamed(&retyped(text))
}

/// The name that is most like one, if one is.
pub(super) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let likeness = |other: &&str| strsim::jaro_winkler(name, other);
    let best = known.into_iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)))?;
    (likeness(&best) >= ALIKE).then_some(best)
}

/// `invalid type: string "many", expected usize` becomes `"many" is not a whole number`.
fn retyped(text: &str) -> String {
    let Some((before, rest)) = text.split_once("invalid type: ") else { return text.to_owned() };
    let Some((found, rest)) = rest.split_once(", expected ") else { return text.to_owned() };
    let end = rest.find([',', '\n', ':']).or_else(|| rest.find(" for key")).unwrap_or(rest.len());
    let (expected, after) = rest.split_at(end);
    let known = TYPES.iter().find(|(name, _)| *name == expected);
    let wanted = match (
        known,
        expected.strip_prefix("struct ").or(expected.strip_prefix("internally tagged enum ")),
    ) {
        (Some((_, wanted)), _) => (*wanted).to_owned(),
        (None, Some(_)) => "a table of settings".to_owned(),
        (None, None) => expected.to_owned(),
    };
    let value = ["string ", "integer ", "floating point ", "boolean "]
        .iter()
        .find_map(|kind| found.strip_prefix(kind));
    format!("{before}{} is not {wanted}{after}", value.unwrap_or(found))
}

/// ``unknown field `quue`, expected one of `queue`, `keys` `` gets the nearest name first.
fn renamed(text: &str) -> String {
    let mut text = text.to_owned();
    for (kind, called) in
        [("unknown field `", "there is no setting"), ("unknown variant `", "there is no choice")]
    {
        let Some(start) = text.find(kind) else { continue };
        let Some(Range { start: name_start, end }) = quoted_at(&text, start) else { continue };
        let name = text[name_start..end].to_owned();
        let Some(list) = text[end..].strip_prefix("`, expected ") else { continue };
        let known: Vec<&str> = list.split('`').skip(1).step_by(2).collect();
        let hint = nearest(&name, known.iter().copied());
        let hint = hint.map_or_else(|| ".".to_owned(), |nearest| format!("; did you mean {nearest}?"));
        text = format!("{}{called} {name}{hint} There are: {}", &text[..start], known.join(", "));
    }
    text
}

/// What stands between the first back quote from `start` on and the next one.
fn quoted_at(text: &str, start: usize) -> Option<Range<usize>> {
    let first = start + text[start..].find('`')? + 1;
    Some(first..first + text[first..].find('`')?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_said_as_people_say_them() {
        let text = "--set x=many: invalid type: string \"many\", expected usize";
        assert_eq!(reworded(text), "--set x=many: \"many\" is not a whole number");
        let text = "invalid type: integer `3`, expected a boolean for key `gpu` in roomsight.toml";
        assert_eq!(reworded(text), "`3` is not true or false for key `gpu` in roomsight.toml");
        assert_eq!(
            reworded("invalid type: sequence, expected struct Bag"),
            "sequence is not a table of settings"
        );
        assert_eq!(reworded("no such file"), "no such file");
        assert_eq!(reworded("invalid type: `"), "invalid type: `");
    }

    #[test]
    fn a_wrong_name_gets_the_nearest_one() {
        let text = "home.toml: unknown field `quue`, expected one of `listen`, `queue`, `keys`";
        assert_eq!(
            reworded(text),
            "home.toml: there is no setting quue; did you mean queue? There are: listen, queue, keys"
        );
        let text = "unknown variant `orb`, expected `fast` or `sift`";
        assert_eq!(reworded(text), "there is no choice orb. There are: fast, sift");
        assert_eq!(reworded("unknown field `x"), "unknown field `x");
        assert_eq!(nearest("hom", ["lab", "home"]), Some("home"));
        assert_eq!(nearest("zzz", ["lab", "home"]), None);
    }
}
