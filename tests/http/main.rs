//! The service as its callers see it, over real sockets.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod access;
mod calls;
mod command;
mod kill;
mod load;
mod metrics;
mod models;
mod oip;
mod operate;
mod replay;
mod robot;
mod service;
mod stream;
mod stream_property;
mod tls;
mod trace;
