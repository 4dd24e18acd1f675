//! One robot: its frames go out at their times, whatever the answers do.

use super::frames::{Frames, Loaded, Ready};
use super::tally::{Tally, Told};
use crate::cli::service;
use roomsight_client::{Client, ClientError, Stream};
use roomsight_protocol::header::Beside;
use roomsight_protocol::rest::{Answer, ProblemBody, RecognizeQuery};
use roomsight_protocol::stream::{Filtered, Hello, Mode, ServerMessage};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};
use tokio::sync::{Notify, Semaphore, mpsc, watch};
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep_until, timeout};

/// How long a service may tell nothing while answers are still to come, and how long it may read nothing.
const PATIENCE: Duration = Duration::from_secs(10);

/// What all robots share.
pub struct Drive {
    /// What is sent.
    pub frames: Arc<Frames>,
    /// What became of it.
    pub tally: Mutex<Tally>,
    /// When it begins, by both clocks.
    pub start: (Instant, SystemTime),
    /// Whether frames have times; otherwise each leaves when the one before has gone.
    pub is_paced: bool,
    /// After this no frame is sent.
    pub end: Duration,
}

/// What one robot sends.
pub struct Feed {
    /// Its name.
    pub robot: String,
    /// Over REST: the model that answers; none for the service's own.
    pub model: Option<String>,
    /// Whether its rooms are kept over time.
    pub is_followed: bool,
    /// How long after the others it starts.
    pub offset: Duration,
    /// Its frames.
    pub ahead: mpsc::Receiver<Ready>,
    /// Turns true when nothing more shall be sent.
    pub stopped: watch::Receiver<bool>,
}

/// A frame whose time has come.
pub struct Shot {
    frame_idx: usize,
    /// When it was due, counted from the start.
    pub at: Duration,
    /// What is sent.
    pub loaded: Loaded,
}

/// What an answer is held against.
#[derive(Clone, Copy)]
pub struct Sent {
    frame_idx: usize,
    at: Duration,
    is_followed: bool,
}

impl Drive {
    /// What became of the frames so far.
    pub fn tally(&self) -> MutexGuard<'_, Tally> {
        self.tally.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a frame that goes out.
    pub fn send(&self, is_followed: bool, shot: &Shot) -> Sent {
        self.tally().sent(self.start.0.elapsed().saturating_sub(shot.at));
        Sent { frame_idx: shot.frame_idx, at: shot.at, is_followed }
    }

    fn told(&self, sent: Sent, answer: &Answer, filtered: Option<&Filtered>, age_ms: Option<f64>) {
        let latency = self.start.0.elapsed().saturating_sub(sent.at);
        let room = Some(self.frames.get(sent.frame_idx).room.as_str()).filter(|room| !room.is_empty());
        let told = Told { at: sent.at, latency, room, answer, filtered, age_ms };
        let mut tally = self.tally();
        tally.told(&told);
        if sent.is_followed {
            tally.stays.add(&told);
        }
    }

    /// What is sent beside an image: the time at which it was due, and what else was sensed.
    pub fn beside<'a>(&self, shot: &'a Shot) -> Beside<'a> {
        let odometry = self.frames.get(shot.frame_idx).odometry;
        Beside {
            captured_at_ns: self.captured_at_ns(shot.at),
            odometry: odometry.map(service::sent_odometry),
            scan: shot.loaded.scan.as_deref(),
        }
    }

    /// The time at which a frame was due, in nanoseconds since 1970.
    fn captured_at_ns(&self, at: Duration) -> Option<u64> {
        let since_1970 = self.start.1.duration_since(SystemTime::UNIX_EPOCH).ok()? + at;
        since_1970.as_nanos().try_into().ok()
    }
}

impl Feed {
    /// Waits for the next frame's time; none at the end.
    pub async fn next(&mut self, drive: &Drive) -> Option<Shot> {
        loop {
            let ready = tokio::select! {
                ready = self.ahead.recv() => ready?,
                _ = self.stopped.wait_for(|&stopped| stopped) => return None,
            };
            let at = if drive.is_paced { self.offset + ready.at } else { drive.start.0.elapsed() };
            if at > drive.end {
                return None;
            }
            if drive.is_paced {
                tokio::select! {
                    () = sleep_until(drive.start.0 + at) => {}
                    _ = self.stopped.wait_for(|&stopped| stopped) => return None,
                }
            }
            match ready.loaded {
                Ok(loaded) => return Some(Shot { frame_idx: ready.frame_idx, at, loaded }),
                Err(_) => drive.tally().err("unreadable file".to_owned()),
            }
        }
    }
}

/// Sends over a stream, and waits for the last answers as long as any come.
///
/// Without times of their own, frames of a lossless stream leave as the service's window opens. Else they
/// would wait in the buffers of the connection, and their latency would tell how long these are.
pub async fn stream(drive: Arc<Drive>, mut feed: Feed, stream: Stream) {
    let Hello { next_seq: mut seq, settings, limits, .. } = stream.hello().clone();
    let has_window = !drive.is_paced && settings.mode == Mode::Lossless;
    let most_pending = if has_window { limits.window.saturating_sub(1) } else { usize::MAX };
    let (mut sender, mut receiver) = stream.split();
    let pending = Pending::default();
    let sending = async {
        while pending.at_most(most_pending).await
            && let Some(shot) = feed.next(&drive).await
        {
            pending.add(seq, drive.send(feed.is_followed, &shot));
            let sending = sender.send_with(seq, drive.beside(&shot), &shot.loaded.image);
            match timeout(PATIENCE, sending).await {
                Ok(Ok(())) => seq += 1,
                // The receiving half learns why.
                Ok(Err(_)) => break,
                Err(_) => {
                    drive.tally().err("the service reads no more".to_owned());
                    break;
                }
            }
        }
        pending.at_most(0).await;
    };
    let receiving = async {
        loop {
            match receiver.receive().await {
                Ok(message) => pending.take(&drive, message),
                Err(error) => return error,
            }
        }
    };
    tokio::select! {
        () = sending => {}
        error = receiving => drive.tally().err(kind(&error)),
    }
    // It may be closed already.
    let _ = sender.close().await;
}

/// Sends over REST on connections that all robots share: a frame that finds all of them busy leaves late.
pub async fn post(drive: Arc<Drive>, mut feed: Feed, client: Client, connections: Arc<Semaphore>) {
    let mut calls = JoinSet::new();
    while let Some(shot) = feed.next(&drive).await {
        let Ok(connection) = connections.clone().acquire_owned().await else { break };
        let sent = drive.send(feed.is_followed, &shot);
        let (robot, model) = (Some(feed.robot.clone()), feed.model.clone());
        let query = RecognizeQuery { robot, model, ..RecognizeQuery::default() };
        let (drive, client) = (drive.clone(), client.clone());
        calls.spawn(async move {
            let Loaded { image, scan } = shot.loaded;
            let answer = match scan {
                Some(scan) => client.recognize_with_scan(image.to_vec(), &scan, &query).await,
                None => client.recognize(image.to_vec(), &query).await,
            };
            match answer {
                Ok(answer) => drive.told(sent, &answer, None, None),
                Err(error) => drive.tally().fail(kind(&error)),
            }
            drop(connection);
        });
        while calls.try_join_next().is_some() {}
    }
    calls.join_all().await;
}

/// The frames of a stream that wait for their answers.
#[derive(Default)]
pub struct Pending {
    frames: Mutex<BTreeMap<u64, Sent>>,
    taken: Notify,
}

impl Pending {
    fn frames(&self) -> MutexGuard<'_, BTreeMap<u64, Sent>> {
        self.frames.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A frame was sent.
    pub fn add(&self, seq: u64, sent: Sent) {
        self.frames().insert(seq, sent);
    }

    /// Takes an answer, and sees that it is one: to a frame that was sent, in order, and the only one.
    pub fn take(&self, drive: &Drive, message: ServerMessage) {
        let seq = match &message {
            ServerMessage::Result(result) => result.seq,
            ServerMessage::Dropped { seq, .. } | ServerMessage::Error { seq: Some(seq), .. } => *seq,
            ServerMessage::Error { seq: None, problem } => return drive.tally().err(problem_name(problem)),
            _ => return,
        };
        let mut frames = self.frames();
        if frames.keys().next().is_some_and(|&first| first < seq) {
            drive.tally().err("answered out of order".to_owned());
        }
        let sent = frames.remove(&seq);
        drop(frames);
        match (sent, message) {
            (None, _) => drive.tally().err("answered, but not sent".to_owned()),
            (Some(sent), ServerMessage::Result(result)) => {
                drive.told(sent, &result.answer, result.filtered.as_ref(), result.age_ms);
            }
            (_, ServerMessage::Dropped { reason, .. }) => drive.tally().lose(reason),
            (_, ServerMessage::Error { problem, .. }) => drive.tally().fail(problem_name(&problem)),
            _ => {}
        }
        self.taken.notify_one();
    }

    /// How many are left.
    pub fn len(&self) -> usize {
        self.frames().len()
    }

    /// Waits until at most so many are left; false where answers cease to come before.
    async fn at_most(&self, n_frames: usize) -> bool {
        while self.len() > n_frames {
            if timeout(PATIENCE, self.taken.notified()).await.is_err() {
                return false;
            }
        }
        true
    }
}

/// An error in a few words that are the same for all of its kind.
pub fn kind(error: &ClientError) -> String {
    match error {
        ClientError::Refused { problem, .. } => problem_name(problem),
        ClientError::Closed { code, .. } => format!("closed with {code}"),
        ClientError::Foreign(status) => format!("status {}", status.as_u16()),
        ClientError::Call(error) if error.is_timeout() => "no answer in time".to_owned(),
        ClientError::Call(error) if error.is_connect() => "no connection".to_owned(),
        ClientError::Call(_) | ClientError::Broken(_) => "connection broke".to_owned(),
        ClientError::Message(_) => "unreadable message".to_owned(),
        ClientError::Url { .. }
        | ClientError::Key
        | ClientError::Late
        | ClientError::Silent
        | ClientError::Authorities(_) => error.to_string(),
    }
}

fn problem_name(problem: &ProblemBody) -> String {
    problem.r#type.rsplit('/').next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::super::schedule::{Rate, Track};
    use super::super::tally::Percentiles;
    use super::*;
    use roomsight_client::fake::{self, Connection};
    use roomsight_lab::dataset::Frame;
    use roomsight_protocol::stream::{Configure, DropReason};
    use roomsight_vision::camera::CameraKind;
    use tempfile::TempDir;
    use tokio::time::sleep;

    const N_FRAMES: usize = 100;

    /// Plays frames of 5 ms against a service that `answer`s, and returns what became of them.
    async fn play<A, F>(answer: A) -> Tally
    where
        A: Fn(Connection) -> F + Send + 'static,
        F: Future<Output = ()> + Send + 'static,
    {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("frame.jpg");
        std::fs::write(&path, "no image, but nobody looks").unwrap();
        let frame = Frame {
            path,
            room: "lab".to_owned(),
            sequence: String::new(),
            camera: CameraKind::Perspective,
            split: String::new(),
            time: None,
            pose: None,
            odometry: None,
            scan: None,
            recorded: None,
        };
        let track = Track::new(std::slice::from_ref(&frame), Rate::PerSecond(200.0)).unwrap();
        let frames = Arc::new(Frames::load(vec![frame]));
        let client = Client::new(&fake::serve(answer).await, Some("rs_k")).unwrap();
        let open = client.stream(&Configure::default()).await.unwrap();
        let drive = Arc::new(Drive {
            frames: frames.clone(),
            tally: Mutex::new(Tally::new().unwrap()),
            start: (Instant::now(), SystemTime::now()),
            is_paced: true,
            end: Duration::MAX,
        });
        let (_stop, stopped) = watch::channel(false);
        let ahead = frames.ahead(track.schedule(0, N_FRAMES, Duration::MAX));
        let feed = Feed {
            robot: "wall-e".to_owned(),
            model: None,
            is_followed: true,
            offset: Duration::ZERO,
            ahead,
            stopped,
        };
        stream(drive.clone(), feed, open).await;
        Arc::into_inner(drive).unwrap().tally.into_inner().unwrap()
    }

    async fn answer_all(mut connection: Connection, stall: Duration) {
        while let Some((header, _)) = connection.frame().await {
            let seq = header.unwrap().seq;
            if seq == 20 {
                sleep(stall).await;
            }
            connection.say(&fake::result(seq, "lab")).await;
        }
    }

    /// The service stands still for 300 ms at one frame of 100. Who waits for each answer before the next frame
    /// sees one slow frame; the 60 frames that were due meanwhile must all show it.
    #[tokio::test]
    async fn a_service_that_stalls_shows_in_every_frame_that_was_due_meanwhile() {
        let tally = play(|connection| answer_all(connection, Duration::from_millis(300))).await;
        assert_eq!((tally.n_sent, tally.n_results, tally.n_unaccounted()), (100, 100, 0));
        let latency = Percentiles::of(&tally.latency).unwrap();
        assert!(latency.p99 >= 280.0, "{latency:?}");
        let above_100_ms = tally.latency.count_between(100_000, u64::MAX);
        assert!(above_100_ms >= 30, "{above_100_ms}");
    }

    #[tokio::test]
    async fn drops_errors_and_silence_are_told_apart() {
        let tally = play(|mut connection: Connection| async move {
            while let Some((header, _)) = connection.frame().await {
                let seq = header.unwrap().seq;
                match seq % 4 {
                    0 => connection.say(&fake::result(seq, "hall")).await,
                    1 => {
                        let reason = DropReason::Superseded;
                        connection.say(&ServerMessage::Dropped { seq, reason }).await;
                    }
                    2 => {
                        let problem = fake::problem("no image");
                        connection.say(&ServerMessage::Error { seq: Some(seq), problem }).await;
                    }
                    _ if seq == 99 => return connection.close(1001, "draining").await,
                    _ => {}
                }
            }
        });
        let tally = tally.await;
        assert_eq!((tally.n_results, tally.n_dropped(), tally.n_failed), (25, 25, 25));
        assert_eq!((tally.n_sent, tally.n_unaccounted()), (100, 25));
        assert_eq!(tally.errors["test"], 25);
        assert_eq!(tally.errors["closed with 1001"], 1);
        // Later frames were answered while these were not.
        assert!(tally.errors["answered out of order"] >= 24, "{:?}", tally.errors);
        assert_eq!(tally.raw.rate().unwrap().rate, Some(0.0));
    }
}
