//! Small pictures of frames, for pages: made beside the frames that are answered, and kept for a while.

use crate::engine::aside::aside;
use bytes::Bytes;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use roomsight_vision::image::{Image, ImageError, Limits};
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::{Semaphore, SemaphorePermit};

/// The quality of the JPEGs, of 100.
const QUALITY: u8 = 80;
/// How many are made at one time: they are small, and frames come first.
const N_AT_ONCE: usize = 2;
/// How many bytes are kept.
const MAX_KEPT_BYTES: usize = 8 << 20;

/// Which thumbnail: of the frame with this number, so many pixels wide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ThumbnailKey {
    pub frame: u64,
    pub width: u32,
}

/// The thumbnails that were made last.
pub struct Thumbnails {
    kept: Mutex<Kept>,
    permits: Semaphore,
}

#[derive(Default)]
struct Kept {
    /// The oldest first.
    thumbnails: VecDeque<(ThumbnailKey, Bytes)>,
    n_bytes: usize,
}

impl Default for Thumbnails {
    fn default() -> Self {
        Self { kept: Mutex::default(), permits: Semaphore::new(N_AT_ONCE) }
    }
}

impl Thumbnails {
    /// One that was made already.
    pub fn find(&self, key: ThumbnailKey) -> Option<Bytes> {
        let kept = self.kept();
        kept.thumbnails.iter().find(|(other, _)| *other == key).map(|(_, bytes)| bytes.clone())
    }

    /// Waits until one may be made; whoever waited looks again whether it was made meanwhile.
    pub async fn turn(&self) -> Option<SemaphorePermit<'_>> {
        self.permits.acquire().await.ok()
    }

    /// Makes one of a frame, and keeps it. Blocks, on a thread that stands aside for frames.
    pub fn make(&self, key: ThumbnailKey, frame: &[u8], limits: Limits) -> Result<Bytes, ImageError> {
        let bytes = aside(|| thumbnail(frame, key.width, limits))?;
        self.kept().push(key, bytes.clone());
        Ok(bytes)
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    fn push(&mut self, key: ThumbnailKey, bytes: Bytes) {
        self.n_bytes += bytes.len();
        self.thumbnails.push_back((key, bytes));
        while self.n_bytes > MAX_KEPT_BYTES
            && let Some((_, oldest)) = self.thumbnails.pop_front()
        {
            self.n_bytes -= oldest.len();
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

    #[test]
    fn the_oldest_give_way() {
        let mut kept = Kept::default();
        let key = |frame| ThumbnailKey { frame, width: 320 };
        for frame in 0..3 {
            kept.push(key(frame), vec![0; MAX_KEPT_BYTES / 2].into());
        }
        assert_eq!((kept.thumbnails.len(), kept.n_bytes), (2, MAX_KEPT_BYTES));
        assert_eq!(kept.thumbnails[0].0, key(1));
    }
}
