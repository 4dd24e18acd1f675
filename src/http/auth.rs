//! The check of who calls, before anything else.

use crate::access::{AuthError, Key, Role};
use crate::http::App;
use crate::problem::Problem;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use roomsight_protocol::stream::KEY_SUBPROTOCOL_PREFIX;
use std::sync::Arc;

/// The header that is read where `Authorization: Bearer` is not given.
const KEY_HEADER: &str = "x-api-key";

/// The name of the cookie.
pub const SESSION_COOKIE: &str = "roomsight_session";

/// The key of a caller that may do what takes one of these roles; none where there are no keys.
///
/// # Errors
/// Why it may not.
fn admit(app: &App, needs: &'static [Role], request: &Request) -> Result<Option<Arc<Key>>, AuthError> {
    let headers = request.headers();
    if app.engine.keyring.is_open() {
        app.sites.check_host(headers)?;
        app.sites.check_origin(request.method(), headers)?;
        return Ok(None);
    }
    let key = match (presented(headers), session_of(headers)) {
        (Some(secret), _) => app.engine.keyring.find(secret).ok_or(AuthError::Unknown)?,
        (None, Some(session)) => {
            let key = app.engine.keyring.find_session(session).ok_or(AuthError::Session)?;
            // The browser sends it by itself, whichever page calls.
            app.sites.check_origin(request.method(), headers)?;
            key
        }
        (None, None) => return Err(AuthError::Missing),
    };
    if needs.contains(&key.role()) || key.role() == Role::Admin {
        Ok(Some(key))
    } else {
        Err(AuthError::Forbidden { has: key.role(), needs })
    }
}

/// Lets robots pass.
pub async fn robots(State(app): State<App>, request: Request, next: Next) -> Response {
    pass(&app, &[Role::Robot], request, next).await
}

/// Lets viewers pass.
pub async fn viewers(State(app): State<App>, request: Request, next: Next) -> Response {
    pass(&app, &[Role::Viewer], request, next).await
}

/// Lets whoever has a key pass, whatever its role.
pub async fn holders(State(app): State<App>, request: Request, next: Next) -> Response {
    pass(&app, &[Role::Robot, Role::Viewer], request, next).await
}

/// Lets admins pass.
pub async fn admins(State(app): State<App>, request: Request, next: Next) -> Response {
    pass(&app, &[], request, next).await
}

/// The name of the key of a request that has one; the key itself is an extension beside it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyName(pub String);

async fn pass(app: &App, needs: &'static [Role], mut request: Request, next: Next) -> Response {
    match admit(app, needs, &request) {
        Ok(key) => {
            if let Some(key) = key {
                tracing::Span::current().record("key", key.name());
                request.extensions_mut().insert(KeyName(key.name().to_owned()));
                request.extensions_mut().insert(key);
            }
            next.run(request).await
        }
        Err(error) => Problem::from(error).into_response(),
    }
}

/// The secret that a request carries.
pub fn presented(headers: &HeaderMap) -> Option<&[u8]> {
    let bearer = headers.get(header::AUTHORIZATION).and_then(|value| {
        let (scheme, key) = value.as_bytes().split_at_checked("Bearer ".len())?;
        scheme.eq_ignore_ascii_case(b"Bearer ").then_some(key.trim_ascii())
    });
    bearer.or_else(|| Some(headers.get(KEY_HEADER)?.as_bytes())).or_else(|| {
        subprotocols(headers).find_map(|name| name.strip_prefix(KEY_SUBPROTOCOL_PREFIX.as_bytes()))
    })
}

/// The subprotocols that a WebSocket's request offers.
pub fn subprotocols(headers: &HeaderMap) -> impl Iterator<Item = &[u8]> {
    let lists = headers.get_all(header::SEC_WEBSOCKET_PROTOCOL).into_iter();
    lists.flat_map(|list| list.as_bytes().split(|&byte| byte == b',')).map(<[u8]>::trim_ascii)
}

/// The session among the cookies of a request.
fn session_of(headers: &HeaderMap) -> Option<&str> {
    let lists = headers.get_all(header::COOKIE).iter().filter_map(|list| list.to_str().ok());
    let mut pairs = lists.flat_map(|list| list.split(';')).filter_map(|pair| pair.trim().split_once('='));
    pairs.find_map(|(name, value)| (name == SESSION_COOKIE).then_some(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_session_is_found_among_other_cookies() {
        let found = |text: &'static str| {
            let headers = HeaderMap::from_iter([(header::COOKIE, text.parse().unwrap())]);
            session_of(&headers).map(str::to_owned)
        };
        assert_eq!(found("a=1; roomsight_session=7.ab; b=roomsight_session=9").as_deref(), Some("7.ab"));
        assert_eq!(found("roomsight_session=7.ab").as_deref(), Some("7.ab"));
        assert_eq!(found("other_roomsight_session=7.ab; a"), None);
    }

    fn headers(name: &'static str, value: &str) -> HeaderMap {
        HeaderMap::from_iter([(name.parse().unwrap(), value.parse().unwrap())])
    }

    #[test]
    fn the_key_is_read_from_any_of_its_places() {
        for headers in [
            headers("authorization", "Bearer rs_a"),
            headers("authorization", "bearer  rs_a"),
            headers("x-api-key", "rs_a"),
            headers("sec-websocket-protocol", "roomsight.v1, key.rs_a"),
        ] {
            assert_eq!(presented(&headers), Some(&b"rs_a"[..]), "{headers:?}");
        }
        assert_eq!(presented(&headers("authorization", "Basic abc")), None);
        assert_eq!(presented(&headers("authorization", "rs_a")), None);
    }
}
