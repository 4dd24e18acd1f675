//! What travels between robots, dashboards and the service, on either side.
//!
//! | module | what |
//! |---|---|
//! | [`rest`] | the JSON of the calls |
//! | [`stream`] | the messages of a stream, `roomsight.v1` over a WebSocket |
//! | [`header`] | the optional header of a streamed frame |
//! | [`event`] | what dashboards are told of robots and of what happens |
//! | [`service`] | what they are told of the service itself |
//! | [`map`] | how the rooms of a model lie |
//! | [`oip`] | the Open Inference Protocol |
//! | [`base64_text`] | frames in JSON, as people's libraries write them |
//! | [`version_id`] | how models and versions are called |
//! | [`object`] | JSON objects that are nothing else |

pub mod base64_text;
pub mod event;
pub mod header;
pub mod map;
pub mod object;
pub mod oip;
pub mod rest;
pub mod service;
pub mod stream;
pub mod version_id;
