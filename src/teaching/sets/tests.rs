use super::*;
use crate::teaching::Who;
use bytes::Bytes;
use image::{GrayImage, ImageFormat, Luma};
use proptest::prelude::*;
use roomsight_protocol::sets::ChangeJson;
use std::io::Cursor;
use tempfile::TempDir;

const ANNA: Who = Who("anna");

struct Opened {
    data: TempDir,
    sets: Sets,
}

fn opened() -> Opened {
    let data = TempDir::new().unwrap();
    let sets = open(data.path());
    sets.create("home").unwrap();
    Opened { data, sets }
}

fn open(data: &Path) -> Sets {
    Sets::open(data, Arc::new(Store::open(data).unwrap()), Limits::default()).unwrap()
}

fn picture(shade: u8) -> NewFrame {
    let mut bytes = Cursor::new(Vec::new());
    GrayImage::from_pixel(8, 8, Luma([shade])).write_to(&mut bytes, ImageFormat::Png).unwrap();
    NewFrame { name: format!("{shade}.png"), bytes: Bytes::from(bytes.into_inner()) }
}

fn add(sets: &Sets, room: &str, shades: &[u8]) -> Vec<String> {
    let pictures: Vec<NewFrame> = shades.iter().map(|&shade| picture(shade)).collect();
    sets.add("home", ANNA, &Place::new(room, Some("monday")).unwrap(), &pictures).unwrap().added
}

fn paths(sets: &Sets) -> Vec<String> {
    let frames = sets.frames("home", &FramesQuery::default()).unwrap().frames;
    frames.into_iter().map(|frame| frame.path).collect()
}

#[test]
fn new_frames_lie_in_their_room_and_copies_and_others_are_named() {
    let Opened { data, sets } = opened();
    let place = Place::new("hall", Some("monday")).unwrap();
    let text = NewFrame { name: "<b>notes</b>.txt".to_owned(), bytes: Bytes::from_static(b"no picture") };
    let sent = [picture(1), picture(2), picture(1), text];
    let result = sets.add("home", ANNA, &place, &sent).unwrap();
    assert_eq!((result.added.len(), result.copies.len(), result.refused.len()), (2, 1, 1));
    assert_eq!((result.copies[0].name.as_str(), &result.copies[0].path), ("1.png", &result.added[0]));
    assert_eq!(result.refused[0].name, "<b>notes</b>.txt");
    assert!(result.added.iter().all(|path| data.path().join("sets/home").join(path).is_file()));
    let elsewhere = sets.add("home", ANNA, &Place::new("Hall", None).unwrap(), &[picture(3)]);
    assert!(matches!(elsewhere, Err(TeachingError::Conflict(_))), "two rooms that look the same");
    let info = sets.show("home").unwrap();
    assert_eq!((info.rooms[0].frames, info.rooms[0].drives[0].name.as_str()), (2, "monday"));
    assert!(info.advice[0].contains("one other room"), "{:?}", info.advice);
    assert_eq!(sets.picture("home", &result.added[0]).unwrap().media_type, "image/png");
    for path in ["../roomsight.db", "hall/../../roomsight.db", "hall/monday/none.png"] {
        assert!(sets.picture("home", path).is_err(), "{path}");
    }
}

#[test]
fn a_change_is_done_as_a_whole_and_can_be_undone() {
    let Opened { sets, data: _data } = opened();
    let [hall, kitchen] = [add(&sets, "hall", &[1, 2]), add(&sets, "kitchen", &[3])];
    let before = paths(&sets);
    let change = |change| sets.change("home", ANNA, change);
    let frames = vec![hall[0].clone(), "hall/monday/gone.png".to_owned()];
    let gone = change(ChangeJson::Move { frames, room: "kitchen".to_owned(), drive: None });
    assert!(matches!(gone, Err(TeachingError::Conflict(_))));
    assert_eq!(paths(&sets), before, "nothing is changed");
    let merged =
        change(ChangeJson::RenameRoom { room: "hall".to_owned(), to: "kitchen".to_owned() }).unwrap();
    assert_eq!((merged.frames, sets.show("home").unwrap().rooms.len()), (2, 1));
    let removed = change(ChangeJson::Remove { frames: kitchen }).unwrap();
    assert_eq!(paths(&sets).len(), 2);
    for id in [removed.id, merged.id] {
        assert!(sets.undo("home", id).unwrap().undone);
    }
    assert_eq!(paths(&sets), before);
    assert!(matches!(sets.undo("home", merged.id), Err(TeachingError::Conflict(_))), "undone already");
    let newest = &sets.show("home").unwrap().changes[0];
    assert_eq!((newest.action.as_str(), newest.undone, newest.by.as_str()), ("remove", true, "anna"));
}

#[test]
fn what_was_moved_since_is_undone_in_order_only() {
    let Opened { sets, data: _data } = opened();
    let frames = add(&sets, "hall", &[1]);
    let to = |room: &str, frames: Vec<String>| {
        sets.change("home", ANNA, ChangeJson::Move { frames, room: room.to_owned(), drive: None }).unwrap()
    };
    let first = to("kitchen", frames);
    let second = to("attic", paths(&sets));
    assert!(matches!(sets.undo("home", first.id), Err(TeachingError::Conflict(_))));
    sets.undo("home", second.id).unwrap();
    sets.undo("home", first.id).unwrap();
}

#[test]
fn names_that_are_taken_get_a_number() {
    let Opened { sets, data } = opened();
    for drive in ["a", "b"] {
        let folder = data.path().join("sets/home/hall").join(drive);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("0001.png"), picture(1).bytes).unwrap();
    }
    let change = ChangeJson::RenameDrive { room: "hall".into(), drive: "b".into(), to: "a".into() };
    sets.change("home", ANNA, change).unwrap();
    assert_eq!(paths(&sets), ["hall/a/0001-2.png", "hall/a/0001.png"]);
}

#[test]
fn a_set_that_vanishes_is_told() {
    let Opened { sets, data } = opened();
    add(&sets, "hall", &[1]);
    fs::remove_dir_all(data.path().join("sets/home")).unwrap();
    assert!(matches!(sets.show("home"), Err(TeachingError::Absent(_))));
    let added = sets.add("home", ANNA, &Place::new("hall", None).unwrap(), &[picture(2)]);
    assert!(matches!(added, Err(TeachingError::Absent(_))));
    assert!(sets.list().unwrap().sets.is_empty());
    assert!(matches!(sets.undo("home", 1), Err(TeachingError::Absent(_))));
}

#[test]
fn sets_are_named_so_that_they_are_one_folder() {
    let Opened { sets, data: _data } = opened();
    for name in ["", "..", "a/b", ".x", "a b"] {
        assert!(sets.create(name).is_err(), "{name}");
    }
    assert!(!sets.create("home").unwrap());
    assert!(matches!(sets.create("Home"), Err(TeachingError::Conflict(_))));
    sets.remove("home").unwrap();
    assert!(sets.list().unwrap().sets.is_empty());
}

#[test]
fn pages_of_frames_follow_each_other() {
    let Opened { sets, data: _data } = opened();
    add(&sets, "hall", &[1, 2, 3, 4, 5]);
    let mut query = FramesQuery { limit: Some(2), ..FramesQuery::default() };
    let mut seen = Vec::new();
    loop {
        let list = sets.frames("home", &query).unwrap();
        assert_eq!(list.total, 5);
        seen.extend(list.frames.into_iter().map(|frame| frame.path));
        let Some(next) = list.next else { break };
        query.after = Some(next);
    }
    assert_eq!(seen, paths(&sets));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// A process that is killed after any number of moves of a change: the next one finishes it.
    #[test]
    fn a_change_that_was_begun_is_finished_at_the_next_start(n_frames in 1_usize..6, n_done in 0_usize..6, undoes: bool) {
        let Opened { data, sets } = opened();
        let shades: Vec<u8> = (0..n_frames as u8).collect();
        add(&sets, "hall", &shades);
        let before = paths(&sets);
        let change = ChangeJson::RenameRoom { room: "hall".into(), to: "kitchen".into() };
        let change = sets.change("home", ANNA, change).unwrap();
        let after = paths(&sets);
        drop(sets);
        // As it was left in the middle.
        let at = |path: &String| data.path().join("sets/home").join(path);
        for (from, to) in before.iter().zip(&after).skip(n_done) {
            fs::create_dir_all(at(from).parent().unwrap()).unwrap();
            fs::rename(at(to), at(from)).unwrap();
        }
        let state = if undoes { "undoing" } else { "begun" };
        let store = Store::open(data.path()).unwrap();
        store.lock().execute("UPDATE set_change SET state = ?1 WHERE id = ?2", (state, change.id)).unwrap();
        drop(store);
        let sets = open(data.path());
        prop_assert_eq!(paths(&sets), if undoes { before } else { after });
        prop_assert_eq!(sets.show("home").unwrap().changes[0].undone, undoes);
    }
}
