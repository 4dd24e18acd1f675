//! Tests against recordings that other libraries wrote.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod recordings;
