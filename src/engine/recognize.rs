//! The one path from bytes to an answer, whatever brought the bytes.

use crate::engine::Engine;
use crate::engine::doubts::{Doubtable, DoubtedAnswer, N_ROOMS, OtherRooms, Sender};
use crate::engine::frame::Frame;
use crate::engine::metrics::{FrameOutcome, Transport};
use crate::engine::pool::{Panicked, QueueFull, Slot, Undone};
use crate::engine::registry::{ServedModel, ShadowPermit, distance};
use crate::engine::robots::RobotRecord;
use crate::engine::timings::Timings;
use crate::engine::told::{by_probability, unknown};
use crate::problem::{Kind, Problem};
use roomsight_protocol::training::PublishedVersion;
use roomsight_recognition::model::{
    self, Evidence, Looking, N_NEAREST, NearFrame, PoseEstimate, Recognition, ScanFieldError, Scratch,
};
use roomsight_vision::image::{Image, ImageError};
use std::cell::Cell;
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio::time::timeout_at;
use tracing::{Span, debug_span};

/// What to do with a frame. One model recognizes it from start to end.
#[derive(Clone)]
pub struct Task {
    /// The model that answers.
    pub served: Arc<ServedModel>,
    /// When nobody wants the answer any more.
    pub deadline: Option<Instant>,
    /// Whether it is wanted why the room was answered.
    pub explain: bool,
    /// What brought the frame.
    pub transport: Transport,
    /// Whose last frame it is, where it is to be kept.
    pub shown_for: Option<Shown>,
    /// Who sends it, where it may be one to doubt.
    pub sender: Option<Sender>,
}

/// A frame of a robot, for those who look at what it sees.
#[derive(Clone)]
pub struct Shown {
    pub robot: Arc<RobotRecord>,
    /// See [`Robots::frame_number`](crate::engine::robots::Robots::frame_number); none where it is not kept as the last one.
    pub number: Option<u64>,
}

/// What was seen in a frame.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The model that answered.
    pub served: Arc<ServedModel>,
    pub recognition: Recognition,
    /// Where asked for: why.
    pub why: Option<Reasons>,
    /// Rows of the frame that are missing at least in part.
    pub damaged_rows: usize,
    /// Where the time went.
    pub timings: Timings,
    /// The frame, where it is to be kept if its answer is one to doubt.
    pub doubtable: Option<Doubtable>,
}

impl Seen {
    /// The most probable room.
    pub fn room(&self) -> &str {
        &self.served.model.rooms()[self.recognition.room_idx]
    }

    /// What of it is kept with a frame that is doubted.
    pub fn doubted_answer(&self) -> DoubtedAnswer {
        let recognition = &self.recognition;
        let ServedModel { name, version, model, .. } = &*self.served;
        DoubtedAnswer {
            room: self.room().to_owned(),
            known: recognition.known,
            unknown: recognition.unknown.map(unknown),
            probability: recognition.probabilities[recognition.room_idx],
            probabilities: by_probability(model.rooms(), &recognition.probabilities, Some(N_ROOMS)),
            novelty: recognition.novelty,
            model: PublishedVersion { name: name.clone(), version: *version },
        }
    }
}

/// Why a frame was answered so.
#[derive(Clone, Debug)]
pub struct Reasons {
    /// What spoke for and against the room, strongest first.
    pub evidence: Vec<Evidence>,
    /// The training frames that are most like it.
    pub nearest: Vec<NearFrame>,
    /// Where it was taken, of models that have learned poses.
    pub pose: Option<PoseEstimate>,
}

/// Why a frame got no answer.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum RecognizeError {
    /// The bytes are no image, or one beyond the limits.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The scan beside the image is not of the laser that the model was trained with.
    #[error(transparent)]
    Scan(#[from] ScanFieldError),
    /// Looked at too late.
    #[error("the frame's deadline passed before it was looked at; allow more time or send fewer frames")]
    DeadlinePassed,
    /// Nobody waits for the answer.
    #[error("the caller left")]
    CallerLeft,
    /// It gave its place in the queue to a caller with fewer frames in it.
    #[error(transparent)]
    PushedOut(#[from] QueueFull),
    /// A defect of ours.
    #[error(transparent)]
    Panicked(#[from] Panicked),
}

impl RecognizeError {
    /// What kind of problem it is.
    fn kind(&self) -> Kind {
        match self {
            Self::Image(ImageError::TooLarge(_)) => Kind::TooLarge,
            Self::Image(_) => Kind::NotAnImage,
            Self::Scan(_) => Kind::BadRequest,
            Self::DeadlinePassed => Kind::DeadlinePassed,
            Self::PushedOut(_) => Kind::QueueFull,
            Self::CallerLeft | Self::Panicked(_) => Kind::Internal,
        }
    }
}

impl From<RecognizeError> for Problem {
    fn from(error: RecognizeError) -> Self {
        match error {
            RecognizeError::PushedOut(full) => full.into(),
            error => Self::new(error.kind(), error),
        }
    }
}

impl From<&Result<Seen, RecognizeError>> for FrameOutcome {
    fn from(result: &Result<Seen, RecognizeError>) -> Self {
        match result {
            Ok(seen) => Self::Answered(seen.timings),
            Err(RecognizeError::CallerLeft) => Self::CallerLeft,
            Err(error) => Self::Failed(error.kind().name()),
        }
    }
}

impl From<Undone> for RecognizeError {
    fn from(undone: Undone) -> Self {
        match undone {
            Undone::PushedOut(full) => full.into(),
            Undone::Panicked(panicked) => panicked.into(),
        }
    }
}

/// Queues one frame in the slot it was admitted with; the future waits for what is seen in it. A
/// deadline that passes while the frame waits is told at once.
pub fn recognize(
    engine: &Engine,
    slot: Slot,
    frame: Frame,
    task: Task,
) -> impl Future<Output = Result<Seen, RecognizeError>> + use<> {
    let looking = engine.clone();
    let queued = (Instant::now(), debug_span!("queue"));
    let deadline = task.deadline;
    let (start, started) = oneshot::channel();
    let mut end = End {
        engine: engine.clone(),
        served: task.served.clone(),
        transport: task.transport,
        outcome: FrameOutcome::CallerLeft,
    };
    let span = Span::current();
    let answer = engine.pool.run(slot, move |has_left| {
        let _entered = span.enter();
        let (since, waiting) = queued;
        let queue = since.elapsed();
        drop(waiting);
        if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            return Err(RecognizeError::DeadlinePassed);
        }
        let _ = start.send(());
        let mut seen = look(&looking, frame, task, has_left)?;
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
            answer.await.unwrap_or_else(|undone| Err(undone.into()))
        };
        if let Ok(seen) = &result {
            end.engine.metrics.answer(&seen.served.name, seen.room(), &seen.recognition);
        }
        end.set(FrameOutcome::from(&result));
        result
    }
}

/// Counts what became of a frame. A caller that leaves drops it before another outcome is known.
struct End {
    engine: Engine,
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
        let ServedModel { name, version, .. } = &*self.served;
        self.engine.metrics.frame(name, *version, self.transport, self.outcome);
    }
}

/// Decodes a frame and sees what is in it, in this thread; `has_left` tells whether nobody waits any more.
pub fn look(
    engine: &Engine,
    mut frame: Frame,
    task: Task,
    has_left: &dyn Fn() -> bool,
) -> Result<Seen, RecognizeError> {
    let limits = engine.settings.frame_limits().enough_for(task.served.model.config().longest_side);
    // The shadow sees the same image.
    let with_colors = engine.registry.wants_colors(&task.served);
    let decode = if with_colors { Image::decode_with_colors } else { Image::decode };
    let (image, decode_time) = timed(&debug_span!("decode"), || decode(&frame.bytes, &limits));
    let image = image?;
    let scan = frame.scan.take();
    if let Some(scan) = &scan {
        task.served.model.extractor().check_scan(scan)?;
    }
    if let Some(Shown { robot, number }) = &task.shown_for {
        if let Some(number) = number {
            engine.robots.keep(robot, *number, || frame.lasting());
        }
        engine.recordings.picture(robot, || frame.lasting());
    }
    let doubtable = task.sender.filter(|sender| engine.doubts.wants(sender));
    let doubtable = doubtable.map(|sender| Doubtable { sender, bytes: frame.lasting() });
    drop(frame);
    if has_left() {
        return Err(RecognizeError::CallerLeft);
    }
    let mut seen = see(task.served, task.explain, model::Frame { image: &image, scan: scan.as_ref() });
    seen.timings.decode = decode_time;
    seen.doubtable = doubtable;
    if let Some(permit) = engine.registry.permit_in_shadow(&seen.served) {
        let (seen, looking) = (seen.clone(), engine.clone());
        engine.pool.queue_shadow(move || {
            compare(&looking, permit, model::Frame { image: &image, scan: scan.as_ref() }, &seen);
        });
    }
    Ok(seen)
}

/// Lets a shadow see a frame that was recognized, and notes whether it agrees.
fn compare(engine: &Engine, permit: ShadowPermit, frame: model::Frame, seen: &Seen) {
    let shadow = permit.shadow().served.clone();
    let other = see(shadow.clone(), false, frame);
    let (rooms, other_rooms) = (seen.served.model.rooms(), shadow.model.rooms());
    let agrees = seen.room() == other.room();
    permit.compared(agrees, distance((rooms, &seen.recognition), (other_rooms, &other.recognition)));
    if !agrees && let Some(doubtable) = &seen.doubtable {
        let others = OtherRooms { shadow: Some(other.room().to_owned()), ..OtherRooms::default() };
        engine.doubts.consider(doubtable, seen.doubted_answer(), others);
    }
}

fn see(served: Arc<ServedModel>, explain: bool, frame: model::Frame) -> Seen {
    let model = &served.model;
    let mut looking = Looking::default();
    let (mut features, mut classify) = (Duration::ZERO, Duration::ZERO);
    let recognition = loop {
        let look = || with_scratch(&served, |scratch| model.look(&mut looking, frame, scratch));
        features += timed(&debug_span!("features"), look).1;
        let (answer, time) = timed(&debug_span!("classify"), || model.answer(&mut looking));
        classify += time;
        if let Some(recognition) = answer {
            break recognition;
        }
    };
    let why = explain.then(|| {
        let features = with_scratch(&served, |scratch| model.look_at_all(looking, frame, scratch));
        Reasons {
            evidence: model.explain(&features, recognition.room_idx),
            nearest: model.nearest(&features, N_NEAREST),
            pose: model.pose(&features),
        }
    });
    let timings = Timings { features, classify, ..Timings::default() };
    let damaged_rows = frame.image.damaged_rows();
    Seen { recognition, why, damaged_rows, timings, served, doubtable: None }
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

fn timed<T>(span: &Span, work: impl FnOnce() -> T) -> (T, Duration) {
    let started = Instant::now();
    let result = span.in_scope(work);
    (result, started.elapsed())
}
