//! Why topics cannot be had.

use thiserror::Error;

/// A name that ROS 2 does not take.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{name:?} is no name of ROS: {reason}")]
pub struct NameError {
    /// What was given.
    pub name: String,
    /// What is wrong with it.
    pub reason: &'static str,
}

/// Why a session, a subscription or a publisher failed.
#[derive(Debug, Error)]
pub enum RosError {
    /// A wrong name.
    #[error(transparent)]
    Name(#[from] NameError),
    /// What the DDS says.
    #[error("DDS: {0}")]
    Dds(String),
    /// What zenoh says.
    #[error("zenoh: {0}")]
    Zenoh(String),
}
