//! The tensors that lie in an ONNX file: weights and constants.

use super::refusal::{MAX_RANK, Problem, refused};
use super::wire::{Value, fields};

/// TensorProto.
pub(super) struct Weights<'a> {
    pub name: &'a str,
    pub dims: Vec<usize>,
    kind: u64,
    /// The numbers, in little endian; empty where they are written one by one.
    raw: &'a [u8],
    /// 32-bit floats that are written in blocks.
    floats: Vec<&'a [u8]>,
}

impl<'a> Weights<'a> {
    /// The sizes that they claim to have are held against their bytes.
    pub fn read(tensor: &'a [u8]) -> Result<Self, Problem> {
        let mut read = Self { name: "", dims: Vec::new(), kind: 0, raw: &[], floats: Vec::new() };
        let mut is_too_deep = false;
        for field in fields(tensor) {
            let field = field?;
            match field.number {
                1 => field.varints(&mut |dim| match read.dims.len() < MAX_RANK {
                    true => read.dims.push(usize::try_from(dim).unwrap_or(usize::MAX)),
                    false => is_too_deep = true,
                })?,
                2 => read.kind = field.varint()?,
                4 => read.add_floats(field.value)?,
                8 => read.name = field.text()?,
                9 => read.raw = field.bytes()?,
                13 | 14 if !matches!(field.value, Value::Varint(0)) => {
                    return refused("keeps weights in other files: save it as one file");
                }
                _ => {}
            }
        }
        let name = read.name;
        if is_too_deep {
            return refused(format!("has weights of more than {MAX_RANK} dimensions, {name:?}"));
        }
        let Some(size) = element_bytes(read.kind) else {
            return refused(format!("has weights of a type that no network of pictures needs, {name:?}"));
        };
        let n_elements = read.dims.iter().try_fold(1_usize, |n, &dim| n.checked_mul(dim));
        let n_bytes = n_elements.and_then(|n| n.checked_mul(size));
        let is_whole = match (n_elements, n_bytes) {
            (Some(_), Some(n_bytes)) if !read.raw.is_empty() => n_bytes == read.raw.len(),
            // Each takes a byte at least; ONNX Runtime counts them.
            (Some(n_elements), Some(_)) => n_elements <= tensor.len(),
            _ => false,
        };
        match is_whole {
            true => Ok(read),
            false => refused(format!("has weights of other sizes than it says, {name:?}")),
        }
    }

    fn add_floats(&mut self, value: Value<'a>) -> Result<(), Problem> {
        match value {
            Value::Bytes(block) => self.floats.push(block),
            // One by one: nobody writes them so, and each would take a place in a list.
            _ => {
                return refused(
                    "has weights that are written one by one: save it again with the package onnx",
                );
            }
        }
        match self.floats.len() > MAX_RANK {
            true => refused("has weights in more pieces than anybody writes"),
            false => Ok(()),
        }
    }

    pub fn check_finite(&self) -> Result<(), Problem> {
        let is_finite = match self.kind {
            1 => self.floats.iter().chain([&self.raw]).all(|block| {
                block.as_chunks::<4>().0.iter().all(|&number| f32::from_le_bytes(number).is_finite())
            }),
            10 => halves_are_finite(self.raw, 0x7c00),
            16 => halves_are_finite(self.raw, 0x7f80),
            11 => self.raw.as_chunks::<8>().0.iter().all(|&number| f64::from_le_bytes(number).is_finite()),
            _ => true,
        };
        match is_finite {
            true => Ok(()),
            false => refused(format!("has weights that are not numbers or infinite, {:?}", self.name)),
        }
    }
}

/// Whether no number of 16 bits has all bits of its exponent set.
fn halves_are_finite(raw: &[u8], exponent: u16) -> bool {
    raw.as_chunks::<2>().0.iter().all(|&half| u16::from_le_bytes(half) & exponent != exponent)
}

/// Of TensorProto.DataType: floats, whole numbers, truth values. `None` for texts and rarer ones.
fn element_bytes(kind: u64) -> Option<usize> {
    match kind {
        2 | 3 | 9 => Some(1),
        4 | 5 | 10 | 16 => Some(2),
        1 | 6 | 12 => Some(4),
        7 | 11 | 13 => Some(8),
        _ => None,
    }
}
