//! The nearest of very many vectors of bytes.

use super::with_instructions;
use std::ops::Range;

/// Columns that are worked on at once.
const COLUMN_BLOCK: usize = 16;

/// Rows that are worked on at once.
const ROW_BLOCK: usize = 4;

/// Stands for the squared length of padding: so large that it is never near.
const PADDING: i32 = i32::MAX / 2;

/// The most numbers a vector has: sums of products then fit 32 bits.
pub const MAX_BYTES: usize = 4096;

/// A column that is near, as one number: its squared distance above, its index below. So numbers order by
/// distance, ties by index.
type Key = u64;

/// Where there is no column.
const NONE: Key = Key::MAX;

/// Vectors of numbers from -127 to 127. They lie four by four, as they are multiplied; the last four of a row
/// may end with zeros.
#[derive(Clone, Debug)]
pub struct ByteRows {
    quads: Vec<[i8; 4]>,
    n_quads: usize,
    /// Of each row.
    squared_lengths: Vec<i32>,
    /// Of each row.
    sums: Vec<i32>,
}

impl ByteRows {
    /// Rows of `width` numbers that lie one after the other in `values`. A number of -128 is taken as -127.
    ///
    /// # Panics
    /// When `width` is 0 or above [`MAX_BYTES`].
    pub fn new(values: &[i8], width: usize) -> Self {
        assert!((1..=MAX_BYTES).contains(&width), "rows of {width} numbers");
        let n_quads = width.div_ceil(4);
        let n_rows = values.len() / width;
        let mut rows = Self {
            quads: vec![[0; 4]; n_rows * n_quads],
            n_quads,
            squared_lengths: Vec::with_capacity(n_rows),
            sums: Vec::with_capacity(n_rows),
        };
        for (row, quads) in values.chunks_exact(width).zip(rows.quads.chunks_exact_mut(n_quads)) {
            let numbers = quads.as_flattened_mut();
            numbers.iter_mut().zip(row).for_each(|(number, &value)| *number = value.max(-127));
            rows.squared_lengths.push(squared_length(numbers));
            rows.sums.push(numbers.iter().map(|&number| i32::from(number)).sum());
        }
        rows
    }

    /// The number of rows.
    #[inline]
    pub fn n_rows(&self) -> usize {
        self.squared_lengths.len()
    }

    fn row(&self, row_idx: usize) -> &[[i8; 4]] {
        &self.quads[row_idx * self.n_quads..][..self.n_quads]
    }
}

fn squared_length(numbers: &[i8]) -> i32 {
    numbers.iter().map(|&number| i32::from(number).pow(2)).sum()
}

/// Vectors of numbers from -127 to 127 laid out as columns, in blocks of 16, for [`Nearest::look`]. A column that
/// was not set is padding and never near.
#[derive(Clone, Debug)]
pub struct ByteColumns {
    /// Block after block; within a block, quad after quad.
    blocks: Vec<[[i8; 4]; COLUMN_BLOCK]>,
    squared_lengths: Vec<[i32; COLUMN_BLOCK]>,
    n_quads: usize,
}

impl ByteColumns {
    /// The number of columns in a block.
    pub const BLOCK: usize = COLUMN_BLOCK;

    /// Blocks of padding, for columns of `width` numbers.
    ///
    /// # Panics
    /// When `width` is 0 or above [`MAX_BYTES`].
    pub fn padding(n_blocks: usize, width: usize) -> Self {
        assert!((1..=MAX_BYTES).contains(&width), "columns of {width} numbers");
        let n_quads = width.div_ceil(4);
        Self {
            blocks: vec![[[0; 4]; COLUMN_BLOCK]; n_blocks * n_quads],
            squared_lengths: vec![[PADDING; COLUMN_BLOCK]; n_blocks],
            n_quads,
        }
    }

    /// Columns of `width` numbers that lie one after the other in `values`.
    ///
    /// # Panics
    /// When `width` is 0 or above [`MAX_BYTES`].
    pub fn new(values: &[i8], width: usize) -> Self {
        let mut columns = Self::padding((values.len() / width.max(1)).div_ceil(COLUMN_BLOCK), width);
        values.chunks_exact(width).enumerate().for_each(|(idx, values)| columns.set(idx, values));
        columns
    }

    /// The number of blocks.
    #[inline]
    pub fn n_blocks(&self) -> usize {
        self.squared_lengths.len()
    }

    /// Sets a column; numbers past its width are ignored, a number of -128 is taken as -127.
    ///
    /// # Panics
    /// When there is no such column.
    #[inline]
    pub fn set(&mut self, column_idx: usize, values: &[i8]) {
        let (block_idx, lane) = (column_idx / COLUMN_BLOCK, column_idx % COLUMN_BLOCK);
        let block = &mut self.blocks[block_idx * self.n_quads..][..self.n_quads];
        let mut squared_length = 0;
        for (lanes, values) in block.iter_mut().zip(values.chunks(4)) {
            let quad = &mut lanes[lane];
            quad.iter_mut().zip(values).for_each(|(number, &value)| *number = value.max(-127));
            squared_length += self::squared_length(quad);
        }
        self.squared_lengths[block_idx][lane] = squared_length;
    }

    /// Copies the first numbers of a column.
    ///
    /// # Panics
    /// When there is no such column.
    #[inline]
    pub fn get(&self, column_idx: usize, values: &mut [i8]) {
        let (block_idx, lane) = (column_idx / COLUMN_BLOCK, column_idx % COLUMN_BLOCK);
        let block = &self.blocks[block_idx * self.n_quads..][..self.n_quads];
        for (lanes, values) in block.iter().zip(values.chunks_mut(4)) {
            values.iter_mut().zip(lanes[lane]).for_each(|(value, number)| *value = number);
        }
    }
}

/// The nearest columns of each of many rows, among all that were looked at.
#[derive(Clone, Debug)]
pub struct Nearest {
    /// `n_kept` of each row, nearest first.
    keys: Vec<Key>,
    n_kept: usize,
}

impl Nearest {
    /// For `n_rows` rows, nothing looked at, the nearest `n_kept` to be kept of each.
    ///
    /// # Panics
    /// When `n_kept` is 0.
    pub fn new(n_rows: usize, n_kept: usize) -> Self {
        assert!(n_kept > 0, "the nearest none");
        Self { keys: vec![NONE; n_rows * n_kept], n_kept }
    }

    /// Squared distance and index of the columns nearest to a row, nearest first, ties by index; fewer than
    /// were to be kept where fewer were looked at.
    ///
    /// # Panics
    /// When there is no such row.
    #[inline]
    pub fn of(&self, row_idx: usize) -> impl Iterator<Item = (u32, u32)> {
        let keys = &self.keys[row_idx * self.n_kept..][..self.n_kept];
        keys.iter().take_while(|&&key| key != NONE).map(|&key| ((key >> 32) as u32, key as u32))
    }

    /// Compares the rows of these indices with the columns in these blocks, which they have not been compared
    /// with yet. The order in which blocks are looked at does not matter.
    ///
    /// # Panics
    /// When there are no such rows or blocks, or rows and columns are not as wide.
    pub fn look(&mut self, rows: &ByteRows, row_idxs: &[u32], columns: &ByteColumns, blocks: Range<usize>) {
        assert_eq!(rows.n_quads, columns.n_quads, "rows and columns of another width");
        let (nearest, look) = (self, &Look { rows, row_idxs, columns, blocks });
        with_instructions!(
            look_kernel, Avx512Vnni: "avx512f,avx512bw,avx512vl,avx512vnni",
            (nearest: &mut Nearest, look: &Look)
        );
    }

    /// Keeps the columns of a block whose distance may be small enough.
    fn keep(&mut self, row_idx: usize, candidates: &Candidates) {
        let keys = &mut self.keys[row_idx * self.n_kept..][..self.n_kept];
        let mut lanes = candidates.lanes;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let distance = candidates.values[lane] + candidates.squared_length;
            let column_idx = candidates.block_idx * COLUMN_BLOCK + lane;
            let key = Key::from(distance as u32) << 32 | column_idx as Key;
            let last = keys.len() - 1;
            if key < keys[last] {
                // Few are moved: by hand this is several times faster than to search and to rotate.
                let mut place = last;
                while place > 0 && keys[place - 1] > key {
                    keys[place] = keys[place - 1];
                    place -= 1;
                }
                keys[place] = key;
            }
        }
    }

    /// The largest squared distance at which a column may be among the nearest of a row.
    fn farthest(&self, row_idx: usize) -> i32 {
        let distance = self.keys[(row_idx + 1) * self.n_kept - 1] >> 32;
        // Below that of padding.
        distance.min((PADDING / 2) as Key) as i32
    }
}

/// What is compared with what.
struct Look<'a> {
    rows: &'a ByteRows,
    row_idxs: &'a [u32],
    columns: &'a ByteColumns,
    blocks: Range<usize>,
}

/// Columns of a block that may be near to a row.
struct Candidates {
    /// A bit a column.
    lanes: u16,
    /// The squared distance of each column without the row's squared length.
    values: [i32; COLUMN_BLOCK],
    squared_length: i32,
    block_idx: usize,
}

/// Instructions that multiply bytes and add the products. Who has a value may execute them.
trait Instructions: Copy {
    /// A number for each of [`COLUMN_BLOCK`] columns.
    type Lanes: Copy;

    /// Products before the first quad, of a row with this sum of its numbers.
    fn start(self, row_sum: i32) -> Self::Lanes;

    /// Adds the products of the next quad.
    fn add(self, products: Self::Lanes, quad: [i8; 4], columns: &[[i8; 4]; COLUMN_BLOCK]) -> Self::Lanes;

    /// The squared lengths of columns less twice their products.
    fn values(self, products: Self::Lanes, squared_lengths: &[i32; COLUMN_BLOCK]) -> Self::Lanes;

    /// The smaller of two numbers in each lane.
    fn smaller(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;

    /// A bit for each value that is at most `limit`.
    fn at_most(self, values: Self::Lanes, limit: i32) -> u16;

    fn into_array(lanes: Self::Lanes) -> [i32; COLUMN_BLOCK];
}

/// Those that every CPU has.
#[derive(Clone, Copy)]
struct Plain;

impl Instructions for Plain {
    type Lanes = [i32; COLUMN_BLOCK];

    #[inline(always)]
    fn start(self, _row_sum: i32) -> Self::Lanes {
        [0; COLUMN_BLOCK]
    }

    #[inline(always)]
    fn add(self, mut products: Self::Lanes, quad: [i8; 4], columns: &[[i8; 4]; COLUMN_BLOCK]) -> Self::Lanes {
        for (product, column) in products.iter_mut().zip(columns) {
            for i in 0..4 {
                *product += i32::from(quad[i]) * i32::from(column[i]);
            }
        }
        products
    }

    #[inline(always)]
    fn values(self, products: Self::Lanes, squared_lengths: &[i32; COLUMN_BLOCK]) -> Self::Lanes {
        std::array::from_fn(|lane| squared_lengths[lane] - 2 * products[lane])
    }

    #[inline(always)]
    fn smaller(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
        std::array::from_fn(|lane| a[lane].min(b[lane]))
    }

    #[inline(always)]
    fn at_most(self, values: Self::Lanes, limit: i32) -> u16 {
        (0..COLUMN_BLOCK).map(|lane| u16::from(values[lane] <= limit) << lane).sum()
    }

    #[inline(always)]
    fn into_array(lanes: Self::Lanes) -> [i32; COLUMN_BLOCK] {
        lanes
    }
}

#[cfg(target_arch = "x86_64")]
mod x86;

#[inline(always)]
fn look_kernel<I: Instructions>(instructions: I, nearest: &mut Nearest, look: &Look) {
    for row_idxs in look.row_idxs.chunks(ROW_BLOCK) {
        match *row_idxs {
            [a, b, c, d] => look_from(instructions, nearest, look, [a, b, c, d]),
            [a, b, c] => look_from(instructions, nearest, look, [a, b, c]),
            [a, b] => look_from(instructions, nearest, look, [a, b]),
            [a] => look_from(instructions, nearest, look, [a]),
            _ => {}
        }
    }
}

/// `R` rows against all columns, [`COLUMN_BLOCK`] at a time; a lane is a column.
#[inline(always)]
fn look_from<I: Instructions, const R: usize>(
    instructions: I,
    nearest: &mut Nearest,
    look: &Look,
    row_idxs: [u32; R],
) {
    let row_idxs = row_idxs.map(|row_idx| row_idx as usize);
    let lengths = row_idxs.map(|row_idx| look.rows.squared_lengths[row_idx]);
    let mut rows = Rows {
        quads: row_idxs.map(|row_idx| look.rows.row(row_idx)),
        // No closures round instructions: they would not be compiled for these.
        starts: [instructions.start(0); R],
    };
    let mut limits = [0; R];
    for r in 0..R {
        rows.starts[r] = instructions.start(look.rows.sums[row_idxs[r]]);
        limits[r] = nearest.farthest(row_idxs[r]) - lengths[r];
    }
    if is_worth_bounding(nearest, &row_idxs, look) {
        let bounds = bounds(instructions, &rows, look, nearest.n_kept);
        for r in 0..R {
            limits[r] = limits[r].min(bounds[r]);
        }
    }
    for block_idx in look.blocks.clone() {
        let values = values_of_block(instructions, &rows, look.columns, block_idx);
        for r in 0..R {
            let lanes = instructions.at_most(values[r], limits[r]);
            if lanes != 0 {
                let values = I::into_array(values[r]);
                let squared_length = lengths[r];
                nearest.keep(row_idxs[r], &Candidates { lanes, values, squared_length, block_idx });
                limits[r] = limits[r].min(nearest.farthest(row_idxs[r]) - lengths[r]);
            }
        }
    }
}

/// `R` rows that are worked on at once.
struct Rows<'a, I: Instructions, const R: usize> {
    quads: [&'a [[i8; 4]]; R],
    starts: [I::Lanes; R],
}

/// The squared distances of a block's columns without the squared lengths of the rows.
#[inline(always)]
fn values_of_block<I: Instructions, const R: usize>(
    instructions: I,
    rows: &Rows<I, R>,
    columns: &ByteColumns,
    block_idx: usize,
) -> [I::Lanes; R] {
    let n = columns.n_quads;
    let mut products = rows.starts;
    for (i, quads) in columns.blocks[block_idx * n..][..n].iter().enumerate() {
        for (sums, row) in products.iter_mut().zip(&rows.quads) {
            *sums = instructions.add(*sums, row[i], quads);
        }
    }
    for sums in &mut products {
        *sums = instructions.values(*sums, &columns.squared_lengths[block_idx]);
    }
    products
}

/// Blocks whose smallest values are told apart for a bound: every second one.
const N_BOUNDING: usize = 2;

/// Whether looking twice is cheaper: the first time most of many columns would be kept and soon dropped.
fn is_worth_bounding(nearest: &Nearest, row_idxs: &[usize], look: &Look) -> bool {
    nearest.n_kept <= N_BOUNDING * COLUMN_BLOCK
        && look.blocks.len() >= nearest.n_kept.div_ceil(2).max(N_BOUNDING)
        && row_idxs.iter().all(|&row_idx| nearest.keys[row_idx * nearest.n_kept] == NONE)
}

/// A value that at least `n_kept` columns have or are below: of the smallest of each lane the `n_kept`-th.
#[inline(always)]
fn bounds<I: Instructions, const R: usize>(
    instructions: I,
    rows: &Rows<I, R>,
    look: &Look,
    n_kept: usize,
) -> [i32; R] {
    let first = look.blocks.start;
    let mut smallest = [values_of_block(instructions, rows, look.columns, first); N_BOUNDING];
    for block_idx in first..look.blocks.end {
        let values = values_of_block(instructions, rows, look.columns, block_idx);
        let group = (block_idx - first) % N_BOUNDING;
        let is_first_of_group = block_idx - first < N_BOUNDING;
        for r in 0..R {
            let before = if is_first_of_group { values[r] } else { smallest[group][r] };
            smallest[group][r] = instructions.smaller(before, values[r]);
        }
    }
    let mut bounds = [0; R];
    for r in 0..R {
        let mut of_lanes = [[0; COLUMN_BLOCK]; N_BOUNDING];
        for group in 0..N_BOUNDING {
            of_lanes[group] = I::into_array(smallest[group][r]);
        }
        let of_lanes = of_lanes.as_flattened_mut();
        of_lanes.sort_unstable();
        bounds[r] = of_lanes[n_kept - 1];
    }
    bounds
}

#[cfg(test)]
mod tests;
