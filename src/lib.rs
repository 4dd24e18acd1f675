//! The service and the command of roomsight.

pub mod repository;

pub mod server;

pub mod cli;
