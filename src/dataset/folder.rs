//! A folder a room: `kitchen/*.jpg`, or `kitchen/SEQUENCE/*.jpg`.

use super::files::{self, list};
use super::{Dataset, DatasetError, Format, Frame};
use crate::camera::CameraKind;
use std::path::Path;

/// Reads a folder of rooms. Frames that lie beside the rooms or deeper than a sequence are problems.
pub fn read(root: &Path) -> Result<Dataset, DatasetError> {
    if !root.is_dir() {
        return Err(DatasetError::UnknownLayout(root.to_owned()));
    }
    let mut dataset = Dataset::new(root, Format::Folder);
    let top = list(root)?;
    for stray in top.images() {
        dataset.report(stray, "not in the folder of a room");
    }
    for room in &top.folders {
        let place = files::name(room);
        let n_before = dataset.frames.len();
        add_frames(&mut dataset, room, &place, "")?;
        for sequence in list(room)?.folders {
            add_frames(&mut dataset, &sequence, &place, &files::name(&sequence))?;
            for deeper in list(&sequence)?.folders {
                dataset.report(&deeper, "deeper than ROOM/SEQUENCE, not read");
            }
        }
        if dataset.frames.len() == n_before {
            dataset.report(room, "a room without a frame");
        }
    }
    if dataset.frames.is_empty() { Err(DatasetError::UnknownLayout(root.to_owned())) } else { Ok(dataset) }
}

fn add_frames(dataset: &mut Dataset, folder: &Path, place: &str, sequence: &str) -> Result<(), DatasetError> {
    dataset.frames.extend(list(folder)?.images().map(|path| Frame {
        path: path.clone(),
        place: place.to_owned(),
        sequence: sequence.to_owned(),
        camera: CameraKind::Perspective,
        split: String::new(),
        time: None,
        pose: None,
    }));
    Ok(())
}
