//! Pictures that are kept, as answers.

use crate::engine::aside::aside;
use crate::engine::recognize::RecognizeError;
use crate::engine::thumbnails::thumbnail;
use crate::http::App;
use crate::http::blocking::blocking;
use crate::problem::Problem;
use crate::teaching::FrameFile;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE, ETAG, IF_NONE_MATCH};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use std::ops::RangeInclusive;

/// How wide small pictures may be, in pixels.
const WIDTHS: RangeInclusive<u32> = 16..=1920;

/// A frame's picture rarely changes under its name.
const CACHED: &str = "private, max-age=3600";

/// Answers with a picture, at most so many pixels wide, or with its file.
///
/// # Errors
/// A width that is none, a picture that cannot be read.
pub async fn answer(
    app: &App,
    headers: &HeaderMap,
    width: Option<u32>,
    read: impl FnOnce(&App) -> Result<FrameFile, Problem> + Send + 'static,
) -> Result<Response, Problem> {
    check_width(width)?;
    let known = headers.get(IF_NONE_MATCH).cloned();
    let make = move |app: &App| {
        let FrameFile { bytes, media_type } = read(app)?;
        let digest = &blake3::hash(&bytes).to_hex()[..16];
        let tag = format!("\"{digest}-{}\"", width.unwrap_or_default());
        if known.is_some_and(|known| known.as_bytes() == tag.as_bytes()) {
            return Ok::<_, Problem>((tag, None));
        }
        let Some(width) = width else { return Ok((tag, Some((media_type, bytes)))) };
        let limits = app.engine.settings.frame_limits();
        let small = aside(|| thumbnail(&bytes, width, limits)).map_err(RecognizeError::from)?;
        Ok((tag, Some(("image/jpeg", small.into()))))
    };
    let (tag, picture) = blocking(app, make).await?;
    let shared = [(ETAG, tag), (CACHE_CONTROL, CACHED.to_owned())];
    Ok(match picture {
        Some((media_type, bytes)) => (shared, [(CONTENT_TYPE, media_type)], bytes).into_response(),
        None => (StatusCode::NOT_MODIFIED, shared).into_response(),
    })
}

/// Holds that a small picture can be so wide.
///
/// # Errors
/// It cannot.
pub fn check_width(width: Option<u32>) -> Result<(), Problem> {
    if width.is_none_or(|width| WIDTHS.contains(&width)) {
        return Ok(());
    }
    let (least, most) = (WIDTHS.start(), WIDTHS.end());
    Err(Problem::query(format!(
        "`width` must be from {least} to {most} pixels; left out, the file is sent as it is"
    )))
}
