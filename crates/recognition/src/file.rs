//! What models are kept in: files, the arrays in them, the networks beside them.
//!
//! | file | what |
//! |---|---|
//! | `disk` | reading within limits, writing anew |
//! | `arrays` | arrays as safetensors, read back with every type and shape checked |
//! | `error` | why bytes are no model |
//! | `names` | names of opinions that files of version 1 imply |
//! | `networks` | networks that a model looks through |

pub(crate) mod arrays;
pub(crate) mod disk;
pub(crate) mod error;
pub(crate) mod names;
pub(crate) mod networks;
