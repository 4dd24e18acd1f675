//! Answers to the pictures of a recording, as a recording: Foxglove shows them over the pictures, and as plots.

use super::Asked;
use crate::cli::manners::note;
use crate::cli::output::{self, say};
use crate::engine::shown::{Shown, shown};
use anyhow::{Context, bail};
use rayon::prelude::*;
use roomsight_lab::dataset::{Frame, RecordedMessage};
use roomsight_recognition::filter::{RoomFilter, Trust};
use roomsight_recognition::model::{self, Features, Model, Recognition, Scan, Scratch};
use roomsight_recording::message::Picture;
use roomsight_recording::write::{Channel, JsonRecording, schema};
use roomsight_vision::image::{Image, Limits};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Pictures that are answered at one time.
const N_AT_ONCE: usize = 64;

/// What is drawn over a picture.
const WHITE: [f64; 4] = [1.0, 1.0, 1.0, 1.0];
const SHADE: [f64; 4] = [0.0, 0.0, 0.0, 0.6];
const GREEN: [f64; 4] = [0.2, 0.9, 0.4, 1.0];
const ORANGE: [f64; 4] = [1.0, 0.6, 0.1, 1.0];

/// Reads a picture as far as a model looks at it.
pub(super) fn read(frame: &Frame, model: &Model, limits: &Limits) -> anyhow::Result<Image> {
    let bytes = frame.read_encoded(limits).map_err(|problem| anyhow::anyhow!("{problem}"))?;
    model.decode(&bytes, limits).with_context(|| frame.path.display().to_string())
}

/// Reads the scan beside a picture, where a model looks at such.
pub(super) fn scan(frame: &Frame, model: &Model) -> anyhow::Result<Option<Arc<Scan>>> {
    frame.read_scan_for(model.extractor()).map_err(|problem| anyhow::anyhow!("{problem}"))
}

/// The topics that are written.
struct Topics {
    picture: Channel,
    annotations: Channel,
    answer: Channel,
    probabilities: Channel,
}

impl Topics {
    fn new(file: &mut JsonRecording, pictures: &str, rooms: &[String]) -> anyhow::Result<Self> {
        let (number, text) = (schema::number(), schema::text());
        let point = schema::object(&json!({"x": number, "y": number}));
        let color = schema::object(&json!({"r": number, "g": number, "b": number, "a": number}));
        let annotations = schema::object(&json!({
            "circles": schema::list(&schema::object(&json!({}))),
            "points": schema::list(&schema::object(&json!({
                "timestamp": schema::time(), "type": {"type": "integer"}, "points": schema::list(&point), "outline_color": color,
                "outline_colors": schema::list(&color), "fill_color": color, "thickness": number,
            }))),
            "texts": schema::list(&schema::object(&json!({
                "timestamp": schema::time(), "position": point, "text": text, "font_size": number, "text_color": color,
                "background_color": color,
            }))),
        }));
        let answer = schema::answer(json!({"labeled_room": text}));
        let of_rooms =
            rooms.iter().map(|room| (room.clone(), number.clone())).collect::<serde_json::Map<_, _>>();
        Ok(Self {
            picture: file.channel(pictures, "foxglove.CompressedImage", &schema::compressed_image())?,
            annotations: file.channel("/roomsight/annotations", "foxglove.ImageAnnotations", &annotations)?,
            answer: file.channel("/roomsight/answer", "roomsight.Answer", &answer)?,
            probabilities: file.channel(
                "/roomsight/probabilities",
                "roomsight.Probabilities",
                &schema::object(&Value::Object(of_rooms)),
            )?,
        })
    }
}

/// Answers the pictures of a recording in order, into a new one.
pub(super) fn answer(model: &Model, frames: &[Asked], output: &Path, limits: &Limits) -> anyhow::Result<()> {
    let frames: Vec<(&Frame, &RecordedMessage)> = frames
        .iter()
        .filter_map(|Asked { frame, .. }| frame.as_ref().zip(frame.as_ref()?.recorded.as_ref()))
        .collect();
    let Some((_, first)) = frames.first() else { bail!("the recording holds no picture to answer") };
    if output.exists() {
        bail!("{} exists already: choose another file", output.display());
    }
    let mut file = JsonRecording::create(output).with_context(|| output.display().to_string())?;
    let topics = Topics::new(&mut file, &first.topic().name, model.rooms())?;
    let mut filter = RoomFilter::new(model.rooms().len(), Trust::default());
    let (mut last, mut n_known, mut n_failed) = (None, 0, 0);
    let mut n_of_room: BTreeMap<&str, usize> = BTreeMap::new();
    let bar = output::progress("answering", frames.len());
    let see = |scratch: &mut Scratch, &(frame, recorded): &(&Frame, &RecordedMessage)| {
        let name = || frame.path.display().to_string();
        let picture = recorded.picture(limits).map_err(anyhow::Error::msg).with_context(name)?;
        let image = model.decode(&picture.encoded, limits).with_context(name)?;
        let scan = scan(frame, model)?;
        let features = model.features(model::Frame { image: &image, scan: scan.as_deref() }, scratch);
        Ok((shown(&picture.encoded, limits)?, model.classify(&features), features, picture))
    };
    for some in frames.chunks(N_AT_ONCE) {
        let seen: Vec<anyhow::Result<_>> = some.par_iter().map_init(Scratch::default, see).collect();
        for (&(frame, recorded), seen) in some.iter().zip(seen) {
            bar.inc(1);
            let (shown, recognition, features, Picture { stamp_ns, frame_id, .. }) = match seen {
                Ok(seen) => seen,
                Err(error) => {
                    note!("left out: {}", output::explained(&error));
                    n_failed += 1;
                    continue;
                }
            };
            let since = last.and_then(|last: &Frame| last.interval_to(frame)).unwrap_or(0.0.into());
            filter.update(model.transitions(), since, recognition.observation());
            last = Some(frame);
            n_known += usize::from(recognition.known);
            *n_of_room.entry(&model.rooms()[filter.room_idx()]).or_default() += 1;
            let time_ns = recorded.message().time_ns;
            let stamp_ns = stamp_ns.unwrap_or(time_ns);
            let timestamp = schema::time_of(stamp_ns);
            let answered = Answered {
                model,
                labeled_room: &frame.room,
                features: &features,
                recognition: &recognition,
                filter: &filter,
                timestamp,
                frame_id,
            };
            let written = answered.write(&mut file, &topics, time_ns, shown);
            written.with_context(|| output.display().to_string())?;
        }
    }
    bar.finish_and_clear();
    file.finish().with_context(|| output.display().to_string())?;
    let mut table = output::table(["room, filtered", "pictures"]);
    for (room, n_pictures) in n_of_room {
        table.add_row([room.to_owned(), n_pictures.to_string()]);
    }
    say!("{table}")?;
    let n_answered = frames.len() - n_failed;
    say!(
        "{n_answered} answers are in {}, {n_known} of them known. To look at them: open it in Foxglove.",
        output.display()
    )?;
    Ok(())
}

/// A picture that is answered.
struct Answered<'a> {
    model: &'a Model,
    labeled_room: &'a str,
    features: &'a Features,
    recognition: &'a Recognition,
    filter: &'a RoomFilter,
    timestamp: Value,
    frame_id: String,
}

impl Answered<'_> {
    fn write(
        &self,
        file: &mut JsonRecording,
        topics: &Topics,
        time_ns: u64,
        shown: Shown,
    ) -> anyhow::Result<()> {
        let Self { model, labeled_room, recognition, filter, timestamp, frame_id, .. } = self;
        let room = &model.rooms()[recognition.room_idx];
        let (filtered, belief) = (&model.rooms()[filter.room_idx()], filter.belief()[filter.room_idx()]);
        let probabilities: serde_json::Map<String, Value> = model
            .rooms()
            .iter()
            .zip(&recognition.probabilities)
            .map(|(room, p)| (room.clone(), json!(p)))
            .collect();
        let unknown = recognition.unknown.map(|why| why.to_string()).unwrap_or_default();
        let answer = json!({
            "timestamp": timestamp, "frame_id": frame_id, "room": room, "probability": recognition.probability(),
            "known": recognition.known, "unknown": unknown, "novelty": recognition.novelty,
            "keypoints": recognition.n_keypoints, "filtered_room": filtered, "filtered_probability": belief,
            "filtered_known": model.knows(filter), "labeled_room": labeled_room,
        });
        let Shown { format, base64 } = shown;
        let image = json!({"timestamp": timestamp, "frame_id": frame_id, "format": format, "data": base64});
        file.write(topics.picture, time_ns, &image)?;
        file.write(topics.answer, time_ns, &answer)?;
        file.write(topics.probabilities, time_ns, &probabilities)?;
        file.write(topics.annotations, time_ns, &self.annotations(room))?;
        Ok(())
    }

    /// What was seen, and what is said of it, over the picture.
    fn annotations(&self, room: &str) -> Value {
        let color = |[r, g, b, a]: [f64; 4]| json!({"r": r, "g": g, "b": b, "a": a});
        let Self { features, recognition, timestamp, .. } = self;
        let said = match recognition.unknown {
            None => format!("{room} {:.2}", recognition.probability()),
            Some(why) => format!("{room}? {:.2}, {why}", recognition.probability()),
        };
        let points = features
            .keypoints()
            .map(|keypoint| json!({"x": keypoint.x * features.scale, "y": keypoint.y * features.scale}));
        json!({
            "circles": [],
            "points": [{
                // Single points.
                "timestamp": timestamp, "type": 1, "points": points.collect::<Vec<_>>(), "thickness": 3.0,
                "outline_color": color(if recognition.known { GREEN } else { ORANGE }), "outline_colors": [],
                "fill_color": color([0.0; 4]),
            }],
            "texts": [{
                "timestamp": timestamp, "position": {"x": 8.0, "y": 28.0}, "text": said, "font_size": 22.0,
                "text_color": color(WHITE), "background_color": color(SHADE),
            }],
        })
    }
}
