//! The optional header of a frame in a stream: with it, the client numbers and dates its frames.
//!
//! | bytes | what |
//! |---|---|
//! | 0 to 3 | `RSF1` |
//! | 4 to 7 | flags, a little-endian u32: bit 0, the time is given; all others 0 |
//! | 8 to 15 | the frame's number, a little-endian u64 up to 2^52 |
//! | 16 to 23 | when it was captured, in nanoseconds since 1970, a little-endian u64; 0 where not given |
//! | 24 on | the encoded image |
//!
//! No image format begins with these four bytes, so that a bare image needs no flag that says so.

/// What begins a frame with a header.
const MAGIC: [u8; 4] = *b"RSF1";
/// The largest number that a header may give. JSON's readers tell whole numbers up to 2^53 apart; what lies
/// between is for bare frames that follow.
pub const MAX_SEQ: u64 = 1 << 52;
/// The flag of a frame whose time is given.
const DATED: u32 = 1;

/// What a client says of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Its number, larger than those before it, at most [`MAX_SEQ`].
    pub seq: u64,
    /// When it was captured, in nanoseconds since 1970.
    pub captured_at_ns: Option<u64>,
}

/// Why a header cannot be read.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
pub enum HeaderError {
    /// The message ends within it.
    #[error("the frame begins with RSF1 but ends within its header of {} bytes", Header::BYTES)]
    Short,
    /// Flags of another version of the protocol.
    #[error("the frame's header has flags that roomsight.v1 does not know: {0:#x}")]
    Flags(u32),
}

impl Header {
    /// How long it is.
    pub const BYTES: usize = 24;

    /// Reads the header of a message, if it has one; what follows is the image.
    ///
    /// # Errors
    /// A header that is cut off or of another version.
    pub fn split(message: &[u8]) -> Result<Option<Self>, HeaderError> {
        if !message.starts_with(&MAGIC) {
            return Ok(None);
        }
        let header: &[u8; Self::BYTES] = message.first_chunk().ok_or(HeaderError::Short)?;
        let [_, _, _, _, f0, f1, f2, f3, rest @ ..] = *header;
        let flags = u32::from_le_bytes([f0, f1, f2, f3]);
        if flags & !DATED != 0 {
            return Err(HeaderError::Flags(flags));
        }
        let [s0, s1, s2, s3, s4, s5, s6, s7, time @ ..] = rest;
        let captured_at_ns = (flags & DATED != 0).then_some(u64::from_le_bytes(time));
        Ok(Some(Self { seq: u64::from_le_bytes([s0, s1, s2, s3, s4, s5, s6, s7]), captured_at_ns }))
    }

    /// The header before an image, as one message.
    pub fn join(self, image: &[u8]) -> Vec<u8> {
        let flags = if self.captured_at_ns.is_some() { DATED } else { 0 };
        let mut message = Vec::with_capacity(Self::BYTES + image.len());
        message.extend(MAGIC);
        message.extend(flags.to_le_bytes());
        message.extend(self.seq.to_le_bytes());
        message.extend(self.captured_at_ns.unwrap_or_default().to_le_bytes());
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
        fn a_header_comes_back(seq: u64, captured_at_ns: Option<u64>, image: Vec<u8>) {
            let header = Header { seq, captured_at_ns };
            let message = header.join(&image);
            prop_assert_eq!(Header::split(&message), Ok(Some(header)));
            prop_assert_eq!(&message[Header::BYTES..], &image);
        }

        #[test]
        fn after_the_magic_anything_is_read_or_refused(rest: Vec<u8>) {
            let header = Header::split(&[&MAGIC[..], &rest].concat());
            prop_assert_eq!(header == Err(HeaderError::Short), rest.len() < Header::BYTES - MAGIC.len());
        }
    }

    #[test]
    fn a_bare_image_has_none_and_a_cut_or_foreign_one_is_refused() {
        assert_eq!(Header::split(b"\xff\xd8\xff"), Ok(None));
        assert_eq!(Header::split(b""), Ok(None));
        let message = Header { seq: 7, captured_at_ns: None }.join(b"");
        assert_eq!(Header::split(&message[..Header::BYTES - 1]), Err(HeaderError::Short));
        let mut foreign = message;
        foreign[4] = 2;
        assert_eq!(Header::split(&foreign), Err(HeaderError::Flags(2)));
    }
}
