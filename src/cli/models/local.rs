//! Models in a repository, changed without a service.

use super::{Label, Target};
use crate::model::{LoadedModel, VerifiedFile, load_golden_frames, warm};
use crate::protocol::rest::{LabelJson, ModelInfo, VersionInfo, VersionState};
use crate::repository::package::copy;
use crate::repository::{Canary, Listing, Record, Repository, VersionId};
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
        load_and_try(staged.path())?;
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
        let LoadedModel { model, digest } = VerifiedFile::read(&self.0.fetch(id)?)?.load()?;
        Ok(VersionInfo {
            digest: Some(digest),
            rooms: Some(model.places().to_vec()),
            card: Some(serde_json::to_value(model.card())?),
            ..version_info(id.version, &self.0.record(&id.name)?)
        })
    }

    pub(super) fn activate(&self, id: &VersionId, epoch: Option<u64>) -> anyhow::Result<()> {
        load_and_try(&self.0.fetch(id)?)?;
        let record = self.record(&id.name, epoch)?;
        Ok(self.0.write_record(&id.name, &record.activated(id.version))?)
    }

    pub(super) fn rollback(&self, name: &str, epoch: Option<u64>) -> anyhow::Result<ModelInfo> {
        let record = self.record(name, epoch)?.rolled_back()?;
        if let Some(version) = record.stable {
            load_and_try(&self.0.fetch(&VersionId::new(name, version))?)?;
        }
        self.0.write_record(name, &record)?;
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

    pub(super) fn label(
        &self,
        (name, label): (&str, Label),
        given: Option<LabelJson>,
        epoch: Option<u64>,
    ) -> anyhow::Result<ModelInfo> {
        let record = self.record(name, epoch)?;
        if let Some(LabelJson { version, .. }) = given {
            load_and_try(&self.0.fetch(&VersionId::new(name, version))?)?;
        }
        let changed = match (label, given) {
            (Label::Canary, Some(LabelJson { version, share })) => {
                record.with_canary(Canary { version, share: share.unwrap_or_default() })?
            }
            (Label::Shadow, Some(LabelJson { version, .. })) => record.with_shadow(version)?,
            (Label::Canary, None) => record.without_canary(),
            (Label::Shadow, None) => record.without_shadow(),
        };
        self.0.write_record(name, &changed)?;
        self.model(name)
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
        let tried = self.folder(id).and_then(|folder| load_and_try(&folder));
        let VersionId { name: model, version } = id.clone();
        let golden_frames = *tried.as_ref().unwrap_or(&0);
        Verdict { model, version, golden_frames, failure: tried.err().map(|error| format!("{error:#}")) }
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

/// Loads the model in a folder and lets it answer its golden frames; returns how many there are.
fn load_and_try(folder: &Path) -> anyhow::Result<usize> {
    let LoadedModel { model, .. } = VerifiedFile::read(folder)?.load()?;
    let golden_frames = load_golden_frames(folder)?;
    warm(&model, &golden_frames).map_err(anyhow::Error::msg)?;
    Ok(golden_frames.len())
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
