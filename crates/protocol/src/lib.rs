//! What travels between robots, dashboards and the service, on either side.
//!
//! | module | what |
//! |---|---|
//! | [`rest`] | the JSON of the calls |
//! | [`stream`] | the messages of a stream, `roomsight.v1` over a WebSocket |
//! | [`header`] | the optional header of a streamed frame |
//! | [`scan`] | what a laser measured beside a frame |
//! | [`sets`] | data sets that the service keeps |
//! | [`inbox`] | frames that the model doubted, and what people say of them |
//! | [`training`] | trainings that the service runs |
//! | [`audit`] | who changed what |
//! | [`recording`] | recordings of what robots send |
//! | [`event`] | what dashboards are told of robots and of what happens |
//! | [`fleet`] | what services tell each other |
//! | [`service`] | what they are told of the service itself |
//! | [`map`] | how the rooms of a model lie |
//! | [`oip`] | the Open Inference Protocol |
//! | [`base64_text`] | frames in JSON, as people's libraries write them |
//! | [`version_id`] | how models and versions are called |
//! | [`object`] | JSON objects that are nothing else |

pub mod audit;
pub mod base64_text;
pub mod event;
pub mod fleet;
pub mod header;
pub mod inbox;
pub mod map;
pub mod object;
pub mod oip;
pub mod recording;
pub mod rest;
pub mod scan;
pub mod service;
pub mod sets;
pub mod stream;
pub mod training;
pub mod version_id;
