//! What is recorded under a name: messages of one type.

use serde::Serialize;
use std::fmt;

/// A topic of a recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Topic {
    /// Its name, such as `/camera/image_raw/compressed`.
    pub name: String,
    /// The type of its messages, as the recording has it, such as `sensor_msgs/msg/CompressedImage`.
    #[serde(rename = "type")]
    pub type_name: String,
    /// How its messages are written.
    pub encoding: Encoding,
    /// The number of its messages, where the recording says it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_messages: Option<u64>,
}

/// How messages are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// As DDS does; ROS 2.
    Cdr,
    /// As ROS 1 does.
    Ros1,
    /// Protocol buffers.
    Protobuf,
    /// JSON.
    Json,
    /// Another way, which is not read.
    Other,
}

/// What messages of a type tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `sensor_msgs/CompressedImage`.
    CompressedImage,
    /// `sensor_msgs/Image`.
    Image,
    /// `foxglove.CompressedImage`.
    FoxgloveCompressedImage,
    /// `foxglove.RawImage`.
    FoxgloveRawImage,
    /// `nav_msgs/Odometry`.
    Odometry,
    /// `geometry_msgs/PoseStamped`.
    PoseStamped,
    /// `geometry_msgs/PoseWithCovarianceStamped`.
    PoseWithCovarianceStamped,
    /// `tf2_msgs/TFMessage`.
    Transforms,
    /// `sensor_msgs/LaserScan`.
    LaserScan,
    /// `std_msgs/String`.
    Text,
    /// Nothing that is read.
    Other,
}

impl Encoding {
    /// By the name that MCAP and rosbag2 have for it.
    pub(crate) fn of(name: &str) -> Self {
        match name {
            "cdr" => Self::Cdr,
            "ros1" => Self::Ros1,
            "protobuf" => Self::Protobuf,
            "json" => Self::Json,
            _ => Self::Other,
        }
    }
}

impl Kind {
    /// Whether messages hold a picture.
    pub fn is_picture(self) -> bool {
        matches!(
            self,
            Self::CompressedImage | Self::Image | Self::FoxgloveCompressedImage | Self::FoxgloveRawImage
        )
    }

    /// Whether messages tell where the robot is.
    pub fn is_pose(self) -> bool {
        matches!(
            self,
            Self::Odometry | Self::PoseStamped | Self::PoseWithCovarianceStamped | Self::Transforms
        )
    }
}

impl Topic {
    /// What its messages tell, as far as they are read.
    pub fn kind(&self) -> Kind {
        let (package, name) = self.type_name.rsplit_once(['/', '.']).unwrap_or(("", &self.type_name));
        let package = package.strip_suffix("/msg").unwrap_or(package);
        let is_ros = matches!(self.encoding, Encoding::Cdr | Encoding::Ros1);
        match (package, name) {
            ("foxglove" | "foxglove_msgs", "CompressedImage") if self.encoding != Encoding::Other => {
                Kind::FoxgloveCompressedImage
            }
            ("foxglove" | "foxglove_msgs", "RawImage") if self.encoding != Encoding::Other => {
                Kind::FoxgloveRawImage
            }
            _ if !is_ros => Kind::Other,
            ("sensor_msgs", "CompressedImage") => Kind::CompressedImage,
            ("sensor_msgs", "Image") => Kind::Image,
            ("sensor_msgs", "LaserScan") => Kind::LaserScan,
            ("nav_msgs", "Odometry") => Kind::Odometry,
            ("geometry_msgs", "PoseStamped") => Kind::PoseStamped,
            ("geometry_msgs", "PoseWithCovarianceStamped") => Kind::PoseWithCovarianceStamped,
            ("tf2_msgs" | "tf", "TFMessage" | "tfMessage") => Kind::Transforms,
            ("std_msgs", "String") => Kind::Text,
            _ => Kind::Other,
        }
    }
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} ({})", self.name, self.type_name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_known_by_all_their_names() {
        let kind = |type_name: &str, encoding| {
            let name = "/topic".to_owned();
            Topic { name, type_name: type_name.to_owned(), encoding, n_messages: None }.kind()
        };
        assert_eq!(kind("sensor_msgs/msg/Image", Encoding::Cdr), Kind::Image);
        assert_eq!(kind("sensor_msgs/Image", Encoding::Ros1), Kind::Image);
        assert_eq!(kind("sensor_msgs/msg/Image", Encoding::Json), Kind::Other);
        assert_eq!(kind("foxglove.RawImage", Encoding::Protobuf), Kind::FoxgloveRawImage);
        assert_eq!(kind("foxglove_msgs/msg/CompressedImage", Encoding::Cdr), Kind::FoxgloveCompressedImage);
        assert_eq!(kind("tf/tfMessage", Encoding::Ros1), Kind::Transforms);
        assert_eq!(kind("Image", Encoding::Cdr), Kind::Other);
    }
}
