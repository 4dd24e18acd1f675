//! The service and the command of roomsight.
//!
//! | module | what |
//! |---|---|
//! | [`problem`] | every error that a caller can see |
//! | [`access`] | who may call: keys, and pages of other sites |
//! | [`settings`] | what an operator may set |
//! | [`repository`] | which versions of which models there are, on a disk or in a bucket |
//! | [`engine`] | what answers frames; it knows no HTTP |
//! | [`teaching`] | what people teach the service: data sets, the inbox, trainings |
//! | [`outside`] | what others are told unasked: webhooks, MQTT |
//! | [`http`] | the HTTP service |
//! | [`cli`] | the commands |
//!
//! Each uses those before it. What recognizes is in `roomsight-recognition`, what travels in `roomsight-protocol`.

#![allow(missing_docs, reason = "other programs use the crates below; here names say it, and comments why")]

pub mod problem;

pub mod access;
pub mod settings;

pub mod repository;

pub mod engine;

pub mod outside;
pub mod teaching;

pub mod http;

pub mod cli;
