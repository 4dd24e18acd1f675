//! Recordings of what robots send and are told, on request: where the operator gave a folder, and within its bounds.
//!
//! | file | what |
//! |---|---|
//! | `writer` | the thread that writes one |

mod writer;

use crate::engine::robots::RobotRecord;
use crate::problem::{Kind, Problem};
use crate::settings::Settings;
use bytes::Bytes;
use roomsight_protocol::recording::{RecordingFile, RecordingInfo, RecordingList};
use roomsight_protocol::rest::Answer;
use roomsight_protocol::stream::Filtered;
use roomsight_vision::image::Limits;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};
use std::{fs, io, thread};
use thiserror::Error;
use writer::{Entry, Progress, What, Writer};

/// How many robots are recorded at one time.
const MAX_AT_ONCE: usize = 8;

/// What may wait for the disk: entries, and bytes of pictures.
const MAX_WAITING: usize = 256;
const MAX_WAITING_BYTES: usize = 32 << 20;

/// What the files end in.
const ENDING: &str = "mcap";

/// The recordings of a service.
pub struct Recordings {
    /// None: nothing is recorded.
    folder: Option<PathBuf>,
    max_bytes: u64,
    limits: Limits,
    /// How many run: the frames of robots that are not recorded cost a look at it.
    n_running: Arc<AtomicUsize>,
    running: Mutex<BTreeMap<String, Running>>,
    /// One begins at a time: recognizing threads wait for no disk.
    beginning: Mutex<()>,
}

/// One that runs, or has just ended.
struct Running {
    info: RecordingInfo,
    sender: SyncSender<Entry>,
    progress: Arc<Progress>,
    thread: JoinHandle<()>,
}

/// Why something cannot be recorded.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The operator gave no folder.
    #[error("this service records nothing: its operator can set `record_folder`")]
    Off,
    /// It is recorded already.
    #[error("the robot {0:?} is recorded already; DELETE ends that")]
    Running(String),
    /// It is not recorded.
    #[error("the robot {0:?} is not recorded")]
    NotRunning(String),
    /// Too many are.
    #[error("{MAX_AT_ONCE} robots are recorded already, the most at one time; end one")]
    TooMany,
    /// No bytes are left.
    #[error("the recordings take {used} bytes, and `record_max_bytes` is {max}: remove some")]
    Full {
        /// What they take.
        used: u64,
        /// What they may.
        max: u64,
    },
    /// No such file.
    #[error("there is no recording {0:?}; GET /v1/recordings lists those that are over")]
    NoFile(String),
    /// What the system says.
    #[error("the folder of recordings cannot be used: {0}")]
    Folder(#[from] io::Error),
    /// What the writer says.
    #[error("a recording cannot be begun: {0}")]
    Begin(String),
}

impl From<RecordingError> for Problem {
    fn from(error: RecordingError) -> Self {
        let kind = match error {
            RecordingError::Off => Kind::NoData,
            RecordingError::Running(_) | RecordingError::TooMany => Kind::Conflict,
            RecordingError::NotRunning(_) | RecordingError::NoFile(_) => Kind::NotFound,
            RecordingError::Full { .. } => Kind::DiskFull,
            RecordingError::Folder(_) | RecordingError::Begin(_) => Kind::Internal,
        };
        Self::new(kind, error)
    }
}

impl Recordings {
    /// As the settings say.
    pub fn new(settings: &Settings) -> Self {
        let folder = Some(&settings.record_folder).filter(|folder| !folder.as_os_str().is_empty());
        Self {
            folder: folder.cloned(),
            max_bytes: settings.record_max_bytes,
            limits: settings.frame_limits(),
            n_running: Arc::default(),
            running: Mutex::default(),
            beginning: Mutex::default(),
        }
    }

    fn running(&self) -> MutexGuard<'_, BTreeMap<String, Running>> {
        let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        // Those whose time or room was up.
        running.retain(|_, one| !one.thread.is_finished());
        running
    }

    fn folder(&self) -> Result<&Path, RecordingError> {
        self.folder.as_deref().ok_or(RecordingError::Off)
    }

    /// Begins to record a robot for so long. It waits for the disk.
    ///
    /// # Errors
    /// Nothing is recorded here; a bound is reached; what the system says.
    pub fn begin(&self, robot: &str, lasting: Duration) -> Result<RecordingInfo, RecordingError> {
        let folder = self.folder()?;
        let _beginning = self.beginning.lock().unwrap_or_else(PoisonError::into_inner);
        {
            let running = self.running();
            if running.contains_key(robot) {
                return Err(RecordingError::Running(robot.to_owned()));
            }
            if running.len() >= MAX_AT_ONCE {
                return Err(RecordingError::TooMany);
            }
        }
        fs::create_dir_all(folder)?;
        let used = total(&files(folder)?);
        if used >= self.max_bytes {
            return Err(RecordingError::Full { used, max: self.max_bytes });
        }
        let now = SystemTime::now();
        let file = file_name(robot, now);
        let time = |at: SystemTime| humantime::format_rfc3339_seconds(at).to_string();
        let info = RecordingInfo {
            file: file.clone(),
            robot: robot.to_owned(),
            began_at: time(now),
            ends_at: time(now + lasting),
            pictures: 0,
            answers: 0,
            lost: 0,
        };
        let progress = Arc::new(Progress::default());
        let writer = Writer::create(folder.join(&file), robot, self.limits, Arc::clone(&progress));
        let writer = writer.map_err(|error| RecordingError::Begin(error.to_string()))?;
        let (sender, entries) = sync_channel(MAX_WAITING);
        let (counted, folder, max_bytes) = (Counted::new(&self.n_running), folder.to_owned(), self.max_bytes);
        let thread = thread::Builder::new().name("recording".to_owned()).spawn(move || {
            let _counted = counted;
            let has_room = || files(&folder).is_ok_and(|files| total(&files) < max_bytes);
            writer.write_all(&entries, lasting, &has_room);
        })?;
        tracing::info!(robot, file, "a robot is recorded");
        let running = Running { info: info.clone(), sender, progress, thread };
        self.running().insert(robot.to_owned(), running);
        Ok(info)
    }

    /// Ends a recording. It waits for the disk.
    ///
    /// # Errors
    /// The robot is not recorded.
    pub fn end(&self, robot: &str) -> Result<RecordingInfo, RecordingError> {
        self.folder()?;
        let ended = self.running().remove(robot);
        ended.map(Running::end).ok_or_else(|| RecordingError::NotRunning(robot.to_owned()))
    }

    /// Ends all, so that their files are whole.
    pub fn end_all(&self) {
        let all = std::mem::take(&mut *self.running());
        all.into_values().for_each(|running| {
            running.end();
        });
    }

    /// All there are. It waits for the disk.
    ///
    /// # Errors
    /// Nothing is recorded here; what the system says.
    pub fn list(&self) -> Result<RecordingList, RecordingError> {
        let folder = self.folder()?;
        let running: Vec<RecordingInfo> = self.running().values().map(Running::told).collect();
        let is_over = |file: &RecordingFile| running.iter().all(|running| running.file != file.file);
        let files = files(folder)?.into_iter().filter(is_over).collect();
        Ok(RecordingList { running, files, max_bytes: self.max_bytes })
    }

    /// Where a recording that is over lies. It waits for the disk.
    ///
    /// # Errors
    /// There is none of this name, or it runs.
    pub fn path(&self, file: &str) -> Result<PathBuf, RecordingError> {
        // What is listed alone: a name cannot lead elsewhere.
        let is_listed = self.list()?.files.iter().any(|listed| listed.file == file);
        if is_listed { Ok(self.folder()?.join(file)) } else { Err(RecordingError::NoFile(file.to_owned())) }
    }

    /// Removes a recording that is over.
    ///
    /// # Errors
    /// There is none of this name, or it runs; what the system says.
    pub fn remove(&self, file: &str) -> Result<(), RecordingError> {
        Ok(fs::remove_file(self.path(file)?)?)
    }

    /// A robot's picture, which is copied only where the robot is recorded.
    pub fn picture(&self, robot: &RobotRecord, bytes: impl FnOnce() -> Bytes) {
        self.add(robot, || What::Picture(bytes()));
    }

    /// What a robot is told of a picture, and, in a stream, of those up to it.
    pub fn answer(&self, robot: &RobotRecord, answer: &Answer, filtered: Option<&Filtered>) {
        self.add(robot, || What::Answer(Box::new((answer.clone(), filtered.cloned()))));
    }

    /// What the disk does not keep up with is lost, and counted.
    fn add(&self, robot: &RobotRecord, what: impl FnOnce() -> What) {
        if self.n_running.load(Ordering::Relaxed) == 0 {
            return;
        }
        let running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(Running { sender, progress, .. }) = running.get(&robot.id()) else { return };
        let what = what();
        let n_bytes = what.n_bytes();
        let has_room = progress.n_waiting_bytes.load(Ordering::Relaxed) + n_bytes <= MAX_WAITING_BYTES;
        progress.n_waiting_bytes.fetch_add(n_bytes, Ordering::Relaxed);
        if !has_room || sender.try_send(Entry { at: SystemTime::now(), what }).is_err() {
            progress.n_waiting_bytes.fetch_sub(n_bytes, Ordering::Relaxed);
            progress.n_lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Running {
    fn told(&self) -> RecordingInfo {
        self.progress.told(&self.info)
    }

    /// Waits until what came is written.
    fn end(self) -> RecordingInfo {
        let Self { info, sender, progress, thread } = self;
        drop(sender);
        // One that panicked has told so, and what it wrote is there.
        let _ = thread.join();
        progress.told(&info)
    }
}

/// Counts one more as long as it lives.
struct Counted(Arc<AtomicUsize>);

impl Counted {
    fn new(count: &Arc<AtomicUsize>) -> Self {
        count.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(count))
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

fn total(files: &[RecordingFile]) -> u64 {
    files.iter().map(|file| file.bytes).sum()
}

/// The recordings in a folder, by name; none where there is no folder yet.
fn files(folder: &Path) -> io::Result<Vec<RecordingFile>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut files = Vec::new();
    for entry in entries {
        let (entry, name) = entry.map(|entry| (entry.metadata(), entry.file_name()))?;
        let Ok(file) = name.into_string() else { continue };
        let is_recording = Path::new(&file).extension().is_some_and(|ending| ending == ENDING);
        // One that was removed meanwhile is none.
        if let Ok(metadata) = entry
            && is_recording
            && metadata.is_file()
        {
            files.push(RecordingFile { file, bytes: metadata.len() });
        }
    }
    files.sort_by(|one, other| one.file.cmp(&other.file));
    Ok(files)
}

/// Of the robot and the time, such as `anna-20260102T030405Z.mcap`; robots choose their names.
fn file_name(robot: &str, at: SystemTime) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let robot: String = robot.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    let time: String =
        humantime::format_rfc3339_millis(at).to_string().chars().filter(|c| !"-:".contains(*c)).collect();
    format!("{robot}-{time}.{ENDING}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_of_a_robot_leads_out_of_the_folder() {
        let at = SystemTime::UNIX_EPOCH + Duration::from_millis(1_767_323_045_678);
        assert_eq!(file_name("anna", at), "anna-20260102T030405.678Z.mcap");
        assert_eq!(file_name("../a b/\0é", at), "___a_b___-20260102T030405.678Z.mcap");
    }
}
