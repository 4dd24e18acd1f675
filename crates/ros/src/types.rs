//! Types of messages, and the hashes by which ROS 2 tells whether two programs mean the same.

use ring::digest::{SHA256, digest};
use std::collections::BTreeMap;
use std::fmt::Write;

/// A type of messages.
#[derive(Debug, PartialEq, Eq)]
pub struct MessageType {
    /// Such as `sensor_msgs/msg/Image`.
    pub name: &'static str,
    fields: &'static [Field],
}

/// A field of messages.
#[derive(Debug, PartialEq, Eq)]
struct Field {
    name: &'static str,
    base: Base,
    many: Many,
}

/// What a field holds one of, or many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Base {
    I32,
    U8,
    U32,
    F32,
    F64,
    Bool,
    Byte,
    Text,
    Message(&'static MessageType),
}

/// How many a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Many {
    One,
    Array(u64),
    Sequence,
}

impl Base {
    /// Its number in `type_description_interfaces/msg/FieldType`.
    fn id(self) -> u32 {
        match self {
            Self::Message(_) => 1,
            Self::U8 => 3,
            Self::I32 => 6,
            Self::U32 => 7,
            Self::F32 => 10,
            Self::F64 => 11,
            Self::Bool => 15,
            Self::Byte => 16,
            Self::Text => 17,
        }
    }
}

impl Many {
    /// What it adds to the number of what it holds.
    fn offset(self) -> u32 {
        match self {
            Self::One => 0,
            Self::Array(_) => 48,
            Self::Sequence => 144,
        }
    }
}

impl MessageType {
    /// As DDS calls it, and zenoh too: `sensor_msgs::msg::dds_::Image_`.
    pub(crate) fn dds_name(&self) -> String {
        let (package, name) = self.name.rsplit_once('/').unwrap_or(("", self.name));
        format!("{}::dds_::{name}_", package.replace('/', "::"))
    }

    /// The hash that REP 2016 defines: of all names and types of fields, also in the messages that it holds.
    pub(crate) fn hash(&self) -> String {
        let hash = digest(&SHA256, self.description().as_bytes());
        hash.as_ref().iter().fold("RIHS01_".to_owned(), |mut text, byte| {
            // A text takes all.
            let _ = write!(text, "{byte:02x}");
            text
        })
    }

    /// The JSON that is hashed: `type_description_interfaces/msg/TypeDescription`, without defaults.
    fn description(&self) -> String {
        let mut referenced = BTreeMap::new();
        self.add_referenced(&mut referenced);
        let referenced: Vec<String> = referenced.values().map(|message| message.own_description()).collect();
        format!(
            r#"{{"type_description": {}, "referenced_type_descriptions": [{}]}}"#,
            self.own_description(),
            referenced.join(", ")
        )
    }

    fn add_referenced(&self, referenced: &mut BTreeMap<&'static str, &'static Self>) {
        for field in self.fields {
            if let Base::Message(message) = field.base {
                referenced.insert(message.name, message);
                message.add_referenced(referenced);
            }
        }
    }

    fn own_description(&self) -> String {
        let field = |field: &Field| {
            let capacity = if let Many::Array(length) = field.many { length } else { 0 };
            let nested = if let Base::Message(message) = field.base { message.name } else { "" };
            format!(
                r#"{{"name": "{}", "type": {{"type_id": {}, "capacity": {capacity}, "string_capacity": 0, "nested_type_name": "{nested}"}}}}"#,
                field.name,
                field.base.id() + field.many.offset(),
            )
        };
        let fields: Vec<String> = self.fields.iter().map(field).collect();
        format!(r#"{{"type_name": "{}", "fields": [{}]}}"#, self.name, fields.join(", "))
    }
}

const fn one(name: &'static str, base: Base) -> Field {
    Field { name, base, many: Many::One }
}

const fn array(name: &'static str, base: Base, length: u64) -> Field {
    Field { name, base, many: Many::Array(length) }
}

const fn sequence(name: &'static str, base: Base) -> Field {
    Field { name, base, many: Many::Sequence }
}

macro_rules! message_types {
    ($($(#[$doc:meta])* $visibility:vis $type:ident = $name:literal [$($field:expr),* $(,)?];)*) => {
        $($(#[$doc])* $visibility static $type: MessageType = MessageType { name: $name, fields: &[$($field),*] };)*
    };
}

message_types! {
    TIME = "builtin_interfaces/msg/Time" [one("sec", Base::I32), one("nanosec", Base::U32)];
    HEADER = "std_msgs/msg/Header" [one("stamp", Base::Message(&TIME)), one("frame_id", Base::Text)];
    /// A picture as a camera encoded it.
    pub COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage" [
        one("header", Base::Message(&HEADER)), one("format", Base::Text), sequence("data", Base::U8),
    ];
    /// A picture of pixels.
    pub IMAGE = "sensor_msgs/msg/Image" [
        one("header", Base::Message(&HEADER)),
        one("height", Base::U32),
        one("width", Base::U32),
        one("encoding", Base::Text),
        one("is_bigendian", Base::U8),
        one("step", Base::U32),
        sequence("data", Base::U8),
    ];
    /// A sweep of a laser.
    pub LASER_SCAN = "sensor_msgs/msg/LaserScan" [
        one("header", Base::Message(&HEADER)),
        one("angle_min", Base::F32),
        one("angle_max", Base::F32),
        one("angle_increment", Base::F32),
        one("time_increment", Base::F32),
        one("scan_time", Base::F32),
        one("range_min", Base::F32),
        one("range_max", Base::F32),
        sequence("ranges", Base::F32),
        sequence("intensities", Base::F32),
    ];
    POINT = "geometry_msgs/msg/Point" [one("x", Base::F64), one("y", Base::F64), one("z", Base::F64)];
    VECTOR = "geometry_msgs/msg/Vector3" [one("x", Base::F64), one("y", Base::F64), one("z", Base::F64)];
    QUATERNION = "geometry_msgs/msg/Quaternion" [
        one("x", Base::F64), one("y", Base::F64), one("z", Base::F64), one("w", Base::F64),
    ];
    POSE = "geometry_msgs/msg/Pose" [
        one("position", Base::Message(&POINT)), one("orientation", Base::Message(&QUATERNION)),
    ];
    TWIST = "geometry_msgs/msg/Twist" [
        one("linear", Base::Message(&VECTOR)), one("angular", Base::Message(&VECTOR)),
    ];
    POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovariance" [
        one("pose", Base::Message(&POSE)), array("covariance", Base::F64, 36),
    ];
    TWIST_WITH_COVARIANCE = "geometry_msgs/msg/TwistWithCovariance" [
        one("twist", Base::Message(&TWIST)), array("covariance", Base::F64, 36),
    ];
    /// Where a robot is by its wheels.
    pub ODOMETRY = "nav_msgs/msg/Odometry" [
        one("header", Base::Message(&HEADER)),
        one("child_frame_id", Base::Text),
        one("pose", Base::Message(&POSE_WITH_COVARIANCE)),
        one("twist", Base::Message(&TWIST_WITH_COVARIANCE)),
    ];
    ROOM_PROBABILITY = "roomsight_msgs/msg/RoomProbability" [
        one("room", Base::Text), one("probability", Base::F32),
    ];
    /// Which room a robot is in.
    pub ROOM_ANSWER = "roomsight_msgs/msg/RoomAnswer" [
        one("header", Base::Message(&HEADER)),
        one("room", Base::Text),
        one("known", Base::Bool),
        one("probability", Base::F32),
        one("frame_room", Base::Text),
        one("frame_known", Base::Bool),
        one("frame_probability", Base::F32),
        one("unknown", Base::Text),
        one("novelty", Base::F32),
        sequence("probabilities", Base::Message(&ROOM_PROBABILITY)),
        one("model", Base::Text),
    ];
    KEY_VALUE = "diagnostic_msgs/msg/KeyValue" [one("key", Base::Text), one("value", Base::Text)];
    DIAGNOSTIC_STATUS = "diagnostic_msgs/msg/DiagnosticStatus" [
        one("level", Base::Byte),
        one("name", Base::Text),
        one("message", Base::Text),
        one("hardware_id", Base::Text),
        sequence("values", Base::Message(&KEY_VALUE)),
    ];
    /// How programs are.
    pub DIAGNOSTIC_ARRAY = "diagnostic_msgs/msg/DiagnosticArray" [
        one("header", Base::Message(&HEADER)), sequence("status", Base::Message(&DIAGNOSTIC_STATUS)),
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As rosbags 0.11 hashes the definitions of Jazzy, and those in `ros2/roomsight_msgs`.
    #[test]
    fn hashes_are_those_of_ros() {
        let hashes = [
            (&COMPRESSED_IMAGE, "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a"),
            (&IMAGE, "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"),
            (&LASER_SCAN, "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"),
            (&ODOMETRY, "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"),
            (&ROOM_ANSWER, "cea05eda2f7a6e4b416c6891d071f9fbe8b81d0ff13a5c32797425030dcb89bb"),
            (&DIAGNOSTIC_ARRAY, "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"),
        ];
        for (message, hash) in hashes {
            assert_eq!(message.hash(), format!("RIHS01_{hash}"), "{}", message.name);
        }
        assert_eq!(IMAGE.dds_name(), "sensor_msgs::msg::dds_::Image_");
    }
}
