//! Who calls, as a request tells it.

use super::auth::KeyName;
use crate::engine::caller::CallerId;
use axum::http::Extensions;
use std::net::{Ipv6Addr, SocketAddr};

/// The address that a connection comes from; every request carries it as an extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer(pub SocketAddr);

/// Who calls, by a request with these extensions: who was found out before, else its key or its address.
pub fn caller_of(extensions: &Extensions) -> CallerId {
    if let Some(caller) = extensions.get::<CallerId>() {
        return caller.clone();
    }
    if let Some(KeyName(name)) = extensions.get() {
        return CallerId::Key(name.as_str().into());
    }
    // Without a connection there is nobody to tell from another.
    let address = extensions.get().map_or(Ipv6Addr::UNSPECIFIED.into(), |Peer(address)| address.ip());
    CallerId::at(address)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extensions(address: &str, key: Option<&str>) -> Extensions {
        let mut extensions = Extensions::new();
        extensions.insert(Peer(address.parse().unwrap()));
        if let Some(key) = key {
            extensions.insert(KeyName(key.to_owned()));
        }
        extensions
    }

    #[test]
    fn a_key_counts_before_a_robots_name_and_that_before_an_address() {
        let of = |key, robot| caller_of(&extensions("10.0.0.1:1000", key)).with_robot(robot);
        assert_eq!(of(Some("fleet"), Some("wall-e")), CallerId::Key("fleet".into()));
        assert_eq!(of(None, Some("wall-e")), CallerId::Robot("wall-e".into()));
        assert_eq!(of(None, None), CallerId::Address("10.0.0.1".parse().unwrap()));
        assert_ne!(of(Some("wall-e"), None), of(None, Some("wall-e")));
    }

    #[test]
    fn one_network_is_one_caller() {
        let of = |address| caller_of(&extensions(address, None));
        assert_eq!(of("[2001:db8::1]:5"), of("[2001:db8::ffff:2]:6"));
        assert_ne!(of("[2001:db8::1]:5"), of("[2001:db8:0:1::1]:5"));
        assert_eq!(of("[::ffff:10.0.0.1]:5"), of("10.0.0.1:6"));
        assert_ne!(of("10.0.0.1:5"), of("10.0.0.2:5"));
    }
}
