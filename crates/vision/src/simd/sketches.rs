//! How alike a vector is to many, by a few bytes of each.

#[cfg(target_arch = "x86_64")]
mod x86;

use super::with_instructions;

/// The bytes of a sketch.
pub const SKETCH: usize = 24;

/// The largest magnitude of a number in a column, so that the products of a pair fit 16 bits.
pub const MAX_IN_COLUMN: i8 = 64;

/// What is added to the numbers of a row, so that none is negative.
const SHIFT: i16 = 128;

/// Columns that are worked on at once.
const COLUMN_BLOCK: usize = 32;

/// Bytes are multiplied two by two.
const N_PAIRS: usize = SKETCH / 2;

/// The score of padding: no column is less alike.
const PADDING: i16 = i16::MIN;

/// A pair of numbers of each column of a block.
type Pairs = [[i8; 2]; COLUMN_BLOCK];
/// A number for each column of a block.
type Scores = [i16; COLUMN_BLOCK];

/// A vector of numbers from -128 to 127, each kept with 128 added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SketchRow(pub [u8; SKETCH]);

impl SketchRow {
    /// The numbers.
    pub fn numbers(&self) -> [i16; SKETCH] {
        self.0.map(|byte| i16::from(byte) - SHIFT)
    }
}

/// Vectors of numbers from -64 to 64, laid out as columns.
#[derive(Clone, Debug, Default)]
pub struct SketchColumns {
    blocks: Vec<[Pairs; N_PAIRS]>,
    /// What a score begins with; [`PADDING`] after the last column.
    starts: Vec<Scores>,
}

impl SketchColumns {
    /// Columns, and what is taken from the score of each.
    ///
    /// # Panics
    /// When there are not as many of both, or a number is beyond [`MAX_IN_COLUMN`].
    pub fn new(columns: &[[i8; SKETCH]], less: &[i16]) -> Self {
        assert_eq!(columns.len(), less.len(), "columns with another number of what is taken from them");
        let n_blocks = columns.len().div_ceil(COLUMN_BLOCK);
        let mut blocks = vec![[[[0; 2]; COLUMN_BLOCK]; N_PAIRS]; n_blocks];
        let mut starts = vec![[PADDING; COLUMN_BLOCK]; n_blocks];
        for (column_idx, (column, &less)) in columns.iter().zip(less).enumerate() {
            assert!(
                column.iter().all(|number| number.unsigned_abs() <= MAX_IN_COLUMN as u8),
                "a column with a number beyond {MAX_IN_COLUMN}"
            );
            let (block_idx, lane) = (column_idx / COLUMN_BLOCK, column_idx % COLUMN_BLOCK);
            let (pairs, _) = column.as_chunks::<2>();
            blocks[block_idx].iter_mut().zip(pairs).for_each(|(lanes, &pair)| lanes[lane] = pair);
            let sum: i16 = column.iter().map(|&number| i16::from(number)).sum();
            starts[block_idx][lane] = sum.wrapping_mul(-SHIFT).wrapping_sub(less);
        }
        Self { blocks, starts }
    }

    /// The scores that there is room for: of each column, and of padding.
    pub fn n_scores(&self) -> usize {
        self.starts.len() * COLUMN_BLOCK
    }
}

/// The product of a row with each column, less what is taken from that, wrapped to 16 bits, into `scores`; returns the
/// largest.
///
/// # Panics
/// When there is no room for [`SketchColumns::n_scores`].
pub fn sketch_scores(row: &SketchRow, columns: &SketchColumns, scores: &mut [i16]) -> i16 {
    assert_eq!(scores.len(), columns.n_scores(), "room for another number of scores");
    with_instructions!(
        scores_kernel, Avx512: "avx512f,avx512bw,avx512vl",
        (row: &SketchRow, columns: &SketchColumns, scores: &mut [i16]) -> i16
    )
}

/// Appends the indices of the scores that are at least `least`, in order.
///
/// # Panics
/// When these are not scores of [`sketch_scores`].
pub fn scores_at_least(scores: &[i16], least: i16, found: &mut Vec<u32>) {
    with_instructions!(
        at_least_kernel, Avx512: "avx512f,avx512bw,avx512vl", (scores: &[i16], least: i16, found: &mut Vec<u32>)
    );
}

/// Instructions that multiply bytes and add the products in 16 bits. Who has a value may execute them.
trait Instructions: Copy {
    /// A row, as it is multiplied.
    type Row: Copy;
    /// A number for each of [`COLUMN_BLOCK`] columns.
    type Lanes: Copy;

    fn row(self, row: &SketchRow) -> Self::Row;

    /// The products of a row with a block of columns, added to `starts`.
    fn scores(self, row: &Self::Row, block: &[Pairs; N_PAIRS], starts: &Scores) -> Self::Lanes;

    fn larger(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;

    /// A bit for each score that is at least `least`.
    fn at_least(self, scores: &Scores, least: i16) -> u32;

    fn of(scores: Scores) -> Self::Lanes;

    fn into_scores(lanes: Self::Lanes) -> Scores;
}

/// Those that every CPU has.
#[derive(Clone, Copy)]
struct Plain;

impl Instructions for Plain {
    type Row = [[u8; 2]; N_PAIRS];
    type Lanes = Scores;

    #[inline(always)]
    fn row(self, row: &SketchRow) -> Self::Row {
        std::array::from_fn(|pair_idx| [row.0[2 * pair_idx], row.0[2 * pair_idx + 1]])
    }

    #[inline(always)]
    fn scores(self, row: &Self::Row, block: &[Pairs; N_PAIRS], starts: &Scores) -> Self::Lanes {
        let mut scores = *starts;
        for (pair, lanes) in row.iter().zip(block) {
            let pair = pair.map(i16::from);
            for (score, lane) in scores.iter_mut().zip(lanes) {
                let product = pair[0] * i16::from(lane[0]) + pair[1] * i16::from(lane[1]);
                *score = score.wrapping_add(product);
            }
        }
        scores
    }

    #[inline(always)]
    fn larger(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
        std::array::from_fn(|lane| a[lane].max(b[lane]))
    }

    #[inline(always)]
    fn at_least(self, scores: &Scores, least: i16) -> u32 {
        scores.iter().enumerate().fold(0, |bits, (lane, &score)| bits | u32::from(score >= least) << lane)
    }

    #[inline(always)]
    fn of(scores: Scores) -> Self::Lanes {
        scores
    }

    #[inline(always)]
    fn into_scores(lanes: Self::Lanes) -> Scores {
        lanes
    }
}

#[inline(always)]
fn scores_kernel<I: Instructions>(
    instructions: I,
    row: &SketchRow,
    columns: &SketchColumns,
    scores: &mut [i16],
) -> i16 {
    let row = instructions.row(row);
    let mut largest = I::of([PADDING; COLUMN_BLOCK]);
    let (of_blocks, _) = scores.as_chunks_mut::<COLUMN_BLOCK>();
    for ((block, starts), scores) in columns.blocks.iter().zip(&columns.starts).zip(of_blocks) {
        let of_block = instructions.scores(&row, block, starts);
        largest = instructions.larger(largest, of_block);
        *scores = I::into_scores(of_block);
    }
    I::into_scores(largest).into_iter().fold(PADDING, i16::max)
}

#[inline(always)]
fn at_least_kernel<I: Instructions>(instructions: I, scores: &[i16], least: i16, found: &mut Vec<u32>) {
    let (blocks, rest) = scores.as_chunks::<COLUMN_BLOCK>();
    assert!(rest.is_empty(), "scores of half a block");
    for (block_idx, scores) in blocks.iter().enumerate() {
        let mut lanes = instructions.at_least(scores, least);
        while lanes != 0 {
            found.push((block_idx * COLUMN_BLOCK) as u32 + lanes.trailing_zeros());
            lanes &= lanes - 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bytes() -> impl Strategy<Value = [u8; SKETCH]> {
        prop::array::uniform(any::<u8>())
    }

    fn column() -> impl Strategy<Value = [i8; SKETCH]> {
        prop::array::uniform(-MAX_IN_COLUMN..=MAX_IN_COLUMN)
    }

    proptest! {
        #[test]
        fn scores_are_the_naive_ones_on_every_cpu(
            row in bytes(),
            columns in prop::collection::vec((column(), any::<i16>()), 0..100),
            least in any::<i16>(),
        ) {
            let row = SketchRow(row);
            let (columns, less): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
            let sketched = SketchColumns::new(&columns, &less);
            let (mut scores, mut plain) = (vec![7; sketched.n_scores()], vec![8; sketched.n_scores()]);
            let largest = sketch_scores(&row, &sketched, &mut scores);
            prop_assert_eq!(largest, scores_kernel(Plain, &row, &sketched, &mut plain));
            prop_assert_eq!(&scores, &plain);
            #[cfg(target_arch = "x86_64")]
            if let Some(avx2) = crate::simd::cpu::Avx2::detected() {
                prop_assert_eq!(scores_kernel(avx2, &row, &sketched, &mut plain), largest);
                prop_assert_eq!(&scores, &plain);
            }
            for (score, (column, &less)) in scores.iter().zip(columns.iter().zip(&less)) {
                let product: i32 = row.numbers().iter().zip(column).map(|(&a, &b)| i32::from(a) * i32::from(b)).sum();
                prop_assert_eq!(*score, (product - i32::from(less)) as i16);
            }
            prop_assert_eq!(largest, scores.iter().copied().max().unwrap_or(PADDING));
            let (mut found, mut plainly) = (Vec::new(), Vec::new());
            scores_at_least(&scores, least, &mut found);
            at_least_kernel(Plain, &scores, least, &mut plainly);
            prop_assert_eq!(&found, &plainly);
            let expected: Vec<u32> = (0..scores.len() as u32).filter(|&idx| scores[idx as usize] >= least).collect();
            prop_assert_eq!(found, expected);
        }
    }
}
