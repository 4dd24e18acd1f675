//! The coefficients of single blocks, as sequential and as progressive frames send them.

use super::bits::Bits;
use super::huffman::{Code, Leaps, MAX_LEAP, Pairs, TO_END, Table};
use crate::simd::Block;
use std::ops::Range;
use std::sync::Arc;

/// A component in a scan.
pub(super) struct Part<'a> {
    /// Which component of the frame.
    pub component_idx: usize,
    /// For first coefficients; there where the scan brings any.
    pub dc: Option<&'a Arc<Table>>,
    /// For all others; there where the scan brings any.
    pub ac: Option<&'a Arc<Table>>,
}

/// What a scan brings of coefficients: all of them and whole, but in a progressive frame.
pub(super) struct Pass {
    /// Which, in the order of streams.
    pub band: Range<usize>,
    /// The lowest bit that was sent before; 0 where none was.
    pub high: u8,
    /// The lowest bit that is sent.
    pub low: u8,
}

impl Pass {
    /// Whether nothing was sent before.
    pub(super) fn is_first(&self) -> bool {
        self.high == 0
    }
}

/// What is carried from block to block of a component.
#[derive(Clone, Copy, Default)]
pub(super) struct State {
    /// The first coefficient of the last block.
    pub last: i16,
    /// Blocks to come that bring nothing, in a progressive frame.
    pub n_empty: u32,
}

/// Where coefficients in the order of streams lie in reading order.
#[rustfmt::skip]
pub(super) const ZIGZAG: [u8; 64] = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6, 7, 14, 21, 28,
    35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55,
    62, 63,
];

/// Where the coefficient lies that this many steps lead past, the first one counted; where they lead past the end,
/// the last one. Any number of a byte has an entry, so that none is checked.
const BEHIND: [u8; 256] = {
    let mut positions = [63; 256];
    let mut k = 0;
    while k < 64 {
        positions[k + 1] = ZIGZAG[k];
        k += 1;
    }
    positions
};

/// Two steps from before this coefficient lead to one of the block, at least with the first.
const LAST_PAIR: usize = 47;

/// What blocks of a sequential frame are read with.
pub(super) struct Sequential<'a> {
    dc: &'a Table,
    ac: &'a Table,
    reading: Reading<'a>,
}

enum Reading<'a> {
    /// All coefficients are wanted.
    Whole(&'a Pairs),
    /// They only color.
    Color,
    /// They are not wanted.
    Past(Arc<Leaps>),
}

impl<'a> Sequential<'a> {
    /// For a part of a scan that brings everything; `None` where one of its tables is missing.
    pub(super) fn new(part: &Part<'a>, is_wanted: bool, only_colors: bool) -> Option<Self> {
        let (dc, ac) = (part.dc?, part.ac?);
        let reading = match (is_wanted, only_colors) {
            (true, false) => Reading::Whole(ac.pairs()),
            (true, true) => Reading::Color,
            (false, _) => Reading::Past(ac.leaps(dc)),
        };
        Some(Self { dc, ac, reading })
    }

    /// Reads a block into that of zeros which `block` gives if it is wanted, else past it. `None` where the data makes
    /// no sense, and then some of it may be in the block.
    ///
    /// What others refuse, a coefficient beyond the last, is let pass where there is only color: the luma behind it must
    /// not depend on who wants colors.
    #[inline(always)]
    pub(super) fn read<'b>(
        &self,
        block: impl FnOnce() -> Option<&'b mut Block>,
        last: &mut i16,
        bits: &mut Bits,
    ) -> Option<()> {
        match &self.reading {
            Reading::Whole(pairs) => self.whole(block()?, pairs, last, bits),
            Reading::Color => self.color(block()?, last, bits),
            Reading::Past(leaps) => self.past(leaps, bits),
        }
    }

    #[inline(always)]
    fn whole(&self, block: &mut Block, pairs: &Pairs, last: &mut i16, bits: &mut Bits) -> Option<()> {
        bits.refill();
        *last = last.wrapping_add(self.dc.difference(bits)?);
        block[0] = *last;
        let mut k = 1;
        'pairs: while k <= LAST_PAIR {
            bits.refill();
            // There are bits for two and a single one.
            for _ in 0..3 {
                let Some(pair) = pairs.next(bits) else {
                    k = single(block, k, self.ac, bits)?;
                    continue 'pairs;
                };
                // A step to the end leads here to a coefficient that is 0 and is set to 0.
                k += usize::from(pair.steps[0]);
                block[usize::from(BEHIND[k & 255] & 63)] = pair.values[0];
                k += usize::from(pair.steps[1]);
                block[usize::from(BEHIND[k & 255] & 63)] = pair.values[1];
                if k > LAST_PAIR {
                    if k > 64 && k < TO_END && pair.values[1] != 0 {
                        return None;
                    }
                    break 'pairs;
                }
            }
        }
        while k < 64 {
            bits.refill();
            k = single(block, k, self.ac, bits)?;
        }
        Some(())
    }

    #[inline(always)]
    fn past(&self, leaps: &Leaps, bits: &mut Bits) -> Option<()> {
        bits.refill();
        let mut k = leaps.first(bits);
        if k == 0 {
            self.dc.difference(bits)?;
            k = 1;
        }
        while k < 64 {
            bits.refill();
            let step = if k < 64 - MAX_LEAP { leaps.others(bits) } else { 0 };
            k += if step == 0 { self.ac.step(bits)? } else { step };
        }
        Some(())
    }

    #[inline(always)]
    fn color(&self, block: &mut Block, last: &mut i16, bits: &mut Bits) -> Option<()> {
        bits.refill();
        *last = last.wrapping_add(self.dc.difference(bits)?);
        block[0] = *last;
        let mut k = 1;
        while k < 64 {
            bits.refill();
            match self.ac.code(bits)? {
                Code::Value { run, value } => {
                    k += run;
                    if let Some(&position) = ZIGZAG.get(k) {
                        block[usize::from(position)] = value;
                    }
                    k += 1;
                }
                Code::Empty { run: 15 } => k += 16,
                Code::Empty { .. } => break,
            }
        }
        Some(())
    }
}

/// Reads one code for coefficient `k`, below 64; returns which is next.
#[inline(always)]
fn single(block: &mut Block, k: usize, ac: &Table, bits: &mut Bits) -> Option<usize> {
    match ac.code(bits)? {
        Code::Value { run, value } => {
            block[usize::from(*ZIGZAG.get(k + run)?)] = value;
            Some(k + run + 1)
        }
        Code::Empty { run: 15 } => Some(k + 16),
        Code::Empty { .. } => Some(TO_END),
    }
}

/// Reads what a pass over a progressive frame brings for a block.
pub(super) fn progressive(
    block: &mut Block,
    part: &Part,
    pass: &Pass,
    state: &mut State,
    bits: &mut Bits,
) -> Option<()> {
    match (pass.band.start, pass.is_first()) {
        (0, true) => {
            bits.refill();
            state.last = state.last.wrapping_add(part.dc?.difference(bits)?);
            block[0] = state.last << pass.low;
        }
        (0, false) => {
            if bits.take_bit() {
                block[0] |= 1 << pass.low;
            }
        }
        (_, true) => first_of_band(block, part.ac?, pass, &mut state.n_empty, bits)?,
        (_, false) => more_of_band(block, part.ac?, pass, &mut state.n_empty, bits)?,
    }
    Some(())
}

/// The first bits of coefficients after the first.
fn first_of_band(
    block: &mut Block,
    ac: &Table,
    pass: &Pass,
    n_empty: &mut u32,
    bits: &mut Bits,
) -> Option<()> {
    if *n_empty > 0 {
        *n_empty -= 1;
        return Some(());
    }
    let mut k = pass.band.start;
    while k < pass.band.end {
        bits.refill();
        match ac.code(bits)? {
            Code::Value { run, value } => {
                k += run;
                block[usize::from(*ZIGZAG.get(k)?)] = value << pass.low;
                k += 1;
            }
            Code::Empty { run: 15 } => k += 16,
            Code::Empty { run } => {
                *n_empty = empty_blocks(run, bits) - 1;
                break;
            }
        }
    }
    Some(())
}

/// One more bit of coefficients after the first, and those that become other than zero by it.
fn more_of_band(
    block: &mut Block,
    ac: &Table,
    pass: &Pass,
    n_empty: &mut u32,
    bits: &mut Bits,
) -> Option<()> {
    let bit = 1i16 << pass.low;
    let mut k = pass.band.start;
    if *n_empty == 0 {
        while k < pass.band.end {
            bits.refill();
            let (mut run, value) = match ac.code(bits)? {
                // The value's one bit is its sign.
                Code::Value { run, value } => (run, if value < 0 { -bit } else { bit }),
                Code::Empty { run: 15 } => (15, 0),
                Code::Empty { run } => {
                    *n_empty = empty_blocks(run, bits);
                    break;
                }
            };
            // Over coefficients that are there already, and as many that stay zero as the run says.
            while k < pass.band.end {
                let coefficient = &mut block[usize::from(ZIGZAG[k])];
                if *coefficient != 0 {
                    refine(coefficient, bit, bits);
                } else if run == 0 {
                    *coefficient = value;
                    break;
                } else {
                    run -= 1;
                }
                k += 1;
            }
            k += 1;
        }
    }
    if *n_empty > 0 {
        for &position in &ZIGZAG[k.min(pass.band.end)..pass.band.end] {
            let coefficient = &mut block[usize::from(position)];
            if *coefficient != 0 {
                refine(coefficient, bit, bits);
            }
        }
        *n_empty -= 1;
    }
    Some(())
}

/// Takes the bit of a coefficient that is not zero.
#[inline(always)]
fn refine(coefficient: &mut i16, bit: i16, bits: &mut Bits) {
    if bits.take_bit() && *coefficient & bit == 0 {
        *coefficient = coefficient.wrapping_add(if *coefficient > 0 { bit } else { -bit });
    }
}

/// How many blocks a code of `run` says to be empty from here on, this one included.
fn empty_blocks(run: usize, bits: &mut Bits) -> u32 {
    bits.refill();
    (1 << run) + bits.take(run as u32)
}

#[cfg(test)]
mod tests {
    use super::super::bits::Stream;
    use super::super::huffman::Class;
    use super::super::huffman::tests::tables;
    use super::*;
    use proptest::prelude::*;

    const KINDS: [[bool; 2]; 3] = [[true, false], [true, true], [false, false]];

    fn next_bits(mut bits: Bits) -> (u32, bool) {
        bits.refill();
        (bits.peek(32), bits.ran_out())
    }

    proptest! {
        #[test]
        fn blocks_are_those_of_single_codes(
            (counts, symbols) in tables(), bytes in prop::collection::vec(any::<u8>(), 0..600),
        ) {
            let dc = Table::standard(Class::Dc, 0).unwrap();
            let ac = Table::shared(&counts, &symbols).unwrap();
            let part = Part { component_idx: 0, dc: Some(&dc), ac: Some(&ac) };
            let [whole, color, past] = KINDS.map(|[is_wanted, only_colors]| {
                Sequential::new(&part, is_wanted, only_colors).unwrap()
            });
            let mut stream = Stream::new(&bytes, 0);
            let (mut bits, mut last) = (stream.interval(), 0);
            while !bits.ran_out() {
                let (mut block, mut plain_block) = ([0; 64], [0; 64]);
                let (mut colored_block, mut plain_last, mut colored_last) = ([0; 64], last, last);
                let (mut plain_bits, mut colored_bits, mut bits_past) = (bits, bits, bits);
                let is_read = whole.read(|| Some(&mut block), &mut last, &mut bits);
                let is_read_plainly = plain(&mut plain_block, &part, &mut plain_last, &mut plain_bits);
                prop_assert_eq!(is_read, is_read_plainly);
                let is_colored = color.read(|| Some(&mut colored_block), &mut colored_last, &mut colored_bits);
                prop_assert_eq!(is_colored, past.read(|| None, &mut 0, &mut bits_past));
                if is_colored.is_some() {
                    prop_assert_eq!(next_bits(colored_bits), next_bits(bits_past));
                }
                if is_read.is_none() {
                    break;
                }
                prop_assert_eq!((block, last), (plain_block, plain_last));
                prop_assert_eq!((block, last), (colored_block, colored_last));
                prop_assert_eq!(next_bits(bits), next_bits(plain_bits));
                prop_assert_eq!(next_bits(bits), next_bits(colored_bits));
            }
        }
    }

    /// Code after code.
    fn plain(block: &mut Block, part: &Part, last: &mut i16, bits: &mut Bits) -> Option<()> {
        bits.refill();
        *last = last.wrapping_add(part.dc?.difference(bits)?);
        block[0] = *last;
        let mut k = 1;
        while k < 64 {
            bits.refill();
            k = single(block, k, part.ac?, bits)?;
        }
        Some(())
    }
}
