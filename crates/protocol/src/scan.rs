//! What a robot's laser measured beside a frame.
//!
//! In JSON it has the fields of a `sensor_msgs/LaserScan` that are needed. In a stream it lies between the
//! [header](super::header) and the image, little-endian:
//!
//! | bytes | what |
//! |---|---|
//! | 0 to 3 | the number of ranges, a u32 |
//! | 4 to 15 | `angle_min`, `angle_increment`, `range_max`, f32 |
//! | 16 on | the ranges, f32; infinite or no number where a beam met nothing |

use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// The most ranges of a scan.
pub const MAX_RANGES: usize = 16_384;

/// Bytes before the ranges.
const HEAD_BYTES: usize = 16;

/// One sweep of a laser scanner in a plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LaserScan {
    /// The angle of the first beam, in radians counterclockwise from ahead.
    pub angle_min: f32,
    /// From one beam to the next, in radians.
    pub angle_increment: f32,
    /// The longest range that is measured, in meters.
    pub range_max: f32,
    /// How far each beam reaches, in meters; null, or `range_max` and more, where it met nothing.
    #[cfg_attr(feature = "schema", schema(min_items = 16, max_items = 16_384))]
    pub ranges: Vec<Option<f32>>,
}

/// Why bytes hold no scan.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
pub enum ScanBytesError {
    /// The message ends within it.
    #[error("the frame's header says that a scan follows, but the message ends within it")]
    Short,
    /// More ranges than any scanner gives.
    #[error("the scan has {0} ranges, at most {MAX_RANGES} are taken")]
    Long(u32),
}

impl LaserScan {
    /// How long it is in a stream.
    pub fn n_bytes(&self) -> usize {
        HEAD_BYTES + 4 * self.ranges.len()
    }

    /// Appends it as a stream has it.
    pub fn write(&self, message: &mut Vec<u8>) {
        message.extend((self.ranges.len() as u32).to_le_bytes());
        for number in [self.angle_min, self.angle_increment, self.range_max] {
            message.extend(number.to_le_bytes());
        }
        for range in &self.ranges {
            message.extend(range.unwrap_or(f32::INFINITY).to_le_bytes());
        }
    }

    /// Reads the one that bytes begin with.
    ///
    /// # Errors
    /// Bytes that end within it, a number of ranges that no scanner gives.
    pub fn read(bytes: &[u8]) -> Result<Self, ScanBytesError> {
        let (head, ranges) = bytes.split_first_chunk::<HEAD_BYTES>().ok_or(ScanBytesError::Short)?;
        let (numbers, _) = head.as_chunks::<4>();
        let n_ranges = u32::from_le_bytes(numbers[0]);
        if n_ranges as usize > MAX_RANGES {
            return Err(ScanBytesError::Long(n_ranges));
        }
        let ranges = ranges.get(..4 * n_ranges as usize).ok_or(ScanBytesError::Short)?;
        let range = |bytes: &[u8; 4]| Some(f32::from_le_bytes(*bytes)).filter(|range| range.is_finite());
        let [angle_min, angle_increment, range_max] = [1, 2, 3].map(|idx| f32::from_le_bytes(numbers[idx]));
        Ok(Self {
            angle_min,
            angle_increment,
            range_max,
            ranges: ranges.as_chunks().0.iter().map(range).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_scan() -> impl Strategy<Value = LaserScan> {
        let ranges = prop::collection::vec(prop::option::of(0.0_f32..30.0), 0..300);
        (-4.0_f32..4.0, 0.001_f32..0.1, 1.0_f32..90.0, ranges).prop_map(
            |(angle_min, angle_increment, range_max, ranges)| LaserScan {
                angle_min,
                angle_increment,
                range_max,
                ranges,
            },
        )
    }

    proptest! {
        #[test]
        fn a_scan_comes_back_and_what_follows_is_left(scan in any_scan(), image: Vec<u8>) {
            let mut message = Vec::new();
            scan.write(&mut message);
            prop_assert_eq!(message.len(), scan.n_bytes());
            message.extend(&image);
            prop_assert_eq!(LaserScan::read(&message), Ok(scan.clone()));
            prop_assert_eq!(&message[scan.n_bytes()..], &image);
            prop_assert_eq!(LaserScan::read(&message[..scan.n_bytes() - 1]), Err(ScanBytesError::Short));
            let json = serde_json::to_string(&scan).unwrap();
            prop_assert_eq!(serde_json::from_str::<LaserScan>(&json).unwrap(), scan);
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes: Vec<u8>) {
            if let Ok(scan) = LaserScan::read(&bytes) {
                prop_assert!(scan.n_bytes() <= bytes.len());
            }
        }
    }

    #[test]
    fn a_number_of_ranges_that_no_scanner_gives_takes_no_memory() {
        let bytes = [&u32::MAX.to_le_bytes()[..], &[0; 12]].concat();
        assert_eq!(LaserScan::read(&bytes), Err(ScanBytesError::Long(u32::MAX)));
    }
}
