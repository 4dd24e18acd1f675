//! What is set by what works beside frames: the inbox, trainings, and those who tell others.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// What is so now, as it was last set.
#[derive(Default)]
pub struct Beside {
    inbox_frames: AtomicU64,
    inbox_bytes: AtomicU64,
    is_training: AtomicBool,
    is_broker_connected: AtomicBool,
    is_fleet_connected: AtomicBool,
}

impl Beside {
    /// So many doubted frames wait for a label, with so many bytes.
    pub fn inbox(&self, n_frames: u64, n_bytes: u64) {
        self.inbox_frames.store(n_frames, Ordering::Relaxed);
        self.inbox_bytes.store(n_bytes, Ordering::Relaxed);
    }

    /// Whether a training runs.
    pub fn training(&self, runs: bool) {
        self.is_training.store(runs, Ordering::Relaxed);
    }

    /// Whether the broker of MQTT is connected.
    pub fn broker(&self, is_connected: bool) {
        self.is_broker_connected.store(is_connected, Ordering::Relaxed);
    }

    /// Whether other services are connected, over NATS.
    pub fn fleet(&self, is_connected: bool) {
        self.is_fleet_connected.store(is_connected, Ordering::Relaxed);
    }

    /// The same, as it was last set.
    pub fn is_fleet_connected(&self) -> bool {
        self.is_fleet_connected.load(Ordering::Relaxed)
    }

    /// Frames that wait for a label.
    pub fn inbox_frames(&self) -> u64 {
        self.inbox_frames.load(Ordering::Relaxed)
    }

    /// Their bytes.
    pub fn inbox_bytes(&self) -> u64 {
        self.inbox_bytes.load(Ordering::Relaxed)
    }

    /// Whether a training runs.
    pub fn is_training(&self) -> bool {
        self.is_training.load(Ordering::Relaxed)
    }

    /// Whether the broker of MQTT is connected.
    pub fn is_broker_connected(&self) -> bool {
        self.is_broker_connected.load(Ordering::Relaxed)
    }
}
