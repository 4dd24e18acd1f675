//! Frames in, tensors out.

use super::problems::InferProblems;
use super::{ModelPath, repository};
use crate::engine::answers::{Asked, answers};
use crate::engine::frame::Frame;
use crate::engine::metrics::Transport;
use crate::http::caller::caller_of;
use crate::http::openapi::{NameParam, VersionParams};
use crate::http::query::Caller;
use crate::http::{App, body};
use crate::problem::{Kind, Problem};
use axum::body::Bytes;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use roomsight_protocol::oip::request::{AskedOutput, InferParameters, InferRequest, Inference, RequestError};
use roomsight_protocol::oip::response::InferResponse;
use roomsight_protocol::oip::tensor::Values;
use roomsight_protocol::oip::{JSON_LENGTH_HEADER, OutputName};
use roomsight_protocol::rest::{Answer, ModelName, RecognizeQuery};
use std::borrow::Cow;
use utoipa::ToSchema;

/// JSON, and the tensors that follow it, in its order.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary, content_media_type = "application/octet-stream")]
#[expect(dead_code, reason = "only described; bodies are read and written as bytes")]
struct JsonAndTensors(Vec<u8>);

/// Tells which rooms frames show
///
/// The input `frame` has the datatype BYTES and the shape `[n]` or `[n, 1]`: encoded images, in base64 where
/// they stand in the JSON, as they are where they follow it (the extension `binary_tensor_data`: the header
/// `Inference-Header-Content-Length` gives the length of the JSON; a `Content-Type` is not looked at). The
/// outputs are `room`, `probability`, `known`, `probabilities` (a row for each frame) and `rooms`. The request
/// fails as a whole where one frame cannot be read.
#[utoipa::path(
    post, path = "/v2/models/{name}/infer", tag = "inference", security(("key" = [])),
    params(NameParam),
    request_body(content((InferRequest = "application/json"), (JsonAndTensors = "application/octet-stream"))),
    responses(
        (status = OK, description = "The rooms",
            content((InferResponse = "application/json"), (JsonAndTensors = "application/octet-stream"))),
        InferProblems
    )
)]
pub async fn infer(State(app): State<App>, path: ModelPath, request: Request) -> Result<Response, Problem> {
    answer(&app, path, request).await
}

/// Tells which rooms frames show, by one version of a model
///
/// As without a version; a canary takes no share of these frames.
#[utoipa::path(
    post, path = "/v2/models/{name}/versions/{version}/infer", tag = "inference", security(("key" = [])),
    params(VersionParams),
    request_body(content((InferRequest = "application/json"), (JsonAndTensors = "application/octet-stream"))),
    responses(
        (status = OK, description = "The rooms",
            content((InferResponse = "application/json"), (JsonAndTensors = "application/octet-stream"))),
        InferProblems
    )
)]
pub async fn infer_version(
    State(app): State<App>,
    path: ModelPath,
    request: Request,
) -> Result<Response, Problem> {
    answer(&app, path, request).await
}

async fn answer(app: &App, path: ModelPath, request: Request) -> Result<Response, Problem> {
    // Told before the body is read. Which version answers is chosen when the robot is known.
    repository::served(app, &path)?;
    let json_length = json_length(request.headers())?;
    let caller = Caller::of(request.extensions(), Transport::Oip)?;
    let id = caller_of(request.extensions());
    let (_, body) = body::read(app, request, app.engine.settings.max_batch_bytes).await?;
    let (n_bytes, max_frames) = (body.bytes.len(), app.engine.settings.max_batch_frames);
    let read = move || Wanted::read(&body, json_length, max_frames);
    let Wanted { id, parameters, outputs, frames } = body::take_apart(app, &id, n_bytes, read).await??;
    let query = RecognizeQuery {
        model: Some(path.name),
        version: path.version,
        deadline_ms: parameters.wait_ms(),
        robot: parameters.robot,
        ..RecognizeQuery::default()
    };
    let asked = Asked::new(app, query, caller)?;
    let served = asked.task.served.clone();
    let answers = all(answers(app.engine.clone(), asked, frames).await?)?;
    let mut response = InferResponse::new(&ModelName::from(&*served), id);
    for output in outputs {
        push(&mut response, output, &answers, served.model.rooms());
    }
    written(response)
}

/// What is wanted, the frames with their share of the memory.
struct Wanted {
    id: Option<String>,
    parameters: InferParameters,
    outputs: Vec<AskedOutput>,
    frames: Vec<Frame>,
}

impl Wanted {
    fn read(body: &Frame, json_length: Option<usize>, max_frames: usize) -> Result<Self, RequestError> {
        let Inference { id, parameters, outputs, frames } =
            Inference::read(&body.bytes, json_length, max_frames)?;
        let frames = frames.into_iter().map(|frame| part(body, frame)).collect();
        Ok(Self { id, parameters, outputs, frames })
    }
}

/// The header of Triton's extension for binary tensors.
fn json_length(headers: &HeaderMap) -> Result<Option<usize>, Problem> {
    let Some(value) = headers.get(JSON_LENGTH_HEADER) else { return Ok(None) };
    let length = value.to_str().ok().and_then(|text| text.parse().ok());
    let wrong = || Problem::query("Inference-Header-Content-Length must be a whole number of bytes");
    length.map(Some).ok_or_else(wrong)
}

fn part(body: &Frame, frame: Cow<[u8]>) -> Frame {
    body.part(match frame {
        Cow::Borrowed(slice) => body.bytes.slice_ref(slice),
        Cow::Owned(bytes) => Bytes::from(bytes),
    })
}

impl From<RequestError> for Problem {
    fn from(error: RequestError) -> Self {
        let kind = match error {
            RequestError::TooManyFrames(_) => Kind::TooLarge,
            _ => Kind::BadRequest,
        };
        Self::new(kind, error)
    }
}

/// The protocol has no place for the error of one frame.
fn all(answers: Vec<Result<Answer, Problem>>) -> Result<Vec<Answer>, Problem> {
    let told = |(frame_idx, answer): (usize, Result<Answer, Problem>)| {
        answer.map_err(|problem| problem.of_frame(frame_idx))
    };
    answers.into_iter().enumerate().map(told).collect()
}

fn push(response: &mut InferResponse, output: AskedOutput, answers: &[Answer], rooms: &[String]) {
    let values = match output.name {
        OutputName::Room => Values::Bytes(answers.iter().map(|answer| answer.room.clone()).collect()),
        OutputName::Probability => Values::Fp32(answers.iter().map(|answer| answer.probability).collect()),
        OutputName::Known => Values::Bool(answers.iter().map(|answer| answer.known).collect()),
        // A model that cannot tell has told no place to be new.
        OutputName::Novelty => {
            Values::Fp32(answers.iter().map(|answer| answer.novelty.unwrap_or_default()).collect())
        }
        OutputName::Probabilities => {
            Values::Fp32(answers.iter().flat_map(|answer| probabilities(answer, rooms)).collect())
        }
        OutputName::Rooms => Values::Bytes(rooms.to_vec()),
    };
    response.push(output, output.name.shape(answers.len() as i64, rooms.len() as i64), values);
}

/// An answer's probabilities in the order of `rooms`; it has the most probable first.
fn probabilities(answer: &Answer, rooms: &[String]) -> impl Iterator<Item = f32> {
    rooms.iter().map(|room| {
        let found = answer.probabilities.iter().find(|other| other.room == *room);
        found.map_or(0.0, |found| found.probability)
    })
}

fn written(response: InferResponse) -> Result<Response, Problem> {
    let failed = |_| Problem::from(Kind::Internal);
    let (body, json_length) = response.into_body().map_err(failed)?;
    Ok(match json_length {
        None => ([(header::CONTENT_TYPE, "application/json")], body).into_response(),
        Some(length) => (
            [(header::CONTENT_TYPE, "application/octet-stream")],
            [(JSON_LENGTH_HEADER, length.to_string())],
            body,
        )
            .into_response(),
    })
}
