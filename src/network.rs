//! Neural networks as a source of features.

mod input;
mod xfeat;

pub use input::{Around, FrameInput};
pub use xfeat::XFeat;

/// Columns and rows of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// How a picture becomes the network's input: `1 x 3 x height x width` floats, `(value - mean) * scale`.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Taken from each value of a pixel, which is 0 to 255: red, green, blue, whatever the order.
    pub mean: [f32; 3],
    /// What is left is multiplied by this: red, green, blue, whatever the order.
    pub scale: [f32; 3],
    /// Which color comes first.
    pub order: ColorOrder,
}

/// The order of the three planes of an input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorOrder {
    /// Red, green, blue.
    #[default]
    Rgb,
    /// Blue, green, red.
    Bgr,
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
