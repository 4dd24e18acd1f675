//! Small pictures of frames, for pages: made beside the frames that are answered, and kept for a while.

use crate::engine::aside::aside;
use bytes::Bytes;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use roomsight_vision::image::{Image, ImageError, Limits};
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Semaphore, SemaphorePermit};

/// The quality of the JPEGs, of 100.
const QUALITY: u8 = 80;
/// How many are made at one time: they are small, and frames come first.
const N_AT_ONCE: usize = 2;
/// How many bytes are kept.
const MAX_KEPT_BYTES: usize = 8 << 20;

/// For how long a thumbnail stands for its robot's last frame, so that all pages share it.
const FRESH: Duration = Duration::from_secs(1);

/// Which thumbnail.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ThumbnailKey {
    /// By its id.
    pub robot: String,
    /// In pixels.
    pub width: u32,
}

/// A small picture of a robot's frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Thumbnail {
    /// The frame's number.
    pub frame: u64,
    pub jpeg: Bytes,
}

/// The thumbnails that were made last, one a robot and width.
pub struct Thumbnails {
    kept: Mutex<Kept>,
    permits: Semaphore,
}

struct Made {
    key: ThumbnailKey,
    thumbnail: Thumbnail,
    at: Instant,
}

#[derive(Default)]
struct Kept {
    /// The oldest first.
    made: VecDeque<Made>,
    n_bytes: usize,
}

impl Default for Thumbnails {
    fn default() -> Self {
        Self { kept: Mutex::default(), permits: Semaphore::new(N_AT_ONCE) }
    }
}

impl Thumbnails {
    /// One that was made already: of the frame with this number, or of one just before it.
    pub fn find(&self, key: &ThumbnailKey, frame: u64) -> Option<Thumbnail> {
        let kept = self.kept();
        let Made { thumbnail, at, .. } = kept.made.iter().find(|made| made.key == *key)?;
        (thumbnail.frame == frame || at.elapsed() < FRESH).then(|| thumbnail.clone())
    }

    /// Waits until one may be made; whoever waited looks again whether it was made meanwhile.
    pub async fn turn(&self) -> Option<SemaphorePermit<'_>> {
        self.permits.acquire().await.ok()
    }

    /// Makes one of the frame with this number, and keeps it. Blocks, on a thread that stands aside for frames.
    pub fn make(
        &self,
        key: ThumbnailKey,
        frame: u64,
        bytes: &[u8],
        limits: Limits,
    ) -> Result<Thumbnail, ImageError> {
        let thumbnail = Thumbnail { frame, jpeg: aside(|| thumbnail(bytes, key.width, limits))? };
        self.kept().push(Made { key, thumbnail: thumbnail.clone(), at: Instant::now() });
        Ok(thumbnail)
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    /// Keeps one in the place of the one before.
    fn push(&mut self, made: Made) {
        if let Some(idx) = self.made.iter().position(|old| old.key == made.key)
            && let Some(old) = self.made.remove(idx)
        {
            self.n_bytes -= old.thumbnail.jpeg.len();
        }
        self.n_bytes += made.thumbnail.jpeg.len();
        self.made.push_back(made);
        while self.n_bytes > MAX_KEPT_BYTES
            && let Some(oldest) = self.made.pop_front()
        {
            self.n_bytes -= oldest.thumbnail.jpeg.len();
        }
    }
}

/// A JPEG of a frame, at most so many pixels wide.
///
/// # Errors
/// The frame is no image, or one beyond the limits.
pub fn thumbnail(frame: &[u8], width: u32, limits: Limits) -> Result<Bytes, ImageError> {
    // A JPEG is decoded no larger than it takes.
    let enough = u64::from(width) * 2;
    let small =
        Limits { max_pixels: limits.max_pixels.min(enough * enough), ..limits.enough_for(width as usize) };
    let image = match Image::decode_with_colors(frame, &small) {
        Err(ImageError::TooLarge(_)) => Image::decode_with_colors(frame, &limits)?,
        image => image?,
    };
    let small = image.thumbnail(width as usize).unwrap_or(image);
    let (pixels, color) = match small.colors() {
        Some(colors) => (colors, ExtendedColorType::Rgb8),
        None => (small.pixels(), ExtendedColorType::L8),
    };
    let mut jpeg = Vec::new();
    // What is taller than a JPEG can be is refused here.
    JpegEncoder::new_with_quality(&mut jpeg, QUALITY)
        .encode(pixels, small.width() as u32, small.height() as u32, color)
        .map_err(|error| ImageError::Damaged(error.to_string()))?;
    Ok(jpeg.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jpeg(width: u32, height: u32) -> Vec<u8> {
        let mut jpeg = Vec::new();
        let pixels = [200, 30, 30].repeat((width * height) as usize);
        JpegEncoder::new(&mut jpeg).encode(&pixels, width, height, ExtendedColorType::Rgb8).unwrap();
        jpeg
    }

    #[test]
    fn a_thumbnail_is_small_and_in_color_and_never_larger_than_the_frame() {
        for (size, width, expected) in
            [((1280, 720), 320, (320, 180)), ((64, 48), 320, (64, 48)), ((400, 400), 16, (16, 16))]
        {
            let small = thumbnail(&jpeg(size.0, size.1), width, Limits::default()).unwrap();
            let small = Image::decode_with_colors(&small, &Limits::default()).unwrap();
            assert_eq!((small.width(), small.height()), expected);
            let [red, green, ..] = small.colors().unwrap() else { panic!("no pixel") };
            assert!(red.abs_diff(200) < 12 && green.abs_diff(30) < 12, "{red} {green}");
        }
        let gray = thumbnail(b"P5\n2 2\n255\n\x00\xff\x00\xff", 320, Limits::default()).unwrap();
        assert!(Image::decode(&gray, &Limits::default()).is_ok());
        assert!(thumbnail(b"no image", 320, Limits::default()).is_err());
    }

    fn made(robot: u32, frame: u64, n_bytes: usize) -> Made {
        let key = ThumbnailKey { robot: robot.to_string(), width: 320 };
        Made { key, thumbnail: Thumbnail { frame, jpeg: vec![0; n_bytes].into() }, at: Instant::now() }
    }

    #[test]
    fn the_oldest_give_way() {
        let mut kept = Kept::default();
        for robot in 0..3 {
            kept.push(made(robot, 1, MAX_KEPT_BYTES / 2));
        }
        assert_eq!((kept.made.len(), kept.n_bytes), (2, MAX_KEPT_BYTES));
        assert_eq!(kept.made[0].key.robot, "1");
        kept.push(made(1, 2, 7));
        assert_eq!((kept.made.len(), kept.n_bytes), (2, MAX_KEPT_BYTES / 2 + 7));
    }

    #[test]
    fn a_fresh_one_stands_for_the_frames_after_it_and_an_old_one_for_its_own_alone() {
        let thumbnails = Thumbnails::default();
        let key = made(1, 0, 0).key;
        let found = |frame| thumbnails.find(&key, frame).map(|found| found.frame);
        thumbnails.kept().push(made(1, 5, 1));
        assert_eq!((found(5), found(6)), (Some(5), Some(5)));
        let Some(at) = Instant::now().checked_sub(FRESH) else { return };
        thumbnails.kept().push(Made { at, ..made(1, 7, 1) });
        assert_eq!((found(7), found(8)), (Some(7), None));
    }
}
