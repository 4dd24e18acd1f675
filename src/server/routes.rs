//! The paths of the API, grouped by who may call them.

use super::answers::answers;
use super::asyncapi::stream_document;
use super::body::{Frames, OneFrame};
use super::openapi::{
    ActivateProblems, BatchForm, Description, FrameForm, FrameProblems, ImageBytes, ModelProblems,
    PathProblems, ReadyProblems,
};
use super::pool::Panicked;
use super::problem::{Kind, Problem};
use super::query::Asked;
use super::recognize::RecognizeError;
use super::{App, auth, events, observe, oip, recognize, robots, stream};
use crate::protocol::event::Event;
use crate::protocol::rest::{
    Answer, BatchAnswer, BatchResult, FrameJson, Health, KindInfo, ModelInfo, ModelList, ModelName,
    RecognizeQuery, VersionInfo,
};
use axum::extract::rejection::PathRejection;
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::HeaderName;
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Redirect};
use axum::routing::get;
use axum::{Json, Router};
use tokio::task::spawn_blocking;
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use utoipa_swagger_ui::SwaggerUi;

const SERVER_TIMING: HeaderName = HeaderName::from_static("server-timing");

/// Everything the service answers. Pure: it listens nowhere.
pub fn router(app: App) -> Router {
    let (api, document) = described()
        .merge(robots().route_layer(from_fn_with_state(app.clone(), auth::robots)))
        .merge(viewers().route_layer(from_fn_with_state(app.clone(), auth::viewers)))
        .merge(admins().route_layer(from_fn_with_state(app.clone(), auth::admins)))
        .merge(anyone())
        .split_for_parts();
    api.merge(SwaggerUi::new("/docs").url("/openapi.json", document))
        .route("/asyncapi.json", get(|| async { Json(stream_document()) }))
        .route("/", get(|| async { Redirect::temporary("/docs/") }))
        // Forms have limits of our own, see `body`.
        .layer(DefaultBodyLimit::disable())
        .layer(CatchPanicLayer::custom(observe::panicked))
        .layer(from_fn_with_state(app.clone(), observe::observe))
        .with_state(app)
}

/// The OpenAPI document of [`router`].
pub fn document() -> utoipa::openapi::OpenApi {
    described().merge(robots()).merge(viewers()).merge(admins()).merge(anyone()).into_openapi()
}

fn described() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(Description::openapi())
}

fn robots() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(recognize_one))
        .routes(routes!(recognize_batch))
        .routes(routes!(stream::connect))
        .merge(oip::robots())
}

fn viewers() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(list_models))
        .routes(routes!(show_model))
        .routes(routes!(show_version))
        .routes(routes!(events::events))
        .routes(routes!(robots::list_robots))
        .routes(routes!(robots::show_robot))
        .merge(oip::viewers())
}

fn admins() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(activate)).merge(oip::admins())
}

fn anyone() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(live))
        .routes(routes!(ready))
        .routes(routes!(show_problem))
        .merge(oip::anyone())
}

/// Tells which room a frame shows
///
/// The frame is JPEG, PNG, WebP, BMP or PGM: as the body itself, in a form, or in JSON.
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
async fn recognize_one(
    State(app): State<App>,
    asked: Asked,
    OneFrame(frame): OneFrame,
) -> Result<impl IntoResponse, Problem> {
    let answer = answers(app, asked, vec![frame]).await?.remove(0)?;
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
async fn recognize_batch(
    State(app): State<App>,
    asked: Asked,
    Frames(frames): Frames,
) -> Result<Json<BatchAnswer>, Problem> {
    let request_id = asked.context.id.to_string();
    let results = answers(app, asked, frames).await?;
    let results = results.into_iter().map(|result| BatchResult::new(result, &request_id)).collect();
    Ok(Json(BatchAnswer { results, request_id }))
}

/// The models there are
#[utoipa::path(
    get, path = "/v1/models", tag = "models", security(("key" = [])),
    responses((status = OK, description = "All models and their versions", body = ModelList), ModelProblems)
)]
async fn list_models(State(app): State<App>) -> Json<ModelList> {
    let models =
        app.registry.models().iter().map(|(name, versions)| ModelInfo::new(name, versions)).collect();
    Json(ModelList { default: app.registry.default_name().to_owned(), models })
}

/// One model
#[utoipa::path(
    get, path = "/v1/models/{name}", tag = "models", security(("key" = [])),
    params(("name" = String, Path, description = "The model's name")),
    responses((status = OK, description = "The model and its versions", body = ModelInfo), ModelProblems)
)]
async fn show_model(State(app): State<App>, Path(name): Path<String>) -> Result<Json<ModelInfo>, Problem> {
    Ok(Json(ModelInfo::new(&name, &app.registry.versions(&name)?)))
}

/// One version of a model
///
/// With its card: how it was trained, and how well it did.
#[utoipa::path(
    get, path = "/v1/models/{name}/versions/{version}", tag = "models", security(("key" = [])),
    params(
        ("name" = String, Path, description = "The model's name"),
        ("version" = u64, Path, description = "The version's number")
    ),
    responses((status = OK, description = "The version", body = VersionInfo), ModelProblems)
)]
async fn show_version(
    State(app): State<App>,
    path: Result<Path<(String, u64)>, PathRejection>,
) -> Result<Json<VersionInfo>, Problem> {
    let Path((name, version)) = path.map_err(|error| Problem::Query(error.body_text()))?;
    let versions = app.registry.versions(&name)?;
    Ok(Json(VersionInfo::with_card(version, versions.state(&name, version)?, &versions)))
}

/// Lets another version of a model serve
///
/// It is loaded and tried first; until then, and where it does not work, the old one serves on. Streams hear
/// of it by `model_changed`.
#[utoipa::path(
    post, path = "/v1/models/{name}/versions/{version}/activate", tag = "models", security(("key" = [])),
    params(
        ("name" = String, Path, description = "The model's name"),
        ("version" = u64, Path, description = "The version's number")
    ),
    responses((status = OK, description = "The version that serves now", body = VersionInfo), ActivateProblems)
)]
async fn activate(
    State(app): State<App>,
    path: Result<Path<(String, u64)>, PathRejection>,
) -> Result<Json<VersionInfo>, Problem> {
    let Path((name, version)) = path.map_err(|error| Problem::Query(error.body_text()))?;
    let loading = app.clone();
    let work = move || loading.registry.activate(&name, version, recognize::warm);
    // A panic on the way is a defect of ours.
    let served = spawn_blocking(work).await.map_err(|_| Problem::from(RecognizeError::from(Panicked)))??;
    app.events.tell(|| Event::ModelChanged { to: ModelName::from(&*served) });
    let versions = app.registry.versions(&served.name)?;
    Ok(Json(VersionInfo::new(version, versions.state(&served.name, version)?, &versions)))
}

/// Whether the process lives
#[utoipa::path(
    get, path = "/livez", tag = "health", responses((status = OK, description = "It lives", body = Health))
)]
async fn live() -> Json<Health> {
    Json(Health { status: "live".to_owned() })
}

/// Whether frames are answered
///
/// A model serves, a frame went through it, and the service is not stopping.
#[utoipa::path(
    get, path = "/readyz", tag = "health",
    responses((status = OK, description = "Frames are answered", body = Health), ReadyProblems)
)]
async fn ready(State(app): State<App>) -> Result<Json<Health>, Problem> {
    if app.is_draining() { Err(Problem::Draining) } else { Ok(Json(Health { status: "ready".to_owned() })) }
}

/// What a kind of problem means
///
/// The `type` of a problem leads here.
#[utoipa::path(
    get, path = "/problems/{name}", tag = "health",
    params(("name" = String, Path, description = "The last part of a problem's `type`", example = "queue-full")),
    responses((status = OK, description = "The kind", body = KindInfo), PathProblems)
)]
async fn show_problem(Path(name): Path<String>) -> Result<Json<KindInfo>, Problem> {
    let kind = Kind::ALL.into_iter().find(|kind| kind.name() == name);
    kind.map(|kind| Json(KindInfo::from(kind))).ok_or(Problem::NotFound)
}
