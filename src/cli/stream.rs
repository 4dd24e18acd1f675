//! `roomsight stream`: the room of a camera, as long as it looks.

mod answering;
mod ffmpeg;
mod mpjpeg;
mod source;

use super::output::say;
use super::service::ServiceArgs;
use crate::cli::manners::note;
use answering::{Answering, Told};
use anyhow::Context;
use clap::Args;
use serde::Serialize;
use source::{Picture, Source};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};
use tokio::sync::watch;

/// The address of a service where none is given.
const DEFAULT_URL: &str = "http://127.0.0.1:8080";

/// Tell the room of a camera
///
/// Looks through a webcam (/dev/video0), a network camera (rtsp://..., http://...) or a video, all by the program ffmpeg, or at the
/// pictures of a folder, and prints a line each time the room changes. While a picture is looked at, of those that come only the latest
/// waits. A camera that gives JPEGs is not encoded anew.
#[derive(Args)]
pub(super) struct StreamArgs {
    /// A device, the address of a camera, a video, or a folder of pictures
    #[arg(long, value_name = "SOURCE")]
    source: String,
    /// Recognize in this process, with the model in this folder [default: a service does]
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["url", "robot"])]
    model: Option<PathBuf>,
    /// The service
    #[arg(long, default_value = DEFAULT_URL)]
    url: String,
    /// What the service calls this camera
    #[arg(long, value_name = "NAME", default_value = "camera")]
    robot: String,
    #[command(flatten)]
    service: ServiceArgs,
    /// Look at most at so many pictures a second
    #[arg(long, value_name = "RATE", default_value_t = 5.0, value_parser = rate)]
    fps: f64,
    /// For how long a camera or a service may be out of reach
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..))]
    patience: u64,
    /// The program ffmpeg
    #[arg(long, value_name = "PROGRAM", default_value = "ffmpeg", env = "ROOMSIGHT_FFMPEG")]
    ffmpeg: PathBuf,
    /// Print a line for every picture, as JSON
    #[arg(long)]
    json: bool,
}

/// A line of `--json`.
#[derive(Serialize)]
struct Line<'a> {
    /// When the picture came, in seconds since 1970.
    at: f64,
    #[serde(flatten)]
    told: &'a Told,
}

fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate: &f64| (0.001..=1000.0).contains(rate));
    rate.ok_or_else(|| "it must be from 0.001 to 1000".to_owned())
}

/// Tells rooms until the source ends or Ctrl-C.
pub(super) fn run(args: &StreamArgs) -> anyhow::Result<()> {
    let patience = Duration::from_secs(args.patience);
    let source = Source::open(&args.source, &args.ffmpeg, args.fps, patience)?;
    tokio::runtime::Runtime::new()?.block_on(async {
        let mut answering = match &args.model {
            Some(folder) => Answering::by_model(folder)?,
            None => {
                let client = args.service.client(&args.url)?;
                let opened = Answering::by_service(&client, &args.robot, patience).await;
                opened.with_context(|| format!("cannot stream to {}", args.url))?
            }
        };
        // The latest picture; the one before it is forgotten.
        let (sender, latest) = watch::channel(None);
        let reading = tokio::spawn(source.read(sender));
        tokio::select! {
            told = tell_all(latest, &mut answering, args.json) => told?,
            _ = tokio::signal::ctrl_c() => return Ok(()),
        }
        reading.await?
    })
}

/// Answers the latest pictures until there are no more.
async fn tell_all(
    mut latest: watch::Receiver<Option<Picture>>,
    answering: &mut Answering,
    json: bool,
) -> anyhow::Result<()> {
    let mut last = None;
    while latest.changed().await.is_ok() {
        let Some(Picture { bytes, at }) = latest.borrow_and_update().clone() else { continue };
        let told = match answering.answer(bytes, at).await? {
            Ok(told) => told,
            Err(reason) => {
                note!("note: a picture is not answered: {reason}");
                continue;
            }
        };
        if json {
            let at = at.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs_f64();
            say!("{}", serde_json::to_string(&Line { at, told: &told })?)?;
        } else if last.as_ref().is_none_or(|last: &Told| (&last.room, last.known) != (&told.room, told.known))
        {
            let time = humantime::format_rfc3339_seconds(at);
            let known = if told.known { "" } else { ", not known" };
            say!("{time}  {} {:.2}{known}", told.room, told.probability)?;
        }
        last = Some(told);
    }
    Ok(())
}
