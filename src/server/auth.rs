//! Who may call: keys, their roles, sessions, pages of other sites, and the check that comes before anything
//! else.
//!
//! | file | what |
//! |---|---|
//! | `key` | a key: its role, its name, its robots |
//! | `keyring` | the keys that are valid now |
//! | `session` | signing in from a browser |
//! | `site` | names of the service, and pages that may call it |

mod key;
mod keyring;
pub mod session;
mod site;

pub use key::{Key, KeyError, Role, check_together};
pub use keyring::Keyring;
pub use site::{Sites, has_one_host};

use super::App;
use super::problem::Problem;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use roomsight_protocol::stream::KEY_SUBPROTOCOL_PREFIX;
use std::sync::Arc;

/// The header that is read where `Authorization: Bearer` is not given.
const KEY_HEADER: &str = "x-api-key";

/// Why a caller was turned away.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum AuthError {
    /// No key was sent.
    #[error("send a key in the header `Authorization: Bearer KEY`")]
    Missing,
    /// A key that nobody has.
    #[error("the key is not known here; check it, or ask the operator for one")]
    Unknown,
    /// A session that is over, or never was.
    #[error("the session is over; sign in again: POST /v1/session with a key")]
    Session,
    /// A name that is not known to be ours, on a service without keys.
    #[error(
        "without keys the service does not answer to the name {0:?}: add it to the setting `hosts`, call the \
         service by its address, or give it keys"
    )]
    Host(String),
    /// A page of another site, in a browser that can reach a service without keys or has a session.
    #[error(
        "a page of another site ({0:?}) may not do this here: add its origin to the setting `origins`; \
         where it is a page of this service behind a proxy, let the proxy pass the header Host"
    )]
    Origin(String),
    /// A key whose role does not allow this.
    #[error("a key with the role {has} may not do this; it takes the role {}", either(.needs))]
    Forbidden {
        /// The role of the key that was sent.
        has: Role,
        /// The roles that would do beside admin.
        needs: &'static [Role],
    },
    /// A robot that another key is bound to, or that is not one of those of the caller's key.
    #[error("the key does not speak for the robot {0:?}; name one of its own, or use that robot's key")]
    Robot(String),
}

fn either(roles: &[Role]) -> String {
    roles.iter().chain([&Role::Admin]).map(Role::to_string).collect::<Vec<_>>().join(" or ")
}

/// The key of a caller that may do what takes one of these roles; none where there are no keys.
///
/// # Errors
/// Why it may not.
fn admit(app: &App, needs: &'static [Role], request: &Request) -> Result<Option<Arc<Key>>, AuthError> {
    let headers = request.headers();
    if app.keyring.is_open() {
        app.sites.check_host(headers)?;
        app.sites.check_origin(request.method(), headers)?;
        return Ok(None);
    }
    let key = match (presented(headers), session::of(headers)) {
        (Some(secret), _) => app.keyring.find(secret).ok_or(AuthError::Unknown)?,
        (None, Some(session)) => {
            let key = app.keyring.find_session(session).ok_or(AuthError::Session)?;
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
fn presented(headers: &HeaderMap) -> Option<&[u8]> {
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

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn the_roles_that_would_do_are_named() {
        let text = |needs| AuthError::Forbidden { has: Role::Robot, needs }.to_string();
        assert!(text(&[Role::Viewer]).ends_with("it takes the role viewer or admin"));
        assert!(text(&[]).ends_with("it takes the role admin"), "{}", text(&[]));
    }
}
