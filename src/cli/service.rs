//! How commands call a service.

use anyhow::Context;
use clap::Args;
use roomsight_client::Client;
use roomsight_protocol::header::Odometry;
use roomsight_protocol::scan::LaserScan;
use roomsight_recognition::model::{Pose, Scan};
use std::fs;
use std::path::PathBuf;

/// The address of a service where none is given.
pub(super) const DEFAULT_URL: &str = "http://127.0.0.1:8080";

/// What a service asks of its callers.
#[derive(Args)]
pub(super) struct ServiceArgs {
    /// A key of the service, where it asks for one
    #[arg(long, global = true, value_name = "KEY", env = "ROOMSIGHT_KEY", hide_env_values = true)]
    key: Option<String>,
    /// The authority of the service's certificate, a file of PEM [default: those that the system believes]
    #[arg(long, global = true, value_name = "FILE", env = "ROOMSIGHT_CA")]
    ca: Option<PathBuf>,
}

impl ServiceArgs {
    /// A client of the service at an address.
    pub(super) fn client(&self, url: &str) -> anyhow::Result<Client> {
        let key = self.key.as_deref();
        let Some(path) = &self.ca else { return Ok(Client::new(url, key)?) };
        let authorities = fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
        Ok(Client::believing(url, key, &authorities)?)
    }
}

/// A scan as it is sent.
pub(super) fn sent_scan(scan: &Scan) -> LaserScan {
    let ranges = scan.ranges().iter().map(|range| Some(*range).filter(|range| range.is_finite()));
    LaserScan {
        angle_min: scan.start(),
        angle_increment: scan.step(),
        range_max: scan.max_range(),
        ranges: ranges.collect(),
    }
}

/// Odometry as it is sent.
pub(super) fn sent_odometry(Pose { x, y, angle }: Pose) -> Odometry {
    Odometry { x, y, heading: angle }
}
