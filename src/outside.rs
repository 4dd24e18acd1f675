//! What others are told unasked: webhooks, a broker of MQTT, and other services over NATS. Each has a queue of its own, is never waited for, and so is
//! never in the way of a robot.
//!
//! | file | what |
//! |---|---|
//! | `webhooks` | what happens, by POST, signed and tried again |
//! | `mqtt` | where robots are, kept at a broker |
//! | `nats` | what services of a fleet tell each other |
//! | `topics` | under what, and how Home Assistant finds it |
//! | `patience` | pauses that grow |

mod mqtt;
mod nats;
mod patience;
mod topics;
mod webhooks;

use crate::engine::Engine;
pub use nats::tell as tell_fleet;

/// Tells others for as long as there is something to tell: for ever, or not at all.
pub async fn tell(engine: Engine) {
    tokio::join!(webhooks::tell(&engine), mqtt::tell(&engine));
}
