//! What is taken of recordings, on the command line.

use clap::{Args, ValueEnum};
use roomsight_lab::dataset::{Clock, Taking};
use std::path::PathBuf;

/// Which pictures of recordings to take, and what tells their rooms.
#[derive(Args)]
#[command(next_help_heading = "Recordings")]
pub(in crate::cli) struct RecordingArgs {
    /// The topic of the pictures [default: the only one]
    #[arg(long, value_name = "TOPIC")]
    topic: Option<String>,
    /// When the robot was in which room: a list with the columns time and room, or start, end and room; times are
    /// seconds or minutes:seconds since the first picture, or seconds since 1970 [default: RUN.rooms.csv beside RUN.mcap]
    #[arg(long, value_name = "CSV", conflicts_with_all = ["room_topic", "map"])]
    labels: Option<PathBuf>,
    /// A topic of std_msgs/String that names the room from each message on
    #[arg(long, value_name = "TOPIC", conflicts_with = "map")]
    room_topic: Option<String>,
    /// A map of the rooms, in which poses are looked up: GeoJSON with polygons called by their property name, or YAML with
    /// rooms, each with name and polygon
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// The topic of the poses: odometry, poses or transforms [default with --map: the only one]
    #[arg(long, value_name = "TOPIC")]
    pose_topic: Option<String>,
    /// Of transforms: what moves with the robot [default: base_link, or base_footprint]
    #[arg(long, value_name = "FRAME")]
    base_frame: Option<String>,
    /// The topic of the scans, with --laser or a model that looks at them [default: the only one]
    #[arg(long, value_name = "TOPIC")]
    scan_topic: Option<String>,
    /// The topic of the odometry, with --odometry [default: the only one]
    #[arg(long, value_name = "TOPIC")]
    odometry_topic: Option<String>,
    /// The clock of times
    #[arg(long, value_enum, default_value = "recorder")]
    clock: ClockName,
    /// Take pictures from so many seconds after the first one on
    #[arg(long, value_name = "SECONDS", value_parser = not_negative)]
    from: Option<f64>,
    /// Take pictures up to so many seconds after the first one
    #[arg(long, value_name = "SECONDS", value_parser = not_negative)]
    to: Option<f64>,
    /// Take at most so many pictures a second
    #[arg(long, value_name = "RATE", value_parser = positive)]
    fps: Option<f64>,
}

/// A clock, on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum ClockName {
    /// When messages were recorded
    Recorder,
    /// When pictures were taken, by their stamps; all messages are read to know them
    Stamps,
}

impl RecordingArgs {
    /// All of it, without what is taken beside pictures.
    pub(in crate::cli) fn taking(&self) -> Taking {
        Taking {
            topic: self.topic.clone(),
            labels: self.labels.clone(),
            room_topic: self.room_topic.clone(),
            map: self.map.clone(),
            pose_topic: self.pose_topic.clone(),
            base_frame: self.base_frame.clone(),
            laser: false,
            scan_topic: self.scan_topic.clone(),
            odometry: false,
            odometry_topic: self.odometry_topic.clone(),
            clock: match self.clock {
                ClockName::Recorder => Clock::Recorder,
                ClockName::Stamps => Clock::Stamps,
            },
            from: self.from,
            to: self.to,
            rate: self.fps,
        }
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number >= 0.0);
    number.ok_or_else(|| "it must be 0 or more".to_owned())
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "it must be more than 0".to_owned())
}
