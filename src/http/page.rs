//! The page for people: files that were made of `dashboard/` and are a part of the program.
//!
//! A program that was built without them has no page, and leads to its documentation instead.

use crate::http::App;
use crate::problem::{Kind, Problem};
use axum::Router;
use axum::extract::Path;
use axum::http::header::{
    ACCEPT_ENCODING, CACHE_CONTROL, CONTENT_ENCODING, CONTENT_SECURITY_POLICY, CONTENT_TYPE, VARY,
};
use axum::http::{HeaderMap, HeaderName, HeaderValue};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::get;
use rust_embed::RustEmbed;

#[derive(RustEmbed)]
#[folder = "dashboard/dist/page"]
#[allow_missing = true]
struct Files;

/// The document; everything else is named by it.
const INDEX: &str = "index.html";
/// Names of assets hold a digest of their content.
const FOR_EVER: &str = "public, max-age=31536000, immutable";
/// The document may be another one after an update.
const ASK_AGAIN: &str = "no-cache";
/// The camera is the page's alone, and there is nothing else to ask for.
const PERMISSIONS: &str = "camera=(self), microphone=(), geolocation=()";
/// Nothing from elsewhere, nothing inside a text.
const CONTENT_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
    media-src 'self' blob:; connect-src 'self' ws: wss:; manifest-src 'self'; base-uri 'none'; form-action 'self'; \
    frame-ancestors 'none'";
/// How files are kept beside the plain ones, the shortest first: what callers call it, and how its files end.
const ENCODINGS: [Encoding; 2] =
    [Encoding { name: "br", extension: ".br" }, Encoding { name: "gzip", extension: ".gz" }];

struct Encoding {
    name: &'static str,
    extension: &'static str,
}

/// Whether this program has a page.
pub fn is_there() -> bool {
    Files::get(INDEX).is_some()
}

/// The calls that the page is made of.
pub fn routes() -> Router<App> {
    let mut router = Router::new().route("/", get(index)).route("/assets/{*path}", get(asset));
    let is_beside = |name: &str| {
        !name.contains('/') && ENCODINGS.iter().all(|encoding| !name.ends_with(encoding.extension))
    };
    for name in Files::iter().filter(|name| is_beside(name) && *name != INDEX) {
        let path = format!("/{name}");
        let beside = async move |headers: HeaderMap| {
            file(&name, &headers, ASK_AGAIN).unwrap_or_else(|| Problem::from(Kind::NotFound).into_response())
        };
        router = router.route(&path, get(beside));
    }
    router
}

/// The page, or where there is none the documentation.
async fn index(headers: HeaderMap) -> Response {
    let policy = [
        (CONTENT_SECURITY_POLICY, HeaderValue::from_static(CONTENT_POLICY)),
        (HeaderName::from_static("permissions-policy"), HeaderValue::from_static(PERMISSIONS)),
    ];
    match file(INDEX, &headers, ASK_AGAIN) {
        Some(page) => (policy, page).into_response(),
        None => Redirect::temporary("docs/").into_response(),
    }
}

/// A script, a style or a picture of the page.
async fn asset(Path(path): Path<String>, headers: HeaderMap) -> Response {
    let found = file(&format!("assets/{path}"), &headers, FOR_EVER);
    found.unwrap_or_else(|| Problem::from(Kind::NotFound).into_response())
}

/// A file as the caller can read it.
fn file(path: &str, headers: &HeaderMap, cached: &'static str) -> Option<Response> {
    let plain = Files::get(path)?;
    let accepted = headers.get(ACCEPT_ENCODING).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let encoded = ENCODINGS
        .iter()
        .filter(|encoding| accepts(accepted, encoding.name))
        .find_map(|encoding| Some((encoding, Files::get(&format!("{path}{}", encoding.extension))?)));
    let shared = [(CONTENT_TYPE, media_type(path)), (CACHE_CONTROL, cached), (VARY, "accept-encoding")];
    Some(match encoded {
        Some((encoding, file)) => {
            (shared, [(CONTENT_ENCODING, encoding.name)], file.data.into_owned()).into_response()
        }
        None => (shared, plain.data.into_owned()).into_response(),
    })
}

/// Whether a list of encodings has this one, and not with the quality 0.
fn accepts(list: &str, name: &str) -> bool {
    list.split(',').any(|entry| {
        let mut parts = entry.split(';').map(str::trim);
        let is_named = parts.next().is_some_and(|encoding| encoding.eq_ignore_ascii_case(name));
        let is_refused = parts.any(|part| {
            part.strip_prefix("q=")
                .is_some_and(|quality| quality.parse::<f32>().is_ok_and(|quality| quality == 0.0))
        });
        is_named && !is_refused
    })
}

/// Of the kinds of files that the page is made of.
fn media_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map(|(_, extension)| extension) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("webmanifest") => "application/manifest+json",
        Some("json" | "map") => "application/json",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_encoding_is_taken_where_it_is_accepted() {
        assert!(accepts("gzip, deflate, br", "br") && accepts("GZIP;q=0.5", "gzip"));
        assert!(!accepts("gzip, br;q=0", "br") && !accepts("", "br") && !accepts("brotli", "br"));
    }
}
