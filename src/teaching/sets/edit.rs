//! What people change of a set: frames move or go, rooms and drives get other names.

use super::change::{Move, Planned};
use super::folder::Found;
use super::names::{FramePath, Place, check_unlike};
use super::{SETS_FOLDER, Sets};
use crate::teaching::{TeachingError, Who};
use roomsight_protocol::sets::{ChangeJson, SetChange, SetFrame};
use std::collections::BTreeSet;

/// The most frames that one change names.
const MAX_FRAMES: usize = 20_000;

/// A change on its way: where each frame goes.
struct Wanted {
    action: &'static str,
    text: String,
    /// Where each goes; none: out of the set.
    frames: Vec<(String, Option<Place>)>,
}

impl Sets {
    /// Changes a set.
    ///
    /// # Errors
    /// Frames, rooms or drives that are not there (any more), names that cannot be: nothing is changed then.
    pub fn change(&self, set: &str, who: Who, change: ChangeJson) -> Result<SetChange, TeachingError> {
        let _changing = self.changing();
        let found = self.found(set)?;
        let wanted = Wanted::of(change, &found)?;
        if wanted.frames.is_empty() {
            return Err(TeachingError::Invalid("it names no frame that would change".to_owned()));
        }
        let moves = self.moves(set, &found, &wanted)?;
        self.journal.make(who, Planned { set, action: wanted.action, text: wanted.text, moves })
    }

    /// The files that move. Names that are taken where they go get a number.
    fn moves(&self, set: &str, found: &Found, wanted: &Wanted) -> Result<Vec<Move>, TeachingError> {
        let mut taken: BTreeSet<String> = found.frames.iter().map(|frame| frame.path.clone()).collect();
        let mut grave = None;
        let mut moves = Vec::with_capacity(wanted.frames.len());
        for (path, place) in &wanted.frames {
            let frame = FramePath::parse(path)?;
            let to = match place {
                Some(place) => {
                    check_unlike(&place.room, found.rooms())?;
                    format!("{SETS_FOLDER}/{set}/{}", free(&frame, place, &mut taken))
                }
                None => {
                    let grave = match &grave {
                        Some(grave) => grave,
                        None => grave.insert(self.journal.relative(&self.journal.new_grave()?)),
                    };
                    format!("{grave}/{path}")
                }
            };
            moves.push(Move { from: format!("{SETS_FOLDER}/{set}/{path}"), to });
        }
        Ok(moves)
    }
}

impl Wanted {
    fn of(change: ChangeJson, found: &Found) -> Result<Self, TeachingError> {
        match change {
            ChangeJson::Move { frames, room, drive } => {
                let place = Place::new(&room, drive.as_deref())?;
                let text = format!("{} to {}", counted(frames.len()), place.room);
                let mut moved = Vec::new();
                for frame in named(&frames, found)? {
                    let own = if drive.is_some() { &place.drive } else { &frame.drive };
                    let place = Place { room: place.room.clone(), drive: own.clone() };
                    if place.room != frame.room || place.drive != frame.drive {
                        moved.push((frame.path.clone(), Some(place)));
                    }
                }
                Ok(Self { action: "move", text, frames: moved })
            }
            ChangeJson::Remove { frames } => {
                let gone = named(&frames, found)?.into_iter().map(|frame| (frame.path.clone(), None));
                Ok(Self { action: "remove", text: counted(frames.len()), frames: gone.collect() })
            }
            ChangeJson::RenameRoom { room, to } => {
                let place = Place::new(&to, None)?;
                let text = format!("{room} to {}", place.room);
                let renamed =
                    |frame: &SetFrame| Place { room: place.room.clone(), drive: frame.drive.clone() };
                let is_same = place.room == room;
                let frames =
                    some(found.of_room(&room).filter(|_| !is_same), &format!("room {room:?}"), renamed)?;
                Ok(Self { action: "rename_room", text, frames })
            }
            ChangeJson::RenameDrive { room, drive, to } => {
                let place = Place::new(&room, Some(&to))?;
                let text = format!("{room}/{drive} to {}", place.drive);
                let of_drive =
                    found.of_room(&room).filter(|frame| frame.drive == drive && place.drive != drive);
                let frames = some(of_drive, &format!("drive {drive:?} in {room:?}"), |_| place.clone())?;
                Ok(Self { action: "rename_drive", text, frames })
            }
            ChangeJson::RemoveRoom { room } => {
                let gone = some(found.of_room(&room), &format!("room {room:?}"), |_| ())?;
                let frames = gone.into_iter().map(|(path, _)| (path, None)).collect();
                Ok(Self { action: "remove_room", text: room, frames })
            }
        }
    }
}

/// The frames of these paths.
fn named<'a>(paths: &[String], found: &'a Found) -> Result<Vec<&'a SetFrame>, TeachingError> {
    if paths.len() > MAX_FRAMES {
        return Err(TeachingError::Invalid(format!("it names more than {MAX_FRAMES} frames")));
    }
    let unique: BTreeSet<&String> = paths.iter().collect();
    let frame = |path: &String| {
        let idx = found.frames.binary_search_by(|frame| frame.path.as_str().cmp(path));
        let gone = || {
            TeachingError::Conflict(format!(
                "the frame {path:?} is not there any more; look again, then decide"
            ))
        };
        idx.map(|idx| &found.frames[idx]).map_err(|_| gone())
    };
    unique.into_iter().map(frame).collect()
}

/// Where frames go, of which there must be one.
fn some<'a, P>(
    frames: impl Iterator<Item = &'a SetFrame>,
    what: &str,
    place: impl Fn(&SetFrame) -> P,
) -> Result<Vec<(String, Option<P>)>, TeachingError> {
    let frames: Vec<_> = frames.map(|frame| (frame.path.clone(), Some(place(frame)))).collect();
    if frames.is_empty() {
        return Err(TeachingError::Conflict(format!(
            "there is no {what} to be changed so; look again, then decide"
        )));
    }
    Ok(frames)
}

/// A path there that is not taken, which is taken from now on.
fn free(frame: &FramePath, place: &Place, taken: &mut BTreeSet<String>) -> String {
    let [stem, extension] = frame.stem_and_extension();
    let numbered = |number: usize| match number {
        1 => place.path_of(frame.file),
        _ => place.path_of(&format!("{stem}-{number}.{extension}")),
    };
    // One of so many is free.
    let path = (1..=taken.len() + 1).map(numbered).find(|path| !taken.contains(path)).unwrap_or_default();
    taken.insert(path.clone());
    path
}

fn counted(n_frames: usize) -> String {
    if n_frames == 1 { "1 frame".to_owned() } else { format!("{n_frames} frames") }
}
