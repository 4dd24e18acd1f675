//! Histograms of gradient directions: rows of gradients are counted, several at once up to the sums.

use super::dispatch;

/// Gradients that are worked on at once.
const BLOCK: usize = 8;

/// Directions of the histogram that [`count_directions`] counts in.
pub const N_DIRECTIONS: usize = 36;

dispatch! {
    /// Adds the `lengths` of gradients, times `weights` and `row_weight`, to the directions nearest to `turns`,
    /// which are from 0 to 1.
    ///
    /// # Panics
    ///
    /// When there are fewer turns or weights than lengths.
    count_directions, count_directions_kernel,
    (lengths: &[f32], turns: &[f32], weights: &[f32], row_weight: f32, histogram: &mut [f32; N_DIRECTIONS])
}

#[inline(always)]
fn count_directions_kernel(
    lengths: &[f32],
    turns: &[f32],
    weights: &[f32],
    row_weight: f32,
    histogram: &mut [f32; N_DIRECTIONS],
) {
    for start in (0..lengths.len()).step_by(BLOCK) {
        let n_lanes = (lengths.len() - start).min(BLOCK);
        let (lengths, turns, weights) = (block(lengths, start), block(turns, start), block(weights, start));
        let (mut bins, mut values) = ([0; BLOCK], [0.0; BLOCK]);
        for lane in 0..BLOCK {
            let bin = whole(turns[lane] * N_DIRECTIONS as f32 + 0.5);
            bins[lane] = if bin >= N_DIRECTIONS as i32 { bin - N_DIRECTIONS as i32 } else { bin };
            values[lane] = lengths[lane] * weights[lane] * row_weight;
        }
        for lane in 0..n_lanes {
            histogram[bins[lane] as usize] += values[lane];
        }
    }
}

/// Cells a side of the square that [`share_gradients`] counts in.
pub const N_CELLS: usize = 4;
/// Directions of a cell.
pub const N_CELL_DIRECTIONS: usize = 8;

/// Those of a row with a cell beyond each side, for gradients that only partly lie inside.
const N_COLUMNS: usize = N_CELLS + 2;

/// Cells row by row, with one beyond each side.
pub type CellHistograms = [[f32; N_CELL_DIRECTIONS]; N_COLUMNS * N_COLUMNS];

/// A row of gradients that lie in a turned square of cells.
#[derive(Clone, Copy, Debug)]
pub struct CellRow<'a> {
    /// The column of the first gradient, and the row.
    pub start: (usize, usize),
    /// The middle of the square.
    pub center: (f32, f32),
    /// The unit vector along the rows of cells, divided by the side of a cell.
    pub along: (f32, f32),
    /// Which way that vector points, in turns.
    pub turn: f32,
    /// Of the gradients.
    pub lengths: &'a [f32],
    /// From 0 to 1.
    pub turns: &'a [f32],
    /// What the lengths are multiplied by, together with `row_weight`.
    pub weights: &'a [f32],
    /// See `weights`.
    pub row_weight: f32,
}

dispatch! {
    /// Shares each gradient among the two nearest directions of the four nearest cells by linear interpolation.
    /// Those further outside than half a cell are left out. Directions are counted from the vector along the rows,
    /// against the sense of the angle.
    ///
    /// # Panics
    ///
    /// When there are fewer turns or weights than lengths.
    share_gradients, share_gradients_kernel,
    (row: &CellRow<'_>, histograms: &mut CellHistograms)
}

#[inline(always)]
fn share_gradients_kernel(row: &CellRow<'_>, histograms: &mut CellHistograms) {
    const MIDDLE: f32 = 0.5 * (N_CELLS - 1) as f32;
    let (along_x, along_y) = row.along;
    let dy = row.start.1 as f32 - row.center.1;
    for start in (0..row.lengths.len()).step_by(BLOCK) {
        let n_lanes = (row.lengths.len() - start).min(BLOCK);
        let (lengths, turns, weights) =
            (block(row.lengths, start), block(row.turns, start), block(row.weights, start));
        let first = (row.start.0 + start) as i32;
        let (mut cells, mut directions) = ([0; BLOCK], [0; BLOCK]);
        let (mut near, mut next, mut shares) = ([0.0; BLOCK], [0.0; BLOCK], [[0.0; BLOCK]; 4]);
        for lane in 0..BLOCK {
            let dx = (first + lane as i32) as f32 - row.center.0;
            // In cells from the center of the one beyond the first.
            let column = MIDDLE + dx * along_x + dy * along_y + 1.0;
            let line = MIDDLE + dy * along_x - dx * along_y + 1.0;
            let direction = (row.turn - turns[lane] + 1.0) * N_CELL_DIRECTIONS as f32;
            let (column_idx, line_idx, direction_idx) = (whole(column), whole(line), whole(direction));
            let is_inside = (column_idx <= N_CELLS as i32) & (line_idx <= N_CELLS as i32);
            let length = if is_inside { lengths[lane] * (weights[lane] * row.row_weight) } else { 0.0 };
            cells[lane] = if is_inside { line_idx * N_COLUMNS as i32 + column_idx } else { 0 };
            directions[lane] = direction_idx;
            let (right, lower) = (column - column_idx as f32, line - line_idx as f32);
            next[lane] = direction - direction_idx as f32;
            near[lane] = 1.0 - next[lane];
            let (upper, lower) = ((1.0 - lower) * length, lower * length);
            shares[0][lane] = upper * (1.0 - right);
            shares[1][lane] = upper * right;
            shares[2][lane] = lower * (1.0 - right);
            shares[3][lane] = lower * right;
        }
        for lane in 0..n_lanes {
            let pair = direction_pair(directions[lane] as usize, near[lane], next[lane]);
            // What the minimum leaves is never more; it tells the compiler that all four are there.
            let cell = (cells[lane] as usize).min(N_COLUMNS * N_COLUMNS - N_COLUMNS - 2);
            add(&mut histograms[cell], shares[0][lane], &pair);
            add(&mut histograms[cell + 1], shares[1][lane], &pair);
            add(&mut histograms[cell + N_COLUMNS], shares[2][lane], &pair);
            add(&mut histograms[cell + N_COLUMNS + 1], shares[3][lane], &pair);
        }
    }
}

/// All directions at once: to add nothing changes nothing.
#[inline(always)]
fn add(histogram: &mut [f32; N_CELL_DIRECTIONS], share: f32, pair: &[f32; N_CELL_DIRECTIONS]) {
    for direction in 0..N_CELL_DIRECTIONS {
        histogram[direction] += share * pair[direction];
    }
}

/// All zero but two neighboring directions.
#[inline(always)]
fn direction_pair(first: usize, near: f32, next: f32) -> [f32; N_CELL_DIRECTIONS] {
    const MASKS: [[u32; N_CELL_DIRECTIONS]; N_CELL_DIRECTIONS] = {
        let mut masks = [[0; N_CELL_DIRECTIONS]; N_CELL_DIRECTIONS];
        let mut direction = 0;
        while direction < N_CELL_DIRECTIONS {
            masks[direction][direction] = u32::MAX;
            direction += 1;
        }
        masks
    };
    let is_near = &MASKS[first % N_CELL_DIRECTIONS];
    let is_next = &MASKS[(first + 1) % N_CELL_DIRECTIONS];
    let mut pair = [0.0; N_CELL_DIRECTIONS];
    for idx in 0..N_CELL_DIRECTIONS {
        pair[idx] = f32::from_bits((near.to_bits() & is_near[idx]) | (next.to_bits() & is_next[idx]));
    }
    pair
}

/// Rounds down; what is below 1 to 0.
#[inline(always)]
fn whole(value: f32) -> i32 {
    (if value > 0.0 { value } else { 0.0 }) as i32
}

/// The values from `start` on, with zeros beyond the last.
#[inline(always)]
fn block(values: &[f32], start: usize) -> [f32; BLOCK] {
    let values = &values[start..];
    if let Some(block) = values.first_chunk() {
        return *block;
    }
    let mut block = [0.0; BLOCK];
    let n = values.len().min(BLOCK);
    block[..n].copy_from_slice(&values[..n]);
    block
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn values(length: usize) -> impl Strategy<Value = Vec<f32>> {
        prop::collection::vec(0.0f32..=1.0, length)
    }

    proptest! {
        #[test]
        fn directions_are_counted_one_by_one(
            lengths in values(40), turns in values(40), weights in values(40), row_weight in 0.0f32..1.0,
            n in 0usize..=40,
        ) {
            let (mut histogram, mut expected) = ([0.5; N_DIRECTIONS], [0.5; N_DIRECTIONS]);
            count_directions(&lengths[..n], &turns, &weights, row_weight, &mut histogram);
            for ((length, turn), weight) in lengths[..n].iter().zip(&turns).zip(&weights) {
                let bin = (turn * N_DIRECTIONS as f32 + 0.5) as usize % N_DIRECTIONS;
                expected[bin] += length * weight * row_weight;
            }
            prop_assert_eq!(histogram, expected);
        }

        #[test]
        fn gradients_are_shared_one_by_one(
            lengths in values(40), turns in values(40), weights in values(40), row_weight in 0.0f32..1.0,
            n in 0usize..=40, start in (0usize..50, 0usize..50), center in (0.0f32..60.0, 0.0f32..60.0),
            angle in 0.0f32..6.3, cell in 1.0f32..20.0,
        ) {
            let along = (angle.cos() / cell, angle.sin() / cell);
            let turn = angle / std::f32::consts::TAU;
            let (mut histograms, mut expected) = ([[0.25; 8]; 36], [[0.25; 8]; 36]);
            let row = CellRow {
                start, center, along, turn, lengths: &lengths[..n], turns: &turns, weights: &weights, row_weight,
            };
            share_gradients(&row, &mut histograms);
            for idx in 0..n {
                let (dx, dy) = ((start.0 + idx) as f32 - center.0, start.1 as f32 - center.1);
                let column = 1.5 + dx * along.0 + dy * along.1 + 1.0;
                let line = 1.5 + dy * along.0 - dx * along.1 + 1.0;
                let direction = (turn - turns[idx] + 1.0) * 8.0;
                let (column_idx, line_idx, direction_idx) = (column as usize, line as usize, direction as usize);
                if column_idx > 4 || line_idx > 4 {
                    continue;
                }
                let length = lengths[idx] * (weights[idx] * row_weight);
                let [right, lower] = [column - column_idx as f32, line - line_idx as f32];
                let next = direction - direction_idx as f32;
                for (line_idx, share) in [(line_idx, 1.0 - lower), (line_idx + 1, lower)] {
                    let share = share * length;
                    for (column_idx, share) in [(column_idx, share * (1.0 - right)), (column_idx + 1, share * right)] {
                        let histogram = &mut expected[line_idx * 6 + column_idx];
                        histogram[direction_idx % 8] += share * (1.0 - next);
                        histogram[(direction_idx + 1) % 8] += share * next;
                    }
                }
            }
            // The same bits.
            prop_assert_eq!(histograms, expected);
        }
    }
}
