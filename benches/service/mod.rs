//! A service in a process of its own, and what it takes. Its CPU time and memory are read from /proc, so that
//! this runs on Linux only.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]
#![allow(dead_code, reason = "each benchmark uses a part")]

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// The model that lies with the project.
pub const MODEL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models/simulated-lab/1");
/// Of Linux, on all machines that this is likely to run on.
const TICKS_A_SECOND: f64 = 100.0;

/// The frames that lie with the model.
pub fn frames() -> Vec<Vec<u8>> {
    frames_of(Path::new(MODEL))
}

/// The frames that lie with a model.
pub fn frames_of(model: &Path) -> Vec<Vec<u8>> {
    let is_frame = |path: &Path| path.extension().is_some_and(|extension| extension != "json");
    let files = fs::read_dir(model.join("golden")).unwrap().map(|entry| entry.unwrap().path());
    files.filter(|path| is_frame(path)).map(|path| fs::read(path).unwrap()).collect()
}

/// User and system time of a process, in seconds.
pub fn cpu_seconds(process: u32) -> f64 {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
    // After the name, which ends with the last parenthesis, utime and stime are fields 12 and 13.
    let fields: Vec<&str> = stat[stat.rfind(')').unwrap()..].split_whitespace().collect();
    fields[12..14].iter().map(|ticks| ticks.parse::<f64>().unwrap()).sum::<f64>() / TICKS_A_SECOND
}

/// Resident memory of a process.
pub fn memory_kib(process: u32) -> f64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

/// A service in a process of its own.
pub struct Service {
    pub process: Child,
    pub url: String,
}

impl Service {
    /// Starts it with these arguments beside those that all need.
    pub fn start(args: &[&str]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_roomsight"))
            .args(["serve", "--listen", "127.0.0.1:0", "--log-format", "json"])
            .args(args)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let url = lines
            .find_map(|line| {
                let line = line.unwrap();
                let (_, after) = line.split_once("listening on ")?;
                Some(after.split(',').next().unwrap().to_owned())
            })
            .unwrap();
        // Its log must not fill the pipe.
        std::thread::spawn(move || lines.for_each(drop));
        Self { process, url }
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
