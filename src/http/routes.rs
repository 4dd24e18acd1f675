//! The paths of the API, grouped by who may call them.

mod audit;
mod events;
mod health;
mod inbox;
mod keys;
mod live;
mod metrics;
mod models;
mod oip;
mod recognize;
mod recordings;
mod robots;
mod service;
mod session;
mod sets;
mod stream;
mod trainings;

use super::asyncapi::stream_document;
use super::openapi::{Description, accept_sessions};
use super::{App, auth, cors, observe, page};
use axum::extract::DefaultBodyLimit;
use axum::middleware::from_fn_with_state;
use axum::routing::get;
use axum::{Json, Router};
use std::sync::Arc;
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use utoipa_swagger_ui::{self as swagger_ui, SwaggerUi};

/// Everything the service answers. Pure: it listens nowhere.
pub fn router(app: App) -> Router {
    let (api, mut document) = described()
        .merge(of_robots().route_layer(from_fn_with_state(app.clone(), auth::robots)))
        .merge(of_viewers().route_layer(from_fn_with_state(app.clone(), auth::viewers)))
        .merge(of_holders().route_layer(from_fn_with_state(app.clone(), auth::holders)))
        .merge(of_admins().route_layer(from_fn_with_state(app.clone(), auth::admins)))
        .merge(of_anyone())
        .split_for_parts();
    accept_sessions(&mut document);
    // Addresses are relative, so that all of it works under a prefix that a proxy takes away.
    let documentation = SwaggerUi::new("/docs").config(swagger_ui::Config::from("../openapi.json"));
    let document = Arc::new(document);
    let api = api
        .merge(documentation)
        .route("/openapi.json", get(async move || Json(document)))
        .route("/asyncapi.json", get(|| async { Json(stream_document()) }))
        .merge(page::routes())
        // Forms have limits of our own, see `body`.
        .layer(DefaultBodyLimit::disable())
        .layer(CatchPanicLayer::custom(observe::panicked));
    let api = match cors::cors(&app.sites) {
        Some(cors) => api.layer(cors),
        None => api,
    };
    api.layer(from_fn_with_state(app.clone(), observe::observe)).with_state(app)
}

/// The OpenAPI document of [`router`].
pub fn document() -> utoipa::openapi::OpenApi {
    let routes = described()
        .merge(of_robots())
        .merge(of_viewers())
        .merge(of_holders())
        .merge(of_admins())
        .merge(of_anyone());
    let mut document = routes.into_openapi();
    accept_sessions(&mut document);
    document
}

fn described() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(Description::openapi())
}

fn of_robots() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(recognize::recognize_one))
        .routes(routes!(recognize::recognize_batch))
        .routes(routes!(stream::connect))
        .merge(oip::robots())
}

fn of_viewers() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(models::list_models))
        .routes(routes!(models::show_model))
        .routes(routes!(models::show_version))
        .routes(routes!(events::events))
        .routes(routes!(robots::list_robots))
        .routes(routes!(robots::show_robot))
        .routes(routes!(robots::show_frame))
        .routes(routes!(live::watch_robots))
        .routes(routes!(service::show_service))
        .routes(routes!(service::show_history))
        .routes(routes!(models::show_map))
        .routes(routes!(metrics::scrape))
        .routes(routes!(sets::list_sets))
        .routes(routes!(sets::show_set))
        .routes(routes!(sets::list_frames))
        .routes(routes!(sets::show_picture))
        .routes(routes!(sets::show_check))
        .routes(routes!(inbox::list_inbox))
        .routes(routes!(inbox::show_rule))
        .routes(routes!(inbox::show_policy))
        .routes(routes!(inbox::show_inbox_picture))
        .routes(routes!(trainings::list_trainings))
        .routes(routes!(trainings::show_training))
        .routes(routes!(audit::list_audit))
        .merge(oip::viewers())
}

fn of_holders() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(session::sign_in, session::sign_out, session::show_session))
        .merge(oip::holders())
}

fn of_admins() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(models::upload_version, models::delete_version))
        .routes(routes!(models::activate))
        .routes(routes!(models::rollback))
        .routes(routes!(models::set_default))
        .routes(routes!(models::set_label, models::remove_label))
        .routes(routes!(sets::create_set, sets::remove_set))
        .routes(routes!(sets::add_frames))
        .routes(routes!(sets::change_set))
        .routes(routes!(sets::undo_change))
        .routes(routes!(sets::begin_check))
        .routes(routes!(inbox::add_wrong))
        .routes(routes!(inbox::set_rule))
        .routes(routes!(inbox::set_policy))
        .routes(routes!(inbox::label_frames))
        .routes(routes!(inbox::discard_frames))
        .routes(routes!(trainings::begin_training))
        .routes(routes!(trainings::cancel_training))
        .routes(routes!(trainings::publish_training))
        .routes(routes!(recordings::begin_recording, recordings::end_recording))
        .routes(routes!(recordings::list_recordings))
        .routes(routes!(recordings::show_recording, recordings::remove_recording))
        .routes(routes!(keys::list_keys, keys::make_key))
        .routes(routes!(keys::revoke_key))
        .merge(oip::admins())
}

fn of_anyone() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(session::sign_in_by_code))
        .routes(routes!(health::live))
        .routes(routes!(health::ready))
        .routes(routes!(health::show_problem))
        .merge(oip::anyone())
}
