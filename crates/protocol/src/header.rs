//! The optional header of a frame in a stream: with it, the client numbers and dates its frames, and says what else it sensed.
//!
//! | bytes | what |
//! |---|---|
//! | 0 to 3 | `RSF1` |
//! | 4 to 7 | flags, a little-endian u32: bit 0, the time is given; bit 1, odometry follows; bit 2, a scan follows; all others 0 |
//! | 8 to 15 | the frame's number, a little-endian u64 up to 2^52 |
//! | 16 to 23 | when it was captured, in nanoseconds since 1970, a little-endian u64; 0 where not given |
//! | 24 to 47 | with bit 1: the robot's `x` and `y` in meters and its heading in radians, little-endian f64 |
//! | then | with bit 2: the [scan](super::scan) of a laser |
//! | then | the encoded image |
//!
//! No image format begins with these four bytes, so that a bare image needs no flag that says so.

use super::scan::LaserScan;

/// What begins a frame with a header.
const MAGIC: [u8; 4] = *b"RSF1";
/// The largest number that a header may give. JSON's readers tell whole numbers up to 2^53 apart; what lies
/// between is for bare frames that follow.
pub const MAX_SEQ: u64 = 1 << 52;
/// The flag of a frame whose time is given.
const DATED: u32 = 1;
/// The flag of a frame with odometry.
const LOCATED: u32 = 2;
/// The flag of a frame with a scan.
const SCANNED: u32 = 4;

/// What a client says of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Header {
    /// Its number, larger than those before it, at most [`MAX_SEQ`].
    pub seq: u64,
    /// When it was captured, in nanoseconds since 1970.
    pub captured_at_ns: Option<u64>,
    /// Where the robot was then.
    pub odometry: Option<Odometry>,
    /// Whether a scan lies before the image.
    pub has_scan: bool,
}

/// Where a robot is by its wheels, in coordinates that may begin anywhere and grow wrong with the way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Odometry {
    /// In meters.
    pub x: f64,
    /// In meters.
    pub y: f64,
    /// In radians, counterclockwise.
    pub heading: f64,
}

/// What a client tells of a frame beside its number and the image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beside<'a> {
    /// When it was captured, in nanoseconds since 1970.
    pub captured_at_ns: Option<u64>,
    /// Where the robot was then.
    pub odometry: Option<Odometry>,
    /// What its laser measured then.
    pub scan: Option<&'a LaserScan>,
}

/// Why a header cannot be read.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
pub enum HeaderError {
    /// The message ends within it.
    #[error("the frame begins with RSF1 but ends within its header of {0} bytes")]
    Short(usize),
    /// Flags of another version of the protocol.
    #[error("the frame's header has flags that roomsight.v1 does not know: {0:#x}")]
    Flags(u32),
}

impl Header {
    /// How long it is without odometry.
    pub const MIN_BYTES: usize = 24;

    /// How long it is at most.
    pub const MAX_BYTES: usize = 48;

    /// How long it is.
    pub fn n_bytes(&self) -> usize {
        if self.odometry.is_some() { Self::MAX_BYTES } else { Self::MIN_BYTES }
    }

    /// Reads the header of a message, if it has one; what follows is the scan, if it has one, and the image.
    ///
    /// # Errors
    /// A header that is cut off or of another version.
    pub fn split(message: &[u8]) -> Result<Option<Self>, HeaderError> {
        if !message.starts_with(&MAGIC) {
            return Ok(None);
        }
        let (header, rest) =
            message.split_first_chunk::<{ Self::MIN_BYTES }>().ok_or(HeaderError::Short(Self::MIN_BYTES))?;
        let [_, _, _, _, f0, f1, f2, f3, numbers @ ..] = *header;
        let flags = u32::from_le_bytes([f0, f1, f2, f3]);
        if flags & !(DATED | LOCATED | SCANNED) != 0 {
            return Err(HeaderError::Flags(flags));
        }
        let [s0, s1, s2, s3, s4, s5, s6, s7, time @ ..] = numbers;
        let captured_at_ns = (flags & DATED != 0).then_some(u64::from_le_bytes(time));
        let odometry = match (flags & LOCATED != 0, rest.as_chunks::<8>().0) {
            (false, _) => None,
            (true, [x, y, heading, ..]) => {
                let [x, y, heading] = [x, y, heading].map(|bytes| f64::from_le_bytes(*bytes));
                Some(Odometry { x, y, heading })
            }
            (true, _) => return Err(HeaderError::Short(Self::MAX_BYTES)),
        };
        let seq = u64::from_le_bytes([s0, s1, s2, s3, s4, s5, s6, s7]);
        Ok(Some(Self { seq, captured_at_ns, odometry, has_scan: flags & SCANNED != 0 }))
    }

    /// The header before what follows it, as one message.
    pub fn join(self, rest: &[u8]) -> Vec<u8> {
        let mut message = self.begin(rest.len());
        message.extend(rest);
        message
    }

    /// A message with room for so many bytes more.
    fn begin(self, n_more: usize) -> Vec<u8> {
        let mut flags = 0;
        for (is_set, flag) in [
            (self.captured_at_ns.is_some(), DATED),
            (self.odometry.is_some(), LOCATED),
            (self.has_scan, SCANNED),
        ] {
            flags |= if is_set { flag } else { 0 };
        }
        let mut message = Vec::with_capacity(self.n_bytes() + n_more);
        message.extend(MAGIC);
        message.extend(flags.to_le_bytes());
        message.extend(self.seq.to_le_bytes());
        message.extend(self.captured_at_ns.unwrap_or_default().to_le_bytes());
        let numbers = self.odometry.into_iter().flat_map(|Odometry { x, y, heading }| [x, y, heading]);
        message.extend(numbers.flat_map(f64::to_le_bytes));
        message
    }
}

impl Beside<'_> {
    /// A frame of this number, as one message.
    pub fn message(&self, seq: u64, image: &[u8]) -> Vec<u8> {
        let Self { captured_at_ns, odometry, scan } = *self;
        let header = Header { seq, captured_at_ns, odometry, has_scan: scan.is_some() };
        let mut message = header.begin(scan.map_or(0, LaserScan::n_bytes) + image.len());
        if let Some(scan) = scan {
            scan.write(&mut message);
        }
        message.extend(image);
        message
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_header_comes_back(
            seq: u64, captured_at_ns: Option<u64>, place in prop::option::of((-1e6_f64..1e6, -1e6_f64..1e6, -9_f64..9.0)),
            has_scan: bool, image: Vec<u8>,
        ) {
            let odometry = place.map(|(x, y, heading)| Odometry { x, y, heading });
            let header = Header { seq, captured_at_ns, odometry, has_scan };
            let message = header.join(&image);
            prop_assert_eq!(Header::split(&message), Ok(Some(header)));
            prop_assert_eq!(&message[header.n_bytes()..], &image);
        }

        #[test]
        fn after_the_magic_anything_is_read_or_refused(rest: Vec<u8>) {
            match Header::split(&[&MAGIC[..], &rest].concat()) {
                Ok(header) => prop_assert!(header.is_some_and(|header| header.n_bytes() <= rest.len() + MAGIC.len())),
                Err(HeaderError::Short(n_bytes)) => prop_assert!(rest.len() + MAGIC.len() < n_bytes),
                Err(HeaderError::Flags(flags)) => prop_assert!(flags > 7),
            }
        }
    }

    #[test]
    fn a_bare_image_has_none_and_a_cut_or_foreign_one_is_refused() {
        assert_eq!(Header::split(b"\xff\xd8\xff"), Ok(None));
        assert_eq!(Header::split(b""), Ok(None));
        let message = Header { seq: 7, ..Header::default() }.join(b"");
        assert_eq!(
            Header::split(&message[..Header::MIN_BYTES - 1]),
            Err(HeaderError::Short(Header::MIN_BYTES))
        );
        let mut foreign = message.clone();
        foreign[4] = 8;
        assert_eq!(Header::split(&foreign), Err(HeaderError::Flags(8)));
        let mut without_odometry = message;
        without_odometry[4] = 2;
        assert_eq!(Header::split(&without_odometry), Err(HeaderError::Short(Header::MAX_BYTES)));
    }

    #[test]
    fn all_that_is_sensed_lies_in_one_message() {
        let scan = LaserScan {
            angle_min: -1.5,
            angle_increment: 0.1,
            range_max: 8.0,
            ranges: vec![Some(1.0), None],
        };
        let odometry = Some(Odometry { x: 1.0, y: 2.0, heading: 3.0 });
        let beside = Beside { captured_at_ns: Some(9), odometry, scan: Some(&scan) };
        let message = beside.message(5, b"image");
        let header = Header::split(&message).unwrap().unwrap();
        assert_eq!(header, Header { seq: 5, captured_at_ns: Some(9), odometry, has_scan: true });
        assert_eq!(LaserScan::read(&message[header.n_bytes()..]), Ok(scan.clone()));
        assert_eq!(&message[header.n_bytes() + scan.n_bytes()..], b"image");
    }
}
