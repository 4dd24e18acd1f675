//! Which frames a model has learned: the rows that opinions keep, and the answers that name a frame, count by them.

use crate::file::arrays::{Array, Arrays, require};
use crate::file::error::FormatError;
use crate::model::pose::Pose;
use crate::model::sample::Sample;
use std::collections::BTreeMap;

/// The frames, in the order in which they were learned.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LearnedFrames {
    /// The room of each.
    pub(crate) labels: Vec<usize>,
    /// The drive of each: an index into `drive_names`.
    drives: Vec<usize>,
    drive_names: Vec<String>,
    /// What each is called, such as its path in the data set; may be empty.
    names: Vec<String>,
    /// Where each was taken, where that is known.
    poses: Vec<Option<Pose>>,
    /// What tells each one's picture from others, where that is known.
    pictures: Vec<Option<u64>>,
}

impl LearnedFrames {
    /// Of samples whose rooms are known.
    pub(crate) fn new(samples: &[&Sample], labels: &[usize]) -> Self {
        let mut learned = Self::default();
        learned.extend(samples.iter().copied().zip(labels.iter().copied()));
        learned
    }

    pub(crate) fn extend<'a>(&mut self, frames: impl Iterator<Item = (&'a Sample, usize)>) {
        let mut drives: BTreeMap<String, usize> = self.drive_names.iter().cloned().zip(0..).collect();
        for (sample, label) in frames {
            let drive = *drives.entry(sample.sequence.clone()).or_insert_with(|| {
                self.drive_names.push(sample.sequence.clone());
                self.drive_names.len() - 1
            });
            self.labels.push(label);
            self.drives.push(drive);
            // Names are lines of a text.
            self.names.push(sample.name.replace(['\n', '\r'], " "));
            self.poses.push(sample.pose.filter(Pose::is_finite));
            self.pictures.push(sample.picture);
        }
    }

    pub(crate) fn n_frames(&self) -> usize {
        self.labels.len()
    }

    /// What a frame is called.
    pub(crate) fn name(&self, frame_idx: usize) -> Option<&str> {
        self.names.get(frame_idx).map(String::as_str).filter(|name| !name.is_empty())
    }

    pub(crate) fn drive(&self, frame_idx: usize) -> &str {
        &self.drive_names[self.drives[frame_idx]]
    }

    /// Where a frame was taken.
    pub(crate) fn pose(&self, frame_idx: usize) -> Option<Pose> {
        self.poses.get(frame_idx).copied().flatten()
    }

    /// What tells the pictures of its frames from others.
    pub(crate) fn pictures(&self) -> impl Iterator<Item = u64> {
        self.pictures.iter().copied().flatten()
    }

    pub(crate) fn has_poses(&self) -> bool {
        self.poses.iter().any(Option::is_some)
    }

    /// With the rooms numbered anew.
    pub(crate) fn renumbered(&self, of_earlier: &[usize]) -> Self {
        Self { labels: self.labels.iter().map(|&label| of_earlier[label]).collect(), ..self.clone() }
    }

    /// The frames that are left, with their rooms numbered by their order in `left_rooms` (ascending).
    pub(crate) fn left(&self, is_left: &[bool], left_rooms: &[usize]) -> Self {
        let mut left = Self::default();
        let mut drives: BTreeMap<usize, usize> = BTreeMap::new();
        for (frame_idx, _) in is_left.iter().enumerate().filter(|(_, is_left)| **is_left) {
            let drive = *drives.entry(self.drives[frame_idx]).or_insert_with(|| {
                left.drive_names.push(self.drive(frame_idx).to_owned());
                left.drive_names.len() - 1
            });
            left.labels.push(left_rooms.binary_search(&self.labels[frame_idx]).unwrap_or_default());
            left.drives.push(drive);
            left.names.push(self.names[frame_idx].clone());
            left.poses.push(self.poses[frame_idx]);
            left.pictures.push(self.pictures[frame_idx]);
        }
        left
    }

    pub(crate) fn to_arrays(&self) -> Vec<Array> {
        if self.labels.is_empty() {
            return Vec::new();
        }
        let posed: Vec<(usize, Pose)> =
            self.poses.iter().enumerate().filter_map(|(idx, pose)| Some((idx, (*pose)?))).collect();
        let numbers: Vec<f64> = posed.iter().flat_map(|(_, pose)| [pose.x, pose.y, pose.angle]).collect();
        vec![
            Array::counts("frames.posed", posed.iter().map(|(idx, _)| *idx)),
            Array::doubles("frames.poses", &numbers),
            Array::longs("frames.pictures", self.pictures.iter().map(|picture| picture.unwrap_or_default())),
            Array::counts("frames.rooms", self.labels.iter().copied()),
            Array::counts("frames.drives", self.drives.iter().copied()),
            Array::text("frames.drive_names", &self.drive_names.join("\n")),
            Array::text("frames.names", &self.names.join("\n")),
        ]
    }

    /// Frames of unknown origin that fit so many rooms; none where the file tells of none.
    pub(crate) fn from_arrays(n_rooms: usize, file: &Arrays) -> Result<Self, FormatError> {
        if !file.has("frames.rooms") {
            return Ok(Self::default());
        }
        let lines = |name| Ok::<_, FormatError>(file.text(name)?.split('\n').map(str::to_owned).collect());
        let labels = file.counts("frames.rooms")?;
        let learned = Self {
            poses: poses(labels.len(), file)?,
            pictures: pictures(labels.len(), file)?,
            labels,
            drives: file.counts("frames.drives")?,
            drive_names: lines("frames.drive_names")?,
            names: lines("frames.names")?,
        };
        let n_frames = learned.labels.len();
        require(n_frames > 0, "it has learned no frame")?;
        let are_as_many = learned.drives.len() == n_frames && learned.names.len() == n_frames;
        require(are_as_many, "its frames have other numbers of drives and names")?;
        require(learned.labels.iter().all(|&label| label < n_rooms), "a frame is of no room")?;
        let n_drives = learned.drive_names.len();
        require(learned.drives.iter().all(|&drive| drive < n_drives), "a frame is of no drive")?;
        Ok(learned)
    }
}

/// Where each of so many frames was taken; files of before this was kept do not say.
fn poses(n_frames: usize, file: &Arrays) -> Result<Vec<Option<Pose>>, FormatError> {
    let mut poses = vec![None; n_frames];
    if file.has("frames.poses") {
        let (posed, numbers) = (file.counts("frames.posed")?, file.doubles("frames.poses")?);
        require(numbers.len() == 3 * posed.len(), "its poses are of other frames")?;
        for (&frame_idx, &[x, y, angle]) in posed.iter().zip(numbers.as_chunks().0) {
            let pose = Pose { x, y, angle };
            require(frame_idx < n_frames && pose.is_finite(), "a pose is of no frame, or no number")?;
            poses[frame_idx] = Some(pose);
        }
    }
    Ok(poses)
}

/// What tells the pictures of so many frames from others: 0 where it is not known, and nothing in files of before this was
/// kept.
fn pictures(n_frames: usize, file: &Arrays) -> Result<Vec<Option<u64>>, FormatError> {
    if !file.has("frames.pictures") {
        return Ok(vec![None; n_frames]);
    }
    let pictures = file.longs("frames.pictures")?;
    require(pictures.len() == n_frames, "its pictures are of other frames")?;
    Ok(pictures.into_iter().map(|picture| (picture != 0).then_some(picture)).collect())
}
