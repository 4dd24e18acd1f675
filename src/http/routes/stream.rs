//! `GET /v1/stream`: a WebSocket begins.

use crate::access::Key;
use crate::engine::streams::{self, Caller, settings};
use crate::http::App;
use crate::http::auth::subprotocols;
use crate::http::caller::caller_of;
use crate::http::openapi::StreamProblems;
use crate::problem::{Kind, Problem};
use axum::Extension;
use axum::body::Body;
use axum::extract::{Query, Request, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::Response;
use hyper::upgrade::OnUpgrade;
use roomsight_protocol::stream::{KEY_SUBPROTOCOL_PREFIX, SUBPROTOCOL, StreamQuery};
use std::fmt;
use std::sync::Arc;
use tokio_tungstenite::tungstenite::handshake::server::create_response;

/// Streams frames over a WebSocket
///
/// The subprotocol is `roomsight.v1`; `asyncapi.json` describes its messages. A key may also be offered as a
/// second subprotocol, `key.KEY`, since browsers cannot set headers here.
#[utoipa::path(
    get, path = "/v1/stream", tag = "recognize", security(("key" = [])), params(StreamQuery),
    responses((status = SWITCHING_PROTOCOLS, description = "The stream begins with `hello`"), StreamProblems)
)]
pub async fn connect(
    State(app): State<App>,
    key: Option<Extension<Arc<Key>>>,
    mut request: Request,
) -> Result<Response, Problem> {
    let Query(query) = Query::<StreamQuery>::try_from_uri(request.uri())
        .map_err(|error| Problem::query(error.body_text()))?;
    if app.engine.is_draining() {
        return Err(Problem::draining());
    }
    let key = key.map(|Extension(key)| key);
    if let Some(robot) = &query.robot {
        app.engine.keyring.check_robot(key.as_deref(), robot)?;
    }
    let initial = settings::initial(&app.engine.registry, key.as_ref().map(|key| key.robot()));
    let settings = settings::changed(&initial, query.change(), &app.engine.registry)?;
    let (mut response, upgrade) = handshake(&mut request).map_err(no_websocket)?;
    if let Some(protocol) = spoken(request.headers())? {
        response.headers_mut().insert(header::SEC_WEBSOCKET_PROTOCOL, protocol);
    }
    let caller = Caller { key, id: caller_of(request.extensions()), query, settings };
    app.engine.streams.spawn(streams::welcome(app.engine.clone(), upgrade, caller));
    Ok(response)
}

/// The response that begins a WebSocket, and what the connection then becomes.
///
/// # Errors
/// Why the request asks for none.
fn handshake(request: &mut Request) -> Result<(Response, OnUpgrade), String> {
    let mut plain = hyper::Request::new(());
    *plain.method_mut() = request.method().clone();
    *plain.version_mut() = request.version();
    *plain.headers_mut() = request.headers().clone();
    let response = create_response(&plain).map_err(|error| error.to_string())?;
    Ok((response.map(|()| Body::empty()), hyper::upgrade::on(request)))
}

fn no_websocket(why: impl fmt::Display) -> Problem {
    let advice = "open a WebSocket with the subprotocol roomsight.v1 here, and let a proxy on the way pass the headers \
        Upgrade and Connection";
    Problem::new(Kind::NoWebSocket, format_args!("{advice}: {why}"))
}

/// The subprotocol of the response, if any was offered.
fn spoken(headers: &HeaderMap) -> Result<Option<HeaderValue>, Problem> {
    let mut offered =
        subprotocols(headers).filter(|name| !name.starts_with(KEY_SUBPROTOCOL_PREFIX.as_bytes()));
    let Some(first) = offered.next() else { return Ok(None) };
    if first == SUBPROTOCOL.as_bytes() || offered.any(|name| name == SUBPROTOCOL.as_bytes()) {
        Ok(Some(HeaderValue::from_static(SUBPROTOCOL)))
    } else {
        Err(no_websocket("the subprotocols that are offered are not spoken here"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(header::HeaderName, &'static str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value))).collect()
    }

    #[test]
    fn the_subprotocol_is_chosen_from_what_is_offered_beside_a_key() {
        let offer = |text| spoken(&headers(&[(header::SEC_WEBSOCKET_PROTOCOL, text)]));
        assert_eq!(offer("roomsight.v1, key.rs_abc").unwrap().unwrap(), SUBPROTOCOL);
        assert_eq!(offer("mqtt,roomsight.v1").unwrap().unwrap(), SUBPROTOCOL);
        assert_eq!(offer("key.rs_abc").unwrap(), None);
        assert!(offer("mqtt").is_err());
        assert_eq!(spoken(&HeaderMap::new()).unwrap(), None);
    }
}
