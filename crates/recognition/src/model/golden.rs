//! The golden frames of a model: a few frames and, in `golden.json`, the answers that it gave when it was saved.
//! Whoever loads it can tell that it still answers the same.

use crate::file::disk::{LoadError, MAX_SIDE_FILE_BYTES, MODEL_FILE, read_bounded, refused, write_new};
use crate::look::scan::{Frame, Scan};
use crate::model::extractor::Scratch;
use crate::model::{Model, Recognition};
use roomsight_vision::image::Limits;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::{fs, io};

/// Where they lie in a model's folder.
pub const GOLDEN_FOLDER: &str = "golden";
const GOLDEN_FILE: &str = "golden.json";

/// The most bytes of all golden frames of a model.
const MAX_GOLDEN_BYTES: u64 = 256 << 20;

/// How far the probability of a golden frame may be from the one when the model was saved.
const PROBABILITY_TOLERANCE: f32 = 0.01;

/// A frame with the answer that the model gave when it was saved.
#[derive(Clone, Debug, PartialEq)]
pub struct GoldenFrame {
    /// Its file name.
    pub name: String,
    /// The encoded image.
    pub bytes: Vec<u8>,
    /// What the laser measured beside it, if the model looks at that.
    pub scan: Option<Scan>,
    /// The room answered.
    pub room: String,
    /// Its probability.
    pub probability: f32,
}

#[derive(Serialize, Deserialize)]
struct GoldenAnswer {
    file: String,
    #[serde(rename = "place")]
    room: String,
    probability: f32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scan: Option<Scan>,
}

/// The golden frames of a model folder; none when it has none.
pub(crate) fn load_golden_frames(folder: &Path) -> Result<Vec<GoldenFrame>, LoadError> {
    let folder = folder.join(GOLDEN_FOLDER);
    let list_path = folder.join(GOLDEN_FILE);
    if !list_path.exists() {
        return Ok(Vec::new());
    }
    let answers: Vec<GoldenAnswer> = serde_json::from_slice(&read_bounded(&list_path, MAX_SIDE_FILE_BYTES)?)
        .map_err(|error| refused(&list_path, error.to_string()))?;
    let mut n_bytes_left = MAX_GOLDEN_BYTES;
    let mut load = |answer: GoldenAnswer| {
        if Path::new(&answer.file).file_name() != Some(answer.file.as_ref()) {
            return Err(refused(&list_path, format!("{:?} is no file name", answer.file)));
        }
        let bytes = read_bounded(&folder.join(&answer.file), n_bytes_left)?;
        n_bytes_left -= bytes.len() as u64;
        let GoldenAnswer { file: name, room, probability, scan } = answer;
        Ok(GoldenFrame { name, bytes, scan, room, probability })
    };
    answers.into_iter().map(&mut load).collect()
}

/// Sends frames through decoding and recognition before a robot does: the golden ones, which must be answered
/// as when the model was saved, or else a drawn one.
pub(crate) fn warm(model: &Model, folder: &Path, golden_frames: &[GoldenFrame]) -> Result<(), LoadError> {
    if golden_frames.is_empty() {
        let path = folder.join(MODEL_FILE);
        let answer = answer_of(model, &drawn_frame(), None).map_err(|reason| refused(&path, reason))?;
        let probability = answer.probability();
        let told = format!("a frame is answered with the probability {probability}");
        return if probability.is_finite() { Ok(()) } else { Err(refused(&path, told)) };
    }
    golden_frames.iter().try_for_each(|frame| {
        frame.check(model).map_err(|reason| refused(&folder.join(GOLDEN_FOLDER).join(&frame.name), reason))
    })
}

impl GoldenFrame {
    /// Whether the model answers it as when it was saved; what else it answers.
    fn check(&self, model: &Model) -> Result<(), String> {
        let answer = answer_of(model, &self.bytes, self.scan.as_ref())?;
        let room = &model.rooms()[answer.room_idx];
        let probability = answer.probability();
        // A probability that is no number is not close either.
        let is_close = (probability - self.probability).abs() <= PROBABILITY_TOLERANCE;
        if *room == self.room && is_close {
            return Ok(());
        }
        let Self { room: expected, probability: expected_probability, .. } = self;
        Err(format!(
            "this golden frame is answered with {room} ({probability:.3}), \
             not with {expected} ({expected_probability:.3})"
        ))
    }
}

fn answer_of(model: &Model, bytes: &[u8], scan: Option<&Scan>) -> Result<Recognition, String> {
    let image = model.decode(bytes, &Limits::default()).map_err(|error| error.to_string())?;
    Ok(model.recognize(Frame { image: &image, scan }, &mut Scratch::default()))
}

pub(crate) fn write_golden(folder: &Path, frames: &[GoldenFrame]) -> io::Result<()> {
    fs::create_dir(folder)?;
    for frame in frames {
        write_new(&folder.join(&frame.name), &frame.bytes)?;
    }
    let answer = |frame: &GoldenFrame| GoldenAnswer {
        file: frame.name.clone(),
        room: frame.room.clone(),
        probability: frame.probability,
        scan: frame.scan.clone(),
    };
    let answers: Vec<GoldenAnswer> = frames.iter().map(answer).collect();
    write_new(&folder.join(GOLDEN_FILE), &serde_json::to_vec_pretty(&answers)?)
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
