//! The arrays of a model file: written as safetensors, read back with every type and shape checked.

use crate::file::error::FormatError;
use crate::file::names::PATTERNS;
use roomsight_vision::image::Image;
use roomsight_vision::matrix::Matrix;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::collections::HashMap;

/// A named array, as it is written.
pub(crate) struct Array {
    name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl Array {
    pub(crate) fn matrix(name: &str, matrix: &Matrix) -> Self {
        let bytes = matrix.as_slice().iter().flat_map(|value| value.to_le_bytes()).collect();
        Self::new(name, Dtype::F32, vec![matrix.n_rows(), matrix.n_cols()], bytes)
    }

    pub(crate) fn vector(name: &str, values: &[f32]) -> Self {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        Self::new(name, Dtype::F32, vec![values.len()], bytes)
    }

    pub(crate) fn doubles(name: &str, values: &[f64]) -> Self {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        Self::new(name, Dtype::F64, vec![values.len()], bytes)
    }

    pub(crate) fn longs(name: &str, numbers: impl ExactSizeIterator<Item = u64>) -> Self {
        let shape = vec![numbers.len()];
        Self::new(name, Dtype::U64, shape, numbers.flat_map(u64::to_le_bytes).collect())
    }

    /// Numbers that fit 32 bits.
    pub(crate) fn counts(name: &str, counts: impl ExactSizeIterator<Item = usize>) -> Self {
        let shape = vec![counts.len()];
        let bytes = counts.flat_map(|count| (count as u32).to_le_bytes()).collect();
        Self::new(name, Dtype::U32, shape, bytes)
    }

    pub(crate) fn picture(name: &str, picture: &Image) -> Self {
        let shape = vec![picture.height(), picture.width()];
        Self::new(name, Dtype::U8, shape, picture.pixels().to_vec())
    }

    /// A matrix of small whole numbers.
    pub(crate) fn bytes(name: &str, shape: [usize; 2], values: &[i8]) -> Self {
        Self::new(name, Dtype::I8, shape.to_vec(), values.iter().map(|&value| value as u8).collect())
    }

    /// Text, as the bytes of its characters.
    pub(crate) fn text(name: &str, text: &str) -> Self {
        Self::new(name, Dtype::U8, vec![text.len()], text.as_bytes().to_vec())
    }

    fn new(name: &str, dtype: Dtype, shape: Vec<usize>, bytes: Vec<u8>) -> Self {
        Self { name: name.to_owned(), dtype, shape, bytes }
    }

    /// The same as one of an opinion's.
    pub(crate) fn of_opinion(mut self, opinion: &str) -> Self {
        self.name.insert(0, SEPARATOR);
        self.name.insert_str(0, opinion);
        self
    }
}

/// Between the name of an opinion and that of its array.
const SEPARATOR: char = '/';

/// A safetensors file of these arrays and one text.
pub(crate) fn serialize(arrays: &[Array], metadata: (&str, String)) -> Result<Vec<u8>, FormatError> {
    let damaged = |error: safetensors::SafeTensorError| FormatError::Damaged(error.to_string());
    let mut views = Vec::with_capacity(arrays.len());
    for array in arrays {
        let view = TensorView::new(array.dtype, array.shape.clone(), &array.bytes).map_err(damaged)?;
        views.push((array.name.as_str(), view));
    }
    let metadata = HashMap::from([(metadata.0.to_owned(), metadata.1)]);
    safetensors::serialize(views, Some(metadata)).map_err(damaged)
}

/// The arrays of a file, or of one opinion in it.
#[derive(Clone, Copy)]
pub(crate) struct Arrays<'a> {
    file: &'a SafeTensors<'a>,
    names: Names<'a>,
}

/// What arrays are called in the file.
#[derive(Clone, Copy)]
enum Names<'a> {
    /// As they are called.
    Plain,
    /// With the name of their opinion before.
    OfOpinion(&'a str),
    /// In files of format version 1, those of what was called the cue.
    OfCue,
}

impl<'a> Arrays<'a> {
    pub(crate) fn new(file: &'a SafeTensors<'a>) -> Self {
        Self { file, names: Names::Plain }
    }

    /// Those of an opinion.
    pub(crate) fn of_opinion(self, opinion: &'a str) -> Self {
        Self { names: Names::OfOpinion(opinion), ..self }
    }

    /// Those of an opinion in a file of format version 1, which had one on local features and a cue.
    pub(crate) fn of_first_version(self, opinion: &str) -> Self {
        let names = if opinion == PATTERNS { Names::OfCue } else { Names::Plain };
        Self { names, ..self }
    }

    fn name(&self, name: &str) -> String {
        match self.names {
            Names::Plain => name.to_owned(),
            Names::OfOpinion(opinion) => format!("{opinion}{SEPARATOR}{name}"),
            Names::OfCue => format!("cue.{}", name.rsplit('.').next().unwrap_or(name)),
        }
    }

    pub(crate) fn matrix(&self, name: &str) -> Result<Matrix, FormatError> {
        let (shape, bytes) = self.read(name, Dtype::F32, 2)?;
        Matrix::from_vec(floats(bytes), shape[1])
            .ok_or_else(|| FormatError::Damaged(format!("{} has no columns", self.name(name))))
    }

    pub(crate) fn vector(&self, name: &str) -> Result<Vec<f32>, FormatError> {
        Ok(floats(self.read(name, Dtype::F32, 1)?.1))
    }

    pub(crate) fn doubles(&self, name: &str) -> Result<Vec<f64>, FormatError> {
        let bytes = self.read(name, Dtype::F64, 1)?.1;
        Ok(bytes.as_chunks().0.iter().map(|&value| f64::from_le_bytes(value)).collect())
    }

    pub(crate) fn longs(&self, name: &str) -> Result<Vec<u64>, FormatError> {
        let bytes = self.read(name, Dtype::U64, 1)?.1;
        Ok(bytes.as_chunks().0.iter().map(|&number| u64::from_le_bytes(number)).collect())
    }

    pub(crate) fn counts(&self, name: &str) -> Result<Vec<usize>, FormatError> {
        Ok(self.numbers(name)?.into_iter().map(|count| count as usize).collect())
    }

    /// Numbers of 32 bits.
    pub(crate) fn numbers(&self, name: &str) -> Result<Vec<u32>, FormatError> {
        let bytes = self.read(name, Dtype::U32, 1)?.1;
        Ok(bytes.as_chunks().0.iter().map(|&number| u32::from_le_bytes(number)).collect())
    }

    /// Empty when there is no such array.
    pub(crate) fn counts_if_any(&self, name: &str) -> Result<Vec<usize>, FormatError> {
        if self.has(name) { self.counts(name) } else { Ok(Vec::new()) }
    }

    /// A matrix of small whole numbers: its shape and its rows.
    pub(crate) fn bytes(&self, name: &str) -> Result<([usize; 2], Vec<i8>), FormatError> {
        let (shape, bytes) = self.read(name, Dtype::I8, 2)?;
        Ok(([shape[0], shape[1]], bytes.iter().map(|&value| value as i8).collect()))
    }

    pub(crate) fn text(&self, name: &str) -> Result<&'a str, FormatError> {
        let bytes = self.read(name, Dtype::U8, 1)?.1;
        str::from_utf8(bytes).map_err(|_| FormatError::Damaged(format!("{} is no text", self.name(name))))
    }

    /// `None` when there is no such array.
    pub(crate) fn picture(&self, name: &str) -> Result<Option<Image>, FormatError> {
        if !self.has(name) {
            return Ok(None);
        }
        let (shape, pixels) = self.read(name, Dtype::U8, 2)?;
        let picture = Image::from_pixels(shape[1], shape[0], pixels.to_vec());
        picture.map(Some).ok_or_else(|| FormatError::Damaged(format!("{} is empty", self.name(name))))
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.file.tensor(&self.name(name)).is_ok()
    }

    /// Shape and little-endian bytes of an array of this type and number of dimensions.
    fn read(
        &self,
        name: &str,
        dtype: Dtype,
        n_dimensions: usize,
    ) -> Result<(Vec<usize>, &'a [u8]), FormatError> {
        let name = self.name(name);
        let tensor = self
            .file
            .tensor(&name)
            .map_err(|_| FormatError::Damaged(format!("the array {name} is missing")))?;
        if tensor.dtype() != dtype || tensor.shape().len() != n_dimensions {
            return Err(FormatError::Damaged(format!("the array {name} has another type or shape")));
        }
        Ok((tensor.shape().to_vec(), tensor.data()))
    }
}

pub(crate) fn require(condition: bool, otherwise: &str) -> Result<(), FormatError> {
    if condition { Ok(()) } else { Err(FormatError::Damaged(otherwise.to_owned())) }
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|&value| f32::from_le_bytes(value)).collect()
}
