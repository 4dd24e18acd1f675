//! New frames come into a set.

use super::change::{Move, Planned};
use super::names::{FramePath, Place, check_unlike};
use super::{SETS_FOLDER, Sets};
use crate::teaching::pictures::file_name;
use crate::teaching::{TeachingError, Who};
use bytes::Bytes;
use roomsight_protocol::sets::{AddedFrames, CopiedFrame, RefusedFrame};
use roomsight_vision::image::Image;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

/// A picture that is to be a frame.
pub struct NewFrame {
    /// What it is called, for messages.
    pub name: String,
    pub bytes: Bytes,
}

/// Pictures that are kept elsewhere come into a set.
pub struct AddedAndKept {
    /// The path of each in the set, in their order.
    pub paths: Vec<String>,
    /// The change that took them; none where all were there.
    pub change: Option<i64>,
}

impl Sets {
    /// Takes pictures into a set.
    ///
    /// # Errors
    /// No such set, a place that cannot be, a disk that is full: nothing is taken then.
    pub fn add(
        &self,
        set: &str,
        who: Who,
        place: &Place,
        pictures: &[NewFrame],
    ) -> Result<AddedFrames, TeachingError> {
        let mut result =
            AddedFrames { added: Vec::new(), copies: Vec::new(), refused: Vec::new(), change: None };
        let mut good = Vec::new();
        for NewFrame { name, bytes } in pictures {
            match Image::decode(bytes, &self.limits) {
                Ok(_) => good.push(NewFrame { name: name.clone(), bytes: bytes.clone() }),
                Err(error) => {
                    result.refused.push(RefusedFrame { name: name.clone(), reason: error.to_string() });
                }
            }
        }
        let _changing = self.changing();
        let mut there = self.by_file_name(set, place)?;
        let grave = if good.is_empty() { None } else { Some(self.journal.new_grave()?) };
        let mut moves = Vec::new();
        for (NewFrame { name, bytes }, grave) in good.into_iter().zip(grave.iter().cycle()) {
            let file = file_name(&bytes);
            if let Some(path) = there.get(&file) {
                result.copies.push(CopiedFrame { name, path: path.clone() });
                continue;
            }
            write(&grave.join(&file), &bytes).inspect_err(|_| drop(fs::remove_dir_all(grave)))?;
            let path = place.path_of(&file);
            let from = self.journal.relative(&grave.join(&file));
            moves.push(Move { from, to: format!("{SETS_FOLDER}/{set}/{path}") });
            there.insert(file, path.clone());
            result.added.push(path);
        }
        if moves.is_empty() {
            // It is empty.
            grave.iter().for_each(|grave| drop(fs::remove_dir(grave)));
            return Ok(result);
        }
        let text = format!("{} to {}", moves.len(), place.path_of(""));
        result.change = Some(self.journal.make(who, Planned { set, action: "add", text, moves })?.id);
        Ok(result)
    }

    /// Takes files that lie in the data directory into a set, where they stay as well. One that the set has in another room moves.
    ///
    /// # Errors
    /// No such set, a place that cannot be, a file that is not there: nothing is taken then.
    pub fn add_kept(
        &self,
        set: &str,
        who: Who,
        place: &Place,
        files: &[&Path],
    ) -> Result<AddedAndKept, TeachingError> {
        let _changing = self.changing();
        let mut there = self.by_file_name(set, place)?;
        let grave = self.journal.new_grave()?;
        let (mut paths, mut moves) = (Vec::new(), Vec::new());
        for file in files {
            let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let path = place.path_of(&name);
            if let Some(other) = there.get(&name) {
                let is_there = FramePath::parse(other)?.place.room == place.room;
                if is_there {
                    paths.push(other.clone());
                    continue;
                }
                // What it shows was said anew.
                let at = |path: &str| format!("{SETS_FOLDER}/{set}/{path}");
                moves.push(Move { from: at(other), to: at(&path) });
                there.insert(name, path.clone());
                paths.push(path);
                continue;
            }
            let linked = grave.join(&name);
            fs::hard_link(file, &linked)
                .or_else(|_| fs::copy(file, &linked).map(drop))
                .map_err(TeachingError::io(file))
                .inspect_err(|_| drop(fs::remove_dir_all(&grave)))?;
            let from = self.journal.relative(&linked);
            moves.push(Move { from, to: format!("{SETS_FOLDER}/{set}/{path}") });
            there.insert(name, path.clone());
            paths.push(path);
        }
        if moves.is_empty() {
            let _ = fs::remove_dir(&grave);
            return Ok(AddedAndKept { paths, change: None });
        }
        let text = format!("{} from the inbox to {}", moves.len(), place.path_of(""));
        let change = self.journal.make(who, Planned { set, action: "label", text, moves })?;
        Ok(AddedAndKept { paths, change: Some(change.id) })
    }

    /// The frames of a set by the names of their files, which tell the content of those that came in here; frames can come to
    /// this place.
    fn by_file_name(&self, set: &str, place: &Place) -> Result<BTreeMap<String, String>, TeachingError> {
        let found = self.found(set)?;
        check_unlike(&place.room, found.rooms())?;
        let file = |path: &str| path.rsplit('/').next().unwrap_or_default().to_owned();
        Ok(found.frames.into_iter().map(|frame| (file(&frame.path), frame.path)).collect())
    }
}

/// Writes a new file that is whole on the disk.
fn write(path: &Path, bytes: &[u8]) -> Result<(), TeachingError> {
    let write = || {
        let mut file = File::create_new(path)?;
        file.write_all(bytes)?;
        file.sync_all()
    };
    write().map_err(TeachingError::io(path))
}
