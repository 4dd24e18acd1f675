//! The fields of a message one after the other, of a stranger: each is there, or an error.

use crate::error::MessageError;

/// Reads fields from the beginning of bytes.
#[derive(Clone, Debug)]
pub(crate) struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
    layout: Layout,
}

/// How fields lie in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Layout {
    is_big_endian: bool,
    /// Numbers begin at multiples of their size, but of no more than this; 1 where nothing is aligned.
    most_alignment: usize,
    /// Whether a text ends in a zero that its length counts.
    has_zero: bool,
}

/// One behind the other, little-endian: ROS 1, and records of MCAP and of bags.
const PACKED: Layout = Layout { is_big_endian: false, most_alignment: 1, has_zero: false };

/// Bytes of CDR that say how the others lie.
const CDR_HEAD: usize = 4;

impl<'a> Fields<'a> {
    /// Fields that lie one behind the other.
    pub(crate) fn packed(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, layout: PACKED }
    }

    /// Fields in the common data representation of DDS (OMG, DDS-XTypes 1.3, section 7.4), plain, of version 1 or 2.
    pub(crate) fn cdr(message: &'a [u8]) -> Result<Self, MessageError> {
        let (head, bytes) = message.split_at_checked(CDR_HEAD).ok_or(MessageError::Short)?;
        let most_alignment = match head[..2] {
            [0, 0 | 1] => 8,
            [0, 6 | 7] => 4,
            _ => return Err(MessageError::Representation([head[0], head[1]])),
        };
        let is_big_endian = head[1] % 2 == 0;
        Ok(Self { bytes, at: 0, layout: Layout { is_big_endian, most_alignment, has_zero: true } })
    }

    /// What is left.
    pub(crate) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// So many bytes.
    pub(crate) fn take(&mut self, n_bytes: usize) -> Result<&'a [u8], MessageError> {
        let taken = self.rest().get(..n_bytes).ok_or(MessageError::Short)?;
        self.at += n_bytes;
        Ok(taken)
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], MessageError> {
        let aligned = self.at.next_multiple_of(N.min(self.layout.most_alignment));
        self.take(aligned - self.at)?;
        let mut bytes = *self.take(N)?.first_chunk().ok_or(MessageError::Short)?;
        if self.layout.is_big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, MessageError> {
        Ok(u8::from_le_bytes(self.number()?))
    }

    pub(crate) fn u32(&mut self) -> Result<u32, MessageError> {
        Ok(u32::from_le_bytes(self.number()?))
    }

    pub(crate) fn u64(&mut self) -> Result<u64, MessageError> {
        Ok(u64::from_le_bytes(self.number()?))
    }

    pub(crate) fn f32(&mut self) -> Result<f32, MessageError> {
        Ok(f32::from_le_bytes(self.number()?))
    }

    pub(crate) fn f64(&mut self) -> Result<f64, MessageError> {
        Ok(f64::from_le_bytes(self.number()?))
    }

    /// As many bytes as a length before them says.
    pub(crate) fn bytes(&mut self) -> Result<&'a [u8], MessageError> {
        let n_bytes = self.u32()? as usize;
        self.take(n_bytes)
    }

    /// A text; what is no UTF-8 in it is replaced.
    pub(crate) fn text(&mut self) -> Result<String, MessageError> {
        let bytes = self.bytes()?;
        let text = if self.layout.has_zero { bytes.strip_suffix(&[0]).unwrap_or(bytes) } else { bytes };
        Ok(String::from_utf8_lossy(text).into_owned())
    }

    /// A time, in seconds and nanoseconds, in nanoseconds.
    pub(crate) fn time_ns(&mut self) -> Result<u64, MessageError> {
        let (seconds, nanoseconds) = (self.u32()?, self.u32()?);
        Ok(u64::from(seconds) * 1_000_000_000 + u64::from(nanoseconds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_cdr_begin_at_multiples_of_their_size() {
        let mut bytes = vec![0, 1, 0, 0, 7, 0, 0, 0, 1, 2, 3, 4];
        bytes.extend([2, 0, 0, 0, b'a', 0, 9, 9]);
        bytes.extend(1.5_f64.to_le_bytes());
        let mut fields = Fields::cdr(&bytes).unwrap();
        assert_eq!((fields.u8(), fields.u32()), (Ok(7), Ok(0x0403_0201)));
        assert_eq!((fields.text().unwrap().as_str(), fields.f64()), ("a", Ok(1.5)));
        assert_eq!(fields.u8(), Err(MessageError::Short));
    }

    #[test]
    fn big_endian_and_the_second_version_are_read() {
        let mut fields = Fields::cdr(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 5]).unwrap();
        assert_eq!((fields.u8(), fields.u32()), (Ok(1), Ok(5)));
        let second = [&[0, 7, 0, 0, 1, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0][..]].concat();
        let mut fields = Fields::cdr(&second).unwrap();
        assert_eq!((fields.u8(), fields.u64()), (Ok(1), Ok(8)), "aligned to four");
        assert_eq!(Fields::cdr(&[0, 3, 0, 0]).unwrap_err(), MessageError::Representation([0, 3]));
    }

    #[test]
    fn nothing_is_taken_beyond_the_end() {
        let mut fields = Fields::packed(&[255, 255, 255, 255, 1]);
        assert_eq!(fields.bytes(), Err(MessageError::Short));
        let mut fields = Fields::packed(&[1, 0, 0, 0, 0xff]);
        assert_eq!(fields.text().unwrap(), "\u{fffd}");
    }
}
