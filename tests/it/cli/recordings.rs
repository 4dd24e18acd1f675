//! Recordings in the commands.

use super::{FAILED, LAB, N_FRAMES, QUICK, ROOMS, done, json, path, refused};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use roomsight_recording::write::JsonRecording;
use roomsight_recording::{Recording, Topic};
use serde_json::json as value;
use std::fs;
use tempfile::TempDir;

/// A recording of a robot that goes from room to room, a picture a second.
fn recorded(folder: &TempDir) -> String {
    let path = folder.path().join("run.mcap");
    let mut recording = JsonRecording::create(&path).unwrap();
    let schema = value!({"type": "object"});
    let camera = recording.channel("/camera", "foxglove.CompressedImage", &schema).unwrap();
    let mut labels = "time,room\n".to_owned();
    let mut seconds = 0;
    for room in ROOMS {
        labels += &format!("{seconds},{room}\n");
        for shift in 0..N_FRAMES {
            let picture = fs::read(format!("{}/{room}/{shift}.png", LAB.data())).unwrap();
            let timestamp = value!({"sec": seconds + 5, "nsec": 0});
            let data = BASE64_STANDARD.encode(picture);
            let message =
                value!({"timestamp": timestamp, "frame_id": "camera", "format": "png", "data": data});
            recording.write(camera, seconds * 1_000_000_000, &message).unwrap();
            seconds += 1;
        }
    }
    recording.finish().unwrap();
    fs::write(folder.path().join("run.rooms.csv"), labels).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_recording_trains_and_is_evaluated() {
    let folder = TempDir::new().unwrap();
    let run = recorded(&folder);
    let model = path(&folder, "model");
    done(&[&["train", &run, "--output", &model], &QUICK[..]].concat());
    let evaluated = json(&["evaluate", &LAB.model(), &run, "--json"]);
    assert_eq!(
        evaluated["evaluation"]["overall"]["n_frames"],
        ROOMS.len() * N_FRAMES as usize,
        "{evaluated}"
    );
    let told = refused(FAILED, &["train", &run, "--output", &path(&folder, "other"), "--topic", "/cam"]);
    assert!(told.contains("/camera (foxglove.CompressedImage)"), "{told}");
    let topics = json(&["inspect", &run, "--json"]);
    assert_eq!(topics["topics"][0]["n_messages"], ROOMS.len() * N_FRAMES as usize, "{topics}");
    assert!(done(&["inspect", &run]).contains("/camera"));
}

#[test]
fn answers_lie_beside_their_pictures() {
    let folder = TempDir::new().unwrap();
    let (run, answers) = (recorded(&folder), path(&folder, "answers.mcap"));
    done(&["recognize", &LAB.model(), &run, "--output", &answers]);
    let recording = Recording::open(answers.as_ref()).unwrap();
    let names: Vec<&str> = recording.topics().iter().map(|topic: &Topic| topic.name.as_str()).collect();
    assert_eq!(names, ["/camera", "/roomsight/annotations", "/roomsight/answer", "/roomsight/probabilities"]);
    let (messages, _) = recording.messages(&[2]).unwrap();
    assert_eq!(messages.len(), ROOMS.len() * N_FRAMES as usize);
    let read = |idx: usize| -> serde_json::Value {
        serde_json::from_slice(&recording.read(&messages[idx]).unwrap()).unwrap()
    };
    let first = read(0);
    assert_eq!((&first["room"], &first["labeled_room"]), (&ROOMS[0].into(), &ROOMS[0].into()), "{first}");
    assert_eq!((messages[1].time_ns, &read(1)["timestamp"]["sec"]), (1_000_000_000, &6.into()));
    assert_eq!(read(messages.len() - 1)["filtered_room"], ROOMS[2]);
    let again = refused(FAILED, &["recognize", &LAB.model(), &run, "--output", &answers]);
    assert!(again.contains("exists already"), "{again}");
    let no_recording =
        refused(FAILED, &["recognize", &LAB.model(), &LAB.frame("bars"), "--output", "x.mcap"]);
    assert!(no_recording.contains("takes one recording"), "{no_recording}");
}
