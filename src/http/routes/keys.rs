//! The calls about keys.

use crate::access::{Key, Role};
use crate::http::App;
use crate::http::blocking::blocking;
use crate::http::body::{BodyError, read_json};
use crate::http::by::By;
use crate::http::openapi::{AddProblems, TeachingProblems};
use crate::http::routes::session;
use crate::problem::Problem;
use crate::teaching::{KeyMade, TeachingError};
use axum::Json;
use axum::extract::{Path, Request, State};
use axum::http::header::SET_COOKIE;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use roomsight_protocol::audit::Deed;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The keys that are valid.
#[derive(Serialize, ToSchema)]
pub struct KeyList {
    /// Those of the settings first, then those that were made here, by name.
    keys: Vec<KeyInfo>,
}

/// A key, without what opens it.
#[derive(Serialize, ToSchema)]
pub struct KeyInfo {
    /// Its name.
    name: String,
    /// What it allows.
    role: Role,
    /// The robots that it alone may speak for; empty: any that is nobody's.
    robots: Vec<String>,
    /// When it was made here, by RFC 3339; left out where it is of the settings.
    #[serde(skip_serializing_if = "Option::is_none")]
    made_at: Option<String>,
    /// Where it comes from.
    from: KeyOrigin,
}

/// Where a key comes from.
#[derive(Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum KeyOrigin {
    /// An operator has set it.
    Settings,
    /// It was made by a call.
    Page,
}

/// A key that is to be made.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct KeyJson {
    /// Its name.
    name: String,
    /// What it allows.
    role: Role,
    /// The robots that it alone may speak for, of the role robot; left out: any that is nobody's.
    #[serde(default)]
    robots: Vec<String>,
}

/// A new key.
#[derive(Serialize, ToSchema)]
pub struct NewKey {
    /// What its owner keeps; it is told this once.
    key: String,
    /// Its name.
    name: String,
    /// What it allows.
    role: Role,
}

/// The keys that are valid
///
/// Without what opens them.
#[utoipa::path(
    get, path = "/v1/keys", tag = "teaching", security(("key" = [])),
    responses((status = OK, description = "All keys", body = KeyList), TeachingProblems)
)]
pub async fn list_keys(State(app): State<App>) -> Result<Json<KeyList>, Problem> {
    let made = blocking(&app, |app| app.teaching()?.keys.list()).await?;
    let info = |key: &Key, made_at: Option<String>| KeyInfo {
        name: key.name().to_owned(),
        role: key.role(),
        robots: key.robots().to_vec(),
        from: if made_at.is_some() { KeyOrigin::Page } else { KeyOrigin::Settings },
        made_at,
    };
    let of_settings = app.engine.settings.keys.iter().map(|key| info(key, None));
    let made = made.into_iter().map(|KeyMade { key, at }| info(&key, Some(at)));
    Ok(Json(KeyList { keys: of_settings.chain(made).collect() }))
}

/// Makes a key
///
/// What opens it is told once. The first key of a service that has none must be one of an admin: from then on keys are needed,
/// and who made it is signed in with it.
#[utoipa::path(
    post, path = "/v1/keys", tag = "teaching", security(("key" = [])),
    request_body(content = KeyJson),
    responses((status = CREATED, description = "The key", body = NewKey), AddProblems)
)]
pub async fn make_key(
    State(app): State<App>,
    by: By,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, Problem> {
    let empty = || BodyError::Malformed("send the key's name and role as JSON".to_owned());
    let KeyJson { name, role, robots } = read_json(&app, request).await?.ok_or_else(empty)?;
    let (was_open, made, key) = blocking(&app, move |app| {
        let teaching = app.teaching()?;
        let _changing = teaching.keys.changing();
        let was_open = app.is_open();
        if was_open && role != Role::Admin {
            let first = "the first key must be one of an admin: without it nobody could make another one";
            return Err(Problem::from(TeachingError::Conflict(first.to_owned())));
        }
        let (secret, key) = teaching.keys.make(role, &name, &robots, &app.engine.keyring.keys())?;
        app.adopt_keys()?;
        by.did(app, Deed::KeyMade, &name, &role.to_string());
        Ok((was_open, NewKey { key: secret, name, role }, key))
    })
    .await?;
    let answer = (StatusCode::CREATED, Json(made));
    if was_open {
        let (cookie, _) = session::begin(&app, &key, &headers);
        return Ok(([(SET_COOKIE, cookie)], answer).into_response());
    }
    Ok(answer.into_response())
}

/// Revokes a key
///
/// Whoever is signed in with it, or streams, is out at once. Keys of the settings are the operator's, and the last key of an admin
/// stays.
#[utoipa::path(
    delete, path = "/v1/keys/{name}", tag = "teaching", security(("key" = [])),
    params(("name" = String, Path, description = "The key's name")),
    responses((status = NO_CONTENT, description = "It is gone"), TeachingProblems)
)]
pub async fn revoke_key(
    State(app): State<App>,
    by: By,
    Path(name): Path<String>,
) -> Result<StatusCode, Problem> {
    blocking(&app, move |app| {
        let teaching = app.teaching()?;
        let _changing = teaching.keys.changing();
        let conflict = |text: &str| Err(Problem::from(TeachingError::Conflict(text.to_owned())));
        if app.engine.settings.keys.iter().any(|key| key.name() == name) {
            return conflict("it is a key of the settings: take it out there, and send the service SIGHUP");
        }
        let is_admin = |key: &Key| key.role() == Role::Admin;
        let keys = app.engine.keyring.keys();
        if keys.iter().any(|key| key.name() == name && is_admin(key))
            && keys.iter().filter(|key| is_admin(key)).count() == 1
        {
            return conflict("it is the last key of an admin: make another one first");
        }
        if !teaching.keys.revoke(&name)? {
            return Err(
                TeachingError::Absent(format!("there is no key {name:?}; GET /v1/keys lists them")).into()
            );
        }
        app.adopt_keys()?;
        by.did(app, Deed::KeyRevoked, &name, "");
        Ok(StatusCode::NO_CONTENT)
    })
    .await
}
