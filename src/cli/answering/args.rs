//! What is to answer the pictures of a camera.

use super::{Answering, LoadedModel};
use crate::cli::service::{DEFAULT_URL, ServiceArgs};
use anyhow::Context;
use clap::Args;
use roomsight_client::Client;
use roomsight_recognition::filter::Trust;
use std::path::PathBuf;
use std::time::Duration;

/// A model in this process, or a service.
#[derive(Args)]
pub(in crate::cli) struct AnsweringArgs {
    /// Recognize in this process, with the model in this folder [default: a service does]
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["url", "robot"])]
    model: Option<PathBuf>,
    /// The service
    #[arg(long, default_value = DEFAULT_URL)]
    url: String,
    #[command(flatten)]
    service: ServiceArgs,
    /// For how long a camera or a service may be out of reach
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..))]
    patience: u64,
}

/// What answers, of which every camera has its own part.
pub(in crate::cli) enum Answerer {
    Model(LoadedModel),
    Service { client: Client, url: String, patience: Duration },
}

impl AnsweringArgs {
    pub(in crate::cli) fn patience(&self) -> Duration {
        Duration::from_secs(self.patience)
    }

    /// # Errors
    /// A folder without a model, an address that is none.
    pub(in crate::cli) fn answerer(&self) -> anyhow::Result<Answerer> {
        Ok(match &self.model {
            Some(folder) => Answerer::Model(LoadedModel::load(folder)?),
            None => {
                let (client, url) = (self.service.client(&self.url)?, self.url.clone());
                Answerer::Service { client, url, patience: self.patience() }
            }
        })
    }
}

impl Answerer {
    /// Whether it is known to look at the scans of lasers.
    #[cfg(feature = "ros")]
    pub(in crate::cli) fn wants_scans(&self) -> bool {
        matches!(self, Self::Model(loaded) if loaded.model.wants_scans())
    }

    /// For one camera, which a service calls so; single pictures are trusted so far, or as by default.
    ///
    /// # Errors
    /// A service that cannot be reached.
    pub(in crate::cli) async fn for_camera(
        &self,
        robot: &str,
        trust: Option<Trust>,
    ) -> anyhow::Result<Answering> {
        match self {
            Self::Model(loaded) => Ok(Answering::by_model(loaded.clone(), trust)),
            Self::Service { client, url, patience } => {
                let opened = Answering::by_service(client, robot, trust, *patience).await;
                opened.with_context(|| format!("cannot stream to {url}"))
            }
        }
    }
}
