//! Models in a repository, changed without a service.

use super::Target;
use crate::model::{LoadedModel, Model, TriedModel, try_model};
use crate::protocol::rest::{ModelInfo, VersionInfo, VersionState};
use crate::repository::package::copy;
use crate::repository::{Change, Listing, Record, Repository, VersionId};
use anyhow::{Context, bail, ensure};
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

/// A repository that is open.
pub struct Local(Repository);

/// Whether a version would serve.
#[derive(Serialize)]
pub struct Verdict {
    /// The model.
    pub model: String,
    /// The version.
    pub version: u64,
    /// The golden frames that it has.
    pub golden_frames: usize,
    /// Why it would not serve.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

impl Local {
    /// The repository at a location.
    pub fn open(location: &str, cache: &Path) -> anyhow::Result<Self> {
        Ok(Self(Repository::open(location, cache)?))
    }

    /// The same to add a version to it: a folder is made where there is none. One that is only read is refused.
    pub fn open_to_add(location: &str, cache: &Path) -> anyhow::Result<Self> {
        if !location.contains("://") {
            fs::create_dir_all(location).with_context(|| location.to_owned())?;
        }
        let local = Self::open(location, cache)?;
        local.0.stage()?.close()?;
        Ok(local)
    }

    /// Adds a version of this number, or of the next one, once it has been tried.
    pub fn push(&self, folder: &Path, name: &str, version: Option<u64>) -> anyhow::Result<VersionId> {
        let staged = self.0.stage()?;
        copy(folder, staged.path()).with_context(|| format!("{} holds no model", folder.display()))?;
        try_model(staged.path(), |_| ())?;
        let version = version.map_or_else(|| self.next_version(name), Ok)?;
        let id = VersionId::new(name, version);
        self.0.publish(&id, staged)?;
        Ok(id)
    }

    /// Where the files of a version are.
    pub fn folder(&self, id: &VersionId) -> anyhow::Result<PathBuf> {
        Ok(self.0.fetch(id)?)
    }

    pub(super) fn list(&self) -> anyhow::Result<Vec<ModelInfo>> {
        let scan = self.0.scan()?;
        scan.foreign.iter().for_each(|foreign| eprintln!("left alone: {foreign}"));
        Ok(scan.models.iter().map(|(name, listing)| model_info(name, listing)).collect())
    }

    pub(super) fn model(&self, name: &str) -> anyhow::Result<ModelInfo> {
        let scan = self.0.scan()?;
        let listing = scan.models.get(name).with_context(|| format!("there is no model {name}"))?;
        Ok(model_info(name, listing))
    }

    pub(super) fn version(&self, id: &VersionId) -> anyhow::Result<VersionInfo> {
        let LoadedModel { model, digest } = Model::load(&self.0.fetch(id)?)?;
        Ok(VersionInfo {
            digest: Some(digest),
            rooms: Some(model.places().to_vec()),
            card: Some(serde_json::to_value(model.card())?),
            ..version_info(id.version, &self.0.record(&id.name)?)
        })
    }

    /// Changes what serves, once what is to serve has been tried; returns the model as it is then.
    pub(super) fn change(&self, name: &str, change: Change, epoch: Option<u64>) -> anyhow::Result<ModelInfo> {
        let record = self.record(name, epoch)?;
        let changed = change.of(&record)?;
        if let Some(version) = change.wants(&changed) {
            self.try_version(&VersionId::new(name, version))?;
        }
        if changed != record {
            self.0.write_record(name, &changed)?;
        }
        self.model(name)
    }

    pub(super) fn delete(&self, id: &VersionId, epoch: Option<u64>) -> anyhow::Result<()> {
        let record = self.record(&id.name, epoch)?;
        let without = record.without(id.version)?;
        if without != record {
            self.0.write_record(&id.name, &without)?;
        }
        Ok(self.0.delete(id)?)
    }

    pub(super) fn verify(&self, target: Option<&Target>) -> anyhow::Result<Vec<Verdict>> {
        let mut verdicts = Vec::new();
        for (name, listing) in self.0.scan()?.models {
            for &version in listing.versions.keys() {
                let is_wanted = target.is_none_or(|target| {
                    target.name == name && target.version.is_none_or(|wanted| wanted == version)
                });
                if is_wanted {
                    verdicts.push(self.verdict(&VersionId::new(&name, version)));
                }
            }
        }
        ensure!(!verdicts.is_empty(), "there is no such version");
        Ok(verdicts)
    }

    fn verdict(&self, id: &VersionId) -> Verdict {
        let VersionId { name: model, version } = id.clone();
        let (golden_frames, failure) = match self.try_version(id) {
            Ok(TriedModel { n_golden_frames, .. }) => (n_golden_frames, None),
            Err(error) => (0, Some(format!("{error:#}"))),
        };
        Verdict { model, version, golden_frames, failure }
    }

    fn try_version(&self, id: &VersionId) -> anyhow::Result<TriedModel> {
        Ok(try_model(&self.0.fetch(id)?, |_| ())?)
    }

    /// One more than any that there was.
    fn next_version(&self, name: &str) -> anyhow::Result<u64> {
        let settled = self.0.record(name)?.settled;
        let scan = self.0.scan()?;
        let listed = scan.models.get(name).and_then(|listing| listing.versions.last_key_value());
        Ok(listed.map_or(0, |(version, _)| *version).max(settled) + 1)
    }

    fn record(&self, name: &str, epoch: Option<u64>) -> anyhow::Result<Record> {
        let record = self.0.record(name)?;
        if let Some(epoch) = epoch.filter(|epoch| *epoch != record.epoch) {
            bail!("the epoch of {name} is {}, not {epoch}: what serves was changed since", record.epoch);
        }
        Ok(record)
    }
}

fn model_info(name: &str, listing: &Listing) -> ModelInfo {
    let Listing { versions, record } = listing;
    ModelInfo {
        name: name.to_owned(),
        serving: record.stable,
        epoch: record.epoch,
        versions: versions.keys().rev().map(|&version| version_info(version, record)).collect(),
    }
}

fn version_info(version: u64, record: &Record) -> VersionInfo {
    let canary = record.canary.filter(|canary| canary.version == version);
    VersionInfo {
        version,
        state: VersionState::Discovered,
        labels: record.labels(version).into_iter().map(str::to_owned).collect(),
        failure: None,
        epoch: None,
        share: canary.map(|canary| canary.share),
        shadow: None,
        digest: None,
        rooms: None,
        card: None,
        history: Vec::new(),
    }
}
