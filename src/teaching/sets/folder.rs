//! What lies in the folder of a set.

use super::names::as_text;
use crate::teaching::TeachingError;
use roomsight_protocol::sets::{LeftOutFile, SetFrame};
use std::fs;
use std::path::Path;

/// How pictures are called, in lower case. What they are, `train` tells by their content.
const EXTENSIONS: [&str; 7] = ["jpg", "jpeg", "png", "webp", "bmp", "pgm", "bin"];

/// The most files that are told as left out.
const MAX_LEFT_OUT: usize = 100;

/// What was found.
#[derive(Default)]
pub struct Found {
    /// By path.
    pub frames: Vec<SetFrame>,
    /// By path, at most [`MAX_LEFT_OUT`].
    pub left_out: Vec<LeftOutFile>,
}

impl Found {
    /// The rooms that have frames, by name.
    pub fn rooms(&self) -> impl Iterator<Item = &str> {
        // Frames are sorted by path, so that those of a room follow each other.
        let mut last = "";
        self.frames.iter().map(|frame| frame.room.as_str()).filter(move |room| {
            let is_new = *room != last;
            last = room;
            is_new
        })
    }

    pub fn of_room(&self, room: &str) -> impl Iterator<Item = &SetFrame> {
        self.frames.iter().filter(move |frame| frame.room == room)
    }

    pub fn n_bytes(&self) -> u64 {
        self.frames.iter().map(|frame| frame.bytes).sum()
    }
}

/// Reads a set's folder: rooms, drives, frames. Hidden files are none of it.
///
/// # Errors
/// A folder that cannot be read.
pub fn read(set: &Path) -> Result<Found, TeachingError> {
    let mut found = Found::default();
    for room in visible(set)? {
        if !room.is_dir {
            found.leave_out(&room.name, "it lies beside the rooms; put it into the folder of one");
            continue;
        }
        for entry in visible(&set.join(&room.name))? {
            let path = format!("{}/{}", room.name, entry.name);
            if !entry.is_dir {
                found.take(path, &room.name, "", &entry);
                continue;
            }
            for file in visible(&set.join(&path))? {
                let path = format!("{path}/{}", file.name);
                if file.is_dir {
                    found.leave_out(&path, "it lies deeper than a drive");
                } else {
                    found.take(path, &room.name, &entry.name, &file);
                }
            }
        }
    }
    found.frames.sort_by(|left, right| left.path.cmp(&right.path));
    Ok(found)
}

impl Found {
    fn take(&mut self, path: String, room: &str, drive: &str, entry: &Entry) {
        let extension = entry.name.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase());
        if extension.is_some_and(|extension| EXTENSIONS.contains(&extension.as_str())) {
            let (room, drive) = (room.to_owned(), drive.to_owned());
            self.frames.push(SetFrame { path, room, drive, bytes: entry.n_bytes });
        } else {
            self.leave_out(
                &path,
                "it is not called as a picture that is read: .jpg, .png, .webp, .bmp or .pgm",
            );
        }
    }

    fn leave_out(&mut self, path: &str, reason: &str) {
        if self.left_out.len() < MAX_LEFT_OUT {
            self.left_out.push(LeftOutFile { path: path.to_owned(), reason: reason.to_owned() });
        }
    }
}

/// Something in a folder.
struct Entry {
    name: String,
    is_dir: bool,
    n_bytes: u64,
}

/// What lies in a folder, by name; what vanishes meanwhile is not there.
fn visible(folder: &Path) -> Result<Vec<Entry>, TeachingError> {
    let mut entries = Vec::new();
    for entry in fs::read_dir(folder).map_err(TeachingError::io(folder))? {
        let entry = entry.map_err(TeachingError::io(folder))?;
        let name = as_text(Path::new(&entry.file_name()));
        // Links lead where operators want them to.
        let Ok(metadata) = fs::metadata(entry.path()) else { continue };
        if !name.starts_with('.') {
            entries.push(Entry { name, is_dir: metadata.is_dir(), n_bytes: metadata.len() });
        }
    }
    entries.sort_by(|left, right| left.name.cmp(&right.name));
    Ok(entries)
}
