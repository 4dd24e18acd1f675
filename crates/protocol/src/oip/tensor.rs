//! The elements of tensors: as bytes, and in JSON.

use super::Datatype;
use serde::de::{DeserializeSeed, Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;
use std::fmt;
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// The most elements of a tensor in JSON.
const MAX_ELEMENTS: usize = 4096;

/// The values of an output, row by row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(untagged)]
pub enum Values {
    /// Of the datatype BYTES.
    Bytes(Vec<String>),
    /// Of the datatype FP32.
    Fp32(Vec<f32>),
    /// Of the datatype BOOL.
    Bool(Vec<bool>),
}

/// The strings of an input of the datatype BYTES, row by row. JSON may nest them as the shape says.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Texts<'a>(pub Vec<Cow<'a, str>>);

/// Why bytes are not the elements they should be.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
pub enum ElementsError {
    /// The bytes end within an element.
    #[error(
        "element {0} (counted from 0) is cut off; each is its length, a little-endian u32, and as many bytes"
    )]
    Cut(usize),
    /// More or fewer than the shape says.
    #[error("the shape says {expected} elements, but more or fewer were sent")]
    Count {
        /// How many there should be.
        expected: usize,
    },
}

impl Values {
    /// What the elements are.
    pub fn datatype(&self) -> Datatype {
        match self {
            Self::Bytes(_) => Datatype::Bytes,
            Self::Fp32(_) => Datatype::Fp32,
            Self::Bool(_) => Datatype::Bool,
        }
    }

    /// As bytes: numbers little-endian, each text after its length.
    pub fn to_bytes(&self) -> Vec<u8> {
        match self {
            Self::Bytes(texts) => texts.iter().flat_map(|text| element(text.as_bytes())).collect(),
            Self::Fp32(numbers) => numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
            Self::Bool(values) => values.iter().map(|&value| u8::from(value)).collect(),
        }
    }
}

/// One element of the datatype BYTES: its length, a little-endian u32, and its bytes.
fn element(bytes: &[u8]) -> impl Iterator<Item = u8> {
    let length = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
    length.to_le_bytes().into_iter().chain(bytes.iter().copied())
}

/// The elements of a tensor of the datatype BYTES, exactly `expected` of them. Nothing is copied.
pub fn elements(mut bytes: &[u8], expected: usize) -> Result<Vec<&[u8]>, ElementsError> {
    let mut found = Vec::new();
    while !bytes.is_empty() {
        let cut = ElementsError::Cut(found.len());
        let (length, rest) = bytes.split_first_chunk().ok_or(cut)?;
        let length = usize::try_from(u32::from_le_bytes(*length)).map_err(|_| cut)?;
        let (element, rest) = rest.split_at_checked(length).ok_or(cut)?;
        if found.len() == expected {
            return Err(ElementsError::Count { expected });
        }
        found.push(element);
        bytes = rest;
    }
    if found.len() == expected { Ok(found) } else { Err(ElementsError::Count { expected }) }
}

impl<'de: 'a, 'a> Deserialize<'de> for Texts<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut texts = Vec::new();
        deserializer.deserialize_seq(Rows(&mut texts))?;
        Ok(Self(texts))
    }
}

/// Collects the strings of lists within lists.
struct Rows<'t, 'a>(&'t mut Vec<Cow<'a, str>>);

impl<'a> Rows<'_, 'a> {
    fn push<E: Error>(self, text: Cow<'a, str>) -> Result<(), E> {
        if self.0.len() == MAX_ELEMENTS {
            return Err(E::custom(format_args!("a tensor has at most {MAX_ELEMENTS} elements in JSON")));
        }
        self.0.push(text);
        Ok(())
    }
}

impl<'de: 'a, 'a> DeserializeSeed<'de> for Rows<'_, 'a> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de: 'a, 'a> Visitor<'de> for Rows<'_, 'a> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an encoded image as a string in base64, or a list of such")
    }

    fn visit_borrowed_str<E: Error>(self, text: &'de str) -> Result<(), E> {
        self.push(Cow::Borrowed(text))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<(), E> {
        self.push(Cow::Owned(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        while list.next_element_seed(Rows(&mut *self.0))?.is_some() {}
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tensor(frames: &[Vec<u8>]) -> Vec<u8> {
        frames.iter().flat_map(|frame| element(frame)).collect()
    }

    proptest! {
        #[test]
        fn elements_come_back(frames: Vec<Vec<u8>>) {
            let bytes = tensor(&frames);
            prop_assert_eq!(elements(&bytes, frames.len()).unwrap(), frames);
        }

        #[test]
        fn any_bytes_are_elements_or_refused(bytes: Vec<u8>, expected in 0_usize..20) {
            if let Ok(found) = elements(&bytes, expected) {
                prop_assert_eq!(found.len(), expected);
                prop_assert_eq!(found.iter().map(|element| 4 + element.len()).sum::<usize>(), bytes.len());
            }
        }

        #[test]
        fn a_tensor_that_was_cut_is_refused(frames: Vec<Vec<u8>>, at: prop::sample::Index) {
            let bytes = tensor(&frames);
            prop_assume!(!bytes.is_empty());
            prop_assert!(elements(&bytes[..at.index(bytes.len())], frames.len()).is_err());
        }
    }

    #[test]
    fn a_length_beyond_the_end_and_another_count_are_told_apart() {
        assert_eq!(elements(&[255; 8], 1), Err(ElementsError::Cut(0)));
        assert_eq!(elements(&[1, 0, 0, 0, 7, 0, 0], 2), Err(ElementsError::Cut(1)));
        assert_eq!(elements(&[0; 8], 1), Err(ElementsError::Count { expected: 1 }));
        assert_eq!(elements(&[0; 4], 2), Err(ElementsError::Count { expected: 2 }));
    }

    #[test]
    fn strings_are_collected_from_lists_within_lists() {
        let texts = |json: &str| serde_json::from_str::<Texts>(json).map(|texts| texts.0.len()).ok();
        assert_eq!(texts(r#"["a", "b\n"]"#), Some(2));
        assert_eq!(texts(r#"[["a"], ["b"]]"#), Some(2));
        assert_eq!(texts("[]"), Some(0));
        for wrong in [r#""a""#, "[1]", "[null]", r#"[{"b64": "a"}]"#, "[\"a\"", &"[".repeat(1000)] {
            assert_eq!(texts(wrong), None, "{wrong}");
        }
        let many = |n_texts: usize| format!("[{}]", vec![r#""""#; n_texts].join(","));
        assert_eq!(texts(&many(MAX_ELEMENTS)), Some(MAX_ELEMENTS));
        assert_eq!(texts(&many(MAX_ELEMENTS + 1)), None);
    }

    #[test]
    fn values_are_written_as_the_protocol_says() {
        assert_eq!(Values::Bytes(vec!["hall".into(), String::new()]).to_bytes(), b"\x04\0\0\0hall\0\0\0\0");
        assert_eq!(Values::Fp32(vec![1.0]).to_bytes(), [0, 0, 0x80, 0x3F]);
        assert_eq!(Values::Bool(vec![true, false]).to_bytes(), [1, 0]);
    }
}
