//! The one path from bytes to an answer, whatever brought the bytes.

use super::App;
use super::body::Frame;
use super::pool::{Panicked, Slot};
use super::registry::ServedModel;
use crate::image::{Image, ImageError, Limits};
use crate::model::{Evidence, Model, Recognition, Scratch};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What to do with a frame. One model recognizes it from start to end.
#[derive(Clone, Debug)]
pub struct Task {
    /// The model that answers.
    pub served: Arc<ServedModel>,
    /// When nobody wants the answer any more.
    pub deadline: Option<Instant>,
    /// Whether the keypoints that spoke for the room are wanted.
    pub explain: bool,
}

/// What was seen in a frame.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The model that answered.
    pub served: Arc<ServedModel>,
    /// Its answer.
    pub recognition: Recognition,
    /// Where asked for: what spoke for and against the room, strongest first.
    pub evidence: Option<Vec<Evidence>>,
    /// Where the time went.
    pub timings: Timings,
}

/// Where the time of one frame went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// Waiting for a thread.
    pub queue: Duration,
    /// Bytes to pixels.
    pub decode: Duration,
    /// Pixels to described keypoints.
    pub features: Duration,
    /// Keypoints to probabilities.
    pub classify: Duration,
}

/// Why a frame got no answer.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum RecognizeError {
    /// The bytes are no image, or one beyond the limits.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// Looked at too late.
    #[error("the frame's deadline passed before it was looked at; allow more time or send fewer frames")]
    DeadlinePassed,
    /// Nobody waits for the answer.
    #[error("the caller left")]
    CallerLeft,
    /// A defect of ours.
    #[error(transparent)]
    Panicked(#[from] Panicked),
}

/// Queues one frame in the slot it was admitted with; the future waits for what is seen in it.
pub fn recognize(
    app: &App,
    slot: Slot,
    frame: Frame,
    task: Task,
) -> impl Future<Output = Result<Seen, RecognizeError>> + use<> {
    let limits = app.settings.frame_limits();
    let queued = Instant::now();
    let span = tracing::Span::current();
    let answer = app.pool.run(slot, move |scratch, has_left| {
        let _entered = span.enter();
        let queue = queued.elapsed();
        if task.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            return Err(RecognizeError::DeadlinePassed);
        }
        let (image, decode) = timed(|| Image::decode(&frame.bytes, &limits));
        let image = image?;
        drop(frame);
        if has_left() {
            return Err(RecognizeError::CallerLeft);
        }
        let mut seen = see(task, &image, scratch);
        seen.timings.queue = queue;
        seen.timings.decode = decode;
        Ok(seen)
    });
    async { answer.await? }
}

/// Sends a drawn frame through decoding and recognition, so that a model that cannot answer is
/// known before a robot finds out.
pub fn warm(model: &Model) -> Result<(), String> {
    let image = Image::decode(&drawn_frame(), &Limits::default()).map_err(|error| error.to_string())?;
    let recognition = model.recognize(&image, &mut Scratch::default());
    let sum: f32 = recognition.probabilities.iter().sum();
    if recognition.probabilities.len() != model.places().len() || (sum - 1.0).abs() > 0.01 {
        return Err(format!("the probabilities of a first frame sum to {sum}"));
    }
    Ok(())
}

fn see(task: Task, image: &Image, scratch: &mut Scratch) -> Seen {
    let model = &task.served.model;
    let (features, features_time) = timed(|| model.features(image, scratch));
    let (recognition, classify) = timed(|| model.classify(&features));
    let evidence = task.explain.then(|| model.explain(&features, recognition.place_idx));
    let timings = Timings { features: features_time, classify, ..Timings::default() };
    Seen { recognition, evidence, timings, served: task.served }
}

/// A PGM of 320 x 240 pixels with blocks of many greys, so that corners are found in it.
fn drawn_frame() -> Vec<u8> {
    let (width, height) = (320_u32, 240_u32);
    let mut bytes = format!("P5\n{width} {height}\n255\n").into_bytes();
    bytes.extend((0..width * height).map(|pixel| {
        let (column, row) = (pixel % width / 20, pixel / width / 20);
        (column * 89 + row * 151 + column * row * 37) as u8
    }));
    bytes
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let started = Instant::now();
    let result = work();
    (result, started.elapsed())
}
