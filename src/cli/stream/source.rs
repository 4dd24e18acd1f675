//! Where pictures come from.

use super::ffmpeg::{Camera, Gives, said};
use super::mpjpeg::Pictures;
use crate::cli::data;
use crate::cli::manners::note;
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tokio::io::AsyncReadExt;
use tokio::sync::watch;
use tokio::time::{Instant, interval, sleep};

/// From one try to reach a camera to the next.
const PAUSE: Duration = Duration::from_secs(1);

/// The most bytes of what ffmpeg says that are read.
const MAX_SAID_BYTES: u64 = 64 << 10;

/// A picture that came.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    pub(super) bytes: Arc<[u8]>,
    pub(super) at: SystemTime,
}

/// Where pictures come from.
pub(super) enum Source {
    /// Files, so many a second.
    Folder { pictures: Vec<PathBuf>, rate: f64 },
    /// What ffmpeg reads, which may be out of reach for so long.
    Camera { camera: Camera, patience: Duration },
}

impl Source {
    pub(super) fn open(source: &str, ffmpeg: &Path, rate: f64, patience: Duration) -> anyhow::Result<Self> {
        let path = Path::new(source);
        if path.is_dir() {
            return Ok(Self::Folder { pictures: data::pictures_in(path)?, rate });
        }
        let camera = Camera { input: source.to_owned(), ffmpeg: ffmpeg.to_owned(), rate };
        if !camera.is_address() && !path.exists() {
            bail!("{source}: no such device, video or folder");
        }
        Ok(Self::Camera { camera, patience })
    }

    /// Reads pictures until the last, or until nobody wants them.
    ///
    /// # Errors
    /// A camera that is out of reach for too long, a video that cannot be read.
    pub(super) async fn read(self, sender: watch::Sender<Option<Picture>>) -> anyhow::Result<()> {
        match self {
            Self::Folder { pictures, rate } => read_folder(pictures, rate, &sender).await,
            Self::Camera { camera, patience } => read_camera(&camera, patience, &sender).await,
        }
    }
}

async fn read_folder(
    pictures: Vec<PathBuf>,
    rate: f64,
    sender: &watch::Sender<Option<Picture>>,
) -> anyhow::Result<()> {
    let mut ticks = interval(Duration::from_secs_f64(1.0 / rate));
    for path in pictures {
        ticks.tick().await;
        let bytes = tokio::fs::read(&path).await.with_context(|| path.display().to_string())?;
        if sender.send(Some(Picture { bytes: bytes.into(), at: SystemTime::now() })).is_err() {
            break;
        }
    }
    Ok(())
}

/// Reads a camera, again and again where it stops.
async fn read_camera(
    camera: &Camera,
    patience: Duration,
    sender: &watch::Sender<Option<Picture>>,
) -> anyhow::Result<()> {
    let mut last_seen = Instant::now();
    let (mut told, mut known) = (false, None);
    loop {
        let gives = match known {
            Some(gives) => gives,
            None => camera.gives().await,
        };
        let (n_pictures, reason) = read_once(camera, gives, sender).await?;
        if sender.is_closed() {
            return Ok(());
        }
        if !camera.is_live() {
            return if n_pictures > 0 {
                Ok(())
            } else {
                bail!("{} gives no picture: {reason}", camera.input)
            };
        }
        if n_pictures > 0 {
            (last_seen, told, known) = (Instant::now(), false, Some(gives));
        }
        if last_seen.elapsed() > patience {
            bail!("{} gave no picture for {} s: {reason}", camera.input, patience.as_secs());
        }
        if !told {
            note!("note: {} is out of reach, and tried again: {reason}", camera.input);
            told = true;
        }
        sleep(PAUSE).await;
    }
}

/// Reads what ffmpeg writes, until it ends: the number of pictures, and what it says.
async fn read_once(
    camera: &Camera,
    gives: Gives,
    sender: &watch::Sender<Option<Picture>>,
) -> anyhow::Result<(usize, String)> {
    let mut child = camera.start(gives)?;
    let (Some(stdout), Some(stderr)) = (child.stdout.take(), child.stderr.take()) else {
        bail!("ffmpeg gives nothing to read");
    };
    let saying = tokio::spawn(async move {
        let mut said = Vec::new();
        // What is beyond is not wanted; what comes before is told even where reading fails.
        let _ = stderr.take(MAX_SAID_BYTES).read_to_end(&mut said).await;
        said
    });
    let mut pictures = Pictures::new(stdout);
    let (mut n_pictures, mut due) = (0, Instant::now());
    let gap = Duration::from_secs_f64(1.0 / camera.rate);
    let mut problem = None;
    loop {
        let bytes = match pictures.next().await {
            Ok(Some(bytes)) => bytes,
            Ok(None) => break,
            Err(error) => {
                problem = Some(error.to_string());
                break;
            }
        };
        n_pictures += 1;
        let now = Instant::now();
        // ffmpeg thins what it decodes; what it passes on comes as fast as the camera gives it.
        if gives == Gives::Jpegs && now < due {
            continue;
        }
        due = now + gap.mul_f64(0.9);
        if sender.send(Some(Picture { bytes: bytes.into(), at: SystemTime::now() })).is_err() {
            break;
        }
    }
    child.kill().await.or_else(|_| child.try_wait().map(drop))?;
    let heard = saying.await.unwrap_or_default();
    Ok((n_pictures, problem.unwrap_or_else(|| said(&heard))))
}
