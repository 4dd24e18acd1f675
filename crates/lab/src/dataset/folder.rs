//! A folder a room: `kitchen/*.jpg`, or `kitchen/SEQUENCE/*.jpg`, with folders around them or splits above or
//! below them as other tools lay them out.

use super::tree::Tree;
use super::{Dataset, DatasetError, Format, Frame, Problem, names};
use roomsight_vision::camera::CameraKind;
use std::path::PathBuf;

/// What other tools call the splits of a data set, in lower case.
const SPLITS: [&str; 11] = [
    "dev",
    "eval",
    "evaluation",
    "holdout",
    "test",
    "testing",
    "train",
    "training",
    "val",
    "valid",
    "validation",
];

/// What cameras call the folder of all their pictures.
const CAMERA_FOLDER: &str = "dcim";

/// Reads a folder of rooms. `rooms` are known to be ones: a single folder of such a name is a room, not a
/// folder around rooms. Frames that lie beside the rooms or deeper than a sequence are problems.
pub fn read(tree: &Tree, rooms: &[String]) -> Result<Dataset, DatasetError> {
    let mut dataset = Dataset::new(&tree.path, Format::Folder);
    dataset.problems.extend(tree.all_unreadable().into_iter().chain(tree.all_left_out()).cloned());
    let reader = Reader { rooms };
    let level = reader.unwrapped(tree);
    if level.path != tree.path {
        dataset.note(&level.path, "the folders in it are taken as the rooms");
    }
    report_lists(&mut dataset, tree);
    if reader.is_split(level)? {
        dataset.note(&level.path, split_note(level));
        add_strays(&mut dataset, level);
        for split in level.with_pictures() {
            add_rooms(&mut dataset, reader.unwrapped(split), &split.name());
        }
    } else {
        add_rooms(&mut dataset, level, "");
    }
    if dataset.frames.is_empty() { Err(unknown(tree, &dataset)) } else { Ok(dataset) }
}

struct Reader<'a> {
    rooms: &'a [String],
}

impl Reader<'_> {
    /// The folder that the rooms or splits lie in: the one given, or one in it when that is all there is.
    fn unwrapped<'t>(&self, tree: &'t Tree) -> &'t Tree {
        let mut level = tree;
        while let Some(inner) = self.wrapped(level) {
            level = inner;
        }
        level
    }

    /// The only folder in `tree` that holds pictures, where several folders with pictures lie in it: as a room
    /// it would be the only one.
    fn wrapped<'t>(&self, tree: &'t Tree) -> Option<&'t Tree> {
        let [only] = tree.with_pictures()[..] else { return None };
        // A folder beside it that is empty, or holds what cannot be read here, is a room too.
        let is_alone = tree.unreadable.is_empty()
            && tree.folders.iter().all(|folder| std::ptr::eq(folder, only) || !folder.may_be_room());
        let is_wrapping = is_alone && tree.pictures.is_empty() && branches(only) && !self.is_named(only);
        is_wrapping.then_some(only)
    }

    /// Whether the name says what the folder is: a room, a split, a camera's.
    fn is_named(&self, folder: &Tree) -> bool {
        self.is_room(folder) || is_split_name(&folder.name()) || is_camera_folder(folder)
    }

    fn is_room(&self, folder: &Tree) -> bool {
        self.rooms.contains(&names::settled(&folder.name()))
    }

    /// Whether the folders in `level` are splits with rooms in them.
    fn is_split(&self, level: &Tree) -> Result<bool, DatasetError> {
        let folders = level.with_pictures();
        let is_split = |folder: &&&Tree| is_split_name(&folder.name()) && !self.is_room(folder);
        let (splits, others): (Vec<&Tree>, Vec<&Tree>) = folders.iter().partition(|folder| is_split(folder));
        let fail = |reason: String| Err(DatasetError::Splits { path: level.path.clone(), reason });
        let has_rooms = |split: &&Tree| !split.with_pictures().is_empty();
        match (&splits[..], &others[..]) {
            ([], _) => Ok(false),
            (_, []) if splits.iter().any(has_rooms) => Ok(true),
            ([first, ..], []) => fail(format!(
                "{} are no rooms, but pictures lie in them directly: put those of each room into a folder of \
                 its name, as {}/kitchen/1.jpg",
                quoted(&splits),
                first.name()
            )),
            // One such name beside rooms may well be a room.
            ([_], _) => Ok(false),
            (_, others) if splits.iter().all(has_rooms) => fail(format!(
                "{} look like splits with rooms in them, but {} lies beside them: move it away, or give one of \
                 the folders alone",
                quoted(&splits),
                quoted(&others[..1])
            )),
            _ => Ok(false),
        }
    }
}

/// Whether several folders with pictures lie in it, or in the only one in it, and no picture directly.
fn branches(folder: &Tree) -> bool {
    folder.pictures.is_empty()
        && match folder.with_pictures()[..] {
            [only] => branches(only),
            ref folders => folders.len() > 1,
        }
}

fn is_split_name(name: &str) -> bool {
    SPLITS.contains(&name.to_lowercase().as_str())
}

fn is_camera_folder(folder: &Tree) -> bool {
    folder.name().eq_ignore_ascii_case(CAMERA_FOLDER)
}

fn quoted(folders: &[&Tree]) -> String {
    folders.iter().map(|folder| format!("`{}`", folder.name())).collect::<Vec<_>>().join(" and ")
}

fn split_note(level: &Tree) -> String {
    let splits = quoted(&level.with_pictures());
    format!("{splits} are taken as splits, the folders in them as rooms; --split takes one of them alone")
}

fn add_rooms(dataset: &mut Dataset, level: &Tree, split: &str) {
    add_strays(dataset, level);
    for folder in &level.folders {
        if is_camera_folder(folder) {
            leave_out(
                dataset,
                folder.all_pictures(),
                "in a camera's folder: put it into the folder of a room",
            );
            continue;
        }
        let Some(room) = folder.path.file_name().and_then(|name| name.to_str()) else {
            leave_out(
                dataset,
                folder.all_pictures(),
                "the name of its room is not UTF-8: rename that folder",
            );
            continue;
        };
        let labels = Labels { room, sequence: "", split };
        if folder.has_pictures() {
            add_room(dataset, folder, &labels);
        } else {
            dataset.report(&folder.path, "a room without a frame");
        }
    }
}

fn add_strays(dataset: &mut Dataset, level: &Tree) {
    leave_out(dataset, level.pictures.iter().collect(), "not in the folder of a room");
}

/// What the folders say of the frames in them.
#[derive(Clone, Copy)]
struct Labels<'a> {
    room: &'a str,
    sequence: &'a str,
    split: &'a str,
}

/// Adds the frames of a room, or of a split of it.
fn add_room(dataset: &mut Dataset, room: &Tree, labels: &Labels) {
    add_frames(dataset, room, labels);
    let folders = room.with_pictures();
    let are_splits = labels.split.is_empty() && folders.iter().all(|folder| is_split_name(&folder.name()));
    for folder in folders {
        if is_camera_folder(folder) {
            add_room(dataset, folder, labels);
        } else if are_splits {
            add_room(dataset, folder, &Labels { split: &folder.name(), ..*labels });
        } else if let Some(sequence) = folder.path.file_name().and_then(|name| name.to_str()) {
            add_frames(dataset, folder, &Labels { sequence, ..*labels });
            for deeper in &folder.folders {
                leave_out(dataset, deeper.all_pictures(), "deeper than ROOM/SEQUENCE, not read");
            }
        } else {
            let reason = "the name of its sequence is not UTF-8: rename that folder";
            leave_out(dataset, folder.all_pictures(), reason);
        }
    }
}

fn add_frames(dataset: &mut Dataset, folder: &Tree, labels: &Labels) {
    dataset.frames.extend(folder.pictures.iter().map(|path| Frame {
        path: path.clone(),
        room: labels.room.to_owned(),
        sequence: labels.sequence.to_owned(),
        camera: CameraKind::Perspective,
        split: labels.split.to_owned(),
        time: None,
        pose: None,
        odometry: None,
        scan: None,
        recorded: None,
    }));
}

fn leave_out(dataset: &mut Dataset, pictures: Vec<&PathBuf>, reason: &str) {
    dataset.problems.extend(pictures.into_iter().map(|picture| Problem::new(picture, reason)));
}

fn report_lists(dataset: &mut Dataset, tree: &Tree) {
    for list in &tree.lists {
        dataset.report(list, "a list, not read: give it itself in place of the folder, if it names frames");
    }
    tree.folders.iter().for_each(|folder| report_lists(dataset, folder));
}

/// Why nothing could be read.
fn unknown(tree: &Tree, dataset: &Dataset) -> DatasetError {
    let why = match (&tree.pictures[..], dataset.problems.first()) {
        ([first, ..], _) if tree.folders.is_empty() => format!(
            "pictures lie in it directly, such as {}: put those of each room into a folder of its name",
            first.display()
        ),
        (_, Some(first)) => format!("no picture in the folder of a room; {first}"),
        (_, None) => "no picture in it".to_owned(),
    };
    DatasetError::UnknownLayout { path: tree.path.clone(), why }
}
