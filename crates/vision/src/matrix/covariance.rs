//! How the columns of rows vary together.

use super::Matrix;

/// The mean of rows, and their covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariance {
    /// A number a column.
    pub mean: Vec<f64>,
    /// Symmetric: as many rows and columns as the rows have columns.
    pub values: Vec<Vec<f64>>,
}

impl Covariance {
    /// Of at least one row.
    pub fn of(rows: &Matrix) -> Self {
        let (n_rows, width) = (rows.n_rows().max(1) as f64, rows.n_cols());
        let mut mean = vec![0.0; width];
        for row in rows.rows() {
            mean.iter_mut().zip(row).for_each(|(mean, &value)| *mean += f64::from(value));
        }
        mean.iter_mut().for_each(|mean| *mean /= n_rows);
        let mut values = vec![vec![0.0; width]; width];
        let mut centered = vec![0.0; width];
        for row in rows.rows() {
            centered.iter_mut().zip(row.iter().zip(&mean)).for_each(|(c, (&v, m))| *c = f64::from(v) - m);
            for (i, sums) in values.iter_mut().enumerate() {
                let factor = centered[i];
                sums[i..].iter_mut().zip(&centered[i..]).for_each(|(sum, value)| *sum += factor * value);
            }
        }
        for i in 0..width {
            let (above, below) = values.split_at_mut(i + 1);
            above[i][i..].iter_mut().for_each(|sum| *sum /= n_rows);
            below.iter_mut().zip(&above[i][i + 1..]).for_each(|(row, value)| row[i] = *value);
        }
        Self { mean, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_that_vary_together_are_told() {
        let rows = Matrix::from_vec(vec![1.0, 2.0, 5.0, 3.0, 6.0, 5.0], 3).unwrap();
        let Covariance { mean, values } = Covariance::of(&rows);
        assert_eq!(mean, [2.0, 4.0, 5.0]);
        assert_eq!(values, [[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0; 3]]);
    }
}
