//! Why a body is not taken.

use crate::engine::bodies::NoMemory;
use crate::engine::frame::EMPTY_FRAME;
use crate::problem::{Kind, Problem};
use std::time::Duration;

/// Why a body gave no frame.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum BodyError {
    /// Nothing in it.
    #[error("{EMPTY_FRAME}")]
    Empty,
    #[error("the body has more than {limit} bytes; send a smaller or more compressed frame")]
    TooLarge {
        /// The most bytes.
        limit: usize,
    },
    /// Too many frames in a batch.
    #[error("the batch has more than {0} frames; send several batches")]
    TooManyFrames(usize),
    /// It took too long.
    #[error("the body was not complete after {} ms; send smaller frames or use a faster connection", .0.as_millis())]
    Slow(Duration),
    /// A type that is not read here.
    #[error("the type {0:?} is not read here; send {1}")]
    UnsupportedType(String, &'static str),
    /// Compressed.
    #[error("a body with the Content-Encoding {0:?} is not read here; send it as it is")]
    Encoded(String),
    /// An image without the bytes that `curl -d` leaves out.
    #[error(
        "this is no image, or it lost bytes on the way; send it with `curl --data-binary @frame.jpg` (`-d` leaves \
         out zeros and ends of lines), or as multipart/form-data with `curl -F frame=@frame.jpg`"
    )]
    Stripped,
    /// Not what its type says.
    #[error("{0}")]
    Malformed(String),
    /// The connection broke.
    #[error("the body broke off: {0}")]
    Broken(String),
    /// All memory for bodies is in use, or the caller's share of it.
    #[error(transparent)]
    NoMemory(#[from] NoMemory),
}

impl From<BodyError> for Problem {
    fn from(error: BodyError) -> Self {
        let kind = match &error {
            BodyError::TooLarge { .. } | BodyError::TooManyFrames(_) => Kind::TooLarge,
            BodyError::Slow(_) => Kind::SlowBody,
            BodyError::UnsupportedType(..) | BodyError::Encoded(_) => Kind::UnsupportedType,
            BodyError::Empty | BodyError::Stripped | BodyError::Malformed(_) | BodyError::Broken(_) => {
                Kind::BadRequest
            }
            BodyError::NoMemory(_) => Kind::QueueFull,
        };
        let retry_after = match &error {
            BodyError::NoMemory(NoMemory(full)) => Some(full.retry_after),
            _ => None,
        };
        Self::new(kind, error).with_retry_after(retry_after)
    }
}
