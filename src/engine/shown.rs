//! Pictures as Foxglove shows them.

use crate::engine::thumbnails::thumbnail;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use roomsight_vision::image::{ImageError, Limits};

/// How files begin that are shown as they are: JPEG, PNG and WebP.
const SHOWN: [(&[u8], &str); 3] =
    [(b"\xff\xd8\xff", "jpeg"), (b"\x89PNG\r\n\x1a\n", "png"), (b"RIFF", "webp")];

/// A picture as Foxglove shows it.
pub struct Shown {
    /// Of the file, as Foxglove calls it.
    pub format: &'static str,
    /// The file in base64.
    pub base64: String,
}

/// A picture as it was encoded, or, of another format, as a JPEG of its size.
///
/// # Errors
/// It is no picture.
pub fn shown(encoded: &[u8], limits: &Limits) -> Result<Shown, ImageError> {
    let known = SHOWN.iter().find(|(begins, _)| encoded.starts_with(begins));
    Ok(match known {
        Some((_, format)) => Shown { format, base64: BASE64_STANDARD.encode(encoded) },
        None => Shown {
            format: "jpeg",
            base64: BASE64_STANDARD.encode(thumbnail(encoded, limits.max_side, *limits)?),
        },
    })
}
