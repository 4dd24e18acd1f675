//! Huffman tables, and the values that follow their codes.

mod standard;

use super::bits::Bits;
use standard::{STANDARD, Standard};
use std::array;
use std::sync::{Arc, OnceLock};

/// Codes up to this length are looked up at once, with what follows them as far as it fits.
const LOOKUP_BITS: u32 = 10;

/// How many combinations of that many bits there are.
const N_LOOKUPS: usize = 1 << LOOKUP_BITS;

/// What the next bits mean: from the lowest bit on 8 bits of length, [`HAS_VALUE`], the symbol and the value.
/// The length is 0 where the code is longer than [`LOOKUP_BITS`]; the value's bits are counted where it is there.
type Entry = u32;

/// Whether the value is there.
const HAS_VALUE: Entry = 1 << 7;

/// How far the end of a block is from any of its coefficients: so far that it is told from a step beyond it.
pub(super) const TO_END: usize = 128;

/// A Huffman table.
pub(super) struct Table {
    lookup: Box<[Entry; N_LOOKUPS]>,
    /// For each length of codes from 1 to 16: the first 16 bits that are beyond its codes.
    limits: [u32; 17],
    /// For each length: what makes the index of a symbol from its code.
    offsets: [i32; 17],
    symbols: Vec<u8>,
    /// What scans of sequential frames may ask for.
    pairs: OnceLock<Pairs>,
    /// With the table of first coefficients.
    leaps: OnceLock<(Arc<Table>, Arc<Leaps>)>,
}

/// How many zeros come before a coefficient, and its value; or what else the symbol stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// The codes of coefficients two by two.
pub(super) struct Pairs(Box<[Pair; N_LOOKUPS]>);

/// What the next bits mean for a block, one or two codes with their values. The second step is 0 where there is
/// one code; the value is then the first one's.
#[derive(Clone, Copy, Default)]
pub(super) struct Pair {
    /// How many bits they are; 0 where not even the first code and its value fit.
    n_bits: u8,
    /// From one coefficient to the next: past the zeros before it, up to 16; or [`TO_END`].
    pub steps: [u8; 2],
    /// The last coefficients that are stepped over, of which all others are 0.
    pub values: [i16; 2],
}

/// Where the last of the codes that are read at once may begin, from the first on.
pub(super) const MAX_LEAP: usize = 32;

/// The codes of blocks that nobody wants, as many at once as fit.
pub(super) struct Leaps {
    /// From the beginning of a block on.
    first: [Leap; N_LOOKUPS],
    /// From any other coefficient on.
    others: [Leap; N_LOOKUPS],
}

/// The codes that begin in the next bits, as far as they fit, and no more than one behind [`MAX_LEAP`].
#[derive(Clone, Copy, Default)]
struct Leap {
    /// How many bits they and their values are; 0 where not even the first code fits.
    n_bits: u8,
    /// Over how many coefficients they step, the end counted as [`TO_END`].
    step: u8,
}

impl Table {
    /// From the number of codes of each length from 1 to 16, and their symbols. `None` where there are more
    /// codes than bits can tell apart.
    pub(super) fn new(counts: &[u8; 16], symbols: &[u8]) -> Option<Self> {
        let mut table = Self {
            lookup: Box::new([0; N_LOOKUPS]),
            limits: [0; 17],
            offsets: [0; 17],
            symbols: symbols.to_vec(),
            pairs: OnceLock::new(),
            leaps: OnceLock::new(),
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

    /// The same, shared with other frames where it is a table of Annex K, as those of most cameras are.
    pub(super) fn shared(counts: &[u8; 16], symbols: &[u8]) -> Option<Arc<Self>> {
        let is_same = |standard: &Standard| standard.counts == counts && standard.symbols == symbols;
        match STANDARD.iter().position(is_same) {
            Some(idx) => Self::at(idx),
            None => Self::new(counts, symbols).map(Arc::new),
        }
    }

    /// The table of Annex K that is meant where a stream brings none, as those of webcams do.
    pub(super) fn standard(class: Class, number: usize) -> Option<Arc<Self>> {
        let is_meant = |standard: &Standard| (standard.class, standard.number) == (class, number);
        Self::at(STANDARD.iter().position(is_meant)?)
    }

    /// Table number `idx` of [`STANDARD`], made once.
    fn at(idx: usize) -> Option<Arc<Self>> {
        static TABLES: [OnceLock<Option<Arc<Table>>>; STANDARD.len()] =
            [const { OnceLock::new() }; STANDARD.len()];
        let Standard { class, number, counts, symbols } = STANDARD[idx];
        let make = || {
            let table = Self::new(counts, symbols).map(Arc::new)?;
            if class == Class::Ac {
                // What a frame mixes it with is not to take the place.
                table.leaps(&Self::standard(Class::Dc, number)?);
            }
            Some(table)
        };
        TABLES[idx].get_or_init(make).clone()
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

    /// The next symbol, and the value whose bits follow it, after a refill; `None` where there is no such code.
    #[inline(always)]
    pub(super) fn code(&self, bits: &mut Bits) -> Option<Code> {
        let entry = self.lookup[bits.peek(LOOKUP_BITS) as usize];
        if entry & HAS_VALUE != 0 {
            bits.skip(entry & 0x1F);
            let run = (entry >> 12 & 15) as usize;
            return Some(Code::Value { run, value: ((entry >> 16) as u16).cast_signed() });
        }
        let symbol = self.finish_code(entry, bits)?;
        let (run, size) = (usize::from(symbol >> 4), u32::from(symbol & 15));
        if size == 0 {
            return Some(Code::Empty { run });
        }
        Some(Code::Value { run, value: extended(bits.take(size), size) })
    }

    /// The next difference of DC values, after a refill; `None` where there is no such code.
    #[inline(always)]
    pub(super) fn difference(&self, bits: &mut Bits) -> Option<i16> {
        let entry = self.lookup[bits.peek(LOOKUP_BITS) as usize];
        let symbol = self.finish_code(entry, bits)?;
        // Values of many sizes are equally likely: better none is guessed, not even whether it is in the entry.
        (symbol < 16).then(|| extended(bits.take(symbol.into()), symbol.into()))
    }

    /// Steps over a code without its value; returns its symbol.
    #[inline(always)]
    fn finish_code(&self, entry: Entry, bits: &mut Bits) -> Option<u8> {
        if entry == 0 {
            let (length, symbol) = self.long_code(bits.peek(16))?;
            bits.skip(length);
            return Some(symbol);
        }
        bits.skip(code_bits(entry));
        Some((entry >> 8) as u8)
    }

    /// The length and the symbol of a code that is longer than [`LOOKUP_BITS`], from the next 16 bits.
    #[cold]
    fn long_code(&self, ahead: u32) -> Option<(u32, u8)> {
        let length = (LOOKUP_BITS as usize + 1..=16).find(|&length| ahead < self.limits[length])?;
        let symbol_idx = (ahead >> (16 - length)) as i32 + self.offsets[length];
        let symbol = *self.symbols.get(usize::try_from(symbol_idx).ok()?)?;
        Some((length as u32, symbol))
    }

    /// The codes of coefficients two by two.
    pub(super) fn pairs(&self) -> &Pairs {
        self.pairs.get_or_init(|| Pairs::new(self))
    }

    /// The codes of blocks, as many at once as fit, where first coefficients have the table `dc`.
    pub(super) fn leaps(&self, dc: &Arc<Self>) -> Arc<Leaps> {
        let make = || Arc::new(Leaps::new(dc, self));
        let (with, leaps) = self.leaps.get_or_init(|| (dc.clone(), make()));
        if Arc::ptr_eq(with, dc) { leaps.clone() } else { make() }
    }

    /// Over how many coefficients the next code steps, after a refill; its value is stepped over too. `None` where there
    /// is no such code.
    #[inline(always)]
    pub(super) fn step(&self, bits: &mut Bits) -> Option<usize> {
        let entry = self.lookup[bits.peek(LOOKUP_BITS) as usize];
        let symbol = self.finish_code(entry, bits)?;
        bits.skip(u32::from(symbol & 15));
        Some(usize::from(step_of(symbol)))
    }
}

impl Pairs {
    fn new(table: &Table) -> Self {
        let mut pairs = Box::new([Pair::default(); N_LOOKUPS]);
        for (ahead, pair) in pairs.iter_mut().enumerate() {
            let Some((first_bits, step, value)) = whole(table.lookup[ahead]) else { continue };
            *pair = Pair { n_bits: first_bits as u8, steps: [step, 0], values: [value; 2] };
            // What the bits behind the look-up are does not matter to a code and a value that fit.
            let second = whole(table.lookup[ahead << first_bits & (N_LOOKUPS - 1)]);
            if let Some((n_bits, step, value)) = second
                && usize::from(pair.steps[0]) < TO_END
                && first_bits + n_bits <= LOOKUP_BITS
            {
                (pair.n_bits, pair.steps[1], pair.values[1]) = ((first_bits + n_bits) as u8, step, value);
            }
        }
        Self(pairs)
    }

    /// The next coefficient of a block or two, stepped over where they and their values fit the look-up. A refill
    /// comes before.
    #[inline(always)]
    pub(super) fn next(&self, bits: &mut Bits) -> Option<Pair> {
        let pair = self.0[bits.peek(LOOKUP_BITS) as usize];
        bits.skip(u32::from(pair.n_bits));
        (pair.n_bits > 0).then_some(pair)
    }
}

impl Leaps {
    /// From the tables of first coefficients and of all others.
    fn new(dc: &Table, ac: &Table) -> Self {
        let first = array::from_fn(|ahead| {
            let (entry, symbol) = (dc.lookup[ahead], (dc.lookup[ahead] >> 8) as u8);
            if entry == 0 || symbol > 15 {
                return Leap::default();
            }
            Leap { n_bits: code_bits(entry) as u8 + symbol, step: 1 }.lengthened(ahead, ac)
        });
        Self { first, others: array::from_fn(|ahead| Leap::default().lengthened(ahead, ac)) }
    }

    /// Over how many coefficients the first codes of a block step, up to [`MAX_LEAP`] and one code more; they and their
    /// values are stepped over. A refill comes before; 0 where the first code is longer than the look-up, or none.
    #[inline(always)]
    pub(super) fn first(&self, bits: &mut Bits) -> usize {
        self.first[bits.peek(LOOKUP_BITS) as usize].take(bits)
    }

    /// The same of other codes.
    #[inline(always)]
    pub(super) fn others(&self, bits: &mut Bits) -> usize {
        self.others[bits.peek(LOOKUP_BITS) as usize].take(bits)
    }
}

impl Leap {
    /// With the codes behind it that end in the bits `ahead`.
    fn lengthened(mut self, ahead: usize, table: &Table) -> Self {
        while u32::from(self.n_bits) < LOOKUP_BITS && usize::from(self.step) <= MAX_LEAP {
            let entry = table.lookup[ahead << self.n_bits & (N_LOOKUPS - 1)];
            let n_bits = code_bits(entry) as u8;
            if entry == 0 || u32::from(self.n_bits + n_bits) > LOOKUP_BITS {
                break;
            }
            let symbol = (entry >> 8) as u8;
            self.n_bits += n_bits + (symbol & 15);
            self.step += step_of(symbol);
        }
        self
    }

    #[inline(always)]
    fn take(self, bits: &mut Bits) -> usize {
        bits.skip(u32::from(self.n_bits));
        usize::from(self.step)
    }
}

/// How many bits a code has without its value.
#[inline(always)]
fn code_bits(entry: Entry) -> u32 {
    (entry & 0x1F) - if entry & HAS_VALUE == 0 { 0 } else { entry >> 8 & 15 }
}

/// What an entry means that needs no bits behind it: how many bits it takes, over how many coefficients it steps, and
/// the value of the last of them.
fn whole(entry: Entry) -> Option<(u32, u8, i16)> {
    let symbol = (entry >> 8) as u8;
    let is_whole = entry & HAS_VALUE != 0 || entry != 0 && symbol & 15 == 0;
    is_whole.then(|| (entry & 0x1F, step_of(symbol), ((entry >> 16) as u16).cast_signed()))
}

/// Over how many coefficients a symbol steps.
#[inline(always)]
fn step_of(symbol: u8) -> u8 {
    if symbol & 15 == 0 && symbol != 0xF0 { TO_END as u8 } else { (symbol >> 4) + 1 }
}

/// What a table is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// The first coefficients of blocks.
    Dc,
    /// All others.
    Ac,
}

/// The number of `size` bits, from 0 to 15, that stands for itself with a leading 1, else for a negative one.
#[inline(always)]
fn extended(bits: u32, size: u32) -> i16 {
    let is_negative = u32::from(bits < 1 << size >> 1);
    (bits as i32 - (is_negative * ((1 << size) - 1)) as i32) as i16
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::bits::Stream;
    use super::*;
    use proptest::prelude::*;

    /// Tables of any shape, and those of the standard.
    pub fn tables() -> impl Strategy<Value = ([u8; 16], Vec<u8>)> {
        let any_table = prop::collection::vec((0..9u8, any::<u8>()), 16..120).prop_map(|draws| {
            // Codes of each length as drawn, as long as there are free ones.
            let (mut counts, mut n_free) = ([0; 16], 1usize);
            for (length, count) in counts.iter_mut().enumerate() {
                n_free *= 2;
                *count = usize::from(draws[length].0).min(length).min(n_free) as u8;
                n_free -= usize::from(*count);
            }
            let n_symbols: usize = counts.iter().map(|&count| usize::from(count)).sum();
            (counts, draws.iter().cycle().take(n_symbols).map(|&(_, symbol)| symbol).collect())
        });
        let standard = STANDARD.map(|standard| (*standard.counts, standard.symbols.to_vec()));
        let standard = prop::sample::select(standard[2..].to_vec());
        // Long runs in short codes, so that pairs and leaps come to the end of a block in every way.
        let run = prop::sample::select(vec![0x00, 0x01, 0x11, 0x71, 0xE0, 0xE1, 0xF0, 0xF1]);
        let runs = prop::collection::vec(run, 8).prop_map(|symbols| {
            let mut counts = [0; 16];
            counts[2] = 8;
            (counts, symbols)
        });
        prop_oneof![any_table, standard, runs]
    }

    /// Lengthens codes bit by bit until there is one, as the standard describes it.
    fn plain_code(counts: &[u8; 16], symbols: &[u8], bits: &mut Bits) -> Option<Code> {
        let (mut code, mut first, mut symbol_idx) = (0, 0, 0);
        for &count in counts {
            code = code << 1 | usize::from(bits.take_bit());
            first <<= 1;
            if code < first + usize::from(count) {
                let symbol = symbols[symbol_idx + code - first];
                let (run, size) = (usize::from(symbol >> 4), u32::from(symbol & 15));
                bits.refill();
                let value = i32::try_from(bits.take(size)).unwrap();
                let is_negative = size > 0 && value < 1 << (size - 1);
                let value = value - if is_negative { (1 << size) - 1 } else { 0 };
                return Some(match size {
                    0 => Code::Empty { run },
                    _ => Code::Value { run, value: value as i16 },
                });
            }
            first += usize::from(count);
            symbol_idx += usize::from(count);
        }
        None
    }

    proptest! {
        #[test]
        fn codes_are_those_of_the_standard(
            (counts, symbols) in tables(), bytes in prop::collection::vec(any::<u8>(), 0..200),
        ) {
            let table = Table::new(&counts, &symbols).unwrap();
            let mut stream = Stream::new(&bytes, 0);
            let mut bits = stream.interval();
            let mut plain_bits = bits;
            while !bits.ran_out() {
                bits.refill();
                let code = table.code(&mut bits);
                prop_assert_eq!(code, plain_code(&counts, &symbols, &mut plain_bits));
                if code.is_none() {
                    break;
                }
                bits.refill();
                plain_bits.refill();
                prop_assert_eq!(bits.peek(32), plain_bits.peek(32));
            }
        }
    }

    #[test]
    fn long_codes_are_found_too() {
        let table = Table::standard(Class::Ac, 0).unwrap();
        // 1111111111111110 is 0xFA: a run of 15 and ten bits, here those of 1023.
        let mut stream = Stream::new(&[0xFF, 0x00, 0xFE, 0xFF, 0x00, 0xC0], 0);
        let mut bits = stream.interval();
        bits.refill();
        assert_eq!(table.code(&mut bits), Some(Code::Value { run: 15, value: 1023 }));
        // 1010 ends a block, 00 and a bit is a value of one bit.
        let mut stream = Stream::new(&[0b1010_0000, 0b0100_0000], 0);
        let mut bits = stream.interval();
        bits.refill();
        assert_eq!(table.code(&mut bits), Some(Code::Empty { run: 0 }));
        assert_eq!(table.code(&mut bits), Some(Code::Value { run: 0, value: -1 }));
        assert_eq!(table.code(&mut bits), Some(Code::Value { run: 0, value: 1 }));
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
