//! `stream`: a camera that is followed. What goes through ffmpeg is left out where that is not installed.

use super::{FAILED, LAB, ROOMS, done, frame, path, refused};
use image::ImageFormat;
use serde_json::Value;
use std::io::{BufRead, BufReader, Cursor, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;
use tempfile::TempDir;

/// Pictures of a connection to a camera, and the time between two.
const N_PICTURES: u32 = 12;
const GAP: Duration = Duration::from_millis(50);

fn has_ffmpeg() -> bool {
    let is_there =
        Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !is_there {
        eprintln!("LEFT OUT: cameras and videos. They take ffmpeg, Debian's package ffmpeg.");
    }
    is_there
}

fn jpeg(room: &str, shift: u32) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    frame(room, 7 * shift).write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
    bytes.into_inner()
}

fn lines(printed: &str) -> Vec<Value> {
    printed.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn a_folder_of_pictures_is_followed() {
    let folder = TempDir::new().unwrap();
    for (idx, room) in ROOMS.iter().enumerate() {
        for shift in 0..4 {
            frame(room, 7 * shift).save(folder.path().join(format!("{idx}{shift}.png"))).unwrap();
        }
    }
    let (source, model) = (path(&folder, ""), LAB.model());
    let told = lines(&done(&["stream", "--source", &source, "--model", &model, "--fps", "20", "--json"]));
    // The latest waits: on a busy machine some are passed over.
    assert!((1..=12).contains(&told.len()), "{told:?}");
    assert_eq!(told.last().unwrap()["frame_room"], ROOMS[2]);
    let printed = done(&["stream", "--source", &source, "--model", &model, "--fps", "20"]);
    assert!(printed.lines().last().unwrap().contains(ROOMS[2]), "{printed}");
}

#[test]
fn a_source_that_is_none_is_named() {
    let model = LAB.model();
    let told = |source: &str| refused(FAILED, &["stream", "--source", source, "--model", &model]);
    assert!(told("/dev/video97").contains("no such device"));
    let picture = LAB.frame("bars");
    let arguments = ["stream", "--source", &picture, "--model", &model, "--ffmpeg", "no-such-program"];
    assert!(refused(FAILED, &arguments).contains("install ffmpeg"));
    if has_ffmpeg() {
        let no_video = format!("{model}/model.json");
        assert!(told(&no_video).contains("gives no picture"));
    }
}

/// A camera of a network: to each connection a few pictures, of one room at first, then of another.
fn serve_camera(listener: &TcpListener) {
    let send = |mut socket: TcpStream, room: &str| {
        let _ = socket.read(&mut [0; 4096]);
        let head = "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=frame\r\n\r\n";
        socket.write_all(head.as_bytes())?;
        for shift in 0..N_PICTURES {
            let picture = jpeg(room, shift);
            let head =
                format!("--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", picture.len());
            socket.write_all(&[head.as_bytes(), &picture, b"\r\n"].concat())?;
            thread::sleep(GAP);
        }
        std::io::Result::Ok(())
    };
    // The first looks what the camera gives, the second looks through it.
    for (number, socket) in listener.incoming().enumerate() {
        let room = if number < 2 { ROOMS[0] } else { ROOMS[2] };
        thread::spawn(move || send(socket.unwrap(), room));
    }
}

#[test]
fn a_camera_that_stops_is_tried_again() {
    if !has_ffmpeg() {
        return;
    }
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}/camera", listener.local_addr().unwrap());
    thread::spawn(move || serve_camera(&listener));
    let mut process = Command::new(env!("CARGO_BIN_EXE_roomsight"))
        .args(["stream", "--json", "--source", &url, "--model", &LAB.model(), "--fps", "100"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut seen: Vec<String> = Vec::new();
    for line in BufReader::new(process.stdout.take().unwrap()).lines() {
        let told: Value = serde_json::from_str(&line.unwrap()).unwrap();
        let room = told["frame_room"].as_str().unwrap().to_owned();
        if seen.last() != Some(&room) {
            seen.push(room);
        }
        if seen.len() > 1 {
            break;
        }
    }
    process.kill().unwrap();
    process.wait().unwrap();
    assert_eq!(seen, [ROOMS[0], ROOMS[2]]);
}
