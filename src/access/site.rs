//! Which names the service answers to, and which pages may call it.
//!
//! Without keys only this machine's own programs are meant to call. But a browser lets any page send requests
//! to 127.0.0.1, under a name of the page's own (its owner lets it point here) or as what they are: calls of
//! another site. So the name must be one that no page can choose, and the page must be one of ours. With keys
//! only a session in a cookie needs this, since a browser sends it by itself.

use super::AuthError;
use http::Method;
use http::header::{self, HeaderMap, HeaderName, HeaderValue};
use http::uri::{Authority, Uri};
use std::net::IpAddr;
use std::sync::Arc;

const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");
const SEC_FETCH_MODE: HeaderName = HeaderName::from_static("sec-fetch-mode");
/// The names and the pages that are ours.
#[derive(Clone, Debug)]
pub struct Sites {
    hosts: Vec<Host>,
    origins: Arc<[Origin]>,
}

/// What is no name or page.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum SiteError {
    /// Among the hosts.
    #[error("{0:?} is no name; give one such as roomsight or roomsight:8080")]
    Host(String),
    /// Among the origins.
    #[error("{0:?} is no origin; give one such as https://dashboard.example")]
    Origin(String),
}

impl SiteError {
    /// The setting that it stands in.
    pub fn setting(&self) -> &'static str {
        match self {
            Self::Host(_) => "hosts",
            Self::Origin(_) => "origins",
        }
    }
}

/// `name` or `name:port`, without regard to case.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Host {
    name: String,
    port: Option<u16>,
}

/// `scheme://name` or `scheme://name:port`, as browsers say where a page comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Origin {
    scheme: String,
    host: Host,
}

impl Sites {
    /// The names `hosts`, the address `listen` and the pages of `origins`, as the settings of these names have them.
    ///
    /// # Errors
    /// What is no host, or no origin.
    pub fn new(hosts: &[String], listen: &str, origins: &[String]) -> Result<Self, SiteError> {
        let host = |text: &String| Host::parse(text).ok_or_else(|| SiteError::Host(text.clone()));
        let origin = |text: &String| Origin::parse(text).ok_or_else(|| SiteError::Origin(text.clone()));
        let mut hosts: Vec<Host> = hosts.iter().map(host).collect::<Result<_, _>>()?;
        hosts.extend(Host::parse(listen));
        Ok(Self { hosts, origins: origins.iter().map(origin).collect::<Result<_, _>>()? })
    }

    /// Whether any origin was set.
    pub fn has_origins(&self) -> bool {
        !self.origins.is_empty()
    }

    /// Holds that a call uses a name of ours: an address, a name of this machine alone, or one that was set.
    ///
    /// # Errors
    /// Another name, or none.
    pub fn check_host(&self, headers: &HeaderMap) -> Result<(), AuthError> {
        let host = headers.get(header::HOST);
        let is_own = host.and_then(host_of).is_some_and(|host| {
            host.is_address() || host.is_of_this_machine() || self.hosts.iter().any(|own| own.covers(&host))
        });
        if is_own { Ok(()) } else { Err(AuthError::Host(shown(host))) }
    }

    /// Holds that a call comes from a page of ours, from one that was set, or from no page at all. Following
    /// a link to here is no call of the page that has it.
    ///
    /// # Errors
    /// A page of another site.
    pub fn check_origin(&self, method: &Method, headers: &HeaderMap) -> Result<(), AuthError> {
        let origin = headers.get(header::ORIGIN);
        if origin.is_some_and(|origin| self.allows(origin)) {
            return Ok(());
        }
        let is_ours = match headers.get(SEC_FETCH_SITE).map(HeaderValue::as_bytes) {
            Some(b"same-origin" | b"none") => true,
            Some(_) => {
                let is_link = headers.get(SEC_FETCH_MODE).is_some_and(|mode| mode == "navigate");
                is_link && method.is_safe() && !headers.contains_key(header::UPGRADE)
            }
            // Browsers leave it out where they cannot trust the network, and other programs always.
            None => origin.is_none_or(|origin| {
                let host = headers.get(header::HOST).and_then(host_of);
                let origin = origin.to_str().ok().and_then(Origin::parse);
                origin.zip(host).is_some_and(|(origin, host)| host.is_maybe(&origin.host))
            }),
        };
        if is_ours { Ok(()) } else { Err(AuthError::Origin(shown(origin))) }
    }

    /// Whether an origin was set, so that its pages may call from a browser.
    pub fn allows(&self, origin: &HeaderValue) -> bool {
        let origin = origin.to_str().ok().and_then(Origin::parse);
        origin.is_some_and(|origin| self.origins.contains(&origin))
    }
}

impl Host {
    fn parse(text: &str) -> Option<Self> {
        let authority: Authority = text.parse().ok()?;
        if text.contains('@') {
            return None;
        }
        let name = authority.host().strip_suffix('.').unwrap_or(authority.host());
        let host = Self { name: name.to_ascii_lowercase(), port: authority.port_u16() };
        (!name.is_empty()).then_some(host)
    }

    /// Whether it is an address: nobody can let a name of their own look like one.
    fn is_address(&self) -> bool {
        let bare = self.name.strip_prefix('[').and_then(|name| name.strip_suffix(']'));
        bare.unwrap_or(&self.name).parse::<IpAddr>().is_ok()
    }

    /// Whether it is a name that systems resolve to themselves.
    fn is_of_this_machine(&self) -> bool {
        self.name == "localhost" || self.name.ends_with(".localhost")
    }

    /// Whether another is this one; without a port it is, whatever the other's.
    fn covers(&self, other: &Self) -> bool {
        self.name == other.name && self.port.is_none_or(|port| other.port == Some(port))
    }

    /// Whether both may be one: some programs and proxies leave the port out.
    fn is_maybe(&self, other: &Self) -> bool {
        self.covers(other) || other.covers(self)
    }
}

impl Origin {
    fn parse(text: &str) -> Option<Self> {
        let uri: Uri = text.parse().ok()?;
        let scheme = uri.scheme_str()?.to_ascii_lowercase();
        let host = Host::parse(uri.authority()?.as_str())?;
        let default_port = match scheme.as_str() {
            "http" => Some(80),
            "https" => Some(443),
            _ => None,
        };
        let port = host.port.filter(|port| Some(*port) != default_port);
        let is_bare = matches!(uri.path(), "" | "/") && uri.query().is_none();
        is_bare.then_some(Self { scheme, host: Host { port, ..host } })
    }
}

fn host_of(value: &HeaderValue) -> Option<Host> {
    Host::parse(value.to_str().ok()?)
}

/// A header for an error's text.
fn shown(value: Option<&HeaderValue>) -> String {
    value.map_or_else(String::new, |value| String::from_utf8_lossy(value.as_bytes()).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LISTEN: &str = "127.0.0.1:8080";

    fn sites(hosts: &[&str], origins: &[&str]) -> Sites {
        let owned = |texts: &[&str]| texts.iter().map(|&text| text.to_owned()).collect::<Vec<_>>();
        Sites::new(&owned(hosts), LISTEN, &owned(origins)).unwrap()
    }

    fn headers(pairs: &[(&'static str, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (HeaderName::from_static(name), value.parse().unwrap())).collect()
    }

    #[test]
    fn only_names_that_no_page_can_choose_are_answered_to() {
        let sites = sites(&["roomsight:8080", "Robots.Lab"], &[]);
        let answers = |host: &str| sites.check_host(&headers(&[("host", host)])).is_ok();
        for own in [
            "127.0.0.1:8080",
            "192.168.1.7",
            "[::1]:8080",
            "localhost",
            "LOCALHOST:9",
            "localhost.:80",
            "lab.localhost",
            "roomsight:8080",
            "RoomSight:8080",
            "robots.lab:1234",
        ] {
            assert!(answers(own), "{own}");
        }
        for foreign in [
            "evil.example:8080",
            "roomsight:8081",
            "roomsight",
            "localhost.evil.example",
            "127.0.0.1.evil.example",
            "127.0.0.1@evil.example",
            "evil.example@127.0.0.1",
            "",
        ] {
            assert!(!answers(foreign), "{foreign}");
        }
        assert!(sites.check_host(&HeaderMap::new()).is_err());
    }

    #[test]
    fn a_page_of_another_site_is_told_from_our_own_and_from_programs() {
        let sites = sites(&[], &["https://dash.example", "http://dash.lab:3000"]);
        let asks = |pairs: &[_]| {
            let headers = headers(&[&[("host", "robot:8080")], pairs].concat());
            sites.check_origin(&Method::POST, &headers).is_ok()
        };
        assert!(asks(&[]), "a program");
        for own in [
            "http://robot:8080",
            "http://ROBOT:8080",
            "http://robot",
            "http://robot/",
            "https://dash.example",
            "https://DASH.example:443",
            "http://dash.lab:3000",
        ] {
            assert!(asks(&[("origin", own)]), "{own}");
        }
        for foreign in [
            "http://evil.example",
            "http://robot:9090",
            "http://dash.example",
            "http://dash.lab",
            "null",
            "",
            "file://",
        ] {
            assert!(!asks(&[("origin", foreign)]), "{foreign}");
        }
        let behind_proxy = ("origin", "https://elsewhere.example");
        assert!(asks(&[behind_proxy, ("sec-fetch-site", "same-origin")]), "a proxy has changed Host");
        for site in ["cross-site", "same-site", "nonsense"] {
            assert!(!asks(&[("sec-fetch-site", site)]), "{site}");
            assert!(asks(&[("sec-fetch-site", site), ("origin", "https://dash.example")]), "{site}");
        }
    }

    #[test]
    fn a_link_from_another_site_may_be_followed_but_opens_no_stream() {
        let sites = sites(&[], &[]);
        let link = [("sec-fetch-site", "cross-site"), ("sec-fetch-mode", "navigate")];
        let may = |method: &Method, pairs: &[_]| sites.check_origin(method, &headers(pairs)).is_ok();
        assert!(may(&Method::GET, &link));
        assert!(!may(&Method::POST, &link), "a form that sends itself");
        assert!(!may(&Method::GET, &[&link[..], &[("upgrade", "websocket")]].concat()));
        assert!(!may(&Method::GET, &[link[0], ("sec-fetch-mode", "no-cors")]), "an image");
    }

    #[test]
    fn what_is_no_host_or_no_origin_is_refused_by_name() {
        for (hosts, origins) in [
            (vec!["http://lab".to_owned()], vec![]),
            (vec!["a b".to_owned()], vec![]),
            (vec![], vec!["dash.example".to_owned()]),
            (vec![], vec!["https://dash.example/path".to_owned()]),
            (vec![], vec!["*".to_owned()]),
        ] {
            let name = if hosts.is_empty() { "origins" } else { "hosts" };
            assert_eq!(Sites::new(&hosts, LISTEN, &origins).unwrap_err().setting(), name);
        }
    }
}
