//! The walk through the blocks of a scan, from restart marker to restart marker.

use super::bits::Bits;
use super::blocks::{self, Part, Pass, State};
use super::frame::{Block, Component, Frame, RowState};
use crate::simd::BLOCKS;
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
    let mut bits = Bits::new(bytes, position);
    let mut walk = Walk { frame, scan, grid, row: 0 };
    let (mut group, mut n_restarts) = (0, 0);
    loop {
        let end = (group + interval).min(n_groups);
        let read_to = walk.segment(group..end, &mut bits);
        walk.miss(read_to..end);
        group = end;
        if group == n_groups {
            break;
        }
        let Some(restart) = bits.restart(n_restarts) else {
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
    bits.position()
}

struct Walk<'a> {
    frame: &'a mut Frame,
    scan: &'a Scan<'a>,
    grid: Grid,
    /// The row of groups whose blocks are kept, in a sequential frame.
    row: usize,
}

impl Walk<'_> {
    /// Reads groups up to the next restart marker; returns the first that could not be read.
    fn segment(&mut self, groups: Range<usize>, bits: &mut Bits) -> usize {
        let mut states = [State::default(); 4];
        let across = self.grid.n_groups[0];
        let (mut row, mut column) = (groups.start / across, groups.start % across);
        for group in groups.clone() {
            if row != self.row {
                self.finish_row();
                self.row = row;
            }
            if self.group(row, column, &mut states, bits).is_none() || bits.ran_out() {
                self.forget(column);
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
    fn group(&mut self, row: usize, column: usize, states: &mut [State; 4], bits: &mut Bits) -> Option<()> {
        let is_progressive = self.frame.is_progressive;
        let parts = self.scan.parts.iter().zip(&self.grid.sizes).zip(states);
        for ((part, &[across, down]), state) in parts {
            let component = &mut self.frame.components[part.component_idx];
            for y in 0..down {
                // All rows are kept in a progressive frame, else those of this row of groups.
                let block_row = if is_progressive { row * down + y } else { y };
                let first = block_row * component.n_padded[0] + column * across;
                for idx in first..first + across {
                    match (is_progressive, component.is_wanted) {
                        (false, false) => blocks::pass_over(None, part, state, bits)?,
                        (false, true) if component.only_colors => {
                            let block = Block::of(&mut component.groups, idx);
                            blocks::pass_over(Some(block), part, state, bits)?;
                        }
                        (false, true) => {
                            let block = Block::of(&mut component.groups, idx);
                            blocks::sequential(block, part, state, bits)?;
                        }
                        (true, is_wanted) => {
                            let mut unwanted = [[[0; BLOCKS]; 64]];
                            let block = if is_wanted {
                                Block::of(&mut component.groups, idx)
                            } else {
                                Block::of(&mut unwanted, 0)
                            };
                            blocks::progressive(block, part, &self.scan.pass, state, bits)?;
                        }
                    }
                }
            }
        }
        Some(())
    }

    /// Makes the blocks of a group gray again that was read in part. In a progressive frame what was read
    /// of it stays.
    fn forget(&mut self, column: usize) {
        if self.frame.is_progressive {
            return;
        }
        for (part, &[across, down]) in self.scan.parts.iter().zip(&self.grid.sizes) {
            let component = &mut self.frame.components[part.component_idx];
            if component.is_wanted {
                for y in 0..down {
                    let first = y * component.n_padded[0] + column * across;
                    (first..first + across).for_each(|idx| Block::of(&mut component.groups, idx).clear());
                }
            }
        }
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

    /// Turns the kept row of groups into samples, and makes room for another.
    fn finish_row(&mut self) {
        if self.frame.is_progressive {
            return;
        }
        for (part, &[_, down]) in self.scan.parts.iter().zip(&self.grid.sizes) {
            let component: &mut Component = &mut self.frame.components[part.component_idx];
            if component.is_wanted {
                component.transform(self.row * down, down);
                component.groups.fill([[0; BLOCKS]; 64]);
            }
        }
    }
}
