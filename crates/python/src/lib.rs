//! The core within a Python process: `roomsight._core`, which `clients/python/src/roomsight/core.py` wraps in the client's types.

mod filter;
mod frame;
mod recognizer;

use mimalloc::MiMalloc;
use pyo3::create_exception;
use pyo3::exceptions::PyException;

// The same as the service's, so that a frame costs the same.
#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

create_exception!(roomsight, ModelError, PyException, "A folder holds no model that can be loaded.");
create_exception!(roomsight, FrameError, PyException, "A frame is no picture, or one beyond the limits.");

/// What `roomsight.core` wraps.
#[pyo3::pymodule]
mod _core {
    #[pymodule_export]
    use super::filter::Filter;
    #[pymodule_export]
    use super::recognizer::Recognizer;
    #[pymodule_export]
    use super::{FrameError, ModelError};
}
