//! What is odd about labeled pictures, as far as it can be told without a person: copies, pictures in which nothing can be seen,
//! labels that the other pictures contradict.

use crate::dataset::{Copied, Dataset, Described, Look, near_pairs};
use roomsight_recognition::model::{Flaw, HeldOutAnswers};
use roomsight_vision::camera::CameraKind;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Pictures are blurred that are less sharp than this share of the middle one of the set.
const BLURRED: f32 = 0.3;

/// Panoramas are twice as wide as high; so much more or less may be cut off.
const PANORAMA: std::ops::Range<f64> = 1.9..2.1;

/// A drive through a room of fewer pictures says nothing.
const LEAST_OF_DRIVE: usize = 5;

/// A drive is in another room where this share of its pictures shows it.
const MOST_OF_DRIVE: f64 = 0.8;

/// Shapes differ by more than this share.
const OTHER_SHAPE: f64 = 0.05;

/// What is odd about a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Oddity {
    /// The other pictures say that it shows another room.
    Label,
    /// Most pictures of its drive that are said to show its room show another one, as other drives say.
    Drive,
    /// The same picture, byte for byte, is said to show two rooms.
    TwoRooms,
    /// Nearly the same picture is said to show two rooms.
    NearTwoRooms,
    /// Byte for byte another picture of the room.
    Copy,
    /// Nearly another picture of the room, of another drive or of none.
    NearCopy,
    /// Its shape is not that of the camera's pictures.
    Camera,
    /// Its shape is not that of most.
    Shape,
    /// Too dark to see anything.
    Dark,
    /// Something is before the lens.
    Covered,
    /// Nothing to see.
    NoDetail,
    /// Far less sharp than the others.
    Blurred,
}

impl Oddity {
    /// All of them, the gravest first.
    pub const ALL: [Self; 12] = [
        Self::Label,
        Self::Drive,
        Self::TwoRooms,
        Self::NearTwoRooms,
        Self::Copy,
        Self::NearCopy,
        Self::Camera,
        Self::Shape,
        Self::Dark,
        Self::Covered,
        Self::NoDetail,
        Self::Blurred,
    ];

    /// What it means and what to do, as a heading.
    pub fn heading(self) -> &'static str {
        match self {
            Self::Label => {
                "Labels that the other pictures contradict, the surest first: look at them, and move what is wrong"
            }
            Self::Drive => {
                "Drives that other drives take to be in another room (the first picture of each): look at them, and move what is wrong"
            }
            Self::TwoRooms => "The same picture in two rooms: keep it in one (training leaves out both)",
            Self::NearTwoRooms => "Nearly the same picture in two rooms: one of them is likely wrong",
            Self::Copy => "Copies: training leaves them out",
            Self::NearCopy => {
                "Nearly the same picture again: held-out rates look too good where it is on both sides \
                 (training leaves it out where there are no drives)"
            }
            Self::Camera => "Of a shape that this camera does not make: is --camera right?",
            Self::Shape => "Of another shape than most: of another camera, or cut",
            Self::Dark => "Too dark to see anything",
            Self::Covered => "Something is before the lens",
            Self::NoDetail => "Nothing to see",
            Self::Blurred => "Blurred",
        }
    }
}

/// A picture that is odd.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Why.
    pub oddity: Oddity,
    /// The picture.
    pub picture: PathBuf,
    /// The room that it is said to show.
    pub room: String,
    /// What says so, in a few words; may be empty.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub detail: String,
    /// The picture that it is a copy of, if it is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub other: Option<PathBuf>,
    /// The room that it shows more likely.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub likely_room: Option<String>,
}

/// A data set under examination.
pub struct Examined<'a> {
    /// The frames.
    pub dataset: &'a Dataset,
    /// The same, described.
    pub described: &'a Described,
}

impl Examined<'_> {
    /// What can be told of each picture, or of two, without any training; by kind, then in the order of the set.
    pub fn pictures(&self) -> Vec<Finding> {
        let mut findings = self.copies();
        findings.extend(self.near_copies());
        findings.extend(self.shapes());
        findings.extend(self.unseen());
        findings.sort_by_key(|finding| finding.oddity);
        findings
    }

    /// Pictures whose room is not the one that models say that were trained without them, but not without the others of their
    /// drives: the surest first.
    pub fn labels(&self, answers: &HeldOutAnswers) -> Vec<Finding> {
        let mut doubts: Vec<(f32, Finding)> = Vec::new();
        for answer in &answers.held_out {
            let recognition = &answer.recognition;
            let likely = &answers.rooms[recognition.room_idx];
            let room = &self.described.samples[answer.sample_idx].room;
            let of_room = answers.rooms.binary_search(room).map(|idx| recognition.probabilities[idx]);
            let Ok(of_room) = of_room else { continue };
            if likely != room {
                let detail = format!("{likely} {:.2}, {room} {of_room:.2}", recognition.probability());
                let finding = self.finding(Oddity::Label, answer.sample_idx, detail);
                // How many times as probable the other room is.
                let odds = recognition.probability() / of_room.max(f32::MIN_POSITIVE);
                doubts.push((odds, Finding { likely_room: Some(likely.clone()), ..finding }));
            }
        }
        doubts.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        doubts.into_iter().map(|(_, finding)| finding).collect()
    }

    /// The first picture of each drive in a room that models take for another room, as they were trained without drives: nearly
    /// all of its pictures for the same.
    pub fn drives(&self, answers: &HeldOutAnswers) -> Vec<Finding> {
        let mut by_drive: BTreeMap<(&str, &str), Vec<(usize, usize)>> = BTreeMap::new();
        for answer in &answers.held_out {
            let sample = &self.described.samples[answer.sample_idx];
            let answered = (answer.sample_idx, answer.recognition.room_idx);
            by_drive.entry((&sample.sequence, &sample.room)).or_default().push(answered);
        }
        let doubt = |((drive, room), answered): ((&str, &str), Vec<(usize, usize)>)| {
            let mut n_of_room: BTreeMap<usize, usize> = BTreeMap::new();
            answered.iter().for_each(|(_, room_idx)| *n_of_room.entry(*room_idx).or_default() += 1);
            let (&room_idx, &n_most) = n_of_room.iter().max_by_key(|(_, n_frames)| **n_frames)?;
            let likely = &answers.rooms[room_idx];
            let is_clear =
                answered.len() >= LEAST_OF_DRIVE && n_most as f64 >= MOST_OF_DRIVE * answered.len() as f64;
            (likely != room && is_clear).then(|| {
                let detail = format!("{drive}: {n_most} of {} pictures show rather {likely}", answered.len());
                let finding = self.finding(Oddity::Drive, answered[0].0, detail);
                Finding { likely_room: Some(likely.clone()), ..finding }
            })
        };
        by_drive.into_iter().filter_map(doubt).collect()
    }

    fn finding(&self, oddity: Oddity, sample_idx: usize, detail: impl Into<String>) -> Finding {
        Finding {
            oddity,
            picture: self.path(sample_idx),
            room: self.described.samples[sample_idx].room.clone(),
            detail: detail.into(),
            other: None,
            likely_room: None,
        }
    }

    fn path(&self, sample_idx: usize) -> PathBuf {
        self.dataset.frames[self.described.frame_idxs[sample_idx]].path.clone()
    }

    fn copies(&self) -> Vec<Finding> {
        let found = |copied: &Copied| {
            let [own, other] =
                [copied.sample_idx, copied.of_idx].map(|idx| &self.described.samples[idx].room);
            let oddity = if own == other { Oddity::Copy } else { Oddity::TwoRooms };
            self.paired(oddity, copied.sample_idx, copied.of_idx)
        };
        self.described.copies(self.dataset).iter().map(found).collect()
    }

    fn paired(&self, oddity: Oddity, sample_idx: usize, other_idx: usize) -> Finding {
        let other = &self.described.samples[other_idx].room;
        let is_same = *other == self.described.samples[sample_idx].room;
        let detail = if is_same { String::new() } else { format!("also in {other}") };
        Finding { other: Some(self.path(other_idx)), ..self.finding(oddity, sample_idx, detail) }
    }

    /// Copies that are one byte for byte are told as such. Of a drive, pictures in a row are alike as they should be.
    fn near_copies(&self) -> Vec<Finding> {
        let looks: Vec<&Look> = self.described.looks.iter().collect();
        let copied: BTreeSet<usize> =
            self.described.copies(self.dataset).iter().map(|copied| copied.sample_idx).collect();
        let mut findings = Vec::new();
        let mut told = BTreeSet::new();
        for [first_idx, idx] in near_pairs(&looks) {
            let [first, sample] = [first_idx, idx].map(|idx| &self.described.samples[idx]);
            if copied.contains(&idx) || copied.contains(&first_idx) {
                continue;
            }
            let oddity = if first.room != sample.room {
                Oddity::NearTwoRooms
            } else if first.sequence != sample.sequence || sample.sequence.is_empty() {
                Oddity::NearCopy
            } else {
                continue;
            };
            // Each once of a kind, however many it is like.
            if told.insert((oddity, idx)) {
                findings.push(self.paired(oddity, idx, first_idx));
            }
        }
        findings
    }

    fn shapes(&self) -> Vec<Finding> {
        let looks = &self.described.looks;
        let mut aspects: Vec<f64> = looks.iter().map(Look::aspect).collect();
        aspects.sort_by(f64::total_cmp);
        let Some(&usual) = aspects.get(aspects.len() / 2) else { return Vec::new() };
        let of_sample = |(sample_idx, look): (usize, &Look)| {
            let camera = self.dataset.frames[self.described.frame_idxs[sample_idx]].camera;
            let size = format!("{} x {}", look.width, look.height);
            if let Some(why) = other_camera(camera, look.aspect()) {
                return Some(self.finding(Oddity::Camera, sample_idx, format!("{size}, {why}")));
            }
            is_other_shape(look.aspect(), usual).then(|| self.finding(Oddity::Shape, sample_idx, size))
        };
        looks.iter().enumerate().filter_map(of_sample).collect()
    }

    fn unseen(&self) -> Vec<Finding> {
        let samples = &self.described.samples;
        let mut sharp: Vec<f32> = self.described.looks.iter().map(|look| look.sharpness).collect();
        sharp.sort_by(f32::total_cmp);
        let usual = sharp.get(sharp.len() / 2).copied().unwrap_or_default();
        let of_sample = |(sample_idx, look): (usize, &Look)| {
            let oddity = match samples[sample_idx].features.flaw {
                Some(Flaw::Dark) => Oddity::Dark,
                Some(Flaw::Covered) => Oddity::Covered,
                Some(Flaw::Flat) => Oddity::NoDetail,
                None if look.sharpness < BLURRED * usual => Oddity::Blurred,
                None => return None,
            };
            Some(self.finding(oddity, sample_idx, ""))
        };
        self.described.looks.iter().enumerate().filter_map(of_sample).collect()
    }
}

/// Why pictures of this shape, so many times as wide as high, are hardly of this camera.
pub fn other_camera(camera: CameraKind, aspect: f64) -> Option<&'static str> {
    match (camera, PANORAMA.contains(&aspect)) {
        (CameraKind::Perspective, true) => Some("as panoramas are (--camera equirectangular)"),
        (CameraKind::Equirectangular, false) => Some("but panoramas are twice as wide as high"),
        _ => None,
    }
}

/// Whether a shape is neither another nor that turned by a quarter.
fn is_other_shape(aspect: f64, usual: f64) -> bool {
    let differs = |usual: f64| (aspect / usual - 1.0).abs() > OTHER_SHAPE;
    differs(usual) && differs(1.0 / usual)
}
