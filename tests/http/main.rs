//! The service as its callers see it, over real sockets.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod calls;
mod command;
mod kill;
mod load;
mod metrics;
mod models;
mod oip;
mod proxy;
mod refusal;
mod replay;
mod robot;
mod service;
mod stream;
mod stream_property;
mod trace;
