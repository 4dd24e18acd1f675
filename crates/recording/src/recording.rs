//! A recording: a file, or a folder of the files that rosbag2 wrote one after the other.

use crate::error::RecordingError;
use crate::file::{Contents, Entry, Place, RecordedFile, Span};
use crate::topic::Topic;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The list in a folder of rosbag2 that says it is one.
const METADATA_FILE: &str = "metadata.yaml";

/// How names of recordings end, in lower case.
const ENDINGS: [&str; 5] = [".mcap", ".db3", ".bag", ".mcap.zstd", ".db3.zstd"];

/// What was recorded on one way of a robot.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    files: Vec<RecordedFile>,
    /// Of each file, which topic of the recording each of its own is.
    topics_of_file: Vec<Vec<usize>>,
    topics: Vec<Topic>,
    span: Option<Span>,
    problems: Vec<String>,
}

/// A message of a recording, and where it lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message {
    /// Which of [`Recording::topics`].
    pub topic_idx: usize,
    /// When it was recorded, in nanoseconds by the clock of the recorder.
    pub time_ns: u64,
    file_idx: usize,
    place: Place,
}

/// Whether something is called a recording: a file by how its name ends, a folder by what rosbag2 puts in it.
pub fn is_called_so(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if path.is_dir() {
        path.join(METADATA_FILE).is_file() && !files_in(path).unwrap_or_default().is_empty()
    } else {
        ENDINGS.iter().any(|ending| name.ends_with(ending))
    }
}

/// The recorded files in a folder, in the order of their numbers.
fn files_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder)?.collect::<io::Result<Vec<_>>>()?;
    let mut files: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).collect();
    files.retain(|path| path.is_file() && is_called_so(path));
    // rosbag2 counts them: run_9 before run_10.
    files.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    Ok(files)
}

impl Recording {
    /// Opens a recording: a file, or a folder of rosbag2. No message is kept.
    ///
    /// # Errors
    /// What is no recording, or cannot be read at all. What can be read in part is, and tells its [`Recording::problems`].
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let paths = if path.is_dir() {
            files_in(path).map_err(RecordingError::io(path))?
        } else {
            vec![path.to_owned()]
        };
        let mut recording = Self {
            path: path.to_owned(),
            files: Vec::new(),
            topics_of_file: Vec::new(),
            topics: Vec::new(),
            span: None,
            problems: Vec::new(),
        };
        for path in &paths {
            let (file, contents) = RecordedFile::open(path)?;
            recording.add(path, file, contents);
        }
        if recording.files.is_empty() { Err(RecordingError::Empty(path.to_owned())) } else { Ok(recording) }
    }

    fn add(&mut self, path: &Path, file: RecordedFile, contents: Contents) {
        let Contents { topics, span, problems } = contents;
        let number = |topic: Topic| {
            let is_same = |other: &&mut Topic| {
                (&other.name, &other.type_name, other.encoding)
                    == (&topic.name, &topic.type_name, topic.encoding)
            };
            let known = self.topics.iter_mut().enumerate().find(|(_, other)| is_same(other));
            if let Some((idx, other)) = known {
                other.n_messages = other.n_messages.zip(topic.n_messages).map(|(one, more)| one + more);
                return idx;
            }
            self.topics.push(topic);
            self.topics.len() - 1
        };
        self.topics_of_file.push(topics.into_iter().map(number).collect());
        self.files.push(file);
        if let Some(span) = span {
            self.span = Some(Span::with(self.span, span));
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let named = |problem: String| if path == self.path { problem } else { format!("{name}: {problem}") };
        self.problems.extend(problems.into_iter().map(named));
    }

    /// What was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What was recorded, in the order of the files.
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// When the first and the last message were recorded, in nanoseconds by the clock of the recorder; none without any.
    pub fn span_ns(&self) -> Option<[u64; 2]> {
        self.span.map(|Span { first_ns, last_ns }| [first_ns, last_ns])
    }

    /// What could not be read, and why.
    pub fn problems(&self) -> &[String] {
        &self.problems
    }

    /// The messages of some topics, in the order of their times; and what of them cannot be found.
    ///
    /// # Errors
    /// What the system says, or a file that changed.
    pub fn messages(&self, topic_idxs: &[usize]) -> Result<(Vec<Message>, Vec<String>), RecordingError> {
        let (mut messages, mut problems) = (Vec::new(), Vec::new());
        for (file_idx, (file, topics)) in self.files.iter().zip(&self.topics_of_file).enumerate() {
            let wanted: Vec<bool> = topics.iter().map(|topic_idx| topic_idxs.contains(topic_idx)).collect();
            if !wanted.contains(&true) {
                continue;
            }
            let index = file.index(&wanted)?;
            let message = |Entry { topic_idx, time_ns, place }: Entry| Message {
                topic_idx: topics[topic_idx],
                time_ns,
                file_idx,
                place,
            };
            messages.extend(index.entries.into_iter().map(message));
            problems.extend(index.problems);
        }
        messages.sort_by_key(|message| message.time_ns);
        Ok((messages, problems))
    }

    /// What a message says, as it was written.
    ///
    /// # Errors
    /// A message of another recording, a damaged one.
    pub fn read(&self, message: &Message) -> Result<Vec<u8>, RecordingError> {
        let file = self.files.get(message.file_idx);
        file.ok_or_else(|| RecordingError::Empty(self.path.clone()))?.message(message.place)
    }
}
