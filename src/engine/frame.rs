//! An encoded frame, and the memory that it holds.

use crate::problem::Problem;
use bytes::Bytes;
use roomsight_protocol::scan::LaserScan;
use roomsight_recognition::model::Scan;
use std::sync::Arc;

/// What is told of a frame without a byte.
pub const EMPTY_FRAME: &str =
    "the body is empty; send the image itself, for example with `curl --data-binary @frame.jpg`";

/// The bytes of one frame, and their share of the memory for bodies.
pub struct Frame {
    pub bytes: Bytes,
    /// What the robot's laser measured beside it.
    pub scan: Option<Scan>,
    /// They lie among others, which go only with them.
    is_part: bool,
    /// Gives the memory back when it is dropped.
    held: Arc<dyn Send + Sync>,
}

impl Frame {
    /// Bytes whose memory is `held`.
    pub fn new(bytes: Bytes, held: impl Send + Sync + 'static) -> Self {
        Self { bytes, scan: None, is_part: false, held: Arc::new(held) }
    }

    /// Bytes that lie in a buffer with others, and whose memory is `held`.
    pub fn within_buffer(bytes: Bytes, held: impl Send + Sync + 'static) -> Self {
        Self { is_part: true, ..Self::new(bytes, held) }
    }

    /// Bytes that are a part of these, or were decoded from them: they share their memory.
    pub fn part(&self, bytes: Bytes) -> Self {
        Self { bytes, scan: None, is_part: true, held: self.held.clone() }
    }

    /// The same with what the robot's laser measured.
    ///
    /// # Errors
    /// Numbers that no laser gives.
    pub fn with_scan(self, scan: LaserScan) -> Result<Self, Problem> {
        let LaserScan { angle_min, angle_increment, range_max, ranges } = scan;
        let ranges = ranges.into_iter().map(|range| range.unwrap_or(f32::INFINITY)).collect();
        let scan = Scan::new(angle_min, angle_increment, range_max, ranges);
        let scan = scan.map_err(|error| Problem::query(error.to_string()))?;
        Ok(Self { scan: Some(scan), ..self })
    }

    /// The image without the bytes before it, which are few.
    pub fn after(&self, n_bytes: usize) -> Self {
        let (bytes, held) = (self.bytes.slice(n_bytes..), self.held.clone());
        Self { bytes, scan: None, is_part: self.is_part, held }
    }

    /// The bytes for one who keeps them when the frame is done with; copied only where they would keep others with them.
    pub fn lasting(&self) -> Bytes {
        if self.is_part { Bytes::copy_from_slice(&self.bytes) } else { self.bytes.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_among_others_is_copied_to_be_kept_and_a_whole_one_is_not() {
        let whole = Frame::new(vec![1, 2, 3].into(), ());
        assert_eq!(whole.lasting().as_ptr(), whole.bytes.as_ptr());
        let after = whole.after(1);
        assert_eq!((after.lasting().as_ptr(), &after.bytes[..]), (after.bytes.as_ptr(), &[2, 3][..]));
        let part = whole.part(whole.bytes.slice(1..));
        assert_ne!(part.lasting().as_ptr(), part.bytes.as_ptr());
        assert_eq!(part.lasting(), part.bytes);
    }
}
