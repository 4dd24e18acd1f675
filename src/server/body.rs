//! Untrusted bodies into frames, within limits on bytes, time and memory.
//!
//! A body is read without a slot in the queue, so that slow senders hold no thread's next job back:
//! a full queue is noticed before the first byte is read, and the slot is taken when the frame is
//! whole. What slow senders can hold is memory, which is bounded for all bodies together.

use super::App;
use super::media_type::{MediaType, content_type};
use super::pool::QueueFull;
use super::problem::Problem;
use crate::protocol::base64_text;
use crate::protocol::object::Object;
use crate::protocol::rest::FrameJson;
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{FromRequest, Multipart, Request};
use axum::http::header;
use http_body_util::BodyExt;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;

/// Bytes of a form or of JSON beside the frame, or of JSON without one.
const ENVELOPE_BYTES: usize = 16 << 10;
/// The most that is allocated because a caller said how long a body will be.
const MAX_TRUSTED_BYTES: usize = 256 << 10;
/// When to come back where no memory for bodies is left.
const MEMORY_WAIT: Duration = Duration::from_secs(1);
/// The field of a form that holds a frame.
const FIELD: &str = "frame";

/// The bytes of one frame, and their share of the memory for bodies.
pub struct Frame {
    /// The encoded image.
    pub bytes: Bytes,
    held: Arc<OwnedSemaphorePermit>,
}

impl Frame {
    /// Takes the memory for bytes that are here already.
    ///
    /// # Errors
    /// None is left.
    pub fn hold(bytes: Bytes, memory: &Arc<Semaphore>) -> Result<Self, BodyError> {
        let held = Arc::new(take(memory, bytes.len())?);
        Ok(Self { bytes, held })
    }

    /// Bytes that are a part of these, or were decoded from them: they share their memory.
    pub fn part(&self, bytes: Bytes) -> Self {
        Self { bytes, held: self.held.clone() }
    }
}

/// The one frame of a request: the image itself, a form, or JSON.
pub struct OneFrame(pub Frame);

/// The frames of a batch, a form.
pub struct Frames(pub Vec<Frame>);

/// Why a body gave no frame.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum BodyError {
    /// Nothing in it.
    #[error("the body is empty; send the image itself, for example with `curl --data-binary @frame.jpg`")]
    Empty,
    /// Too many bytes.
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
    /// All memory for bodies is in use.
    #[error("too many bodies are being received; try again after the time in Retry-After")]
    NoMemory(QueueFull),
}

impl FromRequest<App> for OneFrame {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        const TYPES: &str = "the image itself, as image/jpeg or as application/octet-stream, \
            multipart/form-data with a field `frame`, or application/json with base64 in `frame`";
        let told = MediaType::told(request.headers(), TYPES)?;
        let max_bytes = app.settings.max_frame_bytes;
        let limit = match told {
            MediaType::Image | MediaType::Untold => max_bytes,
            MediaType::Form => max_bytes + ENVELOPE_BYTES,
            MediaType::Json => base64_text::longest(max_bytes) + ENVELOPE_BYTES,
        };
        let (request, body) = read(app, request, limit).await?;
        let frame = if told == MediaType::Form {
            only(form_frames(request, body, 2).await?)?
        } else if told.judged(&body.bytes)? == MediaType::Json {
            Frame { bytes: json_frame(&body.bytes)?, ..body }
        } else {
            body
        };
        if frame.bytes.len() > max_bytes {
            return Err(BodyError::TooLarge { limit: max_bytes }.into());
        }
        Ok(Self(frame))
    }
}

impl FromRequest<App> for Frames {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        const TYPES: &str = "multipart/form-data with a field `frame` for each frame";
        let headers = request.headers();
        if MediaType::told(headers, TYPES)? != MediaType::Form {
            return Err(BodyError::UnsupportedType(content_type(headers).to_owned(), TYPES).into());
        }
        let max_frames = app.settings.max_batch_frames;
        let (request, body) = read(app, request, app.settings.max_batch_bytes).await?;
        let frames = form_frames(request, body, max_frames + 1).await?;
        match frames.len() {
            0 => Err(BodyError::Empty.into()),
            n if n > max_frames => Err(BodyError::TooManyFrames(max_frames).into()),
            _ => Ok(Self(frames)),
        }
    }
}

/// Admits a request with frames and reads its body: size as declared, a free slot, then the bytes.
pub async fn read(app: &App, request: Request, limit: usize) -> Result<(Request, Frame), Problem> {
    if declared(request.body()) > limit {
        return Err(BodyError::TooLarge { limit }.into());
    }
    if app.is_draining() {
        return Err(Problem::Draining);
    }
    app.pool.has_room()?;
    let (request, frame) = receive(app, request, limit).await?;
    if frame.bytes.is_empty() { Err(BodyError::Empty.into()) } else { Ok((request, frame)) }
}

/// Reads the body of a request without frames: a little object of JSON, if there is one.
pub async fn read_json<T: DeserializeOwned>(app: &App, request: Request) -> Result<Option<T>, BodyError> {
    let (_, body) = receive(app, request, ENVELOPE_BYTES).await?;
    if body.bytes.is_empty() {
        return Ok(None);
    }
    let object: Option<Object<T>> = from_json(&body.bytes)?;
    Ok(object.map(|Object(value)| value))
}

/// Reads a body of at most `limit` bytes, within time.
async fn receive(app: &App, mut request: Request, limit: usize) -> Result<(Request, Frame), BodyError> {
    if let Some(encoding) = request.headers().get(header::CONTENT_ENCODING).filter(|&it| it != "identity") {
        return Err(BodyError::Encoded(String::from_utf8_lossy(encoding.as_bytes()).into_owned()));
    }
    let body = std::mem::take(request.body_mut());
    let patience = app.settings.body_timeout();
    let received = timeout(patience, collect(body, limit, &app.body_memory)).await;
    Ok((request, received.map_err(|_| BodyError::Slow(patience))??))
}

/// How long a caller says that a body will be, at least.
fn declared(body: &Body) -> usize {
    usize::try_from(body.size_hint().lower()).unwrap_or(usize::MAX)
}

/// Reads a body of at most `limit` bytes, each byte of which is taken from `memory` as it comes.
async fn collect(mut body: Body, limit: usize, memory: &Arc<Semaphore>) -> Result<Frame, BodyError> {
    let declared = declared(&body);
    let mut held = take(memory, 0)?;
    // A body that comes in one piece is not copied.
    let mut whole = Bytes::new();
    let mut pieces = Vec::new();
    while let Some(piece) = body.frame().await {
        let piece = piece.map_err(|error| BodyError::Broken(error.to_string()))?;
        let Ok(piece) = piece.into_data() else { continue };
        if held.num_permits() + piece.len() > limit {
            return Err(BodyError::TooLarge { limit });
        }
        held.merge(take(memory, piece.len())?);
        if whole.is_empty() && pieces.is_empty() {
            whole = piece;
        } else {
            if pieces.is_empty() {
                pieces.reserve(declared.min(MAX_TRUSTED_BYTES));
                pieces.extend_from_slice(&std::mem::take(&mut whole));
            }
            pieces.extend_from_slice(&piece);
        }
    }
    let bytes = if pieces.is_empty() { whole } else { Bytes::from(pieces) };
    Ok(Frame { bytes, held: Arc::new(held) })
}

fn take(memory: &Arc<Semaphore>, n_bytes: usize) -> Result<OwnedSemaphorePermit, BodyError> {
    let full = BodyError::NoMemory(QueueFull { retry_after: MEMORY_WAIT });
    let Ok(n_bytes) = u32::try_from(n_bytes) else { return Err(full) };
    memory.clone().try_acquire_many_owned(n_bytes).map_err(|_| full)
}

/// The frames of a form in the order sent, at most `max_frames` of them.
async fn form_frames(request: Request, body: Frame, max_frames: usize) -> Result<Vec<Frame>, BodyError> {
    let malformed = |error: String| BodyError::Malformed(format!("the form cannot be read: {error}"));
    let request = request.map(|_| Body::from(body.bytes));
    let mut form =
        Multipart::from_request(request, &()).await.map_err(|error| malformed(error.body_text()))?;
    let mut frames = Vec::new();
    while frames.len() < max_frames
        && let Some(field) = form.next_field().await.map_err(|error| malformed(error.body_text()))?
    {
        if field.name() != Some(FIELD) {
            let name = field.name().unwrap_or_default();
            return Err(malformed(format!("it has a field {name:?}; the field of a frame is `frame`")));
        }
        let bytes = field.bytes().await.map_err(|error| malformed(error.body_text()))?;
        frames.push(Frame { bytes, held: body.held.clone() });
    }
    Ok(frames)
}

fn only(mut frames: Vec<Frame>) -> Result<Frame, BodyError> {
    match (frames.pop(), frames.is_empty()) {
        (None, _) => Err(BodyError::Malformed("the form has no field `frame`".into())),
        (Some(frame), true) => Ok(frame),
        (Some(_), false) => {
            Err(BodyError::Malformed("the form has several frames; send them to /v1/recognize/batch".into()))
        }
    }
}

fn json_frame(body: &[u8]) -> Result<Bytes, BodyError> {
    let Object::<FrameJson>(json) = from_json(body)?;
    let bytes = base64_text::decode(&json.frame)
        .map_err(|error| BodyError::Malformed(format!("`frame` is not base64: {error}")))?;
    if bytes.is_empty() { Err(BodyError::Empty) } else { Ok(bytes.into()) }
}

fn from_json<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T, BodyError> {
    serde_json::from_slice(body)
        .map_err(|error| BodyError::Malformed(format!("the JSON cannot be read: {error}")))
}
