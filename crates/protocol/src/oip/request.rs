//! Frames to recognize: untrusted bytes into frames and what is asked about them.

use super::tensor::{ElementsError, Texts, elements};
use super::{FRAME, OutputName};
use crate::base64_text::{self, Base64Error};
use crate::object::Object;
#[cfg(feature = "schema")]
use crate::rest::EXAMPLE_FRAME;
use serde::de::{Error, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// The most inputs, outputs or dimensions that are read.
const MAX_LIST: usize = 64;
/// The longest part of a parser's message that is told.
const MAX_MESSAGE: usize = 200;

/// What is asked, and about which frames.
#[derive(Debug, PartialEq, Eq)]
pub struct Inference<'a> {
    /// Sent back.
    pub id: Option<String>,
    /// What is asked besides.
    pub parameters: InferParameters,
    /// The tensors that are wanted.
    pub outputs: Vec<AskedOutput>,
    /// The encoded images.
    pub frames: Vec<Cow<'a, [u8]>>,
}

/// A tensor that is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AskedOutput {
    /// Which.
    pub name: OutputName,
    /// Whether as bytes behind the JSON.
    pub binary: bool,
}

/// A request as JSON. Parameters that are not known are passed over, as the protocol wants it.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({
    "id": "42",
    "inputs": [{"name": "frame", "datatype": "BYTES", "shape": [1], "data": [EXAMPLE_FRAME]}],
    "outputs": [{"name": "room"}, {"name": "probability"}]
})))]
pub struct InferRequest<'a> {
    /// Sent back.
    id: Option<String>,
    /// What is asked besides.
    #[serde(default, deserialize_with = "object")]
    parameters: Option<InferParameters>,
    /// One: the tensor `frame`.
    #[serde(borrow, deserialize_with = "few_objects")]
    inputs: Vec<InferInput<'a>>,
    /// The tensors that are wanted; left out: all.
    #[serde(default, deserialize_with = "few_objects")]
    outputs: Vec<InferOutput>,
}

/// What is asked besides the frames.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct InferParameters {
    /// Who asks.
    #[cfg_attr(feature = "schema", schema(example = "wall-e", max_length = 64))]
    pub robot: Option<String>,
    /// How long after the arrival of the request the frames may wait before they are looked at.
    #[cfg_attr(feature = "schema", schema(example = 200))]
    pub deadline_ms: Option<u64>,
    /// The same in microseconds, as Triton's clients send it; 0: as long as it takes.
    timeout: Option<u64>,
    /// Whether tensors are wanted as bytes behind the JSON.
    #[serde(default)]
    binary_data_output: bool,
}

/// The tensor `frame`.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct InferInput<'a> {
    /// `frame`.
    #[cfg_attr(feature = "schema", schema(example = "frame"))]
    name: String,
    /// `BYTES`.
    #[cfg_attr(feature = "schema", schema(example = "BYTES"))]
    datatype: String,
    /// `[n]` or `[n, 1]` for n frames.
    #[serde(deserialize_with = "few")]
    shape: Vec<u64>,
    /// Where the frames follow behind the JSON, each after its length, a little-endian u32.
    #[serde(default, deserialize_with = "object")]
    parameters: Option<InputParameters>,
    /// The frames, where they do not: encoded images, in base64.
    #[serde(default, borrow)]
    #[cfg_attr(feature = "schema", schema(value_type = Option<Vec<String>>))]
    data: Option<Texts<'a>>,
}

/// How a tensor comes.
#[derive(Debug, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct InputParameters {
    /// How many bytes behind the JSON are the tensor's.
    binary_data_size: Option<u64>,
    #[cfg_attr(feature = "schema", schema(ignore))]
    shared_memory_region: Option<IgnoredAny>,
}

/// A tensor that is wanted.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct InferOutput {
    /// Which.
    name: OutputName,
    /// How.
    #[serde(default, deserialize_with = "object")]
    parameters: Option<OutputParameters>,
}

/// How a tensor is wanted.
#[derive(Debug, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct OutputParameters {
    /// Whether as bytes behind the JSON; left out: as `binary_data_output` says.
    binary_data: Option<bool>,
    #[cfg_attr(feature = "schema", schema(ignore))]
    classification: Option<IgnoredAny>,
    #[cfg_attr(feature = "schema", schema(ignore))]
    shared_memory_region: Option<IgnoredAny>,
}

/// Why a request cannot be read.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum RequestError {
    /// The header says more than there is.
    #[error("Inference-Header-Content-Length says {json_length} bytes of JSON, but the body has {body}")]
    JsonLength {
        /// What it says.
        json_length: usize,
        /// How many bytes there are.
        body: usize,
    },
    /// No JSON, or not what it should be.
    #[error("the JSON cannot be read: {0}")]
    Json(String),
    /// Other inputs than the one there is.
    #[error("send one input, `frame`, with the encoded images as its elements")]
    Inputs,
    /// Pixels, most likely.
    #[error("`frame` must have the datatype BYTES: each element is an encoded image, such as a JPEG")]
    Datatype,
    /// Another shape.
    #[error("`frame` must have the shape [n] or [n, 1] for n images")]
    Shape,
    /// No frame.
    #[error("there is no frame: the shape says 0 elements")]
    NoFrame,
    /// More frames than a request may have.
    #[error("the request has more than {0} frames; send several requests")]
    TooManyFrames(usize),
    /// No values, or two kinds of them.
    #[error("give the images in `data`, in base64, or give `binary_data_size` and send them behind the JSON")]
    NoData,
    /// What follows the JSON is not what was announced.
    #[error(
        "{found} bytes follow the JSON, but `binary_data_size` says {announced}; the header \
         Inference-Header-Content-Length must give the length of the JSON"
    )]
    BinarySize {
        /// How many follow.
        found: usize,
        /// How many should.
        announced: u64,
    },
    /// Bytes that are not the elements they should be.
    #[error("`frame` cannot be read: {0}")]
    Elements(#[from] ElementsError),
    /// Text that is not base64.
    #[error(
        "frame {frame_idx} (counted from 0) is not base64: {reason}; JSON cannot carry the bytes of an image"
    )]
    Base64 {
        /// Which, from 0.
        frame_idx: usize,
        /// Why.
        reason: Base64Error,
    },
    /// Memory that only a process beside ours could share.
    #[error("shared memory is not read or written here; send the bytes")]
    SharedMemory,
    /// Triton's strings of classes.
    #[error("`classification` is not served; ask for the outputs `probabilities` and `rooms`")]
    Classification,
}

impl<'a> Inference<'a> {
    /// Reads a body of at most `max_frames` frames, the first `json_length` bytes of which are JSON; all of
    /// them where that is not given.
    pub fn read(body: &'a [u8], json_length: Option<usize>, max_frames: usize) -> Result<Self, RequestError> {
        let json_length = json_length.unwrap_or(body.len());
        let too_long = RequestError::JsonLength { json_length, body: body.len() };
        let (json, binary) = body.split_at_checked(json_length).ok_or(too_long)?;
        let Object::<InferRequest>(request) =
            serde_json::from_slice(json).map_err(|error| unreadable(&error))?;
        let parameters = request.parameters.unwrap_or_default();
        let outputs = asked(&request.outputs, parameters.binary_data_output)?;
        let [input] = <[InferInput; 1]>::try_from(request.inputs).map_err(|_| RequestError::Inputs)?;
        let n_frames = input.n_frames()?;
        if n_frames > max_frames {
            return Err(RequestError::TooManyFrames(max_frames));
        }
        Ok(Self { id: request.id, parameters, outputs, frames: input.frames(binary, n_frames)? })
    }
}

impl InferParameters {
    /// How long the frames may wait before they are looked at, in milliseconds.
    pub fn wait_ms(&self) -> Option<u64> {
        let timeout = self.timeout.filter(|&microseconds| microseconds > 0);
        let timeout_ms = timeout.map(|microseconds| microseconds.div_ceil(1000));
        self.deadline_ms.into_iter().chain(timeout_ms).min()
    }
}

impl<'a> InferInput<'a> {
    fn n_frames(&self) -> Result<usize, RequestError> {
        if self.name != FRAME {
            return Err(RequestError::Inputs);
        }
        if self.datatype != "BYTES" {
            return Err(RequestError::Datatype);
        }
        match self.shape[..] {
            [0] | [0, 1] => Err(RequestError::NoFrame),
            // A number that no frames can have is too many all the same.
            [n] | [n, 1] => Ok(usize::try_from(n).unwrap_or(usize::MAX)),
            _ => Err(RequestError::Shape),
        }
    }

    /// The frames, from the JSON or from the bytes behind it.
    fn frames(self, binary: &'a [u8], n_frames: usize) -> Result<Vec<Cow<'a, [u8]>>, RequestError> {
        let parameters = self.parameters.unwrap_or_default();
        if parameters.shared_memory_region.is_some() {
            return Err(RequestError::SharedMemory);
        }
        let announced = parameters.binary_data_size.unwrap_or(0);
        if binary.len() as u64 != announced {
            return Err(RequestError::BinarySize { found: binary.len(), announced });
        }
        match (self.data, parameters.binary_data_size) {
            (Some(Texts(texts)), None) if texts.len() == n_frames => {
                texts.iter().enumerate().map(|(frame_idx, text)| decoded(frame_idx, text)).collect()
            }
            (Some(_), None) => Err(ElementsError::Count { expected: n_frames }.into()),
            (None, Some(_)) => Ok(elements(binary, n_frames)?.into_iter().map(Cow::Borrowed).collect()),
            (Some(_), Some(_)) | (None, None) => Err(RequestError::NoData),
        }
    }
}

fn decoded<'a>(frame_idx: usize, text: &str) -> Result<Cow<'a, [u8]>, RequestError> {
    let bytes = base64_text::decode(text);
    bytes.map(Cow::Owned).map_err(|reason| RequestError::Base64 { frame_idx, reason })
}

/// The tensors that are wanted; all where none is named.
fn asked(outputs: &[InferOutput], binary: bool) -> Result<Vec<AskedOutput>, RequestError> {
    if outputs.is_empty() {
        return Ok(OutputName::ALL.map(|name| AskedOutput { name, binary }).to_vec());
    }
    let asked = |output: &InferOutput| {
        let own = output.parameters.as_ref();
        if own.is_some_and(|own| own.classification.is_some()) {
            return Err(RequestError::Classification);
        }
        if own.is_some_and(|own| own.shared_memory_region.is_some()) {
            return Err(RequestError::SharedMemory);
        }
        let binary = own.and_then(|own| own.binary_data).unwrap_or(binary);
        Ok(AskedOutput { name: output.name, binary })
    };
    outputs.iter().map(asked).collect()
}

/// The parser's message can hold words of the body.
fn unreadable(error: &serde_json::Error) -> RequestError {
    RequestError::Json(error.to_string().chars().take(MAX_MESSAGE).collect())
}

/// An object, or null.
fn object<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<Option<T>, D::Error> {
    Ok(Option::<Object<T>>::deserialize(deserializer)?.map(|Object(value)| value))
}

/// A list of objects, or null, that nobody can make long.
fn few_objects<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<Vec<T>, D::Error> {
    Ok(few(deserializer)?.into_iter().map(|Object(value)| value).collect())
}

/// A list, or null, that nobody can make long.
fn few<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<Vec<T>, D::Error> {
    struct Few<T>(PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Few<T> {
        type Value = Vec<T>;

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            write!(f, "a list of at most {MAX_LIST}")
        }

        fn visit_unit<E: Error>(self) -> Result<Vec<T>, E> {
            Ok(Vec::new())
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<T>, A::Error> {
            let mut items = Vec::new();
            while let Some(item) = list.next_element()? {
                if items.len() == MAX_LIST {
                    return Err(A::Error::invalid_length(MAX_LIST + 1, &self));
                }
                items.push(item);
            }
            Ok(items)
        }
    }

    deserializer.deserialize_any(Few(PhantomData))
}

#[cfg(test)]
mod tests;
