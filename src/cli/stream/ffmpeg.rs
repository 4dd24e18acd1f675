//! The program ffmpeg, which reads cameras and videos.

use anyhow::{Context, bail};
use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use tokio::process::{Child, Command};

/// The most words of what ffmpeg says that are passed on.
const MAX_SAID: usize = 400;

/// What ffmpeg looks through.
#[derive(Clone, Debug)]
pub(super) struct Camera {
    /// What is opened, as ffmpeg has it.
    pub(super) input: String,
    /// The program.
    pub(super) ffmpeg: PathBuf,
    /// Pictures a second at most.
    pub(super) rate: f64,
}

/// What a camera gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Gives {
    /// JPEGs, which are passed on as they are.
    Jpegs,
    /// Something that is decoded.
    Video,
}

impl Camera {
    pub(super) fn is_device(&self) -> bool {
        self.input.starts_with("/dev/")
    }

    pub(super) fn is_address(&self) -> bool {
        self.input.contains("://")
    }

    /// Whether it goes on without an end: a camera that stops is out of reach.
    pub(super) fn is_live(&self) -> bool {
        self.is_device() || self.is_address()
    }

    /// How ffmpeg opens it, to be had in JPEGs where a device can be asked for these.
    fn opening(&self, asks_for_jpegs: bool) -> Vec<OsString> {
        let mut words: Vec<&str> = Vec::new();
        if self.is_device() {
            words.extend(["-f", "v4l2"]);
            if asks_for_jpegs {
                words.extend(["-input_format", "mjpeg"]);
            }
        } else if self.input.starts_with("rtsp") {
            // Packets that are lost make pictures that are damaged.
            words.extend(["-rtsp_transport", "tcp"]);
        } else if !self.is_live() {
            // At its own pace, as a camera.
            words.push("-re");
        }
        words.extend(["-i", &self.input]);
        words.into_iter().map(OsString::from).collect()
    }

    /// What it gives, as ffprobe says, which comes with ffmpeg.
    pub(super) async fn gives(&self) -> Gives {
        let name = self.ffmpeg.file_name().unwrap_or_default().to_string_lossy().replace("ffmpeg", "ffprobe");
        let words =
            ["-v", "error", "-select_streams", "v:0", "-show_entries", "stream=codec_name", "-of", "csv=p=0"];
        let opening = self.opening(true).into_iter().filter(|word| word != "-re");
        let told = Command::new(self.ffmpeg.with_file_name(name))
            .args(words)
            .args(opening)
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .kill_on_drop(true)
            .output()
            .await;
        match told {
            Ok(told) if String::from_utf8_lossy(&told.stdout).trim() == "mjpeg" => Gives::Jpegs,
            _ => Gives::Video,
        }
    }

    /// Starts ffmpeg: it writes pictures to its standard output.
    ///
    /// # Errors
    /// There is no such program.
    pub(super) fn start(&self, gives: Gives) -> anyhow::Result<Child> {
        let rate = format!("fps={}", self.rate);
        let encoding: &[&str] = match gives {
            Gives::Jpegs => &["-c:v", "copy"],
            Gives::Video => &["-vf", &rate, "-c:v", "mjpeg", "-q:v", "3"],
        };
        let started = Command::new(&self.ffmpeg)
            .args(["-nostdin", "-hide_banner", "-loglevel", "error"])
            .args(self.opening(gives == Gives::Jpegs))
            .args(["-an"])
            .args(encoding)
            .args(["-f", "mpjpeg", "pipe:1"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .kill_on_drop(true)
            .spawn();
        match started {
            Err(error) if error.kind() == io::ErrorKind::NotFound => bail!(missing(&self.ffmpeg)),
            started => started.with_context(|| self.ffmpeg.display().to_string()),
        }
    }
}

fn missing(ffmpeg: &Path) -> String {
    format!(
        "the program {} is not there, which reads cameras and videos: install ffmpeg with your system's package manager, or name it \
         with --ffmpeg. Folders of pictures take none",
        ffmpeg.display()
    )
}

/// What ffmpeg says at its end, shortened.
pub(super) fn said(stderr: &[u8]) -> String {
    let text = String::from_utf8_lossy(stderr);
    let text = text.trim().replace('\n', "; ");
    if text.is_empty() {
        "ffmpeg says nothing of it".to_owned()
    } else {
        text.chars().take(MAX_SAID).collect()
    }
}
