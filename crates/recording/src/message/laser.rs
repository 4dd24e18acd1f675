//! What a laser measures, by messages that tell it.

use super::{Header, fields};
use crate::error::MessageError;
use crate::topic::{Kind, Topic};

/// One sweep of a laser scanner, as its driver says.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// The angle of the first beam, in radians counterclockwise from ahead.
    pub angle_min: f32,
    /// From one beam to the next, in radians.
    pub angle_increment: f32,
    /// The longest range that is measured, in meters.
    pub range_max: f32,
    /// How far each beam reaches, in meters; beyond the longest range, or no number, where it met nothing.
    pub ranges: Vec<f32>,
}

/// The sweep of a `sensor_msgs/LaserScan`.
///
/// # Errors
/// A damaged message, one of another type.
pub fn sweep(topic: &Topic, message: &[u8]) -> Result<Sweep, MessageError> {
    if topic.kind() != Kind::LaserScan {
        return Err(MessageError::Type(topic.type_name.clone()));
    }
    let mut fields = fields(topic, message)?;
    Header::read(&mut fields, topic.encoding)?;
    let [angle_min, _angle_max, angle_increment] = [fields.f32()?, fields.f32()?, fields.f32()?];
    let [_time_increment, _scan_time] = [fields.f32()?, fields.f32()?];
    let [_range_min, range_max] = [fields.f32()?, fields.f32()?];
    let n_ranges = fields.u32()?;
    // As they come: a length that lies takes no room.
    let ranges = (0..n_ranges).map(|_| fields.f32()).collect::<Result<_, _>>()?;
    Ok(Sweep { angle_min, angle_increment, range_max, ranges })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topic::Encoding;

    #[test]
    fn a_scan_of_ros_1_is_read_and_a_cut_one_refused() {
        let (name, type_name) = ("/scan".to_owned(), "sensor_msgs/LaserScan".to_owned());
        let topic = Topic { name, type_name, encoding: Encoding::Ros1, n_messages: None };
        let mut message = vec![1, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0, 0];
        message.extend(b"base");
        let numbers = [-1.5_f32, 1.5, 0.75, 0.0, 0.1, 0.05, 8.0];
        message.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        message.extend(3_u32.to_le_bytes());
        message.extend([1.0_f32, f32::INFINITY, 2.5].iter().flat_map(|number| number.to_le_bytes()));
        let expected = Sweep {
            angle_min: -1.5,
            angle_increment: 0.75,
            range_max: 8.0,
            ranges: vec![1.0, f32::INFINITY, 2.5],
        };
        assert_eq!(sweep(&topic, &message), Ok(expected));
        assert_eq!(sweep(&topic, &message[..message.len() - 1]), Err(MessageError::Short));
        message[48..52].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(sweep(&topic, &message).is_err());
        let other = Topic { type_name: "sensor_msgs/Image".to_owned(), ..topic };
        assert!(matches!(sweep(&other, &message), Err(MessageError::Type(_))));
    }
}
