//! The bits of entropy-coded data, up to the next marker.

/// Bytes of zeros and ones that make up a scan, read from the most significant bit on.
///
/// After the data's end there are only zeros, and [`Bits::ran_out`] tells.
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// The first byte that is not in `window`.
    position: usize,
    /// The next bits, from the highest on.
    window: u64,
    /// How many bits of `window` count; below 0 where more were taken than there were.
    n_bits: i32,
}

/// A restart marker that came where one should, or later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Restart {
    /// How many whole intervals are missing before it.
    pub n_lost: usize,
}

impl<'a> Bits<'a> {
    pub(super) fn new(bytes: &'a [u8], position: usize) -> Self {
        Self { bytes, position, window: 0, n_bits: 0 }
    }

    /// Gets at least 32 bits ready, or all that are left.
    #[inline(always)]
    pub(super) fn refill(&mut self) {
        if self.n_bits >= 32 {
            return;
        }
        if let Some((chunk, _)) = self.bytes.get(self.position..).and_then(|rest| rest.split_first_chunk()) {
            let word = u64::from_be_bytes(*chunk);
            if !has_ff(word) && self.n_bits >= 0 {
                // Bits beyond those that are counted are set too: the same will be set again.
                self.window |= word >> self.n_bits;
                let n_bytes = (63 - self.n_bits) / 8;
                self.position += n_bytes as usize;
                self.n_bits += 8 * n_bytes;
                return;
            }
        }
        self.refill_bytewise();
    }

    /// The same where a byte of 255 needs a look.
    #[cold]
    fn refill_bytewise(&mut self) {
        while self.n_bits <= 56 {
            let Some(&byte) = self.bytes.get(self.position) else { return };
            let mut next = self.position + 1;
            if byte == 0xFF {
                while self.bytes.get(next) == Some(&0xFF) {
                    next += 1;
                }
                if self.bytes.get(next) != Some(&0) {
                    return;
                }
                next += 1;
            }
            self.window |= u64::from(byte) << (56 - self.n_bits);
            self.n_bits += 8;
            self.position = next;
        }
    }

    /// The next `count` bits, from 1 to 32, left where they are.
    #[inline(always)]
    pub(super) fn peek(&self, count: u32) -> u32 {
        (self.window >> (64 - count)) as u32
    }

    /// Steps over `count` bits. A refill gets enough of them for two steps of 16.
    #[inline(always)]
    pub(super) fn skip(&mut self, count: u32) {
        self.window <<= count;
        self.n_bits -= count as i32;
    }

    /// Takes `count` bits, from 0 to 16.
    #[inline(always)]
    pub(super) fn take(&mut self, count: u32) -> u32 {
        let bits = (self.window >> 32 >> (32 - count)) as u32;
        self.skip(count);
        bits
    }

    /// Takes one bit, of those that a refill got.
    #[inline(always)]
    pub(super) fn take_bit(&mut self) -> bool {
        self.refill();
        self.take(1) == 1
    }

    /// Whether more bits were taken than there are.
    #[inline(always)]
    pub(super) fn ran_out(&self) -> bool {
        self.n_bits < 0
    }

    /// Goes on after the next restart marker, which should be number `expected` (modulo 8). Without one
    /// before the scan's end there is nothing to go on with.
    pub(super) fn restart(&mut self, expected: usize) -> Option<Restart> {
        loop {
            let marker_at = next_marker(self.bytes, self.position)?;
            let marker = self.bytes[marker_at + 1];
            if !(0xD0..=0xD7).contains(&marker) {
                self.position = marker_at;
                return None;
            }
            *self = Self::new(self.bytes, marker_at + 2);
            let n_lost = (usize::from(marker - 0xD0) + 8 - expected % 8) % 8;
            // One that was expected a little earlier is late; others tell that something is missing.
            if n_lost < 6 {
                return Some(Restart { n_lost });
            }
        }
    }

    /// Where the data is read on: at a marker where it came to one.
    pub(super) fn position(&self) -> usize {
        self.position
    }
}

/// Where the next marker is, at `position` or later.
pub(super) fn next_marker(bytes: &[u8], position: usize) -> Option<usize> {
    let rest = bytes.get(position..)?;
    rest.windows(2)
        .position(|pair| pair[0] == 0xFF && pair[1] != 0 && pair[1] != 0xFF)
        .map(|idx| position + idx)
}

/// Whether one of the bytes is 255.
#[inline(always)]
fn has_ff(word: u64) -> bool {
    const ONES: u64 = u64::from_ne_bytes([1; 8]);
    const HIGH: u64 = u64::from_ne_bytes([0x80; 8]);
    // A byte of 255 is zero once it is inverted.
    let inverted = !word;
    inverted.wrapping_sub(ONES) & !inverted & HIGH != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stuffed_bytes_are_data_and_markers_end_it() {
        let bytes =
            [0x12, 0xFF, 0x00, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE, 0xFF, 0xFF, 0x00, 0x21, 0xFF, 0xD9];
        let mut bits = Bits::new(&bytes, 0);
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
        assert_eq!((bits.position(), bits.restart(0)), (13, None));
    }

    #[test]
    fn restarts_tell_what_is_missing() {
        let bytes = [1, 0xFF, 0xD0, 2, 0xFF, 0xD3, 3, 0xFF, 0xD3, 4, 0xFF, 0xD9];
        let mut bits = Bits::new(&bytes, 0);
        assert_eq!(bits.restart(0), Some(Restart { n_lost: 0 }));
        assert_eq!(bits.restart(1), Some(Restart { n_lost: 2 }));
        // The same number once more is no longer expected.
        assert_eq!(bits.restart(4), None);
    }
}
