//! A dense row-major matrix of `f32`: one descriptor, bag or center a row.

mod covariance;

pub use covariance::Covariance;

/// A dense row-major matrix. Every row has the same number of columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    data: Vec<f32>,
    n_cols: usize,
}

impl Matrix {
    /// An empty matrix whose rows will have `n_cols` columns.
    pub fn new(n_cols: usize) -> Self {
        Self { data: Vec::new(), n_cols }
    }

    /// A matrix of zeros.
    pub fn zeros(n_rows: usize, n_cols: usize) -> Self {
        Self { data: vec![0.0; n_rows * n_cols], n_cols }
    }

    /// Takes row-major `data`; `None` when its length is not a multiple of `n_cols`.
    pub fn from_vec(data: Vec<f32>, n_cols: usize) -> Option<Self> {
        let fits = if n_cols == 0 { data.is_empty() } else { data.len().is_multiple_of(n_cols) };
        fits.then_some(Self { data, n_cols })
    }

    /// The number of rows.
    #[inline]
    pub fn n_rows(&self) -> usize {
        self.data.len().checked_div(self.n_cols).unwrap_or(0)
    }

    /// The number of columns.
    #[inline]
    pub fn n_cols(&self) -> usize {
        self.n_cols
    }

    /// Row `row_idx`. Panics when there is no such row.
    #[inline]
    pub fn row(&self, row_idx: usize) -> &[f32] {
        &self.data[row_idx * self.n_cols..][..self.n_cols]
    }

    /// Row `row_idx`, to write to. Panics when there is no such row.
    #[inline]
    pub fn row_mut(&mut self, row_idx: usize) -> &mut [f32] {
        &mut self.data[row_idx * self.n_cols..][..self.n_cols]
    }

    /// All rows in order.
    #[inline]
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f32]> {
        self.data.chunks_exact(self.n_cols.max(1))
    }

    /// Appends a row. Panics when its length is not [`Matrix::n_cols`].
    #[inline]
    pub fn push_row(&mut self, row: &[f32]) {
        assert_eq!(row.len(), self.n_cols, "a row of another width");
        self.data.extend_from_slice(row);
    }

    /// The numbers, row after row.
    #[inline]
    pub fn as_slice(&self) -> &[f32] {
        &self.data
    }

    /// The numbers, row after row, to write to.
    #[inline]
    pub fn as_mut_slice(&mut self) -> &mut [f32] {
        &mut self.data
    }
}
