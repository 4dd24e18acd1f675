//! What a body is. Senders name types carelessly: as `image/jpg`, as whatever their library sends when they
//! name none, as JSON since a wrapper always says so. So a type only tells forms apart from other bodies, and
//! those that are certainly no frame; the rest is judged by its first bytes.

use super::BodyError;
use axum::http::{HeaderMap, header};

/// What `curl`, `wget` and others say where the sender names no type.
const URL_ENCODED: &str = "application/x-www-form-urlencoded";
/// Kinds of content that are never a picture, whatever they are exactly.
const OTHER_CONTENT: [&str; 7] = ["audio", "font", "message", "model", "multipart", "text", "video"];
/// How the images begin that are read: JPEG, PNG, WebP, BMP, and those of Netpbm.
const IMAGES: [&[u8]; 9] = [b"\xFF\xD8", b"\x89PNG", b"RIFF", b"BM", b"P1", b"P2", b"P4", b"P5", b"P7"];
/// An image this long has one of the bytes that `curl -d` leaves out.
const SURELY_HAS_ALL_BYTES: usize = 1 << 10;

/// What a body is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MediaType {
    Image,
    /// The same, from somebody who named no type.
    Untold,
    /// A form with fields.
    Form,
    /// JSON.
    Json,
}

impl MediaType {
    /// What the headers say; `wanted` tells those who send something else what to send.
    pub fn told(headers: &HeaderMap, wanted: &'static str) -> Result<Self, BodyError> {
        let content_type = content_type(headers);
        let essence = content_type.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
        let (kind, subtype) = essence.split_once('/').unwrap_or((&essence, ""));
        match essence.as_str() {
            "multipart/form-data" => Ok(Self::Form),
            URL_ENCODED => Ok(Self::Untold),
            _ if subtype == "json" || subtype.ends_with("+json") => Ok(Self::Json),
            _ if OTHER_CONTENT.contains(&kind) => {
                Err(BodyError::UnsupportedType(content_type.to_owned(), wanted))
            }
            _ => Ok(Self::Image),
        }
    }

    /// What a body that is no form is, by how it begins.
    ///
    /// # Errors
    /// An image that lost bytes on the way.
    pub fn judged(self, body: &[u8]) -> Result<Self, BodyError> {
        if body.trim_ascii_start().first() == Some(&b'{') {
            return Ok(Self::Json);
        }
        match self {
            Self::Json if !IMAGES.iter().any(|magic| body.starts_with(magic)) => Ok(Self::Json),
            Self::Untold if is_stripped(body) => Err(BodyError::Stripped),
            _ => Ok(Self::Image),
        }
    }
}

/// The type as it was sent; empty where there is none that can be read.
pub fn content_type(headers: &HeaderMap) -> &str {
    headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default()
}

/// Whether a file went through `curl -d @FILE`, which leaves out zeros and ends of lines, or was encoded as a
/// form for an address.
fn is_stripped(body: &[u8]) -> bool {
    body.len() >= SURELY_HAS_ALL_BYTES && !body.iter().any(|byte| matches!(byte, 0 | b'\r' | b'\n'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn told(content_type: &str) -> Option<MediaType> {
        let headers =
            HeaderMap::from_iter([(header::CONTENT_TYPE, HeaderValue::from_str(content_type).unwrap())]);
        MediaType::told(&headers, "an image").ok()
    }

    #[test]
    fn only_types_that_are_certainly_no_frame_are_refused_by_name() {
        for name in [
            "image/jpeg",
            "image/jpg",
            "image/pjpeg",
            "image/x-ms-bmp",
            "image/*",
            "*/*",
            "IMAGE/PNG; q=1",
            "application/octet-stream",
            "binary/octet-stream",
            "application/x-jpg",
            "jpeg",
        ] {
            assert_eq!(told(name), Some(MediaType::Image), "{name}");
        }
        assert_eq!(told("application/x-www-form-urlencoded; charset=utf-8"), Some(MediaType::Untold));
        assert_eq!(told("Multipart/Form-Data; boundary=x"), Some(MediaType::Form));
        for name in ["application/json; charset=utf-8", "text/json", "application/problem+json"] {
            assert_eq!(told(name), Some(MediaType::Json), "{name}");
        }
        for name in ["text/plain", "text/html; charset=utf-8", "video/mp4", "multipart/mixed; boundary=x"] {
            assert_eq!(told(name), None, "{name}");
        }
        assert_eq!(MediaType::told(&HeaderMap::new(), ""), Ok(MediaType::Image));
    }

    #[test]
    fn bytes_are_what_they_are_whatever_the_type_says() {
        for told in [MediaType::Image, MediaType::Untold, MediaType::Json] {
            assert_eq!(told.judged(b"\xFF\xD8\xFF\xE0"), Ok(MediaType::Image), "{told:?}");
            assert_eq!(told.judged(b" \n{\"frame\": 1}"), Ok(MediaType::Json), "{told:?}");
        }
        assert_eq!(MediaType::Json.judged(b"nothing"), Ok(MediaType::Json));
        assert_eq!(MediaType::Image.judged(b"nothing"), Ok(MediaType::Image));
    }

    #[test]
    fn an_image_that_lost_bytes_is_noticed_where_that_happens() {
        let stripped = vec![7; SURELY_HAS_ALL_BYTES];
        assert_eq!(MediaType::Untold.judged(&stripped), Err(BodyError::Stripped));
        assert_eq!(MediaType::Image.judged(&stripped), Ok(MediaType::Image));
        assert_eq!(MediaType::Untold.judged(&stripped[1..]), Ok(MediaType::Image));
    }
}
