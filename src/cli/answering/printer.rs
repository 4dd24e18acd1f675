//! What is printed of a camera's rooms.

use super::Told;
use crate::cli::output::say;
use serde::Serialize;
use std::io;
use std::time::SystemTime;

/// Prints a line each time the room changes, or a line of JSON for every picture.
pub(in crate::cli) struct Printer {
    json: bool,
    /// What the camera is called, where there are several.
    camera: Option<String>,
    last: Option<(String, bool)>,
}

/// A line of JSON.
#[derive(Serialize)]
struct Line<'a> {
    /// When the picture came, in seconds since 1970.
    at: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    camera: Option<&'a str>,
    #[serde(flatten)]
    told: &'a Told,
}

impl Printer {
    pub(in crate::cli) fn new(json: bool, camera: Option<String>) -> Self {
        Self { json, camera, last: None }
    }

    /// Prints what is told of a picture that came at this time.
    ///
    /// # Errors
    /// Standard output is closed.
    pub(in crate::cli) fn print(&mut self, at: SystemTime, told: &Told) -> io::Result<()> {
        let camera = self.camera.as_deref();
        if self.json {
            let at = at.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs_f64();
            return say!("{}", serde_json::to_string(&Line { at, camera, told })?);
        }
        let is_same = |(room, known): &(String, bool)| (room, *known) == (&told.room, told.known);
        if !self.last.as_ref().is_some_and(is_same) {
            let time = humantime::format_rfc3339_seconds(at);
            let camera = camera.map(|camera| format!("{camera}  ")).unwrap_or_default();
            let known = if told.known { "" } else { ", not known" };
            say!("{time}  {camera}{} {:.2}{known}", told.room, told.probability)?;
            self.last = Some((told.room.clone(), told.known));
        }
        Ok(())
    }
}
