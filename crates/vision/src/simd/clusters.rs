//! The nearest of many centers, where it is known about how far each is: Lloyd's rounds in fixed point, without most of
//! their comparisons.
//!
//! Centers stand in groups. For each point and each group a lower bound is kept of the distance to all centers of the
//! group but the point's own; when centers move it falls by the farthest move of the group (Ding et al., "Yinyang
//! K-Means: A Drop-In Replacement of the Classic K-Means with Consistent Speedup", ICML 2015). A group that may hold a nearer center
//! is compared by the first numbers of its centers, the head, and by all only where these do not tell. So it pays to turn the vectors until
//! their first numbers differ most.
//!
//! All is computed in whole numbers: what is skipped could not have changed anything.

mod lanes;

use super::nearest::{COLUMN_BLOCK, Instructions, PADDING, Plain};
use super::rows::{UnitRows, product_of_rows as product};
use super::with_instructions;
use lanes::Distances;

/// Centers that stand together.
pub const GROUP: usize = COLUMN_BLOCK;

/// Pairs of numbers that are compared first.
const HEAD_PAIRS: usize = 8;

type Lanes = [[i16; 2]; GROUP];

/// The squared distance of two vectors in fixed point, at most 2^30.
#[inline(always)]
fn squared_distance(a: &[[i16; 2]], b: &[[i16; 2]]) -> i32 {
    product(a, a).wrapping_add(product(b, b)).wrapping_sub(product(a, b).wrapping_mul(2))
}

/// Points with their squared lengths.
#[derive(Clone, Debug)]
pub struct MeasuredPoints {
    rows: UnitRows,
    /// Of the head of each, and of the whole.
    lengths: Vec<[i32; 2]>,
}

impl MeasuredPoints {
    /// Measures rows.
    pub fn new(rows: UnitRows) -> Self {
        let n_head = rows.n_pairs_a_row.min(HEAD_PAIRS);
        let lengths = |row: &[[i16; 2]]| [product(&row[..n_head], &row[..n_head]), product(row, row)];
        let lengths = rows.rows().map(lengths).collect();
        Self { rows, lengths }
    }

    /// The rows.
    pub fn rows(&self) -> &UnitRows {
        &self.rows
    }
}

/// The rows of [`UnitRows`] laid out as columns, in groups of [`GROUP`].
#[derive(Clone, Debug)]
pub struct GroupedRows {
    rows: UnitRows,
    heads: Vec<Lanes>,
    tails: Vec<Lanes>,
    /// Squared, [`PADDING`] after the last.
    head_lengths: Vec<[i32; GROUP]>,
    lengths: Vec<[i32; GROUP]>,
    n_head: usize,
}

impl GroupedRows {
    /// Lays out rows.
    pub fn new(rows: UnitRows) -> Self {
        let n_blocks = rows.n_rows().div_ceil(GROUP);
        let n_head = rows.n_pairs_a_row.min(HEAD_PAIRS);
        let n_tail = rows.n_pairs_a_row - n_head;
        let mut blocks = Self {
            heads: vec![[[0; 2]; GROUP]; n_blocks * n_head],
            tails: vec![[[0; 2]; GROUP]; n_blocks * n_tail],
            head_lengths: vec![[PADDING; GROUP]; n_blocks],
            lengths: vec![[PADDING; GROUP]; n_blocks],
            n_head,
            rows,
        };
        for (idx, row) in blocks.rows.rows().enumerate() {
            let (block, lane) = (idx / GROUP, idx % GROUP);
            let (head, tail) = row.split_at(n_head);
            let lay = |lanes: &mut Lanes, pair: &[i16; 2]| lanes[lane] = *pair;
            blocks.heads[block * n_head..].iter_mut().zip(head).for_each(|(lanes, pair)| lay(lanes, pair));
            blocks.tails[block * n_tail..].iter_mut().zip(tail).for_each(|(lanes, pair)| lay(lanes, pair));
            blocks.head_lengths[block][lane] = product(head, head);
            blocks.lengths[block][lane] = product(row, row);
        }
        blocks
    }

    /// The rows.
    pub fn rows(&self) -> &UnitRows {
        &self.rows
    }

    /// The number of groups.
    #[inline]
    pub fn n_groups(&self) -> usize {
        self.lengths.len()
    }

    fn head(&self, block: usize) -> &[Lanes] {
        &self.heads[block * self.n_head..][..self.n_head]
    }

    fn tail(&self, block: usize) -> &[Lanes] {
        let n_tail = self.rows.n_pairs_a_row - self.n_head;
        &self.tails[block * n_tail..][..n_tail]
    }

    /// How far the centers of each group are from those of `before` at most, rounded up.
    ///
    /// # Panics
    /// When `before` has fewer rows, or of another width.
    pub fn drifts(&self, before: &UnitRows) -> Vec<u16> {
        let moved: Vec<u16> = self
            .rows
            .rows()
            .zip(before.rows())
            .map(|(now, before)| at_most(squared_distance(now, before)))
            .collect();
        moved.chunks(GROUP).map(|group| group.iter().copied().max().unwrap_or(0)).collect()
    }
}

/// No less than the root.
#[inline(always)]
fn at_most(squared: i32) -> u16 {
    ((squared as f32).sqrt() * 1.000_001 + 1.0) as u16
}

/// No more than the root.
#[inline(always)]
fn at_least(squared: i32) -> u16 {
    ((squared as f32).sqrt() * 0.999_999) as u16
}

/// What is known of some points.
#[derive(Debug)]
pub struct Assignment<'a> {
    /// The center of each.
    pub nearest: &'a mut [u32],
    /// The squared distance to it.
    pub distances: &'a mut [i32],
    /// One a group, point after point: no more than the distance to any other of its centers before they moved.
    pub bounds: &'a mut [u16],
}

/// Finds the nearest center of each of the points from `first_row` on, ties to the first, and the squared distance to it, when centers of
/// each group have moved by at most `drifts` since `assignment` was made. One that has never been made is of any centers and bounds of 0.
///
/// # Panics
/// When there are no such points or centers, or they are not as wide.
pub fn reassign(
    points: &MeasuredPoints,
    first_row: usize,
    centers: &GroupedRows,
    drifts: &[u16],
    assignment: Assignment,
) {
    let round = Round { points, first_row, centers, drifts };
    with_instructions!(
        reassign_kernel, Avx512: "avx512f,avx512bw,avx512vl", (round: Round, assignment: Assignment)
    );
}

/// What is compared with what.
#[derive(Clone, Copy)]
struct Round<'a> {
    points: &'a MeasuredPoints,
    first_row: usize,
    centers: &'a GroupedRows,
    drifts: &'a [u16],
}

/// The nearest center so far.
#[derive(Clone, Copy)]
struct Best {
    idx: usize,
    squared: i32,
}

impl Best {
    #[inline(always)]
    fn of(points: &MeasuredPoints, row_idx: usize, centers: &GroupedRows, idx: usize) -> Self {
        let product = product(points.rows.row(row_idx), centers.rows.row(idx));
        let of_center = centers.lengths[idx / GROUP][idx % GROUP];
        let [_, of_row] = points.lengths[row_idx];
        Self { idx, squared: of_row.wrapping_add(of_center).wrapping_sub(product.wrapping_mul(2)) }
    }
}

/// A group that may hold a nearer center.
#[derive(Clone, Copy)]
struct Candidate<S> {
    group: usize,
    /// The products of the heads.
    sums: S,
    /// The smallest squared distance of the heads: no more than that of any center.
    least: i32,
}

#[inline(always)]
fn reassign_kernel<I: Distances>(instructions: I, round: Round, assignment: Assignment) {
    let Round { points, first_row, centers, drifts } = round;
    let n_groups = centers.n_groups();
    let mut near = vec![0; n_groups];
    let mut candidates = vec![Candidate { group: 0, sums: I::ZERO, least: 0 }; n_groups];
    let of_points = assignment.nearest.iter_mut().zip(assignment.distances);
    let of_points = of_points.zip(assignment.bounds.chunks_exact_mut(n_groups));
    for (offset, ((nearest, distance), bounds)) in of_points.enumerate() {
        let row_idx = first_row + offset;
        let row = points.rows.row(row_idx);
        let (head, tail) = row.split_at(centers.n_head);
        let [of_head, of_row] = points.lengths[row_idx];
        let mut best = Best::of(points, row_idx, centers, *nearest as usize);
        let reach = at_most(best.squared);
        for (bound, drift) in bounds.iter_mut().zip(drifts) {
            *bound = bound.saturating_sub(*drift);
        }
        let near = smaller(bounds, reach, &mut near);
        // First all heads, then what is left of them: what is not known ahead costs more than what is computed in vain.
        let candidates = &mut candidates[..near.len()];
        for (candidate, &group) in candidates.iter_mut().zip(near) {
            let group = group as usize;
            let sums = sum(instructions, I::ZERO, head, centers.head(group));
            let of_heads = instructions.distances(sums, &centers.head_lengths[group], of_head);
            *candidate = Candidate { group, sums, least: instructions.smallest(of_heads) };
        }
        for candidate in &*candidates {
            bounds[candidate.group] = at_least(candidate.least);
        }
        // The most promising comes first, so that the others are compared with what is near.
        if let Some(first) = (0..candidates.len()).min_by_key(|&idx| candidates[idx].least) {
            candidates.swap(0, first);
        }
        for &Candidate { group, sums, least } in &*candidates {
            if least > best.squared {
                continue;
            }
            let sums = sum(instructions, sums, tail, centers.tail(group));
            let squared = instructions.distances(sums, &centers.lengths[group], of_row);
            let least = instructions.smallest(squared);
            let (lane, others) = instructions.first_and_others(squared, least);
            let first = Best { idx: group * GROUP + lane, squared: least };
            let was = best.idx / GROUP;
            if (first.squared, first.idx) < (best.squared, best.idx) {
                if was != group {
                    bounds[was] = bounds[was].min(at_least(best.squared));
                }
                best = first;
                bounds[group] = at_least(others);
            } else {
                bounds[group] = at_least(if was == group { others } else { first.squared });
            }
        }
        *nearest = best.idx as u32;
        *distance = best.squared;
    }
}

/// The indices of the bounds that are not above `reach`, for which there is room.
#[inline(always)]
fn smaller<'a>(bounds: &[u16], reach: u16, room: &'a mut [u32]) -> &'a [u32] {
    let mut n = 0;
    for (idx, &bound) in bounds.iter().enumerate() {
        // Always written, and kept by counting on: which are near cannot be foreseen.
        room[n] = idx as u32;
        n += usize::from(bound <= reach);
    }
    &room[..n]
}

/// Adds the products of pairs with those of a group.
#[inline(always)]
fn sum<I: Instructions>(instructions: I, mut sums: I::Sums, row: &[[i16; 2]], block: &[Lanes]) -> I::Sums {
    for (&pair, lanes) in row.iter().zip(block) {
        sums = instructions.add(sums, pair, lanes);
    }
    sums
}

/// Lowers the squared distance of each point to that to `center` where this is nearer.
///
/// # Panics
/// When `center` is not as wide, or `distances` has no room for all groups.
pub fn approach(points: &GroupedRows, center: &[[i16; 2]], distances: &mut [i32]) {
    with_instructions!(
        approach_kernel, Avx512: "avx512f,avx512bw,avx512vl",
        (points: &GroupedRows, center: &[[i16; 2]], distances: &mut [i32])
    );
}

#[inline(always)]
fn approach_kernel<I: Distances>(
    instructions: I,
    points: &GroupedRows,
    center: &[[i16; 2]],
    nearest: &mut [i32],
) {
    let (head, tail) = center.split_at(points.n_head);
    let (of_head, of_center) = (product(head, head), product(center, center));
    let (nearest, _) = nearest.as_chunks_mut::<GROUP>();
    assert_eq!(nearest.len(), points.n_groups(), "room for another number of distances");
    for (group, nearest) in nearest.iter_mut().enumerate() {
        let sums = sum(instructions, I::ZERO, head, points.head(group));
        let of_heads = instructions.distances(sums, &points.head_lengths[group], of_head);
        // What is lowered by the heads alone is only a copy.
        if !instructions.lower(&mut nearest.clone(), of_heads) {
            continue;
        }
        let sums = sum(instructions, sums, tail, points.tail(group));
        instructions.lower(nearest, instructions.distances(sums, &points.lengths[group], of_center));
    }
}

#[cfg(test)]
mod tests;
