//! The service and the commands, as their users see them; the documents that are made of the code.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod architecture;
mod circles;
mod cli;
mod experiment;
mod fuzzing;
mod http;
mod openapi;
