//! How sets, rooms, drives and frames may be called: so that each is one folder or file below the set's, and nothing
//! leads elsewhere.

use crate::teaching::TeachingError;
use roomsight_lab::dataset::names::{fault, look, settled};
use roomsight_protocol::version_id::is_name;
use std::path::Path;

/// The longest name of a room or a drive, in bytes.
const MAX_BYTES: usize = 100;

/// What no file system takes in a name, or takes for something else.
const FORBIDDEN: [char; 9] = ['/', '\\', ':', '*', '?', '"', '<', '>', '|'];

/// Where frames are, or go to: names that can be folders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    pub room: String,
    /// Empty: the room's folder itself.
    pub drive: String,
}

impl Place {
    /// # Errors
    /// Names that cannot be folders.
    pub fn new(room: &str, drive: Option<&str>) -> Result<Self, TeachingError> {
        let drive = drive.unwrap_or_default();
        let drive = if drive.is_empty() { String::new() } else { checked(drive, "drive")? };
        Ok(Self { room: check_room(room)?, drive })
    }

    /// The path of a file there, in the set.
    pub fn path_of(&self, file: &str) -> String {
        let parts = [&self.room, &self.drive, file];
        parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("/")
    }
}

/// A frame's path in its set: a room, perhaps a drive, a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FramePath<'a> {
    path: &'a str,
    pub place: Place,
    pub file: &'a str,
}

impl<'a> FramePath<'a> {
    /// # Errors
    /// A path that is none of a frame.
    pub fn parse(path: &'a str) -> Result<Self, TeachingError> {
        let wrong = || {
            TeachingError::Invalid(format!(
                "{path:?} is no path of a frame, which is ROOM/DRIVE/FILE or ROOM/FILE, as GET /v1/sets/SET/frames tells it"
            ))
        };
        let parts: Vec<&str> = path.split('/').collect();
        let is_plain = |part: &&str| {
            !part.is_empty() && !part.starts_with('.') && !part.contains(['\\', '\0']) && part.len() <= 255
        };
        if !parts.iter().all(is_plain) {
            return Err(wrong());
        }
        let (room, drive, file) = match parts[..] {
            [room, file] => (room, "", file),
            [room, drive, file] => (room, drive, file),
            _ => return Err(wrong()),
        };
        let place = Place { room: room.to_owned(), drive: drive.to_owned() };
        Ok(Self { path, place, file })
    }

    /// As it was given.
    pub fn as_str(&self) -> &'a str {
        self.path
    }

    /// The file's name without and with what follows its last dot.
    pub fn stem_and_extension(&self) -> [&'a str; 2] {
        let (stem, extension) = self.file.rsplit_once('.').unwrap_or((self.file, ""));
        [stem, extension]
    }
}

/// A room's name as it is kept.
///
/// # Errors
/// A name that cannot be a folder.
pub fn check_room(name: &str) -> Result<String, TeachingError> {
    checked(name, "room")
}

/// Holds that a set can be called so.
///
/// # Errors
/// A name that could lead elsewhere.
pub fn check_set(name: &str) -> Result<(), TeachingError> {
    if is_name(name) {
        return Ok(());
    }
    Err(TeachingError::Invalid(format!(
        "{name:?} is no name of a data set: use 1 to 64 letters, digits, `-`, `_` and dots inside"
    )))
}

/// Holds that no other room looks the same as this one.
///
/// # Errors
/// One does.
pub fn check_unlike<'a>(room: &str, mut others: impl Iterator<Item = &'a str>) -> Result<(), TeachingError> {
    match others.find(|other| *other != room && look(other) == look(room)) {
        Some(other) => Err(TeachingError::Conflict(format!(
            "there is a room {other:?}, which looks the same as {room:?}: use that name, or another one"
        ))),
        None => Ok(()),
    }
}

/// A name as it is kept.
fn checked(name: &str, what: &str) -> Result<String, TeachingError> {
    let wrong =
        |why: &str| Err(TeachingError::Invalid(format!("{name:?} cannot be the name of a {what}: {why}")));
    let kept = settled(name);
    if fault(&kept).is_some() {
        return wrong("it is empty, or has characters that cannot be seen");
    }
    if kept.len() > MAX_BYTES {
        return wrong("it has more than 100 bytes");
    }
    if kept.starts_with('.') || kept.ends_with('.') || kept.contains(FORBIDDEN) {
        return wrong("leave out / \\ : * ? \" < > | and dots at its ends");
    }
    Ok(kept)
}

/// What a path is called in a set, of a file in its folder.
pub fn as_text(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        for room in ["", " ", "..", ".", "a/b", "a\\b", ".hidden", "a\nb", "x\u{0}", "a:b", &"x".repeat(101)]
        {
            assert!(Place::new(room, None).is_err(), "{room:?}");
            assert!(Place::new("hall", Some(room)).is_err() || room.is_empty(), "{room:?}");
        }
        assert_eq!(Place::new(" living room (2) ", None).unwrap().room, "living room (2)");
        assert_eq!(Place::new("hall", Some("monday")).unwrap().path_of("1.jpg"), "hall/monday/1.jpg");
        assert_eq!(Place::new("hall", None).unwrap().path_of("1.jpg"), "hall/1.jpg");
    }

    #[test]
    fn paths_of_frames_stay_in_their_set() {
        for path in ["", "a", "/a/b", "a//b", "../a/b", "a/../b", "a/b/c/d", "a/.b", "a\\b/c", "a/b\0", "./a"]
        {
            assert!(FramePath::parse(path).is_err(), "{path:?}");
        }
        let path = FramePath::parse("hall/monday/1.2.jpg").unwrap();
        assert_eq!((path.place.drive.as_str(), path.stem_and_extension()), ("monday", ["1.2", "jpg"]));
    }

    #[test]
    fn rooms_that_look_the_same_are_refused() {
        assert!(check_unlike("Kitchen", ["hall", "kitchen"].into_iter()).is_err());
        assert!(check_unlike("kitchen", ["hall", "kitchen"].into_iter()).is_ok());
    }

    proptest! {
        #[test]
        fn whatever_is_taken_is_one_folder(name in "\\PC{0,120}") {
            if let Ok(place) = Place::new(&name, Some(&name)) {
                let path = place.path_of("1.jpg");
                prop_assert_eq!(Path::new(&path).components().count(), 3);
                prop_assert!(FramePath::parse(&path).is_ok());
            }
        }
    }
}
