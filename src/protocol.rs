//! What travels between robots, dashboards and the service, on either side.
//!
//! | module | what |
//! |---|---|
//! | [`rest`] | the JSON of the calls |
//! | [`stream`] | the messages of a stream, `roomsight.v1` over a WebSocket |
//! | [`header`] | the optional header of a streamed frame |
//! | [`event`] | what dashboards are told |
//! | [`oip`] | the Open Inference Protocol |

pub mod event;
pub mod header;
pub mod oip;
pub mod rest;
pub mod stream;
