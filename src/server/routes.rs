//! The paths of the API, grouped by who may call them.

use super::answers::answers;
use super::api;
use super::asyncapi::stream_document;
use super::auth::session;
use super::body::{Frames, OneFrame};
use super::metrics;
use super::openapi::{
    BatchForm, Description, FrameForm, FrameProblems, ImageBytes, LiveProblems, PathProblems, ReadyProblems,
    accept_sessions,
};
use super::problem::{Kind, Problem};
use super::query::Asked;
use super::registry::Choice;
use super::{App, auth, events, models, observe, oip, robots, stream};
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::HeaderName;
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Redirect};
use axum::routing::get;
use axum::{Json, Router};
use roomsight_protocol::rest::{Answer, BatchAnswer, FrameJson, Health, KindInfo, RecognizeQuery};
use std::sync::Arc;
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use utoipa_swagger_ui::{self as swagger_ui, SwaggerUi};

const SERVER_TIMING: HeaderName = HeaderName::from_static("server-timing");

/// Everything the service answers. Pure: it listens nowhere.
pub fn router(app: App) -> Router {
    let (api, mut document) = described()
        .merge(robots().route_layer(from_fn_with_state(app.clone(), auth::robots)))
        .merge(viewers().route_layer(from_fn_with_state(app.clone(), auth::viewers)))
        .merge(holders().route_layer(from_fn_with_state(app.clone(), auth::holders)))
        .merge(admins().route_layer(from_fn_with_state(app.clone(), auth::admins)))
        .merge(anyone())
        .split_for_parts();
    accept_sessions(&mut document);
    // Addresses are relative, so that all of it works under a prefix that a proxy takes away.
    let documentation = SwaggerUi::new("/docs").config(swagger_ui::Config::from("../openapi.json"));
    let document = Arc::new(document);
    let api = api
        .merge(documentation)
        .route("/openapi.json", get(async move || Json(document)))
        .route("/asyncapi.json", get(|| async { Json(stream_document()) }))
        .route("/", get(|| async { Redirect::temporary("docs/") }))
        // Forms have limits of our own, see `body`.
        .layer(DefaultBodyLimit::disable())
        .layer(CatchPanicLayer::custom(observe::panicked));
    let api = match app.sites.cors() {
        Some(cors) => api.layer(cors),
        None => api,
    };
    api.layer(from_fn_with_state(app.clone(), observe::observe)).with_state(app)
}

/// The OpenAPI document of [`router`].
pub fn document() -> utoipa::openapi::OpenApi {
    let routes =
        described().merge(robots()).merge(viewers()).merge(holders()).merge(admins()).merge(anyone());
    let mut document = routes.into_openapi();
    accept_sessions(&mut document);
    document
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
        .routes(routes!(models::list_models))
        .routes(routes!(models::show_model))
        .routes(routes!(models::show_version))
        .routes(routes!(events::events))
        .routes(routes!(robots::list_robots))
        .routes(routes!(robots::show_robot))
        .routes(routes!(metrics::scrape))
        .merge(oip::viewers())
}

fn holders() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(session::sign_in, session::sign_out)).merge(oip::holders())
}

fn admins() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(models::upload_version, models::delete_version))
        .routes(routes!(models::activate))
        .routes(routes!(models::rollback))
        .routes(routes!(models::set_default))
        .routes(routes!(models::set_label, models::remove_label))
        .merge(oip::admins())
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
    let results = results.into_iter().map(|result| api::batch_result(result, &request_id)).collect();
    Ok(Json(BatchAnswer { results, request_id }))
}

/// Whether the process lives
///
/// It does where it answers.
#[utoipa::path(
    get, path = "/livez", tag = "health", security(),
    responses((status = OK, description = "It lives", body = Health), LiveProblems)
)]
async fn live() -> Json<Health> {
    Json(Health { status: "live".to_owned() })
}

/// Whether frames are answered
///
/// A model serves, a frame went through it, and the service is not stopping.
#[utoipa::path(
    get, path = "/readyz", tag = "health", security(),
    responses((status = OK, description = "Frames are answered", body = Health), ReadyProblems)
)]
async fn ready(State(app): State<App>) -> Result<Json<Health>, Problem> {
    if app.is_draining() {
        return Err(Problem::Draining);
    }
    app.registry.choose(None, &Choice::Serving, None)?;
    Ok(Json(Health { status: "ready".to_owned() }))
}

/// What a kind of problem means
///
/// The `type` of a problem leads here.
#[utoipa::path(
    get, path = "/problems/{name}", tag = "health", security(),
    params(("name" = String, Path, description = "The last part of a problem's `type`", example = "queue-full")),
    responses((status = OK, description = "The kind", body = KindInfo), PathProblems)
)]
async fn show_problem(Path(name): Path<String>) -> Result<Json<KindInfo>, Problem> {
    let kind = Kind::ALL.into_iter().find(|kind| kind.name() == name);
    kind.map(|kind| Json(KindInfo::from(kind))).ok_or(Problem::NotFound)
}
