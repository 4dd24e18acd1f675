//! The arrays of a model file: written as safetensors, read back with every type and shape checked.

use super::format::FormatError;
use crate::image::Image;
use crate::matrix::Matrix;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::collections::HashMap;

/// A named array, as it is written.
pub(super) struct Array {
    name: &'static str,
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl Array {
    pub(super) fn matrix(name: &'static str, matrix: &Matrix) -> Self {
        let bytes = matrix.as_slice().iter().flat_map(|value| value.to_le_bytes()).collect();
        Self { name, dtype: Dtype::F32, shape: vec![matrix.n_rows(), matrix.n_cols()], bytes }
    }

    pub(super) fn vector(name: &'static str, values: &[f32]) -> Self {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        Self { name, dtype: Dtype::F32, shape: vec![values.len()], bytes }
    }

    pub(super) fn doubles(name: &'static str, values: &[f64]) -> Self {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        Self { name, dtype: Dtype::F64, shape: vec![values.len()], bytes }
    }

    /// Numbers that fit 32 bits.
    pub(super) fn counts(name: &'static str, counts: impl ExactSizeIterator<Item = usize>) -> Self {
        let shape = vec![counts.len()];
        let bytes = counts.flat_map(|count| (count as u32).to_le_bytes()).collect();
        Self { name, dtype: Dtype::U32, shape, bytes }
    }

    pub(super) fn picture(name: &'static str, picture: &Image) -> Self {
        let shape = vec![picture.height(), picture.width()];
        Self { name, dtype: Dtype::U8, shape, bytes: picture.pixels().to_vec() }
    }
}

/// A safetensors file of these arrays and one text.
pub(super) fn serialize(arrays: &[Array], metadata: (&str, String)) -> Result<Vec<u8>, FormatError> {
    let damaged = |error: safetensors::SafeTensorError| FormatError::Damaged(error.to_string());
    let mut views = Vec::with_capacity(arrays.len());
    for array in arrays {
        let view = TensorView::new(array.dtype, array.shape.clone(), &array.bytes).map_err(damaged)?;
        views.push((array.name, view));
    }
    let metadata = HashMap::from([(metadata.0.to_owned(), metadata.1)]);
    safetensors::serialize(views, Some(metadata)).map_err(damaged)
}

pub(super) fn read_matrix(file: &SafeTensors, name: &str) -> Result<Matrix, FormatError> {
    let (shape, bytes) = read(file, name, (Dtype::F32, 2))?;
    Matrix::from_vec(floats(bytes), shape[1])
        .ok_or_else(|| FormatError::Damaged(format!("{name} has no columns")))
}

pub(super) fn read_vector(file: &SafeTensors, name: &str) -> Result<Vec<f32>, FormatError> {
    Ok(floats(read(file, name, (Dtype::F32, 1))?.1))
}

pub(super) fn read_doubles(file: &SafeTensors, name: &str) -> Result<Vec<f64>, FormatError> {
    let bytes = read(file, name, (Dtype::F64, 1))?.1;
    Ok(bytes.as_chunks().0.iter().map(|&value| f64::from_le_bytes(value)).collect())
}

pub(super) fn read_counts(file: &SafeTensors, name: &str) -> Result<Vec<usize>, FormatError> {
    let bytes = read(file, name, (Dtype::U32, 1))?.1;
    Ok(bytes.as_chunks().0.iter().map(|&count| u32::from_le_bytes(count) as usize).collect())
}

/// Empty when there is no such array.
pub(super) fn read_counts_if_any(file: &SafeTensors, name: &str) -> Result<Vec<usize>, FormatError> {
    if is_there(file, name) { read_counts(file, name) } else { Ok(Vec::new()) }
}

/// `None` when there is no such array.
pub(super) fn read_picture(file: &SafeTensors, name: &str) -> Result<Option<Image>, FormatError> {
    if !is_there(file, name) {
        return Ok(None);
    }
    let (shape, pixels) = read(file, name, (Dtype::U8, 2))?;
    let picture = Image::from_pixels(shape[1], shape[0], pixels.to_vec());
    picture.map(Some).ok_or_else(|| FormatError::Damaged(format!("{name} is empty")))
}

pub(super) fn is_there(file: &SafeTensors, name: &str) -> bool {
    file.tensor(name).is_ok()
}

pub(super) fn require(condition: bool, otherwise: &str) -> Result<(), FormatError> {
    if condition { Ok(()) } else { Err(FormatError::Damaged(otherwise.to_owned())) }
}

/// Shape and little-endian bytes of an array of this type and number of dimensions.
fn read<'a>(
    file: &SafeTensors<'a>,
    name: &str,
    (dtype, n_dimensions): (Dtype, usize),
) -> Result<(Vec<usize>, &'a [u8]), FormatError> {
    let tensor =
        file.tensor(name).map_err(|_| FormatError::Damaged(format!("the array {name} is missing")))?;
    if tensor.dtype() != dtype || tensor.shape().len() != n_dimensions {
        return Err(FormatError::Damaged(format!("the array {name} has another type or shape")));
    }
    Ok((tensor.shape().to_vec(), tensor.data()))
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|&value| f32::from_le_bytes(value)).collect()
}
