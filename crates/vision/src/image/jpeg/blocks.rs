//! The coefficients of single blocks, as sequential and as progressive frames send them.

use super::bits::Bits;
use super::frame::Block;
use super::huffman::{Code, Table};
use std::ops::Range;

/// A component in a scan.
pub(super) struct Part<'a> {
    /// Which component of the frame.
    pub component_idx: usize,
    /// For first coefficients; there where the scan brings any.
    pub dc: Option<&'a Table>,
    /// For all others; there where the scan brings any.
    pub ac: Option<&'a Table>,
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

/// Reads a whole block into one of zeros; `None` where the data makes no sense.
#[inline(always)]
pub(super) fn sequential(mut block: Block, part: &Part, state: &mut State, bits: &mut Bits) -> Option<()> {
    let (dc, ac) = (part.dc?, part.ac?);
    state.last = state.last.wrapping_add(dc.difference(bits)?);
    *block.at(0) = state.last;
    let mut k = 1;
    while k < 64 {
        match ac.code(bits)? {
            Code::Value { run, value } => {
                k += run;
                *block.at(usize::from(*ZIGZAG.get(k)?)) = value;
                k += 1;
            }
            Code::Empty { run: 15 } => k += 16,
            Code::Empty { .. } => break,
        }
    }
    Some(())
}

/// Reads past a block that the luma does without, and into `block` where there is one. What others refuse, a
/// coefficient beyond the last, is let pass: the luma behind it must not depend on who wants colors.
#[inline(always)]
pub(super) fn pass_over(
    mut block: Option<Block>,
    part: &Part,
    state: &mut State,
    bits: &mut Bits,
) -> Option<()> {
    let (dc, ac) = (part.dc?, part.ac?);
    let difference = dc.difference(bits)?;
    if let Some(block) = &mut block {
        state.last = state.last.wrapping_add(difference);
        *block.at(0) = state.last;
    }
    let mut k = 1;
    while k < 64 {
        match ac.code(bits)? {
            Code::Value { run, value } => {
                k += run;
                if let (Some(block), Some(&position)) = (&mut block, ZIGZAG.get(k)) {
                    *block.at(usize::from(position)) = value;
                }
                k += 1;
            }
            Code::Empty { run: 15 } => k += 16,
            Code::Empty { .. } => break,
        }
    }
    Some(())
}

/// Reads what a pass over a progressive frame brings for a block.
pub(super) fn progressive(
    mut block: Block,
    part: &Part,
    pass: &Pass,
    state: &mut State,
    bits: &mut Bits,
) -> Option<()> {
    match (pass.band.start, pass.is_first()) {
        (0, true) => {
            state.last = state.last.wrapping_add(part.dc?.difference(bits)?);
            *block.at(0) = state.last << pass.low;
        }
        (0, false) => {
            if bits.take_bit() {
                *block.at(0) |= 1 << pass.low;
            }
        }
        (_, true) => first_of_band(&mut block, part.ac?, pass, &mut state.n_empty, bits)?,
        (_, false) => more_of_band(&mut block, part.ac?, pass, &mut state.n_empty, bits)?,
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
        match ac.code(bits)? {
            Code::Value { run, value } => {
                k += run;
                *block.at(usize::from(*ZIGZAG.get(k)?)) = value << pass.low;
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
                let coefficient = block.at(usize::from(ZIGZAG[k]));
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
            let coefficient = block.at(usize::from(position));
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
