//! From the tensors that come out of a network to vectors and grids of length 1.

use super::budget::Sizes;
use super::description::{Description, Pooling, Size};
use crate::detect::Keypoint;
use crate::matrix::Matrix;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What came out of a network for one picture.
#[derive(Debug)]
pub struct Outputs {
    pub(super) forms: Arc<Forms>,
    /// By name; each as long as its dimensions say.
    pub(super) tensors: BTreeMap<String, Vec<f32>>,
}

/// A picture, described cell by cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// The middle of each cell in pixels of the input, whose own middles are whole numbers, row by row; the response is
    /// the length that the cell's row had.
    pub keypoints: Vec<Keypoint>,
    /// One row a cell, of length 1.
    pub rows: Matrix,
}

/// The maps of XFeat, channel by channel, each row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct XFeatMaps<'a> {
    /// Cells in a row, each eight pixels wide.
    pub n_columns: usize,
    /// Rows of cells.
    pub n_rows: usize,
    /// 64 channels: a descriptor a cell, of any length.
    pub features: &'a [f32],
    /// 65 channels: scores before a softmax, of the 64 pixels of a cell row by row and of none of them.
    pub keypoints: &'a [f32],
    /// One channel, from 0 to 1.
    pub reliability: &'a [f32],
}

/// How the tensors of a network are to be read, for one size of its input.
#[derive(Debug)]
pub(super) struct Forms {
    size: Size,
    vector: Option<VectorForm>,
    grids: BTreeMap<String, GridForm>,
    xfeat: Option<XFeatForm>,
}

#[derive(Debug)]
struct VectorForm {
    output: String,
    pooling: Pooling,
    form: Form,
}

#[derive(Debug)]
struct GridForm {
    output: String,
    n_columns: usize,
    n_rows: usize,
    form: Form,
}

#[derive(Debug)]
struct XFeatForm {
    features: String,
    keypoints: String,
    reliability: String,
    n_columns: usize,
    n_rows: usize,
}

/// Where in a tensor the numbers of a cell are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// `1 x C x H x W`, or `1 x C` of a single cell.
    Map { n_channels: usize, n_cells: usize },
    /// `1 x N x C`.
    Tokens { n_channels: usize, n_cells: usize, n_before: usize },
}

impl Forms {
    /// Holds the description against the dimensions of the outputs. The error ends a sentence that begins with
    /// the network's name.
    pub fn new(description: &Description, sizes: &Sizes<'_>, size: Size) -> Result<Self, String> {
        let vector = description.vector.as_ref().map(|vector| {
            let n_before = vector.class_tokens.unwrap_or(1);
            let form =
                Form::of(sizes.of_output(&vector.output)?, n_before).map_err(told_of(&vector.output))?;
            if vector.pooling == Pooling::ClassToken && !matches!(form, Form::Tokens { n_before: 1.., .. }) {
                return Err(format!(
                    "has no class token in its output {:?}: name another pooling",
                    vector.output
                ));
            }
            Ok(VectorForm { output: vector.output.clone(), pooling: vector.pooling, form })
        });
        let mut grids = BTreeMap::new();
        for (name, grid) in &description.grids {
            let form = Form::of(sizes.of_output(&grid.output)?, grid.class_tokens.unwrap_or(1));
            let form = form.map_err(told_of(&grid.output))?;
            let (n_columns, n_rows) = match (form, sizes.of_output(&grid.output)?) {
                (Form::Map { .. }, &[_, _, n_rows, n_columns]) => (n_columns, n_rows),
                (Form::Map { .. }, _) => {
                    return Err(format!("has one vector for all cells in its output {:?}", grid.output));
                }
                (Form::Tokens { .. }, _) => form.columns_and_rows(size).ok_or_else(|| {
                    format!(
                        "has tokens in its output {:?} that do not make a grid over {size}: look at class_tokens",
                        grid.output
                    )
                })?,
            };
            grids.insert(name.clone(), GridForm { output: grid.output.clone(), n_columns, n_rows, form });
        }
        let xfeat = description.xfeat.as_ref().map(|outputs| {
            let (n_columns, n_rows) = (size.width as usize / 8, size.height as usize / 8);
            for (name, n_channels) in [(&outputs.features, 64), (&outputs.keypoints, 65), (&outputs.reliability, 1)] {
                if *sizes.of_output(name)? != [1, n_channels, n_rows, n_columns] {
                    return Err(format!("has no output of XFeat in {name:?}: 1 x {n_channels} x {n_rows} x {n_columns} is expected"));
                }
            }
            let [features, keypoints, reliability] =
                [&outputs.features, &outputs.keypoints, &outputs.reliability].map(String::clone);
            Ok(XFeatForm { features, keypoints, reliability, n_columns, n_rows })
        });
        Ok(Self { size, vector: vector.transpose()?, grids, xfeat: xfeat.transpose()? })
    }

    /// The numbers of a vector; `None` where the network has none.
    pub fn vector_len(&self) -> Option<usize> {
        self.vector.as_ref().map(|vector| vector.form.n_channels())
    }

    /// The numbers of a row of the grid `name`; `None` where the network has none of that name.
    pub fn grid_len(&self, name: &str) -> Option<usize> {
        self.grids.get(name).map(|grid| grid.form.n_channels())
    }
}

fn told_of(output: &str) -> impl Fn(String) -> String {
    move |why| format!("has the output {output:?}, which {why}")
}

impl Form {
    fn of(dims: &[usize], n_before: usize) -> Result<Self, String> {
        let form = match *dims {
            [1, n_channels] => Self::Map { n_channels, n_cells: 1 },
            [1, n_channels, height, width] => Self::Map { n_channels, n_cells: height * width },
            [1, n_tokens, n_channels] if n_tokens > n_before => {
                Self::Tokens { n_channels, n_cells: n_tokens - n_before, n_before }
            }
            _ => return Err(format!("is neither a vector, nor a map, nor tokens, but {dims:?}")),
        };
        match form {
            Self::Map { n_channels: 0, .. }
            | Self::Map { n_cells: 0, .. }
            | Self::Tokens { n_channels: 0, .. } => Err("holds no numbers".to_owned()),
            _ => Ok(form),
        }
    }

    fn n_channels(self) -> usize {
        match self {
            Self::Map { n_channels, .. } | Self::Tokens { n_channels, .. } => n_channels,
        }
    }

    fn n_cells(self) -> usize {
        match self {
            Self::Map { n_cells, .. } | Self::Tokens { n_cells, .. } => n_cells,
        }
    }

    /// Square patches over an input of `size`.
    fn columns_and_rows(self, size: Size) -> Option<(usize, usize)> {
        let side = (f64::from(size.width) * f64::from(size.height) / self.n_cells() as f64).sqrt();
        let count = |pixels: u32| (f64::from(pixels) / side).round() as usize;
        let (n_columns, n_rows) = (count(size.width), count(size.height));
        let are_square = size.width as usize * n_rows == size.height as usize * n_columns;
        (are_square && n_columns * n_rows == self.n_cells()).then_some((n_columns, n_rows))
    }

    /// The numbers of cell `cell_idx`, channel by channel.
    fn cell(self, tensor: &[f32], cell_idx: usize) -> impl Iterator<Item = f32> {
        let (start, step) = match self {
            Self::Map { n_cells, .. } => (cell_idx, n_cells),
            Self::Tokens { n_channels, n_before, .. } => ((n_before + cell_idx) * n_channels, 1),
        };
        tensor[start..].iter().step_by(step).take(self.n_channels()).copied()
    }
}

impl Outputs {
    /// The vector of the picture, of length 1; `None` where the network has none, or it is 0.
    pub fn vector(&self) -> Option<Vec<f32>> {
        let VectorForm { output, pooling, form } = self.forms.vector.as_ref()?;
        let tensor = self.tensors.get(output)?;
        let mut vector = vec![0.0; form.n_channels()];
        match pooling {
            Pooling::ClassToken => vector.copy_from_slice(&tensor[..form.n_channels()]),
            _ => {
                let is_generalized = *pooling == Pooling::GeneralizedMean;
                for cell_idx in 0..form.n_cells() {
                    for (sum, number) in vector.iter_mut().zip(form.cell(tensor, cell_idx)) {
                        *sum += if is_generalized { number.max(0.0).powi(3) } else { number };
                    }
                }
                if is_generalized {
                    // The number of cells goes with the length.
                    vector.iter_mut().for_each(|sum| *sum = sum.cbrt());
                }
            }
        }
        to_unit_length(&mut vector)?;
        Some(vector)
    }

    /// The grid `name` of the picture, without cells of zeros; `None` where the network has none of that name.
    pub fn grid(&self, name: &str) -> Option<Grid> {
        let &GridForm { ref output, n_columns, n_rows, form } = self.forms.grids.get(name)?;
        let tensor = self.tensors.get(output)?;
        let middle = |idx: usize, n: usize, pixels: u32| (idx as f32 + 0.5) * pixels as f32 / n as f32 - 0.5;
        let mut grid = Grid { keypoints: Vec::new(), rows: Matrix::new(form.n_channels()) };
        let mut row = vec![0.0; form.n_channels()];
        for cell_idx in 0..form.n_cells() {
            for (to, number) in row.iter_mut().zip(form.cell(tensor, cell_idx)) {
                *to = number;
            }
            let Some(length) = to_unit_length(&mut row) else { continue };
            let x = middle(cell_idx % n_columns, n_columns, self.forms.size.width);
            let y = middle(cell_idx / n_columns, n_rows, self.forms.size.height);
            grid.keypoints.push(Keypoint::new(x, y, length));
            grid.rows.push_row(&row);
        }
        Some(grid)
    }

    /// The maps of XFeat; `None` where the network is another.
    pub fn xfeat(&self) -> Option<XFeatMaps<'_>> {
        let form = self.forms.xfeat.as_ref()?;
        Some(XFeatMaps {
            n_columns: form.n_columns,
            n_rows: form.n_rows,
            features: self.tensors.get(&form.features)?,
            keypoints: self.tensors.get(&form.keypoints)?,
            reliability: self.tensors.get(&form.reliability)?,
        })
    }
}

/// Scales `row` to length 1, and says how long it was; `None` for one that has no direction.
fn to_unit_length(row: &mut [f32]) -> Option<f32> {
    let length = row.iter().map(|number| number * number).sum::<f32>().sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    row.iter_mut().for_each(|number| *number /= length);
    Some(length)
}
