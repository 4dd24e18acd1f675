//! Names of nodes and topics, by the rules of ROS 2 (design.ros2.org, "Topic and Service name mapping to DDS").

use crate::error::NameError;
use std::fmt;
use std::str::FromStr;

/// What a node is called, and in which namespace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeName {
    namespace: String,
    name: String,
}

/// Another name for a topic: `from:=to`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remap {
    from: String,
    to: String,
}

impl NodeName {
    /// A name, such as `roomsight`, in a namespace, such as `/robot1`, or `/` for none.
    ///
    /// # Errors
    /// A name that ROS does not take.
    pub fn new(namespace: &str, name: &str) -> Result<Self, NameError> {
        check_part(name, name)?;
        let trimmed = namespace.strip_prefix('/').unwrap_or(namespace);
        if !trimmed.is_empty() {
            check_parts(namespace, trimmed)?;
        }
        Ok(Self { namespace: format!("/{trimmed}"), name: name.to_owned() })
    }

    /// The namespace, which begins with a slash.
    pub fn namespace(&self) -> &str {
        &self.namespace
    }

    /// The name without its namespace.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The whole name of a topic: of `/a` itself, of `a` in the namespace, of `~/a` below the node.
    ///
    /// # Errors
    /// A name that ROS does not take.
    pub fn topic(&self, name: &str) -> Result<String, NameError> {
        let base = self.namespace.trim_end_matches('/');
        let (base, relative) = if let Some(below) = name.strip_prefix("~/") {
            (format!("{base}/{}", self.name), below)
        } else if let Some(absolute) = name.strip_prefix('/') {
            (String::new(), absolute)
        } else {
            (base.to_owned(), name)
        };
        check_parts(name, relative)?;
        Ok(format!("{base}/{relative}"))
    }

    /// The same after renaming; of several that fit the first counts.
    ///
    /// # Errors
    /// A name that ROS does not take, also of a renaming.
    pub fn remapped(&self, name: &str, remaps: &[Remap]) -> Result<String, NameError> {
        let topic = self.topic(name)?;
        for Remap { from, to } in remaps {
            if self.topic(from)? == topic {
                return self.topic(to);
            }
        }
        Ok(topic)
    }
}

impl fmt::Display for NodeName {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.namespace.trim_end_matches('/'), self.name)
    }
}

impl FromStr for Remap {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        let error = || NameError { name: text.to_owned(), reason: "a renaming is FROM:=TO" };
        let (from, to) = text.split_once(":=").ok_or_else(error)?;
        Ok(Self { from: from.to_owned(), to: to.to_owned() })
    }
}

fn check_parts(name: &str, parts: &str) -> Result<(), NameError> {
    parts.split('/').try_for_each(|part| check_part(name, part))
}

fn check_part(name: &str, part: &str) -> Result<(), NameError> {
    let error = |reason| Err(NameError { name: name.to_owned(), reason });
    match part.chars().next() {
        None => error("a part of it is empty"),
        Some('0'..='9') => error("a part of it begins with a digit"),
        Some(_) if part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') => Ok(()),
        Some(_) => error("it may have letters of ASCII, digits, _ and / alone"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_lie_where_their_names_say() {
        let node = NodeName::new("/robot1", "roomsight").unwrap();
        assert_eq!(node.to_string(), "/robot1/roomsight");
        let topic = |name| node.topic(name).unwrap();
        assert_eq!(topic("image/compressed"), "/robot1/image/compressed");
        assert_eq!(topic("/tf"), "/tf");
        assert_eq!(topic("~/answer"), "/robot1/roomsight/answer");
        let alone = NodeName::new("/", "roomsight").unwrap();
        assert_eq!(NodeName::new("", "roomsight").unwrap(), alone);
        assert_eq!(alone.to_string(), "/roomsight");
        assert_eq!(alone.topic("~/answer").unwrap(), "/roomsight/answer");
        assert_eq!(alone.topic("image").unwrap(), "/image");
    }

    #[test]
    fn renaming_takes_the_whole_name() {
        let node = NodeName::new("/robot1", "roomsight").unwrap();
        let remaps: Vec<Remap> = ["image:=/front/image_raw", "/robot1/roomsight/answer:=room"]
            .map(|text| text.parse().unwrap())
            .to_vec();
        assert_eq!(node.remapped("image", &remaps).unwrap(), "/front/image_raw");
        assert_eq!(node.remapped("~/answer", &remaps).unwrap(), "/robot1/room");
        assert_eq!(node.remapped("image/compressed", &remaps).unwrap(), "/robot1/image/compressed");
    }

    #[test]
    fn names_that_ros_refuses_are_refused() {
        let node = NodeName::new("/", "roomsight").unwrap();
        for name in ["", "/", "a//b", "a/", "1a", "a/2b", "a-b", "~", "~/", "é", "a b"] {
            assert!(node.topic(name).is_err(), "{name:?}");
        }
        assert!(NodeName::new("/a//b", "roomsight").is_err());
        assert!(NodeName::new("/", "room/sight").is_err());
        assert!("image".parse::<Remap>().is_err());
    }
}
