//! `POST /v1/recognize`: a frame, or several.

use crate::engine::answer::batch_result;
use crate::engine::answers::{Asked, answers};
use crate::http::App;
use crate::http::body::{Frames, OneFrame};
use crate::http::openapi::{BatchForm, FrameForm, FrameProblems, ImageBytes};
use crate::problem::Problem;
use axum::Json;
use axum::extract::State;
use axum::http::HeaderName;
use axum::response::IntoResponse;
use roomsight_protocol::rest::{Answer, BatchAnswer, FrameJson, RecognizeQuery};

const SERVER_TIMING: HeaderName = HeaderName::from_static("server-timing");

/// Tells which room a frame shows
///
/// The frame is JPEG, PNG, WebP, BMP or PGM: as the body itself, in a form, or in JSON. What the body is its bytes
/// tell: any type of image is taken, and those that clients send when nobody named one.
#[utoipa::path(
    post, path = "/v1/recognize", tag = "recognize", security(("key" = [])), params(RecognizeQuery),
    request_body(content(
        (ImageBytes = "image/jpeg"), (ImageBytes = "image/png"), (ImageBytes = "image/webp"),
        (ImageBytes = "image/bmp"), (ImageBytes = "image/x-portable-graymap"),
        (ImageBytes = "application/octet-stream"), (FrameForm = "multipart/form-data"),
        (FrameJson = "application/json")
    )),
    responses(
        (status = OK, description = "The room", body = Answer,
            headers(("Server-Timing" = String, description = "The same times as in `timings_ms`"))),
        FrameProblems
    )
)]
pub async fn recognize_one(
    State(app): State<App>,
    asked: Asked,
    OneFrame(frame): OneFrame,
) -> Result<impl IntoResponse, Problem> {
    let answer = answers(app.engine.clone(), asked, vec![frame]).await?.remove(0)?;
    Ok(([(SERVER_TIMING, answer.timings_ms.header())], Json(answer)))
}

/// Tells which rooms several frames show
///
/// The answers come in the order of the frames; a frame that cannot be read has an error in its place.
#[utoipa::path(
    post, path = "/v1/recognize/batch", tag = "recognize", security(("key" = [])), params(RecognizeQuery),
    request_body(content = BatchForm, content_type = "multipart/form-data"),
    responses((status = OK, description = "An answer or an error for each frame", body = BatchAnswer), FrameProblems)
)]
pub async fn recognize_batch(
    State(app): State<App>,
    asked: Asked,
    Frames(frames): Frames,
) -> Result<Json<BatchAnswer>, Problem> {
    let request_id = asked.request_id.to_string();
    let results = answers(app.engine.clone(), asked, frames).await?;
    let results = results.into_iter().map(|result| batch_result(result, &request_id)).collect();
    Ok(Json(BatchAnswer { results, request_id }))
}
