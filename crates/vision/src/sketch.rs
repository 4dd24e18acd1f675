//! The nearest of many vectors, exactly, for a fraction of the comparisons.
//!
//! Of each vector there is a sketch: its coordinates along the directions in which the many differ most, and how
//! long the rest of it is, in a byte each. Two vectors are at least as far from each other as their sketches: what
//! lies beside the directions differs by at least as much as its lengths. How far rounding can move a sketch is known
//! as well, so all but a few of the many are ruled out for sure. The few are compared in full.

use crate::matrix::Matrix;
use crate::simd::{
    LinearMap, MAX_IN_COLUMN, MeasuredRows, Nearness, ONE_PRODUCT, ROUNDING, SKETCH, SketchColumns,
    SketchRow, UnitRows, dot, scores_at_least, sketch_scores,
};

mod directions;

/// The directions; the last number of a sketch is what lies beside them.
const N_DIRECTIONS: usize = SKETCH - 1;

/// Fewer vectors are compared as quickly without.
const FEWEST: usize = 128;

/// The squared length of what a vector of unit length may be off in 32-bit floats, several times what it is.
const FLOAT_ERROR: f32 = 1e-5;

/// Many vectors of at most unit length.
#[derive(Clone, Debug)]
pub struct Sketched {
    rows: MeasuredRows,
    onto: LinearMap,
    /// Taken from the coordinates, so that they lie round zero.
    middle: [f32; SKETCH],
    columns: SketchColumns,
    /// Of the numbers of a row's sketch.
    row_unit: f32,
    /// Of a score.
    score_unit: f32,
    /// The length of the longest sketch of a column.
    longest: f32,
    /// How far a sketch in bytes is from that of its column, at most.
    column_error: f32,
    /// How far half the squared length of a column's sketch is from the truth, at most.
    square_error: f32,
    /// How far rounding to fixed point moves a vector, at most.
    rounding: f32,
}

/// A vector that is asked for.
struct Asked<'a> {
    coordinates: Coordinates,
    /// In fixed point, as those of [`MeasuredRows`].
    squared_length: i32,
    rows: &'a UnitRows,
    row_idx: usize,
}

/// What is filled anew for each vector.
struct Scratch {
    scores: Vec<i16>,
    /// Those that may be the nearest.
    candidates: Vec<u32>,
}

/// A vector as its sketch has it before it is rounded.
struct Coordinates {
    values: [f32; SKETCH],
    /// How far they may be from those of the vector in fixed point.
    error: f32,
}

impl Sketched {
    /// Sketches of the rows of a matrix, none of which is longer than 1. `None` where it does not pay: of few rows or
    /// narrow ones.
    pub fn new(vectors: &Matrix) -> Option<Self> {
        let width = vectors.n_cols();
        if vectors.n_rows() < FEWEST || width < 2 * SKETCH {
            return None;
        }
        let directions = directions::main_directions(vectors, N_DIRECTIONS);
        let mut sketched = Self {
            rows: MeasuredRows::new(UnitRows::new(vectors)),
            onto: LinearMap::new(&directions, &[0.0; N_DIRECTIONS], width),
            middle: [0.0; SKETCH],
            columns: SketchColumns::default(),
            row_unit: 1.0,
            score_unit: 1.0,
            longest: 0.0,
            column_error: 0.0,
            square_error: 0.0,
            rounding: ROUNDING * (width as f32).sqrt(),
        };
        let onto = sketched.onto.apply(vectors.as_slice());
        let of_rows: Vec<Coordinates> = vectors
            .rows()
            .zip(onto.chunks_exact(N_DIRECTIONS))
            .map(|(vector, onto)| sketched.coordinates(vector, onto))
            .collect();
        sketched.take_units(&of_rows);
        sketched.take_columns(&of_rows).then_some(sketched)
    }

    fn take_units(&mut self, of_rows: &[Coordinates]) {
        for (idx, middle) in self.middle.iter_mut().enumerate() {
            let values = of_rows.iter().map(|of_row| of_row.values[idx]);
            let (low, high) = values.fold((f32::MAX, f32::MIN), |(low, high), v| (low.min(v), high.max(v)));
            *middle = (low + high) / 2.0;
        }
        let range = of_rows
            .iter()
            .flat_map(|of_row| {
                of_row.values.iter().zip(&self.middle).map(|(value, middle)| (value - middle).abs())
            })
            .fold(f32::MIN_POSITIVE, f32::max);
        // Rows are of the kind of the many, and reach about as far.
        self.row_unit = range / 127.0;
        self.score_unit = self.row_unit * range / f32::from(MAX_IN_COLUMN);
    }

    /// Whether scores can tell the columns apart.
    fn take_columns(&mut self, of_rows: &[Coordinates]) -> bool {
        let unit = self.score_unit / self.row_unit;
        let (mut columns, mut less) = (Vec::new(), Vec::new());
        for of_row in of_rows {
            let exact = self.centered(of_row);
            // Within the range by its making.
            let most = f32::from(MAX_IN_COLUMN);
            let column = exact.map(|value| (value / unit).round().clamp(-most, most) as i8);
            let as_read = column.map(|number| f32::from(number) * unit);
            self.column_error = self.column_error.max(distance(&exact, &as_read) + of_row.error);
            self.longest = self.longest.max(length(&exact) + of_row.error);
            less.push((length(&exact).powi(2) / 2.0 / self.score_unit).round());
            columns.push(column);
            self.square_error = self.square_error.max(self.longest * of_row.error + self.score_unit);
        }
        if less.iter().any(|&less| less >= f32::from(i16::MAX)) {
            return false;
        }
        let less: Vec<i16> = less.into_iter().map(|less| less as i16).collect();
        self.columns = SketchColumns::new(&columns, &less);
        true
    }

    fn coordinates(&self, vector: &[f32], onto: &[f32]) -> Coordinates {
        let mut values = [0.0; SKETCH];
        values[..N_DIRECTIONS].copy_from_slice(onto);
        let beside = (squared_length(vector) - squared_length(onto)).max(0.0).sqrt();
        values[N_DIRECTIONS] = beside;
        // The root of a small difference is less certain.
        let error = self.rounding + FLOAT_ERROR / beside.max(FLOAT_ERROR.sqrt());
        Coordinates { values, error }
    }

    fn centered(&self, coordinates: &Coordinates) -> [f32; SKETCH] {
        std::array::from_fn(|idx| coordinates.values[idx] - self.middle[idx])
    }

    /// The nearest vector of each row, none of which is longer than 1, by the distance in fixed point, ties to the first: as
    /// [`crate::simd::nearest_columns`], which it equals.
    ///
    /// # Panics
    /// When the rows are of another width, or `nearest` has not room for one each.
    pub fn nearest(&self, vectors: &Matrix, nearest: &mut [u32]) {
        assert_eq!(vectors.n_rows(), nearest.len(), "room for another number of vectors");
        let rows = UnitRows::new(vectors);
        let onto = self.onto.apply(vectors.as_slice());
        let of_rows = vectors.rows().zip(onto.chunks_exact(N_DIRECTIONS)).zip(rows.squared_lengths());
        let mut scratch = Scratch { scores: vec![0; self.columns.n_scores()], candidates: Vec::new() };
        for (row_idx, ((vector, onto), squared_length)) in of_rows.enumerate() {
            let coordinates = self.coordinates(vector, onto);
            let asked = Asked { coordinates, squared_length, rows: &rows, row_idx };
            self.choose(&asked, &mut scratch);
            nearest[row_idx] = self.nearest_among(&asked, &scratch.candidates).idx;
        }
    }

    fn nearest_among(&self, asked: &Asked, candidates: &[u32]) -> Nearness {
        self.rows.nearest_among(asked.rows, asked.row_idx, candidates)
    }

    /// Chooses what may be the nearest: all where sketches cannot tell.
    fn choose(&self, asked: &Asked, scratch: &mut Scratch) {
        let least = self.least_score(asked, scratch);
        scratch.candidates.clear();
        if let Some(least) = least {
            scores_at_least(&scratch.scores, least, &mut scratch.candidates);
        }
        if scratch.candidates.is_empty() {
            scratch.candidates.extend(0..self.rows.n_rows() as u32);
        }
    }

    /// The score below which no vector is the nearest. `None` where scores do not fit.
    fn least_score(&self, asked: &Asked, Scratch { scores, candidates }: &mut Scratch) -> Option<i16> {
        let exact = self.centered(&asked.coordinates);
        // Numbers beyond the range become the last ones, as far from them as they are.
        let row = SketchRow(exact.map(|value| (value / self.row_unit + 128.5) as u8));
        let as_read = row.numbers().map(|number| f32::from(number) * self.row_unit);
        let row_error = distance(&exact, &as_read) + asked.coordinates.error;
        let row_length = length(&as_read);
        // How far a score may be from that of the sketches before they were rounded.
        let error = row_error * self.longest + row_length * self.column_error + self.square_error;
        // No score is larger than that of a column like the row, if only it fits.
        if (row_length * row_length / 2.0 + error) / self.score_unit >= f32::from(i16::MAX) {
            return None;
        }
        let largest = sketch_scores(&row, &self.columns, scores);
        candidates.clear();
        scores_at_least(scores, largest, candidates);
        candidates.truncate(1);
        // The nearest is no farther than this one.
        let first = self.nearest_among(asked, candidates);
        let squared_distance =
            (i64::from(asked.squared_length) - i64::from(first.score)) as f32 / ONE_PRODUCT as f32;
        let length = (length(&exact) - asked.coordinates.error).max(0.0);
        let least = ((length * length - squared_distance) / 2.0 - error - FLOAT_ERROR) / self.score_unit;
        // Below these are those that did not fit.
        (least > f32::from(i16::MIN + 2)).then(|| least.floor() as i16)
    }
}

fn length(values: &[f32; SKETCH]) -> f32 {
    squared_length(values).sqrt()
}

fn squared_length(values: &[f32]) -> f32 {
    let mut product = 0.0;
    dot(values, values, &mut product);
    product as f32
}

fn distance(a: &[f32; SKETCH], b: &[f32; SKETCH]) -> f32 {
    length(&std::array::from_fn(|idx| a[idx] - b[idx]))
}

#[cfg(test)]
mod tests;
