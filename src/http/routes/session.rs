//! Signing in from a browser, which can send no header with `EventSource` and none with a page.
//!
//! A session is a cookie that scripts cannot read and other sites cannot send. The service keeps nothing of
//! it: the cookie is signed, and ends with its time, with its key or with the process.

use crate::access::{AuthError, Key, Role};
use crate::http::App;
use crate::http::auth::{SESSION_COOKIE, presented};
use crate::http::openapi::ViewerProblems;
use crate::problem::Problem;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde::Serialize;
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
    /// When the session ends, in seconds from now; left out by a service without keys.
    #[serde(skip_serializing_if = "Option::is_none")]
    expires_in_s: Option<u64>,
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
    let life = app.engine.settings.session();
    let session = app.engine.keyring.begin_session(&key, life);
    let info = SessionInfo {
        name: Some(key.name().to_owned()),
        role: Some(key.role()),
        expires_in_s: Some(life.as_secs()),
    };
    let cookie = cookie(&session, life, app.tls.is_some() || is_page_encrypted(&headers));
    Ok(([(header::SET_COOKIE, cookie)], Json(info)).into_response())
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
