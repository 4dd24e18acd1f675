//! Recordings that others wrote hold what they say they wrote.
//!
//! `tests/recordings/matrix.py` writes them, `make test-python` runs both.

use roomsight_recording::message::{Picture, Sweep, located, stamp_ns, sweep, text};
use roomsight_recording::{Message, Recording, Topic};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// A matrix of fewer recordings was not written whole.
const MIN_RECORDINGS: usize = 18;

/// Each recording, and what it holds.
fn recordings() -> Option<Vec<(PathBuf, Vec<Value>)>> {
    let Some(folder) = env::var_os("ROOMSIGHT_RECORDINGS").map(PathBuf::from) else {
        eprintln!(
            "LEFT OUT: recordings to read are written by tests/recordings/matrix.py, see `make test-python`"
        );
        return None;
    };
    let mut recordings = Vec::new();
    for entry in fs::read_dir(&folder).expect("ROOMSIGHT_RECORDINGS names a folder") {
        let path = entry.unwrap().path();
        let Some(recording) = path.to_str().unwrap().strip_suffix(".json") else { continue };
        let expected = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        recordings.push((PathBuf::from(recording), expected));
    }
    assert!(recordings.len() >= MIN_RECORDINGS, "only {} recordings", recordings.len());
    Some(recordings)
}

/// What is read of a message, as `matrix.py` tells it.
fn told(recording: &Recording, message: &Message) -> Value {
    let topic: &Topic = &recording.topics()[message.topic_idx];
    let mut told = json!({ "topic": topic.name, "type": topic.type_name, "time": message.time_ns });
    let bytes = recording.read(message).unwrap();
    if let Some(stamp_ns) = stamp_ns(topic, &bytes).unwrap() {
        told["stamp"] = json!(stamp_ns);
    }
    if topic.kind().is_picture() {
        use base64::Engine;
        let picture = Picture::read(topic, &bytes).unwrap();
        told["picture"] = json!(base64::prelude::BASE64_STANDARD.encode(picture.encoded));
    } else if topic.kind().is_pose() {
        let pose = |located: &roomsight_recording::message::Located| {
            json!({
                "frame": located.frame_id, "child": located.child_frame_id,
                "x": located.x, "y": located.y, "yaw": (located.yaw * 1e9).round() / 1e9,
            })
        };
        told["poses"] = located(topic, &bytes).unwrap().iter().map(pose).collect();
    } else if let Ok(Sweep { angle_min, angle_increment, range_max, ranges }) = sweep(topic, &bytes) {
        told["scan"] =
            json!({"start": angle_min, "step": angle_increment, "longest": range_max, "ranges": ranges});
    } else if let Ok(text) = text(topic, &bytes) {
        told["text"] = json!(text);
    }
    told
}

/// The same, whatever the order of messages of one time, and with angles rounded.
fn comparable(mut told: Vec<Value>) -> Vec<String> {
    for pose in told
        .iter_mut()
        .filter_map(|told| told.get_mut("poses"))
        .flat_map(|poses| poses.as_array_mut().unwrap())
    {
        let yaw = pose["yaw"].as_f64().unwrap();
        pose["yaw"] = json!((yaw * 1e6).round() / 1e6);
    }
    let mut texts: Vec<String> = told.iter().map(Value::to_string).collect();
    texts.sort();
    texts
}

fn all(recording: &Recording) -> (Vec<Message>, Vec<String>) {
    recording.messages(&(0..recording.topics().len()).collect::<Vec<_>>()).unwrap()
}

#[test]
fn every_message_of_others_recordings_is_read_as_it_was_written() {
    let Some(recordings) = recordings() else { return };
    for (path, expected) in recordings {
        let recording = Recording::open(&path).unwrap();
        let (messages, problems) = all(&recording);
        assert_eq!(problems, Vec::<String>::new(), "{}", path.display());
        let has_index = !path.to_string_lossy().contains("no_");
        assert_eq!(
            recording.problems().is_empty(),
            has_index,
            "{}: {:?}",
            path.display(),
            recording.problems()
        );
        assert!(messages.is_sorted_by_key(|message| message.time_ns));
        let times = expected.iter().map(|message| message["time"].as_u64().unwrap());
        let span = [times.clone().min().unwrap(), times.max().unwrap()];
        assert_eq!(recording.span_ns(), Some(span), "{}", path.display());
        let n_messages: u64 = recording.topics().iter().filter_map(|topic| topic.n_messages).sum();
        assert_eq!(n_messages, if has_index { expected.len() as u64 } else { 0 }, "{}", path.display());
        let read = messages.iter().map(|message| told(&recording, message)).collect();
        let (read, expected) = (comparable(read), comparable(expected));
        let first = read.iter().zip(&expected).find(|(read, expected)| read != expected);
        assert_eq!(first, None, "{}", path.display());
        assert_eq!(read.len(), expected.len(), "{}", path.display());
    }
}

/// The files of a recording, without their ends.
fn cut(path: &Path, share: f64, into: &Path) -> PathBuf {
    let copy = into.join(path.file_name().unwrap());
    let cut_file = |from: &Path, to: &Path| {
        let bytes = fs::read(from).unwrap();
        let is_recording = roomsight_recording::is_called_so(from);
        let n_left = if is_recording { (bytes.len() as f64 * share) as usize } else { bytes.len() };
        fs::write(to, &bytes[..n_left]).unwrap();
    };
    if path.is_file() {
        cut_file(path, &copy);
        return copy;
    }
    fs::create_dir(&copy).unwrap();
    for entry in fs::read_dir(path).unwrap() {
        let from = entry.unwrap().path();
        cut_file(&from, &copy.join(from.file_name().unwrap()));
    }
    copy
}

#[test]
fn what_is_left_of_a_recording_is_read_and_said_to_be_cut() {
    let Some(recordings) = recordings() else { return };
    let mut n_read = 0;
    for (path, expected) in recordings {
        let expected = comparable(expected);
        for share in [0.02, 0.3, 0.6, 0.9, 0.999] {
            let folder = tempfile::tempdir().unwrap();
            let left = cut(&path, share, folder.path());
            let what = format!("{share} of {}", path.display());
            // A database or a file packed as a whole may be lost without its end.
            let recording = match Recording::open(&left) {
                Ok(recording) => recording,
                Err(error) => {
                    assert!(what.contains("sqlite") || share < 0.1, "{what}: {error}");
                    continue;
                }
            };
            let (messages, problems) = all(&recording);
            let n_problems = problems.len() + recording.problems().len();
            assert!(n_problems > 0 || messages.len() == expected.len(), "{what}: nothing is said");
            let read = messages.iter().filter(|message| recording.read(message).is_ok());
            let read = comparable(read.map(|message| told(&recording, message)).collect());
            n_read += read.len();
            assert!(read.iter().all(|message| expected.binary_search(message).is_ok()), "{what}: made up");
            if share > 0.5 && !what.contains("sqlite") {
                assert!(
                    read.len() as f64 > share * 0.6 * expected.len() as f64,
                    "{what}: {} of {}",
                    read.len(),
                    expected.len()
                );
            }
        }
    }
    assert!(n_read > 5000, "{n_read}");
}
