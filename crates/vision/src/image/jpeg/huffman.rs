//! Huffman tables, and the values that follow their codes.

use super::bits::Bits;

/// Codes up to this length are looked up at once, with the value that follows where both fit.
const LOOKUP_BITS: u32 = 10;

/// What the next bits mean: from the lowest bit on 8 bits of length, [`HAS_VALUE`], the symbol and the value.
/// The length is 0 where the code is longer than [`LOOKUP_BITS`]; the value's bits are counted where it is there.
type Entry = u32;

/// Whether the value is there.
const HAS_VALUE: Entry = 1 << 7;

/// A Huffman table.
pub(super) struct Table {
    lookup: Vec<Entry>,
    /// For each length of codes from 1 to 16: the first 16 bits that are beyond its codes.
    limits: [u32; 17],
    /// For each length: what makes the index of a symbol from its code.
    offsets: [i32; 17],
    symbols: Vec<u8>,
}

/// How many zeros come before a coefficient, and its value; or what else the symbol stands for.
#[derive(Clone, Copy)]
pub(super) enum Code {
    /// A coefficient after `run` zeros.
    Value {
        /// From 0 to 15.
        run: usize,
        /// The coefficient, never 0.
        value: i16,
    },
    /// No value follows: 15 for 16 zeros, other numbers end blocks.
    Empty {
        /// From 0 to 15.
        run: usize,
    },
}

impl Table {
    /// From the number of codes of each length from 1 to 16, and their symbols. `None` where there are more
    /// codes than bits can tell apart.
    pub(super) fn new(counts: &[u8; 16], symbols: &[u8]) -> Option<Self> {
        let mut table = Self {
            lookup: vec![0; 1 << LOOKUP_BITS],
            limits: [0; 17],
            offsets: [0; 17],
            symbols: symbols.to_vec(),
        };
        let (mut code, mut symbol_idx) = (0u32, 0usize);
        for (length, &count) in (1u32..).zip(counts) {
            table.offsets[length as usize] = symbol_idx as i32 - code as i32;
            for _ in 0..count {
                let symbol = *symbols.get(symbol_idx)?;
                if code >= 1 << length {
                    return None;
                }
                table.enter(code, length, symbol);
                code += 1;
                symbol_idx += 1;
            }
            table.limits[length as usize] = code << (16 - length);
            code <<= 1;
        }
        Some(table)
    }

    /// The table of Annex K that is meant where a stream brings none, as those of webcams do.
    pub(super) fn standard(class: Class, number: usize) -> Option<Self> {
        let (counts, symbols) = match (class, number) {
            (Class::Dc, 0) => (&DC_LUMA, &DC_SYMBOLS[..]),
            (Class::Dc, 1) => (&DC_CHROMA, &DC_SYMBOLS[..]),
            (Class::Ac, 0) => (&AC_LUMA, &AC_LUMA_SYMBOLS[..]),
            (Class::Ac, 1) => (&AC_CHROMA, &AC_CHROMA_SYMBOLS[..]),
            _ => return None,
        };
        Self::new(counts, symbols)
    }

    fn enter(&mut self, code: u32, length: u32, symbol: u8) {
        if length > LOOKUP_BITS {
            return;
        }
        let n_free = LOOKUP_BITS - length;
        let size = u32::from(symbol & 15);
        for rest in 0..1 << n_free {
            let mut entry = length | Entry::from(symbol) << 8;
            if (1..=n_free).contains(&size) {
                let value = extended(rest >> (n_free - size), size);
                entry = (entry + size) | HAS_VALUE | Entry::from(value.cast_unsigned()) << 16;
            }
            self.lookup[(code << n_free | rest) as usize] = entry;
        }
    }

    /// The next symbol, and the value whose bits follow it; `None` where there is no such code.
    #[inline(always)]
    pub(super) fn code(&self, bits: &mut Bits) -> Option<Code> {
        bits.refill();
        let entry = self.lookup[bits.peek(LOOKUP_BITS) as usize];
        if entry & HAS_VALUE != 0 {
            bits.skip(entry & 0x1F);
            let run = (entry >> 12 & 15) as usize;
            return Some(Code::Value { run, value: ((entry >> 16) as u16).cast_signed() });
        }
        let symbol = self.finish_symbol(entry, bits)?;
        let (run, size) = (usize::from(symbol >> 4), u32::from(symbol & 15));
        if size == 0 {
            return Some(Code::Empty { run });
        }
        Some(Code::Value { run, value: extended(bits.take(size), size) })
    }

    /// The next difference of DC values; `None` where there is no such code.
    #[inline(always)]
    pub(super) fn difference(&self, bits: &mut Bits) -> Option<i16> {
        match self.code(bits)? {
            Code::Value { run: 0, value } => Some(value),
            Code::Empty { run: 0 } => Some(0),
            _ => None,
        }
    }

    #[inline(always)]
    fn finish_symbol(&self, entry: Entry, bits: &mut Bits) -> Option<u8> {
        if entry != 0 {
            bits.skip(entry & 0x1F);
            return Some((entry >> 8) as u8);
        }
        let ahead = bits.peek(16);
        let length = (LOOKUP_BITS as usize + 1..=16).find(|&length| ahead < self.limits[length])?;
        bits.skip(length as u32);
        let symbol_idx = (ahead >> (16 - length)) as i32 + self.offsets[length];
        self.symbols.get(usize::try_from(symbol_idx).ok()?).copied()
    }
}

/// What a table is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// The first coefficients of blocks.
    Dc,
    /// All others.
    Ac,
}

/// The number of `size` bits, from 1 to 15, that stands for itself with a leading 1, else for a negative one.
#[inline(always)]
fn extended(bits: u32, size: u32) -> i16 {
    let value = bits as i32;
    (if bits >> (size - 1) == 0 { value + 1 - (1 << size) } else { value }) as i16
}

const DC_LUMA: [u8; 16] = [0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0];
const DC_CHROMA: [u8; 16] = [0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0];
const DC_SYMBOLS: [u8; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
const AC_LUMA: [u8; 16] = [0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 0x7D];
const AC_CHROMA: [u8; 16] = [0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 0x77];

#[rustfmt::skip]
const AC_LUMA_SYMBOLS: [u8; 162] = [
    0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61, 0x07, 0x22, 0x71,
    0x14, 0x32, 0x81, 0x91, 0xA1, 0x08, 0x23, 0x42, 0xB1, 0xC1, 0x15, 0x52, 0xD1, 0xF0, 0x24, 0x33, 0x62, 0x72,
    0x82, 0x09, 0x0A, 0x16, 0x17, 0x18, 0x19, 0x1A, 0x25, 0x26, 0x27, 0x28, 0x29, 0x2A, 0x34, 0x35, 0x36, 0x37,
    0x38, 0x39, 0x3A, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4A, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59,
    0x5A, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6A, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7A, 0x83,
    0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8A, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9A, 0xA2, 0xA3,
    0xA4, 0xA5, 0xA6, 0xA7, 0xA8, 0xA9, 0xAA, 0xB2, 0xB3, 0xB4, 0xB5, 0xB6, 0xB7, 0xB8, 0xB9, 0xBA, 0xC2, 0xC3,
    0xC4, 0xC5, 0xC6, 0xC7, 0xC8, 0xC9, 0xCA, 0xD2, 0xD3, 0xD4, 0xD5, 0xD6, 0xD7, 0xD8, 0xD9, 0xDA, 0xE1, 0xE2,
    0xE3, 0xE4, 0xE5, 0xE6, 0xE7, 0xE8, 0xE9, 0xEA, 0xF1, 0xF2, 0xF3, 0xF4, 0xF5, 0xF6, 0xF7, 0xF8, 0xF9, 0xFA,
];

#[rustfmt::skip]
const AC_CHROMA_SYMBOLS: [u8; 162] = [
    0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07, 0x61, 0x71, 0x13, 0x22,
    0x32, 0x81, 0x08, 0x14, 0x42, 0x91, 0xA1, 0xB1, 0xC1, 0x09, 0x23, 0x33, 0x52, 0xF0, 0x15, 0x62, 0x72, 0xD1,
    0x0A, 0x16, 0x24, 0x34, 0xE1, 0x25, 0xF1, 0x17, 0x18, 0x19, 0x1A, 0x26, 0x27, 0x28, 0x29, 0x2A, 0x35, 0x36,
    0x37, 0x38, 0x39, 0x3A, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4A, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58,
    0x59, 0x5A, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6A, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7A,
    0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8A, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9A,
    0xA2, 0xA3, 0xA4, 0xA5, 0xA6, 0xA7, 0xA8, 0xA9, 0xAA, 0xB2, 0xB3, 0xB4, 0xB5, 0xB6, 0xB7, 0xB8, 0xB9, 0xBA,
    0xC2, 0xC3, 0xC4, 0xC5, 0xC6, 0xC7, 0xC8, 0xC9, 0xCA, 0xD2, 0xD3, 0xD4, 0xD5, 0xD6, 0xD7, 0xD8, 0xD9, 0xDA,
    0xE2, 0xE3, 0xE4, 0xE5, 0xE6, 0xE7, 0xE8, 0xE9, 0xEA, 0xF2, 0xF3, 0xF4, 0xF5, 0xF6, 0xF7, 0xF8, 0xF9, 0xFA,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_codes_are_found_too() {
        let table = Table::standard(Class::Ac, 0).unwrap();
        // 1111111111111110 is 0xFA: a run of 15 and ten bits, here those of 1023.
        let bytes = [0xFF, 0x00, 0xFE, 0xFF, 0x00, 0xC0];
        let mut bits = Bits::new(&bytes, 0);
        assert!(matches!(table.code(&mut bits), Some(Code::Value { run: 15, value: 1023 })));
        // 1010 ends a block, 00 and a bit is a value of one bit.
        let mut bits = Bits::new(&[0b1010_0000, 0b0100_0000], 0);
        assert!(matches!(table.code(&mut bits), Some(Code::Empty { run: 0 })));
        assert!(matches!(table.code(&mut bits), Some(Code::Value { run: 0, value: -1 })));
        assert!(matches!(table.code(&mut bits), Some(Code::Value { run: 0, value: 1 | -1 })));
    }

    #[test]
    fn impossible_tables_are_refused() {
        let mut counts = [0; 16];
        counts[0] = 3;
        assert!(Table::new(&counts, &[1, 2, 3]).is_none());
        counts[0] = 2;
        assert!(Table::new(&counts, &[1]).is_none());
        assert!(Table::new(&counts, &[1, 2]).is_some());
    }
}
