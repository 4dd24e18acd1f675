//! Untrusted bodies into frames, within limits on bytes, time and memory.
//!
//! A body is read without a slot in the queue, so that slow senders hold no thread's next job back:
//! a full queue is noticed before the first byte is read, and the slot is taken when the frame is
//! whole. What slow senders can hold is memory, which is bounded for all bodies together and for each
//! caller, see [`Bodies`](crate::engine::bodies::Bodies).

mod error;
mod media_type;

pub use error::BodyError;

use crate::engine::bodies::Held;
use crate::engine::caller::CallerId;
use crate::engine::frame::Frame;
use crate::engine::pool::Whose;
use crate::engine::recognize::RecognizeError;
use crate::http::App;
use crate::http::caller::caller_of;
use crate::http::seats::Line;
use crate::problem::Problem;
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{FromRequest, Multipart, Request};
use axum::http::header;
use http_body_util::BodyExt;
use media_type::{MediaType, content_type};
use roomsight_protocol::base64_text;
use roomsight_protocol::object::Object;
use roomsight_protocol::rest::FrameJson;
use roomsight_protocol::scan::LaserScan;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::sync::Arc;
use std::time::Duration;
use tokio::runtime::Handle;
use tokio::time::{sleep, timeout};

/// Bytes of a form or of JSON beside the frame, or of JSON without one.
const ENVELOPE_BYTES: usize = 16 << 10;
/// Bytes of JSON with as many ranges as a scan may have.
const SCAN_BYTES: usize = 256 << 10;
/// Bytes of JSON that names frames: as many as one change moves.
const LIST_BYTES: usize = 4 << 20;
/// The most that is allocated because a caller said how long a body will be.
const MAX_TRUSTED_BYTES: usize = 256 << 10;
/// The longest body that is taken apart on the thread that received it, which takes a millisecond or two.
const MAX_BYTES_AT_ONCE: usize = 1 << 20;
/// How long a caller whose share is used up waits to hear so: one that asks again at once takes little from others.
const REFUSAL_PAUSE: Duration = Duration::from_millis(100);
/// The field of a form that holds a frame.
const FIELD: &str = "frame";
/// The field of a form that holds the scan of a laser, as JSON.
const SCAN_FIELD: &str = "scan";

/// The one frame of a request: the image itself, a form, or JSON.
pub struct OneFrame(pub Frame);

/// The frames of a batch, a form.
pub struct Frames(pub Vec<Frame>);

/// Pictures of a request, each with its name: the image itself, or a form.
pub struct NamedFrames(pub Vec<NamedFrame>);

/// A picture, and what its sender calls it.
pub struct NamedFrame {
    /// Empty where it was not told.
    pub name: String,
    pub frame: Frame,
}

impl FromRequest<App> for NamedFrames {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        const TYPES: &str = "the image itself, as image/jpeg or as application/octet-stream, or \
            multipart/form-data with a field `frame` for each";
        let settings = &app.engine.settings;
        match MediaType::told(request.headers(), TYPES)? {
            MediaType::Form => {
                let (request, body) = read(app, request, settings.max_batch_bytes).await?;
                let frames =
                    form_fields(app, request, body, settings.max_batch_frames + 1).await?.without_scan()?;
                match frames.len() {
                    0 => Err(BodyError::Empty.into()),
                    n if n > settings.max_batch_frames => {
                        Err(BodyError::TooManyFrames(settings.max_batch_frames).into())
                    }
                    _ => Ok(Self(frames)),
                }
            }
            MediaType::Json => {
                Err(BodyError::UnsupportedType(content_type(request.headers()).to_owned(), TYPES).into())
            }
            MediaType::Image | MediaType::Untold => {
                let (_, frame) = read(app, request, settings.max_frame_bytes).await?;
                Ok(Self(vec![NamedFrame { name: String::new(), frame }]))
            }
        }
    }
}

impl FromRequest<App> for OneFrame {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        const TYPES: &str = "the image itself, as image/jpeg or as application/octet-stream, \
            multipart/form-data with a field `frame`, or application/json with base64 in `frame`";
        let told = MediaType::told(request.headers(), TYPES)?;
        let max_bytes = app.engine.settings.max_frame_bytes;
        let limit = match told {
            MediaType::Image | MediaType::Untold => max_bytes,
            MediaType::Form => max_bytes + ENVELOPE_BYTES + SCAN_BYTES,
            MediaType::Json => base64_text::longest(max_bytes) + ENVELOPE_BYTES + SCAN_BYTES,
        };
        let (request, body) = read(app, request, limit).await?;
        let frame = if told == MediaType::Form {
            only_frame(form_fields(app, request, body, 2).await?)?
        } else if told.judged(&body.bytes)? == MediaType::Json {
            let n_bytes = body.bytes.len();
            let read = move || json_frame(&body);
            take_apart(app, &caller_of(request.extensions()), n_bytes, read).await??
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
        let max_frames = app.engine.settings.max_batch_frames;
        let (request, body) = read(app, request, app.engine.settings.max_batch_bytes).await?;
        let frames = form_fields(app, request, body, max_frames + 1).await?.without_scan()?;
        match frames.len() {
            0 => Err(BodyError::Empty.into()),
            n if n > max_frames => Err(BodyError::TooManyFrames(max_frames).into()),
            _ => Ok(Self(frames.into_iter().map(|named| named.frame).collect())),
        }
    }
}

/// Admits a request with frames and reads its body: size as declared, a free slot, then the bytes.
pub async fn read(app: &App, request: Request, limit: usize) -> Result<(Request, Frame), Problem> {
    if declared(request.body()) > limit {
        return Err(BodyError::TooLarge { limit }.into());
    }
    if app.engine.is_draining() {
        return Err(Problem::draining());
    }
    if let Err(full) = app.engine.pool.has_room(&caller_of(request.extensions())) {
        if full.whose == Whose::Caller {
            sleep(REFUSAL_PAUSE).await;
        }
        return Err(full.into());
    }
    let (request, frame) = receive(app, request, limit).await?;
    if frame.bytes.is_empty() { Err(BodyError::Empty.into()) } else { Ok((request, frame)) }
}

/// Reads the body of a request without frames: a little object of JSON, if there is one.
pub async fn read_json<T: DeserializeOwned>(app: &App, request: Request) -> Result<Option<T>, BodyError> {
    read_json_within(app, request, ENVELOPE_BYTES).await
}

/// The same where it may name many frames.
pub async fn read_json_list<T: DeserializeOwned>(
    app: &App,
    request: Request,
) -> Result<Option<T>, BodyError> {
    read_json_within(app, request, LIST_BYTES).await
}

async fn read_json_within<T: DeserializeOwned>(
    app: &App,
    request: Request,
    limit: usize,
) -> Result<Option<T>, BodyError> {
    let (_, body) = receive(app, request, limit).await?;
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
    let patience = app.engine.settings.body_timeout();
    let held = app.engine.bodies.begin(caller_of(request.extensions()))?;
    let _waits = request.extensions().get::<Arc<Line>>().map(Line::waits);
    let received = timeout(patience, collect(body, limit, held)).await;
    Ok((request, received.map_err(|_| BodyError::Slow(patience))??))
}

/// How long a caller says that a body will be, at least.
fn declared(body: &Body) -> usize {
    usize::try_from(body.size_hint().lower()).unwrap_or(usize::MAX)
}

/// Reads a body of at most `limit` bytes, the memory for which is taken as they come.
async fn collect(mut body: Body, limit: usize, mut held: Held) -> Result<Frame, BodyError> {
    let declared = declared(&body);
    // A body that comes in one piece is not copied.
    let mut whole = Bytes::new();
    let mut pieces = Vec::new();
    loop {
        let piece = tokio::select! {
            piece = body.frame() => piece,
            gave_way = held.gives_way() => return Err(gave_way.into()),
        };
        let Some(piece) = piece else { break };
        let piece = piece.map_err(|error| BodyError::Broken(error.to_string()))?;
        let Ok(piece) = piece.into_data() else { continue };
        if held.n_bytes() + piece.len() > limit {
            return Err(BodyError::TooLarge { limit });
        }
        held.take(piece.len(), declared).await?;
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
    held.complete();
    // A single piece lies in the connection's buffer.
    let is_single = pieces.is_empty();
    Ok(if is_single { Frame::within_buffer(whole, held) } else { Frame::new(pieces.into(), held) })
}

/// Takes a body of `n_bytes` apart: a long one as its caller's work, on a thread that recognizes, so that those
/// that serve sockets go on.
pub async fn take_apart<T: Send + 'static>(
    app: &App,
    caller: &CallerId,
    n_bytes: usize,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Problem> {
    if n_bytes <= MAX_BYTES_AT_ONCE {
        return Ok(work());
    }
    let slot = app.engine.pool.admit_one(caller)?;
    Ok(app.engine.pool.run(slot, |_| work()).await.map_err(RecognizeError::from)?)
}

/// What a form holds.
struct Fields {
    /// In the order sent.
    frames: Vec<NamedFrame>,
    scan: Option<LaserScan>,
}

impl Fields {
    /// The frames of one that may not hold a scan, since it would not be known beside which frame.
    fn without_scan(self) -> Result<Vec<NamedFrame>, BodyError> {
        match self.scan {
            None => Ok(self.frames),
            Some(_) => Err(BodyError::Malformed(
                "the form has a field `scan`, which goes beside a single frame to /v1/recognize".into(),
            )),
        }
    }
}

/// What a form holds, at most `max_frames` frames of it.
async fn form_fields(app: &App, request: Request, body: Frame, max_frames: usize) -> Result<Fields, Problem> {
    let caller = caller_of(request.extensions());
    let n_bytes = body.bytes.len();
    let fields = fields(request, body, max_frames);
    if n_bytes <= MAX_BYTES_AT_ONCE {
        return Ok(fields.await?);
    }
    // All of it is here already, so that the thread is never idle.
    let runtime = Handle::current();
    Ok(take_apart(app, &caller, n_bytes, move || runtime.block_on(fields)).await??)
}

async fn fields(request: Request, body: Frame, max_frames: usize) -> Result<Fields, BodyError> {
    let malformed = |error: String| BodyError::Malformed(format!("the form cannot be read: {error}"));
    let request = request.map(|_| Body::from(body.bytes.clone()));
    let mut form =
        Multipart::from_request(request, &()).await.map_err(|error| malformed(error.body_text()))?;
    let (mut frames, mut scan) = (Vec::new(), None);
    while frames.len() < max_frames
        && let Some(field) = form.next_field().await.map_err(|error| malformed(error.body_text()))?
    {
        if field.name() == Some(SCAN_FIELD) {
            let bytes = field.bytes().await.map_err(|error| malformed(error.body_text()))?;
            scan = Some(from_json(&bytes)?);
            continue;
        }
        if field.name() != Some(FIELD) {
            let name = field.name().unwrap_or_default();
            return Err(malformed(format!(
                "it has a field {name:?}; the field of a frame is `frame`, that of a laser's scan `scan`"
            )));
        }
        let name = field.file_name().unwrap_or_default().to_owned();
        let bytes = field.bytes().await.map_err(|error| malformed(error.body_text()))?;
        frames.push(NamedFrame { name, frame: body.part(bytes) });
    }
    Ok(Fields { frames, scan })
}

/// The frame of a form that holds one.
fn only_frame(Fields { mut frames, scan }: Fields) -> Result<Frame, Problem> {
    let several = "the form has several frames; send them to /v1/recognize/batch";
    match (frames.pop(), frames.is_empty()) {
        (None, _) => Err(BodyError::Malformed("the form has no field `frame`".into()).into()),
        (Some(NamedFrame { frame, .. }), true) => beside(frame, scan),
        (Some(_), false) => Err(BodyError::Malformed(several.into()).into()),
    }
}

/// A frame with the scan that lies beside it.
fn beside(frame: Frame, scan: Option<LaserScan>) -> Result<Frame, Problem> {
    match scan {
        Some(scan) => frame.with_scan(scan),
        None => Ok(frame),
    }
}

fn json_frame(body: &Frame) -> Result<Frame, Problem> {
    let Object::<FrameJson>(json) = from_json(&body.bytes)?;
    let bytes = base64_text::decode(&json.frame)
        .map_err(|error| BodyError::Malformed(format!("`frame` is not base64: {error}")))?;
    if bytes.is_empty() {
        return Err(BodyError::Empty.into());
    }
    beside(body.part(bytes.into()), json.scan)
}

fn from_json<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T, BodyError> {
    serde_json::from_slice(body)
        .map_err(|error| BodyError::Malformed(format!("the JSON cannot be read: {error}")))
}
