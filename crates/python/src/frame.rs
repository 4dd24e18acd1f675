//! What a frame may be: encoded bytes, a path, pixels of NumPy, an image of Pillow.

use crate::FrameError;
use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use roomsight_recognition::model::Model;
use roomsight_vision::image::{Image, Limits};
use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::PathBuf;

/// A frame that needs no Python any more.
pub enum Frame {
    Encoded(PyBackedBytes),
    File(PathBuf),
    Pixels(Image),
}

impl Frame {
    /// Takes what Python gives.
    ///
    /// # Errors
    /// `TypeError` where it is nothing of that.
    pub fn of(given: &Bound<'_, PyAny>, wants_colors: bool) -> PyResult<Self> {
        if let Ok(bytes) = given.extract::<PyBackedBytes>() {
            return Ok(Self::Encoded(bytes));
        }
        if let Ok(array) = given.cast::<PyArrayDyn<u8>>() {
            return pixels(&array.readonly(), wants_colors).map(Self::Pixels);
        }
        if let Ok(path) = given.extract::<PathBuf>() {
            return Ok(Self::File(path));
        }
        if !given.hasattr("__array_interface__")? {
            let kind = given.get_type().name()?;
            let reason = format!("a frame is bytes, a path, a NumPy array or a Pillow image, not {kind}");
            return Err(PyTypeError::new_err(reason));
        }
        if let Ok(mode) = given.getattr("mode").and_then(|mode| mode.extract::<String>())
            && !["L", "RGB"].contains(&mode.as_str())
        {
            let reason =
                format!("a Pillow image is of mode L or RGB, not {mode}: give image.convert(\"RGB\")");
            return Err(PyTypeError::new_err(reason));
        }
        let array = given.py().import("numpy")?.call_method1("asarray", (given,))?;
        match array.cast::<PyArrayDyn<u8>>() {
            Ok(array) => pixels(&array.readonly(), wants_colors).map(Self::Pixels),
            Err(_) => {
                let kind = array.getattr("dtype")?;
                Err(PyTypeError::new_err(format!("pixels are of 8 bits, not of {kind}")))
            }
        }
    }

    /// The picture, as far as `model` looks at it.
    ///
    /// # Errors
    /// `FrameError` where it is none, `OSError` where its file cannot be read.
    pub fn decoded(self, model: &Model) -> PyResult<Image> {
        let limits = Limits::default();
        let decoded = match self {
            Self::Pixels(image) => return Ok(image),
            Self::Encoded(bytes) => model.decode(&bytes, &limits),
            Self::File(path) => {
                let mut bytes = Vec::new();
                // One byte more than is taken, so that a longer file is refused and not cut.
                File::open(path)?.take(limits.max_bytes as u64 + 1).read_to_end(&mut bytes)?;
                model.decode(&bytes, &limits)
            }
        };
        decoded.map_err(|error| FrameError::new_err(error.to_string()))
    }
}

/// A picture of pixels, height x width or height x width x 3 of red, green and blue. Where they lie row after row they are read in place.
fn pixels(array: &PyReadonlyArrayDyn<'_, u8>, wants_colors: bool) -> PyResult<Image> {
    let shape = array.shape().to_vec();
    let limits = Limits::default();
    let (height, width, n_channels) = match shape[..] {
        [height, width] => (height, width, 1),
        [height, width, 3] => (height, width, 3),
        _ => {
            let sides: Vec<String> = shape.iter().map(ToString::to_string).collect();
            let sides = sides.join(" x ");
            let reason = format!("pixels are height x width or height x width x 3, not {sides}");
            return Err(PyTypeError::new_err(reason));
        }
    };
    let is_too_large = width.max(height) as u64 > u64::from(limits.max_side)
        || (width as u64).saturating_mul(height as u64) > limits.max_pixels;
    if is_too_large {
        let reason = format!(
            "{width} x {height}; at most {} a side and {} pixels",
            limits.max_side, limits.max_pixels
        );
        return Err(FrameError::new_err(reason));
    }
    let view = array.as_array();
    // Those that lie in another order are put in order first.
    let samples = view.as_slice().map_or_else(|| view.iter().copied().collect(), Cow::Borrowed);
    let image = match n_channels {
        1 => Image::from_pixels(width, height, samples.into_owned()),
        _ => Image::from_rgb(width, height, &samples, wants_colors),
    };
    image.ok_or_else(|| FrameError::new_err("it has no pixels"))
}
