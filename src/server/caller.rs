//! Who calls, for what is shared among callers: turns on the threads, places in the queue, bytes of bodies.

use super::auth::KeyName;
use super::listen::Peer;
use axum::http::Extensions;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::Arc;

/// The network of an IPv6 address that one caller commonly has to itself.
const IPV6_NETWORK: u128 = u128::MAX << 64;

/// One caller: the name of its key, else of its robot, else its address. Cheap to clone.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum CallerId {
    /// All who have the key of this name.
    Key(Arc<str>),
    /// A robot of this name, where there are no keys.
    Robot(Arc<str>),
    /// All at this address who say no name.
    Address(IpAddr),
}

impl CallerId {
    /// Of a request with these extensions: who was found out before, else its key or its address.
    pub fn of(extensions: &Extensions) -> Self {
        if let Some(caller) = extensions.get::<Self>() {
            return caller.clone();
        }
        if let Some(KeyName(name)) = extensions.get() {
            return Self::Key(name.as_str().into());
        }
        // Without a connection there is nobody to tell from another.
        let address = extensions.get().map_or(Ipv6Addr::UNSPECIFIED.into(), |Peer(address)| address.ip());
        Self::at(address)
    }

    /// The same where it says that it is this robot; a key says more than that.
    pub fn with_robot(self, robot: Option<&str>) -> Self {
        match (self, robot) {
            (Self::Address(_), Some(robot)) => Self::Robot(robot.into()),
            (caller, _) => caller,
        }
    }

    /// Whoever calls from this address without a name. Addresses of one IPv6 network are one caller.
    pub fn at(address: IpAddr) -> Self {
        Self::Address(match address.to_canonical() {
            IpAddr::V6(address) => Ipv6Addr::from_bits(address.to_bits() & IPV6_NETWORK).into(),
            v4 => v4,
        })
    }
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
        let of = |key, robot| CallerId::of(&extensions("10.0.0.1:1000", key)).with_robot(robot);
        assert_eq!(of(Some("fleet"), Some("wall-e")), CallerId::Key("fleet".into()));
        assert_eq!(of(None, Some("wall-e")), CallerId::Robot("wall-e".into()));
        assert_eq!(of(None, None), CallerId::Address("10.0.0.1".parse().unwrap()));
        assert_ne!(of(Some("wall-e"), None), of(None, Some("wall-e")));
    }

    #[test]
    fn one_network_is_one_caller() {
        let of = |address| CallerId::of(&extensions(address, None));
        assert_eq!(of("[2001:db8::1]:5"), of("[2001:db8::ffff:2]:6"));
        assert_ne!(of("[2001:db8::1]:5"), of("[2001:db8:0:1::1]:5"));
        assert_eq!(of("[::ffff:10.0.0.1]:5"), of("10.0.0.1:6"));
        assert_ne!(of("10.0.0.1:5"), of("10.0.0.2:5"));
    }
}
