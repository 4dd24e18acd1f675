//! Rooms by time.
//!
//! A list has the columns `time,room`: from then on the robot is in that room, or in none that is named, up to the next
//! line; or `start,end,room`: between these. Times are seconds, or `minutes:seconds` and `hours:minutes:seconds` as a
//! player shows them, since the first picture; seconds since 1970 where they are that many.

use super::{DatasetError, SECOND, unusable};
use crate::dataset::{Problem, files, manifest};
use roomsight_recording::message::text;
use roomsight_recording::{Kind, Recording};
use std::path::{Path, PathBuf};

/// How the name of a list ends that lies beside a recording, behind the name of the recording.
const ENDING: &str = ".rooms.csv";

/// The list in a folder of rosbag2.
const IN_FOLDER: &str = "rooms.csv";

/// What the columns of a list may be called.
const STARTS: [&str; 3] = ["time", "start", "from"];
const ENDS: [&str; 2] = ["end", "to"];
const ROOMS: [&str; 2] = ["room", "place"];

/// Seconds from here on count from 1970: no recording is three years long.
const SINCE_1970: f64 = 1e8;

/// The most seconds since 1970, which are in the year 2286.
const MOST_SECONDS: f64 = 1e10;

/// The list beside a recording, if there is one: `run.rooms.csv` of `run.mcap` or of the folder `run`.
pub(super) fn beside(recording: &Path) -> Option<PathBuf> {
    let name = files::name(recording);
    let stem = name.split('.').next().unwrap_or_default();
    let beside = [recording.with_file_name(format!("{stem}{ENDING}")), recording.join(IN_FOLDER)];
    beside.into_iter().find(|path| path.is_file())
}

/// A room from one time to another, in nanoseconds; empty where there is none.
#[derive(Clone, Debug, PartialEq)]
struct Stay {
    from_ns: u64,
    to_ns: u64,
    room: String,
}

/// Which room a robot was in when.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RoomTrack {
    /// By time.
    stays: Vec<Stay>,
}

impl RoomTrack {
    /// A list; times since the beginning count from `first_ns`.
    pub(super) fn read(path: &Path, first_ns: u64) -> Result<Self, DatasetError> {
        let text = files::read_labels(path).map_err(DatasetError::Manifest)?;
        Self::parse(&text, first_ns).map_err(|(line, reason)| {
            let problem = Problem::new(path, reason);
            DatasetError::Manifest(if line > 0 { problem.at(line) } else { problem })
        })
    }

    /// A list as text; an error with its line, or 0.
    fn parse(text: &str, first_ns: u64) -> Result<Self, (u64, String)> {
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(manifest::delimiter(text, &[&STARTS[..], &ENDS, &ROOMS].concat()))
            .comment(Some(b'#'))
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let headings = reader.headers().map_err(|error| (1, error.to_string()))?.clone();
        let column = |names: &[&str]| {
            headings.iter().position(|heading| names.iter().any(|name| heading.eq_ignore_ascii_case(name)))
        };
        let (start, end) = (column(&STARTS), column(&ENDS));
        let (Some(start), Some(room)) = (start, column(&ROOMS)) else {
            return Err((1, "it must name the columns time and room, or start, end and room".to_owned()));
        };
        let mut stays: Vec<Stay> = Vec::new();
        for record in reader.records() {
            let record = record.map_err(|error| (0, error.to_string()))?;
            let line = record.position().map_or(0, csv::Position::line);
            let field = |idx: usize| record.get(idx).unwrap_or_default();
            let time = |idx: usize| {
                let text = field(idx);
                time_ns(text, first_ns).ok_or_else(|| {
                    (
                        line,
                        format!(
                            "`{text}` is no time: give seconds, or minutes:seconds, since the first picture"
                        ),
                    )
                })
            };
            let from_ns = time(start)?;
            let to_ns = end.map_or(Ok(u64::MAX), time)?;
            if to_ns < from_ns {
                return Err((line, "it ends before it begins".to_owned()));
            }
            if let Some(last) = stays.last_mut() {
                if from_ns < last.from_ns {
                    return Err((
                        line,
                        "it is earlier than the line before: sort the list by time".to_owned(),
                    ));
                }
                if end.is_none() {
                    last.to_ns = from_ns;
                } else if from_ns < last.to_ns {
                    return Err((
                        line,
                        "it begins before the line before ends: a robot is in one room".to_owned(),
                    ));
                }
            }
            stays.push(Stay { from_ns, to_ns, room: field(room).to_owned() });
        }
        if stays.is_empty() { Err((0, "it names no room".to_owned())) } else { Ok(Self { stays }) }
    }

    /// What a topic of texts says: from each message on the room that it names, up to the next.
    pub(super) fn of_topic(recording: &Recording, name: &str) -> Result<Self, DatasetError> {
        let topics = recording.topics();
        let of_texts: Vec<usize> =
            (0..topics.len()).filter(|&idx| topics[idx].kind() == Kind::Text).collect();
        let Some(&topic_idx) = of_texts.iter().find(|&&idx| topics[idx].name == name) else {
            let there = super::named(topics, &of_texts);
            return Err(unusable(
                recording,
                format!("there is no topic of texts {name}; there are: {there}"),
            ));
        };
        let failed = |error: &dyn std::fmt::Display| unusable(recording, error.to_string());
        let (messages, _) = recording.messages(&[topic_idx]).map_err(|error| failed(&error))?;
        let mut stays: Vec<Stay> = Vec::new();
        for message in &messages {
            let bytes = recording.read(message).map_err(|error| failed(&error))?;
            let room = text(&topics[topic_idx], &bytes).map_err(|error| failed(&error))?;
            let room = room.trim().to_owned();
            match stays.last_mut() {
                Some(last) if last.room == room => continue,
                Some(last) => last.to_ns = message.time_ns,
                None => (),
            }
            stays.push(Stay { from_ns: message.time_ns, to_ns: u64::MAX, room });
        }
        if stays.is_empty() {
            Err(unusable(recording, format!("nothing is recorded under {name}")))
        } else {
            Ok(Self { stays })
        }
    }

    /// The room at a time; none between stays.
    pub(super) fn at(&self, time_ns: u64) -> Option<&str> {
        let idx = self.stays.partition_point(|stay| stay.from_ns <= time_ns).checked_sub(1)?;
        let stay = &self.stays[idx];
        (time_ns < stay.to_ns && !stay.room.is_empty()).then_some(stay.room.as_str())
    }

    /// Why no picture from one time to another, in seconds, has a room.
    pub(super) fn why_none(&self, from: f64, to: f64) -> String {
        let labeled = self.stays.first().zip(self.stays.last());
        let seconds = |time_ns: u64| time_ns as f64 / SECOND;
        let (first, last) = labeled.map_or((0.0, 0.0), |(first, last)| {
            (seconds(first.from_ns), seconds(if last.to_ns == u64::MAX { last.from_ns } else { last.to_ns }))
        });
        format!(
            "its labels are of another time: pictures are from {from:.3} to {to:.3} s, labels from {first:.3} to {last:.3} s; \
             if they are of the clock of the messages' stamps, give --clock stamps"
        )
    }
}

/// A time as people and programs write it, in nanoseconds.
fn time_ns(text: &str, first_ns: u64) -> Option<u64> {
    if !text.bytes().all(|byte| byte.is_ascii_digit() || b":. ".contains(&byte)) {
        return None;
    }
    let parts: Vec<f64> = text.split(':').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    let seconds = match parts[..] {
        [seconds] => seconds,
        [minutes, seconds] => minutes * 60.0 + seconds,
        [hours, minutes, seconds] => (hours * 60.0 + minutes) * 60.0 + seconds,
        _ => return None,
    };
    if seconds > MOST_SECONDS {
        return None;
    }
    // Whole seconds apart from their fraction, which would lose its last digits.
    let fraction =
        text.split_once('.').map_or(0.0, |(_, digits)| format!("0.{digits}").parse().unwrap_or(0.0));
    let time_ns = seconds.trunc() as u64 * 1_000_000_000 + (fraction * SECOND).round() as u64;
    Some(if seconds >= SINCE_1970 { time_ns } else { first_ns.saturating_add(time_ns) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FIRST_NS: u64 = 1_700_000_000_000_000_000;

    fn at(track: &RoomTrack, seconds: f64) -> Option<&str> {
        track.at(FIRST_NS + (seconds * SECOND) as u64)
    }

    #[test]
    fn a_room_lasts_up_to_the_next_line() {
        let track = RoomTrack::parse("time,room\n1,hall\n0:02.5,\n1:00,kitchen\n", FIRST_NS).unwrap();
        let rooms = [0.5, 1.0, 2.4, 2.6, 59.0, 60.0, 1e6].map(|seconds| at(&track, seconds));
        assert_eq!(rooms, [None, Some("hall"), Some("hall"), None, None, Some("kitchen"), Some("kitchen")]);
    }

    #[test]
    fn a_room_may_say_when_it_ends() {
        let text = "start;end;place\n1700000001.25;1700000002;hall\n0:00:03;0:00:04;kitchen\n";
        let track = RoomTrack::parse(text, FIRST_NS).unwrap();
        let rooms = [1.2, 1.3, 2.5, 3.5, 4.5].map(|seconds| at(&track, seconds));
        assert_eq!(rooms, [None, Some("hall"), None, Some("kitchen"), None]);
    }

    #[test]
    fn what_is_no_list_is_told_with_its_line() {
        let error = |text: &str| RoomTrack::parse(text, FIRST_NS).unwrap_err();
        assert!(error("when,where\n1,hall\n").1.contains("columns time and room"));
        assert_eq!(error("time,room\n1,hall\nsoon,bath\n").0, 3);
        assert!(error("time,room\n2,hall\n1,bath\n").1.contains("sort"));
        assert!(error("start,end,room\n1,3,hall\n2,4,bath\n").1.contains("one room"));
        assert!(error("start,end,room\n3,1,hall\n").1.contains("ends before"));
        assert!(error("time,room\n").1.contains("no room"));
    }

    proptest! {
        #[test]
        fn no_list_panics(text in "[ -~\n]{0,80}") {
            let _ = RoomTrack::parse(&text, FIRST_NS);
            let _ = RoomTrack::parse(&format!("time,room\n{text}"), FIRST_NS);
        }
    }
}
