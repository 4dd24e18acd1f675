//! The real labels of COLD, and what names results that are kept.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod cold_labels;
mod recordings;
mod sources;
