//! The service as its callers see it, over real sockets.

mod access;
mod calls;
mod command;
mod default_model;
mod fair;
mod kill;
mod live;
mod load;
mod metrics;
mod misread;
mod models;
mod oip;
mod operate;
mod proxy;
mod replay;
mod robot;
mod service;
mod stream;
mod stream_pressure;
mod stream_property;
mod stream_resume;
mod teaching;
mod tls;
mod trace;
mod upload;
