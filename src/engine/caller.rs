//! Who calls, for what is shared among callers: turns on the threads, places in the queue, bytes of bodies.

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
