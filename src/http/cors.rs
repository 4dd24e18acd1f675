//! What browsers are told of the pages that may call.

use crate::access::Sites;
use axum::http::Method;
use axum::http::header::{self, HeaderName};
use std::time::Duration;
use tower_http::cors::{AllowOrigin, CorsLayer};

/// How long a browser may remember what it may send.
const PREFLIGHT_LIFE: Duration = Duration::from_secs(600);
/// What a page may send beside the headers that any page may.
const ALLOWED_HEADERS: [HeaderName; 7] = [
    header::AUTHORIZATION,
    header::CONTENT_TYPE,
    header::IF_MATCH,
    HeaderName::from_static("x-api-key"),
    HeaderName::from_static("x-request-id"),
    HeaderName::from_static("traceparent"),
    HeaderName::from_static("inference-header-content-length"),
];
/// What a page may read beside the headers that any page may.
const EXPOSED_HEADERS: [HeaderName; 5] = [
    header::ETAG,
    header::RETRY_AFTER,
    HeaderName::from_static("x-request-id"),
    HeaderName::from_static("server-timing"),
    HeaderName::from_static("inference-header-content-length"),
];

/// Tells browsers which pages may read answers; none where no origin was set.
pub fn cors(sites: &Sites) -> Option<CorsLayer> {
    if !sites.has_origins() {
        return None;
    }
    let sites = sites.clone();
    let layer = CorsLayer::new()
        .allow_origin(AllowOrigin::predicate(move |origin, _| sites.allows(origin)))
        .allow_credentials(true)
        .allow_private_network(true)
        .allow_methods([Method::GET, Method::POST, Method::PUT, Method::DELETE])
        .allow_headers(ALLOWED_HEADERS)
        .expose_headers(EXPOSED_HEADERS)
        .max_age(PREFLIGHT_LIFE);
    Some(layer)
}
