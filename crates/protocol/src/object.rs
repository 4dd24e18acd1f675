//! JSON objects that are nothing else.

use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;

/// A value that stands in an object of JSON. By itself serde also takes a list of the fields' values in
/// their order, which no document promises and which changes its meaning with every field that is added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Object<T>(pub T);

struct Fields<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Object<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Fields(PhantomData)).map(Self)
    }
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for Fields<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, fields: A) -> Result<T, A::Error> {
        T::deserialize(MapAccessDeserializer::new(fields))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rest::FrameJson;
    use std::borrow::Cow;

    #[test]
    fn a_list_of_the_fields_is_no_object() {
        let read = |text| serde_json::from_str::<Object<FrameJson>>(text).map(|Object(json)| json.frame);
        assert!(serde_json::from_str::<FrameJson>(r#"["AAAA"]"#).is_ok(), "what serde does by itself");
        for wrong in [r#"["AAAA"]"#, "null", "[]", r#""AAAA""#, "3"] {
            assert!(read(wrong).unwrap_err().to_string().contains("expected an object"), "{wrong}");
        }
        assert!(matches!(read(r#"{"frame": "AAAA"}"#), Ok(Cow::Borrowed("AAAA"))), "nothing is copied");
    }
}
