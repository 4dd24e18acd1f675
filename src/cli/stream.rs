//! `roomsight stream`: the room of a camera, as long as it looks.

mod ffmpeg;
mod mpjpeg;
mod source;

use super::answering::{Answering, AnsweringArgs, Printer, Shot};
use crate::cli::manners::note;
use clap::Args;
use source::{Picture, Source};
use std::path::PathBuf;
use tokio::sync::watch;

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
    #[command(flatten)]
    answering: AnsweringArgs,
    /// What the service calls this camera
    #[arg(long, value_name = "NAME", default_value = "camera")]
    robot: String,
    /// Look at most at so many pictures a second
    #[arg(long, value_name = "RATE", default_value_t = 5.0, value_parser = rate)]
    fps: f64,
    /// The program ffmpeg
    #[arg(long, value_name = "PROGRAM", default_value = "ffmpeg", env = "ROOMSIGHT_FFMPEG")]
    ffmpeg: PathBuf,
    /// Print a line for every picture, as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate: &f64| (0.001..=1000.0).contains(rate));
    rate.ok_or_else(|| "it must be from 0.001 to 1000".to_owned())
}

/// Tells rooms until the source ends or Ctrl-C.
pub(super) fn run(args: &StreamArgs) -> anyhow::Result<()> {
    let source = Source::open(&args.source, &args.ffmpeg, args.fps, args.answering.patience())?;
    let answerer = args.answering.answerer()?;
    tokio::runtime::Runtime::new()?.block_on(async {
        let mut answering = answerer.for_camera(&args.robot, None).await?;
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
    let mut printer = Printer::new(json, None);
    while latest.changed().await.is_ok() {
        let Some(Picture { bytes, at }) = latest.borrow_and_update().clone() else { continue };
        let shot = Shot { picture: &bytes, at, odometry: None, scan: None };
        let told = match answering.answer(shot).await? {
            Ok(told) => told,
            Err(reason) => {
                note!("note: a picture is not answered: {reason}");
                continue;
            }
        };
        printer.print(at, &told)?;
    }
    Ok(())
}
