//! The OpenAPI document, made from the handlers and the kinds of problem.

use crate::http::auth::SESSION_COOKIE;
use crate::http::problem::ErrorForm;
use crate::problem::Kind;
use axum::http::header::RETRY_AFTER;
use roomsight_protocol::oip::ErrorBody;
use roomsight_protocol::rest::ProblemBody;
use roomsight_protocol::scan::LaserScan;
use std::collections::BTreeMap;
use std::iter;
use utoipa::openapi::security::{
    ApiKey, ApiKeyValue, Http, HttpAuthScheme, SecurityRequirement, SecurityScheme,
};
use utoipa::openapi::{Content, HeaderBuilder, Ref, RefOr, Response};
use utoipa::{IntoParams, IntoResponses, Modify, OpenApi, ToSchema};

/// The name of the security scheme.
const KEY: &str = "key";
/// The name of the security scheme of those who signed in.
const SESSION: &str = "session";
/// What can go wrong with any call that takes a key.
pub const AUTH_KINDS: [Kind; 4] = [Kind::Unauthorized, Kind::Forbidden, Kind::ForeignSite, Kind::UnknownHost];

/// What can go wrong with what lies in the data directory.
const TEACHING_KINDS: [Kind; 7] = [
    Kind::BadRequest,
    Kind::NotFound,
    Kind::Conflict,
    Kind::NotAnImage,
    Kind::Internal,
    Kind::NoData,
    Kind::DiskFull,
];

/// What is not told by the handlers.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "roomsight",
        description = "Tells a robot which room it is in: one frame in, the rooms with their \
            probabilities out. Every error is `application/problem+json`, under `/v2` an object with \
            an `error`; its text says what to do about it. An answer names its request in `request_id` and in `X-Request-Id`, which a \
            caller may also send.",
        contact(name = "whoever runs this service"),
        license(name = "Apache-2.0", identifier = "Apache-2.0")
    ),
    servers(
        (url = "/", description = "The service that this document comes from"),
        (url = ".", description = "The same under a prefix, which a proxy takes away")
    ),
    tags(
        (name = "recognize", description = "Frames to rooms"),
        (name = "dashboards", description = "Who streams, and what happens"),
        (name = "models", description = "What recognizes them"),
        (name = "teaching", description = "What people teach, and what they decide"),
        (name = "health", description = "Whether the service works"),
        (name = "inference", description = "The Open Inference Protocol, for clients that speak it already")
    ),
    components(schemas(ProblemBody, ErrorBody)),
    modifiers(&Key)
)]
pub struct Description;

/// A body that is the image itself.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary, content_media_type = "application/octet-stream")]
#[expect(dead_code, reason = "only described; `body` reads it")]
pub struct ImageBytes(Vec<u8>);

/// A frame as a form.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described; `body` reads it")]
pub struct FrameForm {
    /// The image.
    frame: ImageBytes,
    /// What the robot's laser measured beside it, as JSON, for models that look at that.
    scan: Option<LaserScan>,
}

/// Several frames as a form.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described; `body` reads it")]
pub struct BatchForm {
    /// The images, each in a field `frame`.
    #[schema(min_items = 1)]
    frame: Vec<ImageBytes>,
}

/// The model that a path names.
#[derive(IntoParams)]
#[into_params(parameter_in = Path)]
#[expect(dead_code, reason = "only described; handlers take it from the path")]
pub struct NameParam {
    /// The model's name.
    name: String,
}

/// The version that a path names.
#[derive(IntoParams)]
#[into_params(parameter_in = Path)]
#[expect(dead_code, reason = "only described; handlers take it from the path")]
pub struct VersionParams {
    /// The model's name.
    name: String,
    /// The version's number.
    version: u64,
}

/// The epoch that a change builds on.
#[derive(IntoParams)]
#[into_params(parameter_in = Header)]
#[expect(dead_code, reason = "only described; `models::Expected` reads it")]
pub struct IfMatch {
    /// The model's epoch as `ETag` gave it: where what serves was changed since, nothing is done.
    #[param(rename = "If-Match", value_type = String, required = false, pattern = r#"^("[0-9]+"|[0-9]+|\*)$"#)]
    epoch: Option<String>,
}

/// What can go wrong with a frame or a batch of them.
pub struct FrameProblems;

/// What can go wrong when models are read.
pub struct ModelProblems;

/// A body that is a version of a model.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary, content_media_type = "application/x-tar")]
#[expect(dead_code, reason = "only described; `upload` reads it")]
pub struct TarBytes(Vec<u8>);

/// What can go wrong when what serves is changed.
pub struct ChangeProblems;

/// What can go wrong when a label is set.
pub struct LabelProblems;

/// What can go wrong when a version is uploaded.
pub struct UploadProblems;

/// What can go wrong with what people teach.
pub struct TeachingProblems;

/// What can go wrong when what people teach comes with a body.
pub struct AddProblems;

/// What can go wrong when a browser signs in by a code.
pub struct CodeProblems;

/// What can go wrong for dashboards.
pub struct ViewerProblems;

/// What can go wrong when one robot is asked for.
pub struct RobotProblems;

/// What can go wrong when a robot's last frame is asked for.
pub struct FramePictureProblems;

/// What can go wrong when the map of a version is asked for.
pub struct MapProblems;

/// What can go wrong before a stream begins.
pub struct StreamProblems;

/// What can go wrong when life is asked for.
pub struct LiveProblems;

/// What can go wrong when readiness is asked for.
pub struct ReadyProblems;

/// What can go wrong where anyone may ask.
pub struct PathProblems;

impl IntoResponses for FrameProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        responses(ErrorForm::Problem, frame_kinds())
    }
}

impl IntoResponses for ModelProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([Kind::BadRequest, Kind::NoSuchModel, Kind::Internal])
    }
}

impl IntoResponses for ChangeProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([
            Kind::BadRequest,
            Kind::NoSuchModel,
            Kind::NotReady,
            Kind::Conflict,
            Kind::StaleEpoch,
            Kind::NoRepository,
            Kind::Internal,
        ])
    }
}

impl IntoResponses for LabelProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        let read = [Kind::SlowBody, Kind::TooLarge, Kind::UnsupportedType, Kind::QueueFull];
        let mut all = ChangeProblems::responses();
        all.extend(responses(ErrorForm::Problem, read));
        all
    }
}

impl IntoResponses for UploadProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([
            Kind::BadRequest,
            Kind::SlowBody,
            Kind::Conflict,
            Kind::TooLarge,
            Kind::UnsupportedType,
            Kind::NotAModel,
            Kind::QueueFull,
            Kind::Draining,
            Kind::NoRepository,
            Kind::Internal,
        ])
    }
}

impl IntoResponses for TeachingProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed(TEACHING_KINDS)
    }
}

impl IntoResponses for AddProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        let read = [Kind::SlowBody, Kind::TooLarge, Kind::UnsupportedType, Kind::QueueFull, Kind::Draining];
        responses(ErrorForm::Problem, AUTH_KINDS.into_iter().chain(TEACHING_KINDS).chain(read))
    }
}

impl IntoResponses for CodeProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        let read = [Kind::SlowBody, Kind::TooLarge, Kind::UnsupportedType, Kind::QueueFull];
        responses(
            ErrorForm::Problem,
            [Kind::BadRequest, Kind::Unauthorized, Kind::ForeignSite].into_iter().chain(read),
        )
    }
}

impl IntoResponses for ViewerProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([])
    }
}

impl IntoResponses for RobotProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([Kind::NotFound])
    }
}

impl IntoResponses for FramePictureProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([Kind::BadRequest, Kind::NotFound, Kind::TooLarge, Kind::NotAnImage, Kind::Internal])
    }
}

impl IntoResponses for MapProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([Kind::BadRequest, Kind::NoSuchModel, Kind::NotReady, Kind::Internal])
    }
}

impl IntoResponses for StreamProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        keyed([
            Kind::BadRequest,
            Kind::NoSuchModel,
            Kind::NotReady,
            Kind::NoWebSocket,
            Kind::RobotOfAnother,
            Kind::Draining,
            Kind::NoModel,
        ])
    }
}

impl IntoResponses for LiveProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        responses(ErrorForm::Problem, [Kind::BadRequest])
    }
}

impl IntoResponses for ReadyProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        responses(ErrorForm::Problem, [Kind::BadRequest, Kind::Draining, Kind::NoModel])
    }
}

impl IntoResponses for PathProblems {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        responses(ErrorForm::Problem, [Kind::NotFound])
    }
}

/// What can go wrong with frames.
pub fn frame_kinds() -> impl Iterator<Item = Kind> {
    let concerns_others = |kind: &Kind| {
        matches!(
            kind,
            Kind::NotFound
                | Kind::MethodNotAllowed
                | Kind::NotHttp
                | Kind::PathTooLong
                | Kind::HeadTooLong
                | Kind::NoWebSocket
                | Kind::Conflict
                | Kind::StaleEpoch
                | Kind::NotAModel
                | Kind::NoRepository
                | Kind::NoData
                | Kind::DiskFull
        )
    };
    Kind::all().filter(move |kind| !concerns_others(kind))
}

/// What can go wrong with any call that takes a key, and what else.
fn keyed<const N: usize>(others: [Kind; N]) -> BTreeMap<String, RefOr<Response>> {
    responses(ErrorForm::Problem, AUTH_KINDS.into_iter().chain(others))
}

/// One response a status, its kinds described together.
pub fn responses(
    form: ErrorForm,
    kinds: impl IntoIterator<Item = Kind>,
) -> BTreeMap<String, RefOr<Response>> {
    let mut texts: BTreeMap<u16, Vec<String>> = BTreeMap::new();
    for kind in kinds {
        let text = format!("{} (`{}`): {}.", kind.title(), kind.uri(), kind.advice());
        texts.entry(kind.status()).or_default().push(text);
    }
    let schema = match form {
        ErrorForm::Problem => ProblemBody::name(),
        ErrorForm::Oip => ErrorBody::name(),
    };
    texts
        .into_iter()
        .map(|(status, texts)| {
            let mut response = Response::new(texts.join(" "));
            if status == Kind::QueueFull.status() {
                let wait =
                    HeaderBuilder::new().description(Some("Seconds until a slot is likely to be free"));
                response.headers.insert(RETRY_AFTER.to_string(), RefOr::T(wait.build()));
            }
            let content = Content::new(Some(Ref::from_schema_name(schema.clone())));
            response.content.insert(form.media_type().to_owned(), RefOr::T(content));
            (status.to_string(), RefOr::T(response))
        })
        .collect()
}

struct Key;

impl Modify for Key {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        let components = document.components.get_or_insert_default();
        let mut scheme = Http::new(HttpAuthScheme::Bearer);
        scheme.description = Some(
            "A key made by `roomsight key new`; also read from `X-Api-Key`. A service without keys asks \
             for none."
                .to_owned(),
        );
        components.add_security_scheme(KEY, SecurityScheme::Http(scheme));
        let text = "The cookie that POST /v1/session gives for a key, for pages in a browser.";
        let cookie = ApiKey::Cookie(ApiKeyValue::with_description(SESSION_COOKIE, text));
        components.add_security_scheme(SESSION, SecurityScheme::ApiKey(cookie));
    }
}

/// Lets each call that takes a key take a session too, but for the one that makes sessions.
pub fn accept_sessions(document: &mut utoipa::openapi::OpenApi) {
    let items = document.paths.paths.values_mut();
    let operations = items.flat_map(|item| {
        [&mut item.get, &mut item.put, &mut item.delete, &mut item.post]
            .into_iter()
            .filter_map(Option::as_mut)
    });
    for operation in operations {
        let makes_sessions = operation.operation_id.as_deref() == Some("sign_in");
        if let Some(security) =
            operation.security.as_mut().filter(|schemes| !makes_sessions && !schemes.is_empty())
        {
            security.push(SecurityRequirement::new(SESSION, iter::empty::<String>()));
        }
    }
}
