//! The bits of entropy-coded data, up to the next marker.

/// What a scan holds, interval after interval: the bytes between two restart markers, or all of them.
pub(super) struct Stream<'a> {
    bytes: &'a [u8],
    /// The first byte behind the last interval: where a marker begins, or the end.
    position: usize,
    /// The bytes of an interval as they were before zeros were stuffed between them, and [`PADDING`].
    interval: Vec<u8>,
}

/// Follows the bytes of an interval, so that its last ones can be read together with others.
const PADDING: [u8; 8] = [0; 8];

/// Zeros and ones, read from the most significant bit of each byte on.
///
/// After the data's end there are only zeros, and [`Bits::ran_out`] tells.
#[derive(Clone, Copy)]
pub(super) struct Bits<'a> {
    /// The bytes that are not in `window`, at least not as a whole, and [`PADDING`].
    rest: &'a [u8],
    /// The next bits, from the highest on.
    window: u64,
    /// How many bits of `window` count, up to 63. Those behind them are zeros, or already what they will be.
    n_bits: u32,
    /// How many bytes were read behind the padding.
    n_beyond: usize,
}

/// A restart marker that came where one should, or later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Restart {
    /// How many whole intervals are missing before it.
    pub n_lost: usize,
}

impl<'a> Stream<'a> {
    pub(super) fn new(bytes: &'a [u8], position: usize) -> Self {
        let n_bytes = bytes.len().saturating_sub(position) + PADDING.len();
        Self { bytes, position, interval: Vec::with_capacity(n_bytes) }
    }

    /// The bits up to the next marker.
    pub(super) fn interval(&mut self) -> Bits<'_> {
        self.interval.clear();
        while let Some(rest) = self.bytes.get(self.position..) {
            let n_plain = first_ff(rest).unwrap_or(rest.len());
            self.interval.extend_from_slice(&rest[..n_plain]);
            self.position += n_plain;
            // One or more bytes of 255 and a 0 are a single byte of 255.
            let n_ff = rest[n_plain..].iter().take_while(|&&byte| byte == 0xFF).count();
            if rest.get(n_plain + n_ff) != Some(&0) {
                break;
            }
            self.interval.push(0xFF);
            self.position += n_ff + 1;
        }
        self.interval.extend(PADDING);
        Bits { rest: &self.interval, window: 0, n_bits: 0, n_beyond: 0 }
    }

    /// Goes on after the next restart marker, which should be number `expected` (modulo 8). Without one
    /// before the scan's end there is nothing to go on with.
    pub(super) fn restart(&mut self, expected: usize) -> Option<Restart> {
        loop {
            self.position = next_marker(self.bytes, self.position)?;
            let marker = self.bytes[self.position + 1];
            if !(0xD0..=0xD7).contains(&marker) {
                return None;
            }
            self.position += 2;
            let n_lost = (usize::from(marker - 0xD0) + 8 - expected % 8) % 8;
            // One that was expected a little earlier is late; others tell that something is missing.
            if n_lost < 6 {
                return Some(Restart { n_lost });
            }
        }
    }

    /// Where the last interval ends.
    pub(super) fn position(&self) -> usize {
        self.position
    }
}

impl Bits<'_> {
    /// Gets at least 56 bits ready.
    #[inline(always)]
    pub(super) fn refill(&mut self) {
        // From 0 to 7.
        let n_bytes = (!self.n_bits & 63) as usize / 8;
        if let Some(&chunk) = self.rest.first_chunk() {
            self.window |= u64::from_be_bytes(chunk) >> (self.n_bits & 63);
            self.rest = &self.rest[n_bytes..];
        } else {
            self.n_beyond += n_bytes;
        }
        self.n_bits |= 56;
    }

    /// The next `count` bits, from 1 to 32, left where they are.
    #[inline(always)]
    pub(super) fn peek(&self, count: u32) -> u32 {
        (self.window >> (64 - count)) as u32
    }

    /// Steps over `count` bits, of those that a refill got.
    #[inline(always)]
    pub(super) fn skip(&mut self, count: u32) {
        self.window <<= count;
        self.n_bits -= count;
    }

    /// Takes `count` bits, from 0 to 16, of those that a refill got.
    #[inline(always)]
    pub(super) fn take(&mut self, count: u32) -> u32 {
        let bits = (self.window >> 32 >> (32 - count)) as u32;
        self.skip(count);
        bits
    }

    /// Takes one bit.
    #[inline(always)]
    pub(super) fn take_bit(&mut self) -> bool {
        self.refill();
        self.take(1) == 1
    }

    /// Whether more bits were taken than there are.
    #[inline(always)]
    pub(super) fn ran_out(&self) -> bool {
        8 * self.rest.len() + (self.n_bits as usize) < 8 * (PADDING.len() + self.n_beyond)
    }
}

/// Where the next marker is, at `position` or later.
pub(super) fn next_marker(bytes: &[u8], mut position: usize) -> Option<usize> {
    loop {
        position += first_ff(bytes.get(position..)?)?;
        match bytes.get(position + 1)? {
            0xFF => position += 1,
            0 => position += 2,
            _ => return Some(position),
        }
    }
}

/// Where the first byte of 255 is.
fn first_ff(bytes: &[u8]) -> Option<usize> {
    const ONES: u64 = u64::from_ne_bytes([1; 8]);
    const HIGH: u64 = u64::from_ne_bytes([0x80; 8]);
    let (chunks, rest) = bytes.as_chunks();
    for (chunk_idx, &chunk) in chunks.iter().enumerate() {
        // A byte of 255 is zero once it is inverted; the lowest that is found is one.
        let inverted = !u64::from_le_bytes(chunk);
        let found = inverted.wrapping_sub(ONES) & !inverted & HIGH;
        if found != 0 {
            return Some(8 * chunk_idx + found.trailing_zeros() as usize / 8);
        }
    }
    rest.iter().position(|&byte| byte == 0xFF).map(|idx| 8 * chunks.len() + idx)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn stuffed_bytes_are_data_and_markers_end_it() {
        let bytes =
            [0x12, 0xFF, 0x00, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE, 0xFF, 0xFF, 0x00, 0x21, 0xFF, 0xD9];
        let mut stream = Stream::new(&bytes, 0);
        let mut bits = stream.interval();
        let mut taken = Vec::new();
        for _ in 0..10 {
            bits.refill();
            taken.push(bits.take(8) as u8);
        }
        assert_eq!(taken, [0x12, 0xFF, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE, 0xFF, 0x21]);
        assert!(!bits.ran_out());
        bits.refill();
        assert_eq!(bits.take(1), 0);
        assert!(bits.ran_out());
        assert_eq!((stream.position(), stream.restart(0)), (13, None));
    }

    #[test]
    fn restarts_tell_what_is_missing() {
        let bytes = [1, 0xFF, 0xD0, 2, 0xFF, 0xD3, 3, 0xFF, 0xD3, 4, 0xFF, 0xD9];
        let mut stream = Stream::new(&bytes, 0);
        assert_eq!(stream.restart(0), Some(Restart { n_lost: 0 }));
        assert_eq!(stream.restart(1), Some(Restart { n_lost: 2 }));
        // The same number once more is no longer expected.
        assert_eq!(stream.restart(4), None);
    }

    /// The first marker and the data before it, byte by byte.
    fn plain_interval(bytes: &[u8]) -> (Option<usize>, Vec<u8>) {
        let (mut data, mut n_ff) = (Vec::new(), 0);
        for (idx, &byte) in bytes.iter().enumerate() {
            match byte {
                0xFF => n_ff += 1,
                0 if n_ff > 0 => (n_ff, data) = (0, [&data[..], &[0xFF]].concat()),
                _ if n_ff > 0 => return (Some(idx - 1), data),
                _ => data.push(byte),
            }
        }
        (None, data)
    }

    proptest! {
        #[test]
        fn bits_are_those_of_bytes(
            bytes in prop::collection::vec(prop::sample::select(vec![0u8, 1, 0x5A, 0x80, 0xFE, 0xFF]), 0..60),
            counts in prop::collection::vec(1u32..=16, 0..60),
        ) {
            let (marker, data) = plain_interval(&bytes);
            prop_assert_eq!(next_marker(&bytes, 0), marker);
            let bit = |at: usize| u32::from(data.get(at / 8).is_some_and(|byte| byte >> (7 - at % 8) & 1 == 1));
            let mut stream = Stream::new(&bytes, 0);
            let mut bits = stream.interval();
            let mut at = 0;
            for count in counts {
                bits.refill();
                let expected = (0..count as usize).fold(0, |bits, idx| bits << 1 | bit(at + idx));
                prop_assert_eq!(bits.peek(count), expected);
                prop_assert_eq!(bits.take(count), expected);
                at += count as usize;
                prop_assert_eq!(bits.ran_out(), at > 8 * data.len());
            }
            prop_assert_eq!(next_marker(&bytes, stream.position()), marker);
        }
    }
}
