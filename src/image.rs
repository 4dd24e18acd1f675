//! 8-bit luma images, and decoding untrusted bytes into them within limits.
//!
//! Luma is Rec. 601 (0.299 R + 0.587 G + 0.114 B) for every format, as JPEG stores it, so that a frame
//! sent as PNG is the same image as one sent as JPEG.

mod decode;
mod integral;
mod resize;

pub use integral::Integral;

/// What a decoder may be asked for by bytes of unknown origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The longest encoded frame, in bytes.
    pub max_bytes: usize,
    /// The longest side, in pixels.
    pub max_side: u32,
    /// The most pixels in a frame.
    pub max_pixels: u64,
    /// The most memory that decoding one frame may take, in bytes.
    pub max_memory: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_bytes: 16 << 20, max_side: 16_384, max_pixels: 50_000_000, max_memory: 512 << 20 }
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
}

/// An 8-bit luma image, row-major, at least 1 x 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Image {
    /// Takes row-major pixels; `None` when empty or when the length is not `width * height`.
    pub fn from_pixels(width: usize, height: usize, pixels: Vec<u8>) -> Option<Self> {
        (width > 0 && height > 0 && width.checked_mul(height) == Some(pixels.len())).then_some(Self {
            width,
            height,
            pixels,
        })
    }

    /// Decodes a JPEG, PNG, WebP, BMP or PGM of unknown origin, EXIF orientation applied.
    ///
    /// Size, dimensions and the memory that the decoder will take are checked against `limits` before
    /// anything is allocated.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, ImageError> {
        decode::decode(bytes, limits)
    }

    /// Shrinks to at most `longest_side` pixels by area averaging; `None` when it is small enough already.
    pub fn shrink_to(&self, longest_side: usize) -> Option<Self> {
        resize::shrink_to(self, longest_side)
    }

    /// Width in pixels, at least 1.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels, at least 1.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row after row.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// The pixels of row `y`. Panics when `y` is not below the height.
    pub fn row(&self, y: usize) -> &[u8] {
        &self.pixels[y * self.width..][..self.width]
    }
}
