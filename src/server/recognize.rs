//! The one path from bytes to an answer, whatever brought the bytes.

use super::App;
use super::body::Frame;
use super::metrics::{FrameOutcome, Transport};
use super::pool::{Panicked, Slot};
use super::registry::ServedModel;
use crate::image::{Image, ImageError, Limits};
use crate::model::{Evidence, GoldenFrame, Model, Recognition, Scratch};
use std::cell::Cell;
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio::time::timeout_at;
use tracing::{Span, debug_span};

/// How far the probability of a golden frame may be from the one when the model was saved.
const PROBABILITY_TOLERANCE: f32 = 0.01;

/// What to do with a frame. One model recognizes it from start to end.
#[derive(Clone, Debug)]
pub struct Task {
    /// The model that answers.
    pub served: Arc<ServedModel>,
    /// When nobody wants the answer any more.
    pub deadline: Option<Instant>,
    /// Whether the keypoints that spoke for the room are wanted.
    pub explain: bool,
    /// What brought the frame.
    pub transport: Transport,
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

/// Queues one frame in the slot it was admitted with; the future waits for what is seen in it. A
/// deadline that passes while the frame waits is told at once.
pub fn recognize(
    app: &App,
    slot: Slot,
    frame: Frame,
    task: Task,
) -> impl Future<Output = Result<Seen, RecognizeError>> + use<> {
    let limits = app.settings.frame_limits();
    let queued = (Instant::now(), debug_span!("queue"));
    let deadline = task.deadline;
    let (start, started) = oneshot::channel();
    let mut end = End {
        app: app.clone(),
        served: task.served.clone(),
        transport: task.transport,
        outcome: FrameOutcome::CallerLeft,
    };
    let span = Span::current();
    let answer = app.pool.run(slot, move |has_left| {
        let _entered = span.enter();
        let (since, waiting) = queued;
        let queue = since.elapsed();
        drop(waiting);
        if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            return Err(RecognizeError::DeadlinePassed);
        }
        let _ = start.send(());
        let mut seen = look(frame, &limits, task, has_left)?;
        seen.timings.queue = queue;
        Ok(seen)
    });
    async move {
        let is_late = match deadline {
            Some(deadline) => timeout_at(deadline.into(), started).await.is_err(),
            None => false,
        };
        let result = if is_late {
            Err(RecognizeError::DeadlinePassed)
        } else {
            answer.await.unwrap_or_else(|panicked| Err(panicked.into()))
        };
        end.set(FrameOutcome::from(&result));
        result
    }
}

/// Counts what became of a frame. A caller that leaves drops it before another outcome is known.
struct End {
    app: App,
    served: Arc<ServedModel>,
    transport: Transport,
    outcome: FrameOutcome,
}

impl End {
    /// It came to this.
    fn set(&mut self, outcome: FrameOutcome) {
        self.outcome = outcome;
    }
}

impl Drop for End {
    fn drop(&mut self) {
        self.app.metrics.frame(&self.served, self.transport, self.outcome);
    }
}

/// Decodes a frame and sees what is in it, in this thread; `has_left` tells whether nobody waits any more.
pub fn look(
    frame: Frame,
    limits: &Limits,
    task: Task,
    has_left: &dyn Fn() -> bool,
) -> Result<Seen, RecognizeError> {
    let (image, decode) = timed(&debug_span!("decode"), || Image::decode(&frame.bytes, limits));
    let image = image?;
    drop(frame);
    if has_left() {
        return Err(RecognizeError::CallerLeft);
    }
    let mut seen = see(task, &image);
    seen.timings.decode = decode;
    Ok(seen)
}

/// Sends frames through decoding and recognition before a robot does: the golden ones of the model's
/// folder, which must be answered as when it was saved, or else a drawn one.
pub fn warm(model: &Model, golden_frames: &[GoldenFrame]) -> Result<(), String> {
    if golden_frames.is_empty() {
        return answer_of(model, &drawn_frame()).map(|_| ());
    }
    for golden in golden_frames {
        let answer =
            answer_of(model, &golden.bytes).map_err(|reason| format!("{}: {reason}", golden.name))?;
        let place = &model.places()[answer.place_idx];
        let probability = answer.probability();
        if *place != golden.place || (probability - golden.probability).abs() > PROBABILITY_TOLERANCE {
            let GoldenFrame { name, place: expected, probability: expected_probability, .. } = golden;
            return Err(format!(
                "the golden frame {name} is answered with {place} ({probability:.3}), \
                 not with {expected} ({expected_probability:.3})"
            ));
        }
    }
    Ok(())
}

fn answer_of(model: &Model, bytes: &[u8]) -> Result<Recognition, String> {
    let image = Image::decode(bytes, &Limits::default()).map_err(|error| error.to_string())?;
    Ok(model.recognize(&image, &mut Scratch::default()))
}

fn see(task: Task, image: &Image) -> Seen {
    let model = &task.served.model;
    let (features, features_time) = timed(&debug_span!("features"), || {
        with_scratch(&task.served, |scratch| model.features(image, scratch))
    });
    let (recognition, classify) = timed(&debug_span!("classify"), || model.classify(&features));
    let evidence = task.explain.then(|| model.explain(&features, recognition.place_idx));
    let timings = Timings { features: features_time, classify, ..Timings::default() };
    Seen { recognition, evidence, timings, served: task.served }
}

/// Lends this thread's working memory for frames of one model. A job that panics takes the memory
/// along, so that nothing half-written is used again.
fn with_scratch<T>(served: &Arc<ServedModel>, work: impl FnOnce(&mut Scratch) -> T) -> T {
    thread_local!(static SCRATCHES: Cell<Vec<(Weak<ServedModel>, Scratch)>> = const { Cell::new(Vec::new()) });
    let mut scratches = SCRATCHES.take();
    scratches.retain(|(owner, _)| owner.strong_count() > 0);
    let is_ours = |(owner, _): &(Weak<ServedModel>, Scratch)| owner.as_ptr() == Arc::as_ptr(served);
    let scratch_idx = scratches.iter().position(is_ours).unwrap_or_else(|| {
        scratches.push((Arc::downgrade(served), Scratch::default()));
        scratches.len() - 1
    });
    let result = work(&mut scratches[scratch_idx].1);
    SCRATCHES.set(scratches);
    result
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

fn timed<T>(span: &Span, work: impl FnOnce() -> T) -> (T, Duration) {
    let started = Instant::now();
    let result = span.in_scope(work);
    (result, started.elapsed())
}
