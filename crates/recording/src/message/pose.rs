//! Where a robot is, by messages that tell it.

use super::{Header, fields};
use crate::error::MessageError;
use crate::fields::Fields;
use crate::topic::{Kind, Topic};

/// Where something is on the floor.
#[derive(Clone, Debug, PartialEq)]
pub struct Located {
    /// What it is located in, such as `map` or `odom`.
    pub frame_id: String,
    /// What is located, such as `base_link`; empty where the message does not say.
    pub child_frame_id: String,
    /// In meters.
    pub x: f64,
    /// In meters.
    pub y: f64,
    /// Which way it looks, in radians from the x axis to the y axis.
    pub yaw: f64,
}

/// What a message says of where things are: one thing, or several of a message of transforms.
///
/// # Errors
/// A damaged message, one of another type.
pub fn located(topic: &Topic, message: &[u8]) -> Result<Vec<Located>, MessageError> {
    let mut fields = fields(topic, message)?;
    let header = |fields: &mut Fields| Header::read(fields, topic.encoding);
    match topic.kind() {
        Kind::PoseStamped | Kind::PoseWithCovarianceStamped => {
            let Header { frame_id, .. } = header(&mut fields)?;
            Ok(vec![place(&mut fields, frame_id, String::new())?])
        }
        Kind::Odometry => {
            let Header { frame_id, .. } = header(&mut fields)?;
            let child_frame_id = fields.text()?;
            Ok(vec![place(&mut fields, frame_id, child_frame_id)?])
        }
        Kind::Transforms => {
            let n_transforms = fields.u32()?;
            let mut transforms = Vec::new();
            for _ in 0..n_transforms {
                let Header { frame_id, .. } = header(&mut fields)?;
                let child_frame_id = fields.text()?;
                transforms.push(place(&mut fields, frame_id, child_frame_id)?);
            }
            Ok(transforms)
        }
        _ => Err(MessageError::Type(topic.type_name.clone())),
    }
}

/// A point or translation, and the quaternion behind it.
fn place(fields: &mut Fields, frame_id: String, child_frame_id: String) -> Result<Located, MessageError> {
    let [x, y, _z] = [fields.f64()?, fields.f64()?, fields.f64()?];
    let [qx, qy, qz, qw] = [fields.f64()?, fields.f64()?, fields.f64()?, fields.f64()?];
    let yaw = (2.0 * (qw * qz + qx * qy)).atan2(1.0 - 2.0 * (qy * qy + qz * qz));
    Ok(Located { frame_id, child_frame_id, x, y, yaw })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topic::Encoding;

    #[test]
    fn a_pose_of_ros_1_is_read() {
        let name = "/pose".to_owned();
        let type_name = "geometry_msgs/PoseStamped".to_owned();
        let topic = Topic { name, type_name, encoding: Encoding::Ros1, n_messages: None };
        let mut message = vec![1, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0];
        message.extend(b"map");
        let half = std::f64::consts::FRAC_1_SQRT_2;
        message.extend(
            [1.5, -2.0, 0.0, 0.0, 0.0, half, half].iter().flat_map(|number: &f64| number.to_le_bytes()),
        );
        let [pose] = &located(&topic, &message).unwrap()[..] else { panic!("one pose") };
        assert_eq!((pose.frame_id.as_str(), pose.x, pose.y), ("map", 1.5, -2.0));
        assert!((pose.yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
        assert_eq!(located(&topic, &message[..message.len() - 1]), Err(MessageError::Short));
    }
}
