//! Writes one recording, as Foxglove and `roomsight train` read it: the pictures, and what was said of each.

use crate::engine::aside::stand_aside;
use crate::engine::shown::{Shown, shown};
use bytes::Bytes;
use roomsight_protocol::recording::RecordingInfo;
use roomsight_protocol::rest::Answer;
use roomsight_protocol::stream::Filtered;
use roomsight_recording::write::{Channel, JsonRecording, RecordingResult, schema};
use roomsight_vision::image::Limits;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant, SystemTime};

/// How often it is looked whether there is room.
const N_BETWEEN_LOOKS: u64 = 16;

/// Something that is recorded.
pub(super) struct Entry {
    pub(super) at: SystemTime,
    pub(super) what: What,
}

/// What is recorded.
pub(super) enum What {
    Picture(Bytes),
    Answer(Box<(Answer, Option<Filtered>)>),
}

/// How far a recording is.
#[derive(Default)]
pub(super) struct Progress {
    pub(super) n_pictures: AtomicU64,
    pub(super) n_answers: AtomicU64,
    pub(super) n_lost: AtomicU64,
    /// Of pictures that wait to be written.
    pub(super) n_waiting_bytes: AtomicUsize,
}

/// Writes a recording.
pub(super) struct Writer {
    file: JsonRecording,
    pictures: Channel,
    answers: Channel,
    path: PathBuf,
    limits: Limits,
    progress: Arc<Progress>,
}

impl Progress {
    /// A recording that is so far.
    pub(super) fn told(&self, info: &RecordingInfo) -> RecordingInfo {
        RecordingInfo {
            pictures: self.n_pictures.load(Ordering::Relaxed),
            answers: self.n_answers.load(Ordering::Relaxed),
            lost: self.n_lost.load(Ordering::Relaxed),
            ..info.clone()
        }
    }
}

impl What {
    /// What it holds in memory, as far as it is much.
    pub(super) fn n_bytes(&self) -> usize {
        match self {
            Self::Picture(bytes) => bytes.len(),
            Self::Answer(_) => 0,
        }
    }
}

impl Writer {
    /// A new file of a robot.
    ///
    /// # Errors
    /// What the system says.
    pub(super) fn create(
        path: PathBuf,
        robot: &str,
        limits: Limits,
        progress: Arc<Progress>,
    ) -> RecordingResult<Self> {
        let mut file = JsonRecording::create(&path)?;
        let (picture, answer) = (schema::compressed_image(), schema::answer(json!({})));
        let topic = format!("/{}/image", robot.trim_matches('/'));
        let pictures = file.channel(&topic, "foxglove.CompressedImage", &picture)?;
        let answers = file.channel("/roomsight/answer", "roomsight.Answer", &answer)?;
        Ok(Self { file, pictures, answers, path, limits, progress })
    }

    /// Writes until the time is up, nothing more comes, or there is no room; then ends the file.
    pub(super) fn write_all(
        mut self,
        entries: &Receiver<Entry>,
        lasting: Duration,
        has_room: &dyn Fn() -> bool,
    ) {
        stand_aside();
        let ends = Instant::now() + lasting;
        for n_written in 0.. {
            if n_written % N_BETWEEN_LOOKS == 0 && !has_room() {
                tracing::warn!(file = %self.path.display(), "a recording ends: `record_max_bytes` is reached");
                break;
            }
            match entries.recv_timeout(ends.saturating_duration_since(Instant::now())) {
                Ok(entry) => {
                    if let Err(error) = self.write(entry) {
                        tracing::warn!(file = %self.path.display(), %error, "a recording ends");
                        break;
                    }
                }
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            }
        }
        if let Err(error) = self.file.finish() {
            tracing::warn!(file = %self.path.display(), %error, "a recording could not be ended; it can be read as far as it goes");
        }
    }

    fn write(&mut self, Entry { at, what }: Entry) -> RecordingResult<()> {
        let since = at.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let time_ns = u64::try_from(since.as_nanos()).unwrap_or(u64::MAX);
        let timestamp = schema::time_of(time_ns);
        self.progress.n_waiting_bytes.fetch_sub(what.n_bytes(), Ordering::Relaxed);
        match what {
            What::Picture(bytes) => {
                // It was decoded before.
                let Ok(Shown { format, base64 }) = shown(&bytes, &self.limits) else { return Ok(()) };
                let picture =
                    json!({"timestamp": timestamp, "frame_id": "", "format": format, "data": base64});
                self.file.write(self.pictures, time_ns, &picture)?;
                self.progress.n_pictures.fetch_add(1, Ordering::Relaxed);
            }
            What::Answer(told) => {
                let (answer, filtered) = *told;
                let mut message = json!({
                    "timestamp": timestamp, "frame_id": "", "room": answer.room, "probability": answer.probability,
                    "known": answer.known, "unknown": answer.unknown.map_or("", |why| why.name()),
                    "novelty": answer.novelty, "keypoints": answer.keypoints,
                });
                if let (Some(filtered), Some(fields)) = (filtered, message.as_object_mut()) {
                    fields.insert("filtered_room".to_owned(), filtered.room.into());
                    fields.insert("filtered_probability".to_owned(), filtered.probability.into());
                    fields.insert("filtered_known".to_owned(), filtered.known.into());
                }
                self.file.write(self.answers, time_ns, &message)?;
                self.progress.n_answers.fetch_add(1, Ordering::Relaxed);
            }
        }
        Ok(())
    }
}
