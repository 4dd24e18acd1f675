//! The walk through the blocks of a scan, from restart marker to restart marker.

use super::bits::{Bits, Stream};
use super::blocks::{Part, Pass, Sequential, State, progressive};
use super::frame::{Frame, RowState};
use crate::simd::Block;
use std::ops::Range;

/// A scan, as its header says.
pub(super) struct Scan<'a> {
    /// The components that it holds, 1 to 4.
    pub parts: Vec<Part<'a>>,
    /// What it brings of them.
    pub pass: Pass,
    /// Groups of blocks between restart markers; 0 without any.
    pub restart_interval: usize,
}

/// The groups of blocks of a scan.
struct Grid {
    /// Groups across and down.
    n_groups: [usize; 2],
    /// Rows of pixels that a group reaches over.
    height: usize,
    /// Blocks of each part in a group, across and down.
    sizes: Vec<[usize; 2]>,
}

impl Grid {
    fn of(frame: &Frame, scan: &Scan) -> Self {
        if let [part] = &scan.parts[..] {
            let component = &frame.components[part.component_idx];
            let height = 8 * frame.factors.down / component.factors.down;
            // Where one factor is no multiple of the other a row may be noted that is a few pixels off.
            return Self { n_groups: component.n_blocks, height, sizes: vec![[1, 1]] };
        }
        let sizes = scan.parts.iter().map(|part| frame.components[part.component_idx].factors);
        Self {
            n_groups: [
                frame.width.div_ceil(8 * frame.factors.across),
                frame.height.div_ceil(8 * frame.factors.down),
            ],
            height: 8 * frame.factors.down,
            sizes: sizes.map(|factors| [factors.across, factors.down]).collect(),
        }
    }

    /// The rows of pixels that groups reach over.
    fn rows(&self, groups: Range<usize>) -> Range<usize> {
        let across = self.n_groups[0];
        groups.start / across * self.height..groups.end.div_ceil(across) * self.height
    }
}

/// Reads a scan into the planes of `frame`; what cannot be read is noted and stays gray. Returns where the
/// data ends, at the latest.
pub(super) fn read(frame: &mut Frame, scan: &Scan, bytes: &[u8], position: usize) -> usize {
    let grid = Grid::of(frame, scan);
    let n_groups = grid.n_groups[0] * grid.n_groups[1];
    let interval = if scan.restart_interval == 0 { n_groups } else { scan.restart_interval };
    let mut stream = Stream::new(bytes, position);
    let Some(strips) = strips(frame, scan, &grid) else {
        frame.note(0..frame.height, RowState::Missing);
        return position;
    };
    let mut walk = Walk { frame, scan, grid, strips, row: 0 };
    let (mut group, mut n_restarts) = (0, 0);
    loop {
        let end = (group + interval).min(n_groups);
        let read_to = walk.segment(group..end, stream.interval());
        walk.miss(read_to..end);
        group = end;
        if group == n_groups {
            break;
        }
        let Some(restart) = stream.restart(n_restarts) else {
            walk.miss(group..n_groups);
            break;
        };
        let next = (group + restart.n_lost * interval).min(n_groups);
        walk.miss(group..next);
        group = next;
        if group == n_groups {
            break;
        }
        n_restarts += 1 + restart.n_lost;
    }
    walk.finish_row();
    stream.position()
}

/// A row of groups of a sequential frame: what is kept of one component until it is transformed.
struct Strip<'a> {
    component_idx: usize,
    reader: Sequential<'a>,
    /// Blocks in a group, across and down.
    size: [usize; 2],
    /// Blocks in a row.
    across: usize,
    /// Where the blocks of a group lie from its first one on.
    offsets: Vec<usize>,
    /// The first coefficient of the last block.
    last: i16,
    /// Row after row, zeros where nothing was read; none where they are not wanted.
    blocks: Vec<Block>,
}

/// Of each part, if the frame is sequential; `None` where one has no tables.
fn strips<'a>(frame: &Frame, scan: &Scan<'a>, grid: &Grid) -> Option<Vec<Strip<'a>>> {
    if frame.is_progressive {
        return Some(Vec::new());
    }
    let strips = scan.parts.iter().zip(&grid.sizes).map(|(part, &size)| {
        let component = &frame.components[part.component_idx];
        let across = component.n_padded[0];
        let n_blocks = if component.is_wanted { across * size[1] } else { 0 };
        Some(Strip {
            component_idx: part.component_idx,
            reader: Sequential::new(part, component.is_wanted, component.only_colors)?,
            size,
            across,
            offsets: (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| y * across + x)).collect(),
            last: 0,
            blocks: vec![[0; 64]; n_blocks],
        })
    });
    strips.collect()
}

impl Strip<'_> {
    /// Reads the blocks of a group; `None` where the data makes no sense.
    #[inline(always)]
    fn read(&mut self, column: usize, bits: &mut Bits) -> Option<()> {
        let first = column * self.size[0];
        for offset in &self.offsets {
            self.reader.read(|| self.blocks.get_mut(first + offset), &mut self.last, bits)?;
        }
        Some(())
    }

    /// Makes the blocks of a group gray.
    fn clear(&mut self, column: usize) {
        let [across, _] = self.size;
        for row in self.blocks.chunks_exact_mut(self.across) {
            row[column * across..][..across].fill([0; 64]);
        }
    }
}

struct Walk<'a> {
    frame: &'a mut Frame,
    scan: &'a Scan<'a>,
    grid: Grid,
    /// Of each part, in a sequential frame.
    strips: Vec<Strip<'a>>,
    /// The row of groups that the strips hold.
    row: usize,
}

impl Walk<'_> {
    /// Reads groups up to the next restart marker; returns the first that could not be read.
    fn segment(&mut self, groups: Range<usize>, mut bits: Bits) -> usize {
        let mut states = [State::default(); 4];
        self.strips.iter_mut().for_each(|strip| strip.last = 0);
        let across = self.grid.n_groups[0];
        let (mut row, mut column) = (groups.start / across, groups.start % across);
        for group in groups.clone() {
            if row != self.row {
                self.finish_row();
                self.row = row;
            }
            if self.group(column, &mut states, &mut bits).is_none() || bits.ran_out() {
                // In a progressive frame what was read of it stays.
                self.strips.iter_mut().for_each(|strip| strip.clear(column));
                return group;
            }
            column += 1;
            if column == across {
                (row, column) = (row + 1, 0);
            }
        }
        groups.end
    }

    /// Reads the blocks of a group; `None` where the data makes no sense.
    #[inline(always)]
    fn group(&mut self, column: usize, states: &mut [State; 4], bits: &mut Bits) -> Option<()> {
        if self.frame.is_progressive {
            // A copy: what others know the address of does not stay in registers.
            let mut own = *bits;
            self.progressive_group(column, states, &mut own)?;
            *bits = own;
        }
        self.strips.iter_mut().try_for_each(|strip| strip.read(column, bits))
    }

    #[inline(never)]
    fn progressive_group(&mut self, column: usize, states: &mut [State; 4], bits: &mut Bits) -> Option<()> {
        for ((part, &[across, down]), state) in self.scan.parts.iter().zip(&self.grid.sizes).zip(states) {
            let component = &mut self.frame.components[part.component_idx];
            for y in 0..down {
                let first = (self.row * down + y) * component.n_padded[0] + column * across;
                for idx in first..first + across {
                    let mut unwanted = [0; 64];
                    let block = if component.is_wanted { &mut component.blocks[idx] } else { &mut unwanted };
                    progressive(block, part, &self.scan.pass, state, bits)?;
                }
            }
        }
        Some(())
    }

    /// Notes groups that could not be read, unless they only color.
    fn miss(&mut self, groups: Range<usize>) {
        let is_needed = |part: &Part| self.frame.components[part.component_idx].is_needed();
        if !groups.is_empty() && self.scan.parts.iter().any(is_needed) {
            let is_first = self.scan.pass.band.start == 0 && self.scan.pass.is_first();
            let state = if is_first { RowState::Missing } else { RowState::Coarse };
            self.frame.note(self.grid.rows(groups), state);
        }
    }

    /// Turns the strips into samples, and makes room for others.
    fn finish_row(&mut self) {
        for strip in self.strips.iter_mut().filter(|strip| !strip.blocks.is_empty()) {
            let component = &mut self.frame.components[strip.component_idx];
            component.transform(&strip.blocks, self.row * strip.size[1]);
            strip.blocks.fill([0; 64]);
        }
    }
}
