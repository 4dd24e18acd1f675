//! What a frame header says, and the planes that scans fill.

use super::super::{ImageError, unsupported};
use super::{damaged, reduced};
use crate::simd::{Block, inverse_dct};
use std::ops::Range;

/// A frame: all that its components have in common.
pub(super) struct Frame {
    /// Pixels, at least 1.
    pub width: usize,
    /// Pixels, at least 1.
    pub height: usize,
    /// Whether coefficients come in several scans.
    pub is_progressive: bool,
    /// The largest of the components' factors.
    pub factors: Factors,
    /// From 1 to 4, without 2.
    pub components: Vec<Component>,
    /// What happened to each row of pixels.
    pub rows: Vec<RowState>,
}

/// Samples of a component for one of the component that has the fewest, in both directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Factors {
    /// From 1 to 4.
    pub across: usize,
    /// From 1 to 4.
    pub down: usize,
}

/// What is known of a row of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum RowState {
    /// As it was sent.
    Whole,
    /// Shown, but refinements of it are missing.
    Coarse,
    /// At least a part of it was not sent.
    Missing,
}

/// A plane of samples.
pub(super) struct Component {
    /// As scans name it.
    pub id: u8,
    pub factors: Factors,
    /// The number of its quantization table.
    pub table_number: usize,
    /// Its quantization table, in reading order, from its first scan on.
    pub quantization: Option<[u16; 64]>,
    /// Whether its samples are wanted.
    pub is_wanted: bool,
    /// Whether it colors what is there without it: the picture is read as if it were not wanted, and has no
    /// colors where it cannot be read.
    pub only_colors: bool,
    /// Blocks that hold pixels of the frame, across and down.
    pub n_blocks: [usize; 2],
    /// The same with those that only fill up the last groups of blocks, and an even number across.
    pub n_padded: [usize; 2],
    /// The coefficients of a row of blocks after the other, where the frame is progressive.
    pub blocks: Vec<Block>,
    /// For each coefficient in zigzag order: the bits that are still to come, in a progressive frame.
    pub missing_bits: [Option<u8>; 64],
    /// Whether a scan brought its first coefficients.
    pub was_sent: bool,
    /// Samples a side of a block: 8, or fewer where the frame is read smaller.
    pub side: usize,
    /// Row after row of `n_padded` blocks. Gray where nothing was sent.
    pub samples: Vec<u8>,
}

impl Frame {
    /// Reads the header of a frame that is `is_progressive`, or sequential.
    pub(super) fn read(header: &[u8], is_progressive: bool) -> Result<Self, ImageError> {
        let &[precision, height_high, height_low, width_high, width_low, n_components, ref rest @ ..] =
            header
        else {
            return Err(damaged("the frame header is too short"));
        };
        if precision != 8 {
            return Err(unsupported(&format!("a JPEG of {precision} bits a sample"), "save it with 8 bits"));
        }
        let (width, height) = (
            usize::from(u16::from_be_bytes([width_high, width_low])),
            usize::from(u16::from_be_bytes([height_high, height_low])),
        );
        if width == 0 {
            return Err(damaged("it has no pixels"));
        }
        if height == 0 {
            return Err(unsupported("a JPEG that tells its height at its end", "save it anew"));
        }
        if !matches!(n_components, 1 | 3 | 4) {
            let format = format!("a JPEG of {n_components} components");
            return Err(unsupported(&format, "save it as gray, YCbCr, RGB or CMYK"));
        }
        let entries = rest.as_chunks::<3>().0;
        if entries.len() < usize::from(n_components) {
            return Err(damaged("the frame header is too short"));
        }
        let entries = &entries[..usize::from(n_components)];
        let factors_of = |byte: u8| Factors { across: usize::from(byte >> 4), down: usize::from(byte & 15) };
        let all = || entries.iter().map(|&[_, factors, _]| factors_of(factors));
        if all().any(|factors| !(1..=4).contains(&factors.across) || !(1..=4).contains(&factors.down)) {
            return Err(damaged("a sampling factor is not from 1 to 4"));
        }
        let largest = Factors {
            across: all().map(|factors| factors.across).max().unwrap_or(1),
            down: all().map(|factors| factors.down).max().unwrap_or(1),
        };
        let group = [width.div_ceil(8 * largest.across), height.div_ceil(8 * largest.down)];
        let components = entries.iter().map(|&[id, factors, table]| {
            let factors = factors_of(factors);
            Component {
                id,
                factors,
                table_number: usize::from(table),
                quantization: None,
                is_wanted: true,
                only_colors: false,
                n_blocks: [
                    (width * factors.across).div_ceil(8 * largest.across),
                    (height * factors.down).div_ceil(8 * largest.down),
                ],
                n_padded: [(group[0] * factors.across).next_multiple_of(2), group[1] * factors.down],
                blocks: Vec::new(),
                missing_bits: [None; 64],
                was_sent: false,
                side: 8,
                samples: Vec::new(),
            }
        });
        Ok(Self {
            width,
            height,
            is_progressive,
            factors: largest,
            components: components.collect(),
            rows: vec![RowState::Whole; height],
        })
    }

    /// The size that it is read at when blocks become `side` samples wide.
    pub(super) fn size_at(&self, side: usize) -> [usize; 2] {
        [(self.width * side).div_ceil(8), (self.height * side).div_ceil(8)]
    }

    /// The bytes that reading it takes when blocks become `side` samples wide; what only colors is left out.
    pub(super) fn memory_at(&self, side: usize) -> u64 {
        let [width, height] = self.size_at(side).map(|side| side as u64);
        self.memory_of_planes(side, Component::is_needed) + width * height
    }

    /// The bytes that colors take beside [`Frame::memory_at`].
    pub(super) fn memory_of_colors_at(&self, side: usize) -> u64 {
        let [width, height] = self.size_at(side).map(|side| side as u64);
        let n_full_planes = self.components.iter().filter(|component| component.only_colors).count() as u64;
        self.memory_of_planes(side, |component| component.only_colors) + (n_full_planes + 3) * width * height
    }

    fn memory_of_planes(&self, side: usize, is_meant: impl Fn(&Component) -> bool) -> u64 {
        let planes = self.components.iter().filter(|&component| is_meant(component)).map(|component| {
            let [across, down] = component.n_padded.map(|n_blocks| n_blocks as u64);
            let rows_kept = if self.is_progressive { down } else { component.factors.down as u64 };
            across * (down * (side * side) as u64 + rows_kept * size_of::<Block>() as u64)
        });
        planes.sum()
    }

    /// Goes on without what only colors.
    pub(super) fn give_up_colors(&mut self) {
        for component in self.components.iter_mut().filter(|component| component.only_colors) {
            component.is_wanted = false;
            component.blocks = Vec::new();
            component.samples = Vec::new();
        }
    }

    /// Makes room for all wanted planes, whose blocks become `side` samples wide.
    pub(super) fn allocate(&mut self, side: usize) {
        for component in self.components.iter_mut().filter(|component| component.is_wanted) {
            let [across, down] = component.n_padded;
            component.side = side;
            if self.is_progressive {
                component.blocks = vec![[0; 64]; across * down];
            }
            component.samples = vec![128; across * down * side * side];
        }
    }

    /// Notes what happened to rows of pixels.
    pub(super) fn note(&mut self, rows: Range<usize>, state: RowState) {
        let n_rows = self.rows.len();
        for row in &mut self.rows[rows.start.min(n_rows)..rows.end.min(n_rows)] {
            *row = state.max(*row);
        }
    }

    /// The longest run of rows of which nothing is missing.
    pub(super) fn whole_rows(&self) -> Range<usize> {
        let mut longest = 0..0;
        let mut start = 0;
        for (row, &state) in self.rows.iter().enumerate() {
            if state == RowState::Missing {
                start = row + 1;
            } else if row + 1 - start > longest.len() {
                longest = start..row + 1;
            }
        }
        longest
    }
}

impl Component {
    /// Whether there is no picture without it.
    pub(super) fn is_needed(&self) -> bool {
        self.is_wanted && !self.only_colors
    }

    /// Turns rows of blocks into samples, of which the first is `row` in the plane.
    pub(super) fn transform(&mut self, blocks: &[Block], row: usize) {
        let Some(quantization) = &self.quantization else { return };
        let (across, side) = (self.n_padded[0], self.side);
        let row_of_samples = across * side * side;
        let samples = self.samples.chunks_exact_mut(row_of_samples).skip(row);
        for (blocks, samples) in blocks.chunks_exact(across).zip(samples) {
            match side {
                8 => inverse_dct(blocks, quantization, samples),
                _ => reduced::inverse_dct(blocks, quantization, samples, side),
            }
        }
    }
}
