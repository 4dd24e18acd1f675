//! The drives of a data set, and what their frames show once described.

use super::ExperimentError;
use crate::dataset::cold::{DrivenPath, Illumination, Part, SequenceName};
use crate::dataset::{Dataset, Described};
use crate::simulate::Wall;
use crate::validate;
use roomsight_recognition::model::{Config, Extractor};
use roomsight_vision::camera::{Camera, CameraKind, Mask, Projection};
use roomsight_vision::image::{Image, Limits};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs;

/// One drive through a lab, seen by one camera.
pub struct Drive {
    /// Lab, part, path, light and number.
    pub name: SequenceName,
    /// The name as it stands in the data set.
    pub sequence: String,
    /// Its frames alone.
    pub dataset: Dataset,
    /// Whether each frame is near a border of rooms; see [`validate::near_borders`].
    pub near_border: Vec<Option<bool>>,
    /// The camera that took it.
    pub camera: Camera,
    /// The digest of all its frames, labels and poses, and of the camera.
    pub digest: String,
}

/// The drives of a data set, sorted by their sequence.
pub struct Drives {
    drives: Vec<Drive>,
}

impl Drives {
    /// Takes the drives apart, every `stride`-th frame of each, and reads every frame once for its digest.
    ///
    /// # Errors
    /// No sequence of COLD, a sequence of one room or without a frame that can be read, or no mirror in the frames
    /// of a lab.
    pub fn new(dataset: &Dataset, stride: usize) -> Result<Self, ExperimentError> {
        let mut by_sequence: BTreeMap<&str, Dataset> = BTreeMap::new();
        for frame in &dataset.frames {
            let empty = || Dataset { frames: Vec::new(), problems: Vec::new(), ..dataset.clone() };
            by_sequence.entry(&frame.sequence).or_insert_with(empty).frames.push(frame.clone());
        }
        let mut cameras = BTreeMap::new();
        let mut drives = Vec::new();
        for (sequence, mut dataset) in by_sequence {
            let Some(name) = SequenceName::parse(sequence) else { continue };
            if dataset.rooms().len() < 2 {
                return Err(ExperimentError::OneRoom(sequence.to_owned()));
            }
            if !dataset.frames.iter().any(|frame| frame.read(&Limits::default()).is_ok()) {
                return Err(ExperimentError::Unreadable(sequence.to_owned()));
            }
            let near_border = validate::near_borders(&dataset).into_iter().step_by(stride).collect();
            dataset.frames = dataset.frames.into_iter().step_by(stride).collect();
            let camera = match cameras.get(&name.lab) {
                Some(camera) => Camera::clone(camera),
                None => camera_of(&dataset).ok_or_else(|| ExperimentError::NoMirror(sequence.to_owned()))?,
            };
            cameras.insert(name.lab.clone(), camera.clone());
            let digest = digest(&dataset, &camera);
            drives.push(Drive { name, sequence: sequence.to_owned(), dataset, near_border, camera, digest });
        }
        if drives.is_empty() {
            return Err(ExperimentError::NoDrives);
        }
        Ok(Self { drives })
    }

    /// All drives.
    pub fn iter(&self) -> impl Iterator<Item = &Drive> {
        self.drives.iter()
    }

    /// The drive of this index.
    pub fn get(&self, drive_idx: usize) -> &Drive {
        &self.drives[drive_idx]
    }

    /// The indices of the drives that are wanted.
    pub fn indices(&self, is_wanted: impl Fn(&SequenceName) -> bool) -> Vec<usize> {
        (0..self.drives.len()).filter(|&idx| is_wanted(&self.drives[idx].name)).collect()
    }

    /// The labs, sorted.
    pub fn labs(&self) -> Vec<String> {
        let mut labs: Vec<String> = self.drives.iter().map(|drive| drive.name.lab.clone()).collect();
        labs.sort();
        labs.dedup();
        labs
    }

    /// The drives' names, for messages.
    pub fn names(&self) -> String {
        self.drives.iter().map(|drive| drive.sequence.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The drive of Lu's experiments in this light: Saarbruecken, or else the first lab, part B, standard path.
    pub fn of_lu(&self, illumination: Illumination, run: u32) -> Option<usize> {
        let labs = self.labs();
        let lab = labs.iter().find(|lab| lab.contains("saarbruecken")).or(labs.first())?;
        let is_wanted = |name: &SequenceName| {
            (&name.lab, name.part, name.path) == (lab, Part::B, DrivenPath::Standard)
                && (name.illumination, name.run) == (illumination, run)
        };
        self.indices(is_wanted).first().copied()
    }
}

impl Drive {
    /// The walls round it, where its lab is simulated.
    pub fn walls(&self) -> Vec<Wall> {
        let frame = self.dataset.frames.first();
        frame.and_then(|frame| frame.path.ancestors().nth(2)).map(Wall::read).unwrap_or_default()
    }

    /// Finds and describes the keypoints of all frames, of which some may be hidden.
    pub fn describe(&self, config: &Config, occlusion: Occlusion) -> Result<Described, ExperimentError> {
        let camera = Camera { mask: occlusion.mask(), ..self.camera.clone() };
        let described = self.dataset.describe(&Extractor::new(config, camera), &Limits::default(), || ());
        if described.samples.is_empty() {
            return Err(ExperimentError::Unreadable(self.sequence.clone()));
        }
        Ok(described)
    }
}

/// Stripes of a frame whose pixels are not looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Occlusion {
    /// How much is hidden, in sixteenths of the frame, from 0 to 8.
    pub sixteenths: u8,
}

impl Occlusion {
    /// What hides the stripes: of each eighth of the frame's width, the first columns.
    fn mask(self) -> Option<Mask> {
        const N_STRIPES: usize = 8;
        const COLUMNS_A_STRIPE: usize = 16;
        if self.sixteenths == 0 {
            return None;
        }
        let n_hidden = usize::from(self.sixteenths) * COLUMNS_A_STRIPE / 16;
        let pixel = |column: usize| if column % COLUMNS_A_STRIPE < n_hidden { 0 } else { 255 };
        let width = N_STRIPES * COLUMNS_A_STRIPE;
        Image::from_pixels(width, 1, (0..width).map(pixel).collect()).map(Mask::new)
    }
}

fn camera_of(dataset: &Dataset) -> Option<Camera> {
    let projection = match dataset.frames.first()?.camera {
        CameraKind::Perspective => Projection::Perspective,
        CameraKind::Equirectangular => Projection::Equirectangular,
        CameraKind::Omnidirectional => Projection::Omnidirectional(dataset.find_mirror(&Limits::default())?),
    };
    Some(Camera::new(projection))
}

/// Frames that cannot be read have no share in it; describing them reports them.
fn digest(dataset: &Dataset, camera: &Camera) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(digest_of_camera(camera).as_bytes());
    for frame in &dataset.frames {
        let bytes = fs::read(&frame.path).unwrap_or_default();
        hasher.update(blake3::hash(&bytes).as_bytes());
        hasher.update(blake3::hash(frame.room.as_bytes()).as_bytes());
        let pose = frame.pose.map(|pose| [pose.x, pose.y, pose.angle].map(f64::to_le_bytes));
        hasher.update(pose.unwrap_or_default().as_flattened());
    }
    hasher.finalize().to_hex().to_string()
}

fn digest_of_camera(camera: &Camera) -> blake3::Hash {
    // Plain numbers always have a JSON form.
    let mut hasher = blake3::Hasher::new();
    hasher.update(&serde_json::to_vec(&camera.projection).unwrap_or_default());
    if let Some(picture) = camera.mask.as_ref().map(Mask::picture) {
        hasher.update(&picture.width().to_le_bytes());
        hasher.update(picture.pixels());
    }
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use roomsight_vision::camera::Mirror;

    #[test]
    fn cameras_that_see_otherwise_have_other_digests() {
        let mirror = Mirror { center_x: 0.5, center_y: 0.4, inner_radius: 0.1, outer_radius: 0.45 };
        let moved = Mirror { center_x: 0.501, ..mirror };
        let mask = Image::from_pixels(2, 1, vec![0, 255]).map(Mask::new);
        let camera = |mirror| Camera::new(Projection::Omnidirectional(mirror));
        let cameras = [camera(mirror), camera(moved), Camera { mask, ..camera(mirror) }];
        let digests = cameras.map(|camera| digest_of_camera(&camera));
        assert!(digests[0] != digests[1] && digests[0] != digests[2] && digests[1] != digests[2]);
    }

    #[test]
    fn as_many_sixteenths_of_the_columns_are_hidden_as_asked() {
        assert!(Occlusion { sixteenths: 0 }.mask().is_none());
        for sixteenths in 1..=8 {
            let mask = Occlusion { sixteenths }.mask().unwrap();
            let pixels = mask.picture().pixels();
            let n_hidden = pixels.iter().filter(|&&pixel| pixel == 0).count();
            assert_eq!(n_hidden * 16, pixels.len() * usize::from(sixteenths));
        }
    }
}
