use super::*;
use crate::engine::doubts::{DoubtedAnswer, DoubtedFrame};
use crate::teaching::Who;
use bytes::Bytes;
use roomsight_protocol::inbox::{Doubt, InboxFilter, InboxQuery, LabeledFrames, LabelsJson, SeenFrame};
use roomsight_protocol::training::PublishedVersion;
use roomsight_vision::image::Limits;
use tempfile::TempDir;

const ANNA: Who = Who("anna");
const BEN: Who = Who("ben");

struct Kept {
    data: TempDir,
    sets: Arc<Sets>,
    inbox: Inbox,
}

fn opened() -> Kept {
    let data = TempDir::new().unwrap();
    let store = Arc::new(Store::open(data.path()).unwrap());
    let sets = Arc::new(Sets::open(data.path(), store.clone(), Limits::default()).unwrap());
    let inbox = Inbox::open(data.path(), store, sets.clone()).unwrap();
    Kept { data, sets, inbox }
}

fn doubted(picture: u8, value: f64) -> DoubtedFrame {
    DoubtedFrame {
        bytes: Bytes::from(vec![0xff, 0xd8, picture]),
        robot: Some("eve".to_owned()),
        key: None,
        answer: DoubtedAnswer {
            room: "hall".to_owned(),
            known: false,
            unknown: None,
            probability: 0.4,
            probabilities: Vec::new(),
            novelty: None,
            model: PublishedVersion { name: "home".to_owned(), version: 1 },
        },
        filtered_room: None,
        shadow_room: None,
        reasons: vec![Doubt::Unknown, Doubt::Torn],
        value,
        said: None,
    }
}

fn seen(frame: &InboxFrame) -> SeenFrame {
    SeenFrame { id: frame.id, revision: frame.revision }
}

fn labels(room: &str, frames: &[&InboxFrame]) -> LabelsJson {
    let frames = frames.iter().map(|frame| seen(frame)).collect();
    LabelsJson { set: "home".to_owned(), room: room.to_owned(), drive: Some("d".to_owned()), frames }
}

#[test]
fn what_teaches_most_comes_first_and_can_be_asked_for_by_reason() {
    let Kept { inbox, data: _data, .. } = opened();
    for (picture, value) in [(1, 0.2), (2, 0.9), (3, 0.5)] {
        inbox.keep(doubted(picture, value)).unwrap();
    }
    let ids = |query: &InboxQuery| -> Vec<i64> {
        inbox.list(query).unwrap().frames.iter().map(|frame| frame.id).collect()
    };
    assert_eq!(ids(&InboxQuery::default()), [2, 3, 1]);
    let second = InboxQuery { after: Some(1), limit: Some(1), ..InboxQuery::default() };
    assert_eq!((ids(&second), inbox.list(&second).unwrap().next), (vec![3], Some(2)));
    assert_eq!(ids(&InboxQuery { reason: Some(Doubt::Torn), ..InboxQuery::default() }).len(), 3);
    assert!(ids(&InboxQuery { reason: Some(Doubt::Wrong), ..InboxQuery::default() }).is_empty());
    assert!(ids(&InboxQuery { state: InboxFilter::Labeled, ..InboxQuery::default() }).is_empty());
    assert_eq!(inbox.picture(2).unwrap().bytes, [0xff, 0xd8, 2]);
}

#[test]
fn the_oldest_without_a_label_go_where_there_is_no_room_with_their_pictures() {
    let Kept { inbox, data, .. } = opened();
    let first = inbox.keep(doubted(1, 0.5)).unwrap();
    inbox.keep(doubted(2, 0.5)).unwrap();
    inbox.label(ANNA, &labels("hall", &[&first])).unwrap();
    let rule = InboxRule { max_frames: 2, ..InboxRule::default() };
    inbox.set_rule(&rule).unwrap();
    inbox.keep(doubted(3, 0.5)).unwrap();
    let all = InboxQuery { state: InboxFilter::All, ..InboxQuery::default() };
    let mut ids: Vec<i64> = inbox.list(&all).unwrap().frames.iter().map(|frame| frame.id).collect();
    ids.sort_unstable();
    assert_eq!(ids, [1, 3], "the labeled one stays");
    assert!(inbox.picture(2).is_err());
    let n_files = |folder: &Path| -> usize {
        let inside = |path: PathBuf| fs::read_dir(path).unwrap().count();
        fs::read_dir(folder).unwrap().map(|entry| inside(entry.unwrap().path())).sum()
    };
    assert_eq!(n_files(&data.path().join(INBOX_FOLDER)), 2);
    for rule in [InboxRule { max_frames: 0, ..rule.clone() }, InboxRule { every_s: f64::NAN, ..rule }] {
        assert!(inbox.set_rule(&rule).is_err(), "{rule:?}");
    }
}

#[test]
fn frames_go_when_they_are_old_and_not_when_the_clock_jumps() {
    let Kept { inbox, data: _data, .. } = opened();
    let age = |days: i64| {
        let ms = days * 24 * 3600 * 1000;
        inbox.store.lock().execute("UPDATE inbox_frame SET at = at - ?1 WHERE id = 1", [ms]).unwrap();
        inbox.tidy().unwrap();
        inbox.list(&InboxQuery::default()).unwrap().frames.len()
    };
    inbox.keep(doubted(1, 0.5)).unwrap();
    inbox.keep(doubted(2, 0.5)).unwrap();
    assert_eq!((age(29), age(2)), (2, 1));
    let year_ms = 365 * 24 * 3600 * 1000;
    let rule = inbox.rule().unwrap();
    inbox.make_room_for(&rule, crate::teaching::store::now_ms() + year_ms).unwrap();
    assert_eq!(inbox.list(&InboxQuery::default()).unwrap().frames.len(), 1, "a year in a moment is none");
}

#[test]
fn a_picture_that_two_frames_have_goes_with_the_last_of_them() {
    let Kept { inbox, data: _data, .. } = opened();
    let frames = [inbox.keep(doubted(1, 0.5)).unwrap(), inbox.keep(doubted(1, 0.5)).unwrap()];
    assert_eq!(inbox.discard(&[seen(&frames[0])]).unwrap(), 1);
    assert!(inbox.picture(frames[1].id).is_ok());
    assert_eq!(inbox.discard(&[seen(&frames[1])]).unwrap(), 1);
    assert!(inbox.picture(frames[1].id).is_err());
}

#[test]
fn of_two_who_label_a_frame_the_first_one_does_and_the_other_is_told() {
    let Kept { inbox, sets, data } = opened();
    let frame = inbox.keep(doubted(1, 0.5)).unwrap();
    let other = inbox.keep(doubted(2, 0.5)).unwrap();
    let labeled = inbox.label(ANNA, &labels("hall", &[&frame])).unwrap();
    let path = labeled.labeled[0].label.clone().unwrap().path;
    assert!(data.path().join("sets/home").join(&path).is_file());
    let late = inbox.label(BEN, &labels("kitchen", &[&frame, &other])).unwrap();
    assert_eq!((late.labeled.len(), late.labeled[0].id), (1, other.id));
    let conflict = &late.conflicts[0];
    assert_eq!(conflict.label.as_ref().map(|label| label.by.as_str()), Some("anna"));
    assert!(conflict.reason.contains("anna"), "{conflict:?}");
    assert_eq!(inbox.discard(&[seen(&frame)]).unwrap(), 0, "it was changed since");
    assert!(data.path().join("sets/home").join(&path).is_file());
    // What is undone is open again.
    sets.undo("home", labeled.change.unwrap()).unwrap();
    inbox.forget_labels("home").unwrap();
    let open = inbox.list(&InboxQuery::default()).unwrap();
    assert_eq!((open.open, open.frames[0].id, open.frames[0].revision), (1, frame.id, 2));
    assert!(inbox.picture(frame.id).is_ok());
}

#[test]
fn a_picture_that_the_set_has_in_another_room_moves_and_comes_back_when_that_is_undone() {
    let Kept { inbox, sets, data } = opened();
    let frames = [inbox.keep(doubted(1, 0.5)).unwrap(), inbox.keep(doubted(1, 0.5)).unwrap()];
    let path = |labeled: &LabeledFrames| labeled.labeled[0].label.clone().unwrap().path;
    let first = inbox.label(ANNA, &labels("hall", &[&frames[0]])).unwrap();
    let second = inbox.label(BEN, &labels("kitchen", &[&frames[1]])).unwrap();
    let is_there = |path: &str| data.path().join("sets/home").join(path).is_file();
    assert!(path(&second).starts_with("kitchen/") && is_there(&path(&second)) && !is_there(&path(&first)));
    sets.undo("home", second.change.unwrap()).unwrap();
    assert!(is_there(&path(&first)) && !is_there(&path(&second)));
}

#[test]
fn labels_with_names_that_cannot_be_label_nothing() {
    let Kept { inbox, data, .. } = opened();
    let frame = inbox.keep(doubted(1, 0.5)).unwrap();
    for room in ["../../x", "", "a/b"] {
        assert!(inbox.label(ANNA, &labels(room, &[&frame])).is_err(), "{room}");
    }
    assert!(inbox.label(ANNA, &labels("hall", &[])).is_err());
    assert_eq!(fs::read_dir(data.path().join("sets")).unwrap().count(), 0);
}
