//! What happens around every request: its id, its line in the log, its error in one form.

use crate::engine::metrics::Answered;
use crate::http::App;
use crate::http::caller::Peer;
use crate::http::linger::linger;
use crate::http::problem::{ErrorForm, of_framework, render};
use crate::http::trace::TraceParent;
use crate::problem::{Kind, Problem};
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method, Version, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::any::Any;
use std::hash::{BuildHasher, RandomState};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;
use tracing::field::Empty;
use tracing::{Instrument, info_span};

/// The route of requests that match none.
const NO_ROUTE: &str = "(none)";
/// What probes ask every few seconds, and anyone may as fast as it likes.
const HEALTH: [&str; 4] = ["/livez", "/readyz", "/v2/health/live", "/v2/health/ready"];
const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
const MAX_ID_BYTES: usize = 64;
/// What the documentation page needs, and nothing from elsewhere. The digest is that of the one style that the
/// page's script writes into it.
const CONTENT_POLICY: &str = "default-src 'self'; img-src 'self' data:; style-src 'self' \
    'sha256-RL3ie0nH+Lzz2YNqQN83mnU0J1ot4QL7b99vMdIX99w='; frame-ancestors 'none'";

/// Makes the ids of requests that bring none: a part for this process, and a number.
pub struct RequestIds {
    process: u32,
    next: AtomicU64,
}

/// What every handler may know about its request.
#[derive(Clone, Debug)]
pub struct RequestContext {
    /// Its id, the caller's own where that can be used.
    pub id: Arc<str>,
    /// When its head had arrived.
    pub arrived: Instant,
}

impl RequestIds {
    /// Ids that differ from those of other processes.
    pub fn new() -> Self {
        Self { process: RandomState::new().hash_one(0) as u32, next: AtomicU64::new(1) }
    }

    pub fn next(&self) -> Arc<str> {
        format!("{:08x}-{:06x}", self.process, self.next.fetch_add(1, Ordering::Relaxed)).into()
    }
}

impl Default for RequestIds {
    fn default() -> Self {
        Self::new()
    }
}

/// Gives the request an id and a span, and the response its headers; completes problems.
pub async fn observe(State(app): State<App>, request: Request, next: Next) -> Response {
    let given = request.headers().get(&REQUEST_ID).and_then(usable_id);
    let context =
        RequestContext { id: given.unwrap_or_else(|| app.request_ids.next()), arrived: Instant::now() };
    let form = ErrorForm::of(request.uri().path());
    let route = request.extensions().get::<MatchedPath>().cloned();
    let method = request.method().clone();
    let address = request.extensions().get::<Peer>().map(|peer| peer.0);
    let peer = address.map(tracing::field::display);
    let route_name = || route.as_ref().map_or(NO_ROUTE, MatchedPath::as_str);
    let span = info_span!(
        "request", request_id = &*context.id, %method, route = route_name(), peer,
        trace_id = Empty, key = Empty, robot = Empty, model = Empty
    );
    if let Some(parent) = TraceParent::of(request.headers()) {
        parent.adopt(&span);
    }
    async {
        let mut request = linger(request);
        request.extensions_mut().insert(context.clone());
        let response = if has_one_host(&request) {
            next.run(request).await
        } else {
            // What stands between might read it otherwise.
            Problem::query("send one header Host").into_response()
        };
        let response = complete(response, &context, form);
        let (status, took) = (response.status(), context.arrived.elapsed());
        let (pattern, method) = (route_name(), method_name(&method));
        app.engine.metrics.answered(Answered { pattern, method, status: status.as_u16(), took });
        let is_told = !status.is_client_error()
            || address.is_none_or(|address| app.refusals.is_news(address.ip(), status.as_u16()));
        let (status, ms) = (status.as_u16(), took.as_micros() as f64 / 1e3);
        if HEALTH.contains(&route_name()) {
            tracing::debug!(status, ms, "answered");
        } else if is_told {
            tracing::info!(status, ms, "answered");
        }
        response
    }
    .instrument(span)
    .await
}

/// The answer to a request whose handler panicked; the panic itself is in the log.
pub fn panicked(_: Box<dyn Any + Send>) -> Response {
    Problem::from(Kind::Internal).into_response()
}

fn complete(mut response: Response, context: &RequestContext, form: ErrorForm) -> Response {
    let status = response.status();
    if let Some(problem) = response.extensions_mut().remove::<Arc<Problem>>() {
        response = render(&problem, response, &context.id, form);
    } else if status.is_client_error() || status.is_server_error() {
        response = render(&of_framework(status), response, &context.id, form);
    }
    let headers = response.headers_mut();
    if let Ok(id) = HeaderValue::from_str(&context.id) {
        headers.insert(REQUEST_ID, id);
    }
    for (name, value) in [
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CONTENT_SECURITY_POLICY, CONTENT_POLICY),
    ] {
        // The page and pictures say it themselves.
        headers.entry(name).or_insert(HeaderValue::from_static(value));
    }
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    response
}

/// Whether a request says once to whom it speaks, as HTTP/1.1 demands.
fn has_one_host(request: &Request) -> bool {
    let n_hosts = request.headers().get_all(header::HOST).iter().count();
    n_hosts == 1 || n_hosts == 0 && request.version() < Version::HTTP_11
}

/// The name of a method; callers may make up their own.
fn method_name(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PUT => "PUT",
        Method::PATCH => "PATCH",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}

/// A caller's id, where it can stand in a log as it is.
fn usable_id(value: &HeaderValue) -> Option<Arc<str>> {
    let id = value.to_str().ok()?;
    let is_usable = (1..=MAX_ID_BYTES).contains(&id.len()) && id.bytes().all(|byte| byte.is_ascii_graphic());
    is_usable.then(|| id.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_taken_over_only_where_it_can_stand_in_a_log() {
        let id = |text: &str| usable_id(&HeaderValue::from_bytes(text.as_bytes()).unwrap());
        assert_eq!(id("abc-1_2").as_deref(), Some("abc-1_2"));
        for bad in ["", "a b", "caf\u{e9}", &"x".repeat(65)] {
            assert_eq!(id(bad), None, "{bad:?}");
        }
    }

    #[test]
    fn ids_differ() {
        let ids = RequestIds::new();
        assert_ne!(ids.next(), ids.next());
    }
}
