//! Signing in from a browser, which can send no header with `EventSource` and none with a page.
//!
//! A session is a cookie that scripts cannot read and other sites cannot send. The service keeps nothing of
//! it: the cookie is signed, and ends with its time, with its key or with the process.

use crate::access::{AuthError, Key, Role};
use crate::http::App;
use crate::http::auth::{SESSION_COOKIE, presented};
use crate::http::body::{BodyError, read_json};
use crate::http::openapi::{CodeProblems, ViewerProblems};
use crate::problem::Problem;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;
use utoipa::ToSchema;

/// Who is signed in.
#[derive(Serialize, ToSchema)]
pub struct SessionInfo {
    /// The name of the key; left out by a service without keys.
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    /// What it allows; left out by a service without keys, where anyone may do everything.
    #[serde(skip_serializing_if = "Option::is_none")]
    role: Option<Role>,
    /// When the session that begins ends, in seconds from now; told where one begins.
    #[serde(skip_serializing_if = "Option::is_none")]
    expires_in_s: Option<u64>,
}

/// A code that stands for a key once.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CodeJson {
    /// As it was told.
    code: String,
}

/// Signs a browser in
///
/// Takes a key, and answers with a cookie that stands for it for a while, so that pages and `EventSource`, which
/// cannot send a key, can call. A session is made from a key alone, not from another session.
#[utoipa::path(
    post, path = "/v1/session", tag = "dashboards", security(("key" = [])),
    responses(
        (status = OK, description = "Who is signed in", body = SessionInfo,
            headers(("Set-Cookie" = String, description = "The session; none by a service without keys"))),
        ViewerProblems
    )
)]
pub async fn sign_in(
    State(app): State<App>,
    key: Option<Extension<Arc<Key>>>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let Some(Extension(key)) = key else {
        return Ok(Json(SessionInfo { name: None, role: None, expires_in_s: None }).into_response());
    };
    if presented(&headers).is_none() {
        return Err(AuthError::Missing.into());
    }
    let (cookie, info) = begin(&app, &key, &headers);
    Ok(([(header::SET_COOKIE, cookie)], Json(info)).into_response())
}

/// Signs a browser in by a code
///
/// A code is told once, as a QR code by `roomsight serve --lan`, and stands for a key once: for a phone, on which nobody types
/// a key.
#[utoipa::path(
    post, path = "/v1/session/code", tag = "dashboards", security(),
    request_body(content = CodeJson),
    responses(
        (status = OK, description = "Who is signed in", body = SessionInfo,
            headers(("Set-Cookie" = String, description = "The session"))),
        CodeProblems
    )
)]
pub async fn sign_in_by_code(
    State(app): State<App>,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, Problem> {
    // Another site cannot sign a browser in as somebody else.
    app.sites.check_origin(&Method::POST, &headers)?;
    let empty = || BodyError::Malformed("send the code as JSON".to_owned());
    let CodeJson { code } = read_json(&app, request).await?.ok_or_else(empty)?;
    let key = app.engine.keyring.take_code(&code).ok_or(AuthError::Code)?;
    let (cookie, info) = begin(&app, &key, &headers);
    Ok(([(header::SET_COOKIE, cookie)], Json(info)).into_response())
}

/// Who is signed in
///
/// Whose key or session the request carries; nothing by a service without keys.
#[utoipa::path(
    get, path = "/v1/session", tag = "dashboards", security(("key" = [])),
    responses((status = OK, description = "Who calls", body = SessionInfo), ViewerProblems)
)]
pub async fn show_session(key: Option<Extension<Arc<Key>>>) -> Json<SessionInfo> {
    let key = key.map(|Extension(key)| key);
    let (name, role) = (key.as_ref().map(|key| key.name().to_owned()), key.as_ref().map(|key| key.role()));
    Json(SessionInfo { name, role, expires_in_s: None })
}

/// A session of a key: the cookie that stands for it, and what is told of it.
pub fn begin(app: &App, key: &Key, headers: &HeaderMap) -> (String, SessionInfo) {
    let life = app.engine.settings.session();
    let session = app.engine.keyring.begin_session(key, life);
    let (name, role) = (Some(key.name().to_owned()), Some(key.role()));
    let info = SessionInfo { name, role, expires_in_s: Some(life.as_secs()) };
    (cookie(&session, life, app.tls.is_some() || is_page_encrypted(headers)), info)
}

/// Signs a browser out
///
/// Takes the cookie away. What was copied from it elsewhere is valid until its time is up or its key is gone.
#[utoipa::path(
    delete, path = "/v1/session", tag = "dashboards", security(("key" = [])),
    responses(
        (status = NO_CONTENT, description = "Signed out",
            headers(("Set-Cookie" = String, description = "The cookie's end"))),
        ViewerProblems
    )
)]
pub async fn sign_out() -> impl IntoResponse {
    (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie("", Duration::ZERO, false))])
}

fn cookie(value: &str, life: Duration, is_secure: bool) -> String {
    let secure = if is_secure { "; Secure" } else { "" };
    format!("{SESSION_COOKIE}={value}; Path=/; Max-Age={}; HttpOnly; SameSite=Strict{secure}", life.as_secs())
}

/// Whether the page came over TLS, which a proxy before the service may have ended.
fn is_page_encrypted(headers: &HeaderMap) -> bool {
    headers.get(header::ORIGIN).is_some_and(|origin| origin.as_bytes().starts_with(b"https://"))
}
