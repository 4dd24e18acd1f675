//! The calls about models: what there is, what serves, and changes of both.

mod map;
mod upload;

use crate::engine::registry::{ChangeError, model_info, version_info, version_info_with_card};
use crate::http::App;
use crate::http::blocking::blocking;
use crate::http::body::{BodyError, read_json};
use crate::http::by::By;
use crate::http::openapi::{
    ChangeProblems, IfMatch, LabelProblems, MapProblems, ModelProblems, NameParam, TarBytes, UploadProblems,
    VersionParams,
};
use crate::problem::Problem;
use crate::repository::{Canary, Change, RepositoryError};
use axum::Json;
use axum::extract::rejection::PathRejection;
use axum::extract::{FromRequestParts, Path, Request, State};
use axum::http::StatusCode;
use axum::http::header::{ETAG, IF_MATCH};
use axum::http::request::Parts;
use axum::response::{IntoResponse, Response};
use map::map;
use roomsight_protocol::audit::Deed;
use roomsight_protocol::map::ModelMap;
use roomsight_protocol::rest::{LabelJson, ModelInfo, ModelList, VersionInfo};
use roomsight_protocol::version_id::VersionId;
use serde::Deserialize;
use upload::upload;
use utoipa::ToSchema;

/// Which version a call is about.
pub struct VersionPath(VersionId);

/// Which label of which model a call is about.
#[derive(Deserialize)]
pub struct LabelPath {
    name: String,
    label: Label,
}

/// A label that a version gets beside the stable one.
#[derive(Clone, Copy, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Label {
    /// Answers a share of the robots.
    Canary,
    /// Answers nobody.
    Shadow,
}

/// The epoch at which the caller looked at what serves, where it says so.
pub struct Expected(Option<u64>);

/// The models there are
///
/// With their versions, the highest first, and the one that requests get that name none.
#[utoipa::path(
    get, path = "/v1/models", tag = "models", security(("key" = [])),
    responses((status = OK, description = "All models and their versions", body = ModelList), ModelProblems)
)]
pub async fn list_models(State(app): State<App>) -> Json<ModelList> {
    let registry = &app.engine.registry;
    let entries = registry.entries();
    let models = entries.iter().map(|(name, entry)| model_info(name, entry, registry)).collect();
    Json(ModelList { default: registry.default_name(), models })
}

/// One model
///
/// Its versions, and what each of them serves as.
#[utoipa::path(
    get, path = "/v1/models/{name}", tag = "models", security(("key" = [])),
    params(("name" = String, Path, description = "The model's name.")),
    responses(
        (status = OK, description = "The model and its versions", body = ModelInfo,
            headers(("ETag" = String, description = "The model's epoch, for `If-Match`"))),
        ModelProblems
    )
)]
pub async fn show_model(State(app): State<App>, Path(name): Path<String>) -> Result<Response, Problem> {
    told_model(&app, &name)
}

/// One version of a model
///
/// With its card: how it was trained, and how well it did.
#[utoipa::path(
    get, path = "/v1/models/{name}/versions/{version}", tag = "models", security(("key" = [])),
    params(VersionParams),
    responses((status = OK, description = "The version", body = VersionInfo), ModelProblems)
)]
pub async fn show_version(
    State(app): State<App>,
    VersionPath(id): VersionPath,
) -> Result<Json<VersionInfo>, Problem> {
    let entry = app.engine.registry.entry(&id.name)?;
    let serving = app.engine.registry.serving(&id.name);
    Ok(Json(version_info_with_card(id.version, entry.version(&id.name, id.version)?, &serving)))
}

/// How the rooms of a version lie
///
/// Which room leads to which, and where training frames were taken, as far as those came with poses. The version must be
/// in memory.
#[utoipa::path(
    get, path = "/v1/models/{name}/versions/{version}/map", tag = "models", security(("key" = [])),
    params(VersionParams),
    responses((status = OK, description = "Its map", body = ModelMap), MapProblems)
)]
pub async fn show_map(
    State(app): State<App>,
    VersionPath(id): VersionPath,
) -> Result<Json<ModelMap>, Problem> {
    Ok(Json(map(&app, &id)?))
}

/// Adds a version of a model
///
/// The body is the version's folder as a tar, a tar.gz or a zip (`model.safetensors`, `model.json`, `golden/`), or
/// the model file alone: what it is is told by its bytes. It is tried before it is taken, and never changes after. With the policy `latest` it comes to
/// serve at once where it is newer than all that served.
#[utoipa::path(
    put, path = "/v1/models/{name}/versions/{version}", tag = "models", security(("key" = [])),
    params(VersionParams),
    request_body(content(
        (TarBytes = "application/x-tar"), (TarBytes = "application/gzip"), (TarBytes = "application/zip"),
        (TarBytes = "application/octet-stream")
    )),
    responses((status = CREATED, description = "The version", body = VersionInfo), UploadProblems)
)]
pub async fn upload_version(
    State(app): State<App>,
    by: By,
    VersionPath(id): VersionPath,
    request: Request,
) -> Result<Response, Problem> {
    if app.engine.registry.entry(&id.name).is_ok_and(|entry| entry.versions.contains_key(&id.version)) {
        return Err(ChangeError::from(RepositoryError::Exists(id)).into());
    }
    upload(&app, &by, &id, request).await?;
    Ok((StatusCode::CREATED, told_version(&app, &id)?).into_response())
}

/// Removes a version of a model
///
/// Not one that serves: stable, canary or shadow.
#[utoipa::path(
    delete, path = "/v1/models/{name}/versions/{version}", tag = "models", security(("key" = [])),
    params(VersionParams, IfMatch),
    responses((status = NO_CONTENT, description = "It is gone"), ChangeProblems)
)]
pub async fn delete_version(
    State(app): State<App>,
    by: By,
    VersionPath(id): VersionPath,
    Expected(epoch): Expected,
) -> Result<StatusCode, Problem> {
    blocking(&app, move |app| {
        app.engine.registry.delete(&id, epoch)?;
        by.did(app, Deed::DeleteVersion, &id.to_string(), "");
        Ok::<_, Problem>(())
    })
    .await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Lets another version of a model serve
///
/// It is loaded and tried first; until then, and where it does not work, the old one serves on. Streams hear
/// of it by `model_changed`.
#[utoipa::path(
    post, path = "/v1/models/{name}/versions/{version}/activate", tag = "models", security(("key" = [])),
    params(VersionParams, IfMatch),
    responses((status = OK, description = "The version that serves now", body = VersionInfo), ChangeProblems)
)]
pub async fn activate(
    State(app): State<App>,
    by: By,
    VersionPath(id): VersionPath,
    Expected(epoch): Expected,
) -> Result<Response, Problem> {
    change(&app, by, &id.name, Change::Activate(id.version), epoch).await?;
    told_version(&app, &id)
}

/// Lets the version serve that served before
///
/// It is still in memory, so that this takes no time. A second rollback leads back.
#[utoipa::path(
    post, path = "/v1/models/{name}/rollback", tag = "models", security(("key" = [])),
    params(("name" = String, Path, description = "The model's name."), IfMatch),
    responses((status = OK, description = "The model, and what serves now", body = ModelInfo), ChangeProblems)
)]
pub async fn rollback(
    State(app): State<App>,
    by: By,
    Path(name): Path<String>,
    Expected(epoch): Expected,
) -> Result<Response, Problem> {
    change(&app, by, &name, Change::Rollback, epoch).await?;
    told_model(&app, &name)
}

/// Lets a model answer requests that name none
///
/// It does so for all services of the repository, over restarts, and until another model is named here, whatever
/// models come. A version of it must serve.
#[utoipa::path(
    put, path = "/v1/models/{name}/default", tag = "models", security(("key" = [])),
    params(("name" = String, Path, description = "The model's name.")),
    responses((status = OK, description = "The model", body = ModelInfo), ChangeProblems)
)]
pub async fn set_default(
    State(app): State<App>,
    by: By,
    Path(name): Path<String>,
) -> Result<Response, Problem> {
    let wanted = name.clone();
    blocking(&app, move |app| {
        app.engine.registry.set_default(&wanted)?;
        by.did(app, Deed::Default, &wanted, "");
        Ok::<_, Problem>(())
    })
    .await?;
    told_model(&app, &name)
}

/// Gives a label to a version
///
/// A `canary` answers a share of the robots in the place of the stable version; a robot stays with its
/// version. A `shadow` sees what the stable version sees, and answers nobody: how far both agree is told with
/// the version.
#[utoipa::path(
    put, path = "/v1/models/{name}/labels/{label}", tag = "models", security(("key" = [])),
    params(NameParam, ("label" = inline(Label), Path, description = "The label"), IfMatch),
    request_body(content = LabelJson),
    responses((status = OK, description = "The model, and what serves now", body = ModelInfo), LabelProblems)
)]
pub async fn set_label(
    State(app): State<App>,
    by: By,
    path: Result<Path<LabelPath>, PathRejection>,
    Expected(epoch): Expected,
    request: Request,
) -> Result<Response, Problem> {
    let LabelPath { name, label } = labeled(path)?;
    let empty =
        || BodyError::Malformed("send the label's version as JSON, such as {\"version\": 3}".to_owned());
    let LabelJson { version, share } = read_json(&app, request).await?.ok_or_else(empty)?;
    let wanted = match (label, share) {
        (Label::Canary, Some(share)) => Change::Canary(Some(Canary { version, share })),
        (Label::Shadow, None) => Change::Shadow(Some(version)),
        (Label::Canary, None) => {
            return Err(Problem::query("a canary needs a `share`, above 0 and below 1"));
        }
        (Label::Shadow, Some(_)) => {
            return Err(Problem::query("a shadow answers nobody: leave `share` out"));
        }
    };
    change(&app, by, &name, wanted, epoch).await?;
    told_model(&app, &name)
}

/// Takes a label away
///
/// The version stays where it is and can get a label again.
#[utoipa::path(
    delete, path = "/v1/models/{name}/labels/{label}", tag = "models", security(("key" = [])),
    params(NameParam, ("label" = inline(Label), Path, description = "The label"), IfMatch),
    responses((status = OK, description = "The model, and what serves now", body = ModelInfo), ChangeProblems)
)]
pub async fn remove_label(
    State(app): State<App>,
    by: By,
    path: Result<Path<LabelPath>, PathRejection>,
    Expected(epoch): Expected,
) -> Result<Response, Problem> {
    let LabelPath { name, label } = labeled(path)?;
    let wanted = match label {
        Label::Canary => Change::Canary(None),
        Label::Shadow => Change::Shadow(None),
    };
    change(&app, by, &name, wanted, epoch).await?;
    told_model(&app, &name)
}

impl FromRequestParts<App> for VersionPath {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, Problem> {
        let path = Path::<(String, String)>::from_request_parts(parts, app).await;
        let Path((name, version)) = path.map_err(|error| Problem::query(error.body_text()))?;
        let id = format!("{name}/{version}")
            .parse()
            .map_err(RepositoryError::Id)
            .map_err(ChangeError::Repository)?;
        Ok(Self(id))
    }
}

impl FromRequestParts<App> for Expected {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &App) -> Result<Self, Problem> {
        let Some(given) = parts.headers.get(IF_MATCH).filter(|given| *given != "*") else {
            return Ok(Self(None));
        };
        let epoch = given.to_str().ok().and_then(|text| text.trim_matches('"').parse().ok());
        let wrong = || Problem::query("If-Match must be the ETag of the model, such as \"3\"");
        epoch.map(|epoch| Self(Some(epoch))).ok_or_else(wrong)
    }
}

/// Changes what serves, where that may take its time.
pub async fn change(
    app: &App,
    by: By,
    name: &str,
    change: Change,
    epoch: Option<u64>,
) -> Result<(), Problem> {
    let name = name.to_owned();
    blocking(app, move |app| {
        app.engine.registry.change(&name, change, epoch)?;
        let (deed, detail) = deed(change);
        by.did(app, deed, &name, &detail);
        Ok::<_, Problem>(())
    })
    .await
}

/// A change as the audit has it.
fn deed(change: Change) -> (Deed, String) {
    match change {
        Change::Activate(version) => (Deed::Activate, version.to_string()),
        Change::Rollback => (Deed::Rollback, String::new()),
        Change::Canary(Some(Canary { version, share })) => {
            (Deed::Label, format!("{version} as canary for {:.0} % of the robots", 100.0 * share))
        }
        Change::Shadow(Some(version)) => (Deed::Label, format!("{version} as shadow")),
        Change::Canary(None) => (Deed::Unlabel, "canary".to_owned()),
        Change::Shadow(None) => (Deed::Unlabel, "shadow".to_owned()),
        Change::Unload => (Deed::Unlabel, "all".to_owned()),
    }
}

fn labeled(path: Result<Path<LabelPath>, PathRejection>) -> Result<LabelPath, Problem> {
    path.map(|Path(path)| path).map_err(|error| Problem::query(error.body_text()))
}

fn told_model(app: &App, name: &str) -> Result<Response, Problem> {
    let entry = app.engine.registry.entry(name)?;
    let info = model_info(name, &entry, &app.engine.registry);
    Ok(([(ETAG, etag(entry.record.epoch))], Json(info)).into_response())
}

fn told_version(app: &App, id: &VersionId) -> Result<Response, Problem> {
    let entry = app.engine.registry.entry(&id.name)?;
    let info = version_info(
        id.version,
        entry.version(&id.name, id.version)?,
        &app.engine.registry.serving(&id.name),
    );
    Ok(([(ETAG, etag(entry.record.epoch))], Json(info)).into_response())
}

fn etag(epoch: u64) -> String {
    format!("\"{epoch}\"")
}
