//! 8-bit luma images, and decoding untrusted bytes into them within limits.
//!
//! Luma is Rec. 601 (0.299 R + 0.587 G + 0.114 B) for every format, as JPEG stores it, so that a frame
//! sent as PNG is the same image as one sent as JPEG. Colors are decoded beside it where they are asked for, and
//! never change it.

mod containers;
mod decode;
mod exif;
mod format;
mod integral;
mod jpeg;
mod other;
mod resize;

use crate::simd;
use decode::{check_size, damaged, oriented, unsupported};
pub use integral::Integral;

/// What a decoder may be asked for by bytes of unknown origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The longest encoded frame, in bytes.
    pub max_bytes: usize,
    /// The longest side, in pixels.
    pub max_side: u32,
    /// The most pixels that are decoded of a frame. JPEGs of more are decoded at a half, a quarter or an
    /// eighth of their size.
    pub max_pixels: u64,
    /// The most memory that decoding one frame may take, in bytes.
    pub max_memory: u64,
    /// The longest side in pixels that JPEGs beyond the limits on sides, pixels and memory may be decoded at
    /// and still be of use; smaller ones are refused.
    pub enough_side: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_bytes: 16 << 20,
            max_side: 16_384,
            max_pixels: 50_000_000,
            max_memory: 512 << 20,
            enough_side: 640,
        }
    }
}

impl Limits {
    /// The same limits, for a reader who looks at frames with this longest side in pixels.
    pub fn enough_for(self, longest_side: usize) -> Self {
        Self { enough_side: u32::try_from(longest_side).unwrap_or(u32::MAX), ..self }
    }
}

/// Why bytes did not become an [`Image`].
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum ImageError {
    /// The bytes begin like no format that is read here.
    #[error("not an image: the bytes are no JPEG, PNG, WebP, BMP or PGM")]
    UnknownFormat,
    /// More bytes, pixels or memory than the limits allow.
    #[error("the image is too large: {0}")]
    TooLarge(String),
    /// The format is known, the content is damaged or cut off.
    #[error("the image is damaged: {0}")]
    Damaged(String),
    /// A format, or a kind of one, that is not read here.
    #[error("{format} is not read here; {advice}")]
    Unsupported {
        /// Its name, with an article.
        format: String,
        /// What to do.
        advice: String,
    },
    /// A decoder panicked on it.
    #[error(
        "the image cannot be decoded: it brings out a defect of the decoder; save it anew, and report it"
    )]
    Broken,
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// The first column.
    pub left: usize,
    /// The first row.
    pub top: usize,
    /// The column after the last.
    pub right: usize,
    /// The row after the last.
    pub bottom: usize,
}

impl Region {
    /// The same region of the image once it is shrunk to `size`, given as width and height: the pixels that lie in it whole.
    pub fn shrunk(self, image: &Image, size: [usize; 2]) -> Self {
        let first = |position: usize, from: usize, to: usize| (position * to).div_ceil(from);
        let last = |position: usize, from: usize, to: usize| position * to / from;
        Self {
            left: first(self.left, image.width, size[0]),
            top: first(self.top, image.height, size[1]),
            right: last(self.right, image.width, size[0]),
            bottom: last(self.bottom, image.height, size[1]),
        }
    }
}

/// What is missing of a frame that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Gap {
    /// Rows of the frame as it was sent that are missing at least in part, or coarser than they were meant.
    damaged_rows: usize,
    /// The largest part of the image of which nothing is missing.
    visible: Region,
}

/// An 8-bit luma image, row-major, at least 1 x 1. It may carry the colors of its pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
    colors: Option<Vec<u8>>,
    reduction: usize,
    gap: Option<Gap>,
}

impl Image {
    /// Takes row-major pixels; `None` when empty or when the length is not `width * height`.
    pub fn from_pixels(width: usize, height: usize, pixels: Vec<u8>) -> Option<Self> {
        (width > 0 && height > 0 && width.checked_mul(height) == Some(pixels.len())).then_some(Self {
            width,
            height,
            pixels,
            colors: None,
            reduction: 1,
            gap: None,
        })
    }

    /// Takes red, green and blue of each pixel, row after row, and keeps them where `keeps_colors`; `None` when empty or when
    /// there are not three numbers a pixel. Luma is that of an encoded frame of these pixels.
    pub fn from_rgb(width: usize, height: usize, rgb: &[u8], keeps_colors: bool) -> Option<Self> {
        let (pixels, rest) = rgb.as_chunks();
        let mut luma = vec![0; pixels.len()];
        simd::luma(pixels, &mut luma);
        let image = Self::from_pixels(width, height, luma).filter(|_| rest.is_empty())?;
        if keeps_colors { image.with_colors(rgb.to_vec()) } else { Some(image) }
    }

    /// The same with the colors of its pixels: red, green and blue of each, row after row. `None` when there are
    /// not three numbers a pixel.
    pub fn with_colors(self, colors: Vec<u8>) -> Option<Self> {
        let fits = self.pixels.len().checked_mul(3) == Some(colors.len());
        fits.then_some(Self { colors: Some(colors), ..self })
    }

    /// Decodes a JPEG, PNG, WebP, BMP or PGM of unknown origin, EXIF orientation applied.
    ///
    /// Size, dimensions and the memory that the decoder will take are checked against `limits` before
    /// anything is allocated. Rows that a JPEG lacks are gray, and told by [`Image::damaged_rows`]; one of
    /// which less than a third is there is refused.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, ImageError> {
        decode::decode(bytes, limits, false)
    }

    /// The same, with [`Image::colors`] where there are any. They cost time and memory; the rest is what
    /// [`Image::decode`] gives. Colors that would take more memory than `limits` allow, or are damaged beyond
    /// reading, are left out.
    pub fn decode_with_colors(bytes: &[u8], limits: &Limits) -> Result<Self, ImageError> {
        decode::decode(bytes, limits, true)
    }

    /// Red, green and blue of each pixel, row after row: three bytes a pixel, sRGB where the file says nothing
    /// else. `None` where they were not asked for, of a gray picture, and after shrinking.
    #[inline]
    pub fn colors(&self) -> Option<&[u8]> {
        self.colors.as_deref()
    }

    /// Shrinks to at most `longest_side` pixels by area averaging; `None` when it is small enough already. The
    /// smaller image has no colors.
    pub fn shrink_to(&self, longest_side: usize) -> Option<Self> {
        resize::shrink_to(self, longest_side)
    }

    /// A picture to look at, at most so many pixels wide, by area averaging; with colors where there are any.
    pub fn thumbnail(&self, width: usize) -> Option<Self> {
        resize::thumbnail(self, width)
    }

    /// Pixels of the frame as it was sent for one pixel of the image, along a side: 1, 2, 4 or 8.
    pub fn reduction(&self) -> usize {
        self.reduction
    }

    /// Rows of the frame as it was sent that are missing at least in part, or coarser than they were meant.
    pub fn damaged_rows(&self) -> usize {
        self.gap.map_or(0, |gap| gap.damaged_rows)
    }

    /// Where a part is missing: the largest region without a gap. Nothing beyond was seen by the camera.
    pub fn visible(&self) -> Option<Region> {
        self.gap.map(|gap| gap.visible)
    }

    /// Width in pixels, at least 1.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels, at least 1.
    #[inline]
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row after row.
    #[inline]
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// The pixels of row `y`. Panics when `y` is not below the height.
    #[inline]
    pub fn row(&self, y: usize) -> &[u8] {
        &self.pixels[y * self.width..][..self.width]
    }
}
