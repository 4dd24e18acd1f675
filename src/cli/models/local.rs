//! Models in a repository, changed without a service.

use super::Target;
use crate::cli::manners::note;
use crate::engine::registry::network_infos;
use crate::repository::package::{PackageLimits, copy, unpack};
use crate::repository::{Change, DefaultModel, Listing, Repository, RepositoryError, Scan, ServingRecord};
use anyhow::{Context, bail, ensure};
use roomsight_protocol::rest::{ModelInfo, VersionInfo, VersionState};
use roomsight_protocol::version_id::VersionId;
use roomsight_recognition::model::{LoadedModel, Model, NetworkEntry, NetworkStore, TriedModel, try_model};
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
    /// The networks that it uses.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub networks: Vec<NetworkEntry>,
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

    /// Adds a version of this number, or of the next one, once it has been tried: the model's folder, or an archive
    /// of it.
    pub fn push(&self, model: &Path, name: &str, version: Option<u64>) -> anyhow::Result<VersionId> {
        let staged = self.0.stage()?;
        if model.is_file() {
            unpack(model, staged.path(), &PackageLimits::default())
                .with_context(|| model.display().to_string())?;
        } else {
            copy(model, staged.path()).with_context(|| format!("{} holds no model", model.display()))?;
        }
        self.0.complete(staged.path())?;
        try_model(staged.path(), &NetworkStore::default(), |_| ())?;
        let before = self.0.scan()?;
        let id = match version {
            Some(version) => VersionId::new(name, version),
            None => self.next_version(&before, name)?,
        };
        self.0.publish(&id, staged)?;
        if let Err(error) = self.settle_default(&before, name) {
            // The version is there nevertheless.
            eprintln!("which model is the default is not written down: {error:#}");
        }
        Ok(id)
    }

    /// Keeps the default model what it was before a model of this name was added: where nobody has said it, the
    /// first by name of those that were there.
    fn settle_default(&self, before: &Scan, name: &str) -> anyhow::Result<()> {
        if before.default.is_some() {
            return Ok(());
        }
        let first = before.models.keys().next().map_or(name, String::as_str);
        match self.0.write_default(&DefaultModel::after(None, first)) {
            // Somebody else has said it meanwhile.
            Err(RepositoryError::DefaultOvertaken(_)) => Ok(()),
            written => Ok(written?),
        }
    }

    pub(super) fn set_default(&self, name: &str) -> anyhow::Result<ModelInfo> {
        self.model(name)?;
        let current = self.0.default_model()?;
        if current.as_ref().is_none_or(|current| current.model != name) {
            self.0.write_default(&DefaultModel::after(current.as_ref(), name))?;
        }
        self.model(name)
    }

    /// The model of requests that name none, where that was said.
    pub fn default_name(&self) -> anyhow::Result<Option<String>> {
        Ok(self.0.default_model()?.map(|default| default.model))
    }

    /// The version of a model that serves, or would as the latest; none where there is none.
    pub fn serving(&self, name: &str) -> anyhow::Result<Option<VersionId>> {
        let scan = self.0.scan()?;
        let serving = scan.models.get(name).and_then(|Listing { versions, record }| {
            record
                .stable
                .filter(|stable| versions.contains_key(stable))
                .or(versions.keys().next_back().copied())
        });
        Ok(serving.map(|version| VersionId::new(name, version)))
    }

    /// Where the files of a version are.
    pub fn folder(&self, id: &VersionId) -> anyhow::Result<PathBuf> {
        Ok(self.0.fetch(id)?)
    }

    pub(super) fn list(&self) -> anyhow::Result<Vec<ModelInfo>> {
        let scan = self.0.scan()?;
        scan.foreign.iter().for_each(|foreign| note!("left alone: {foreign}"));
        Ok(scan.models.keys().filter_map(|name| model_info(name, &scan)).collect())
    }

    pub(super) fn model(&self, name: &str) -> anyhow::Result<ModelInfo> {
        model_info(name, &self.0.scan()?).with_context(|| format!("there is no model {name}"))
    }

    pub(super) fn version(&self, id: &VersionId) -> anyhow::Result<VersionInfo> {
        let LoadedModel { model, digest } = Model::load(&self.0.fetch(id)?)?;
        Ok(VersionInfo {
            digest: Some(digest),
            rooms: Some(model.rooms().to_vec()),
            networks: network_infos(&model),
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
        match self.try_version(id) {
            Ok(TriedModel { loaded, n_golden_frames: golden_frames }) => {
                let networks = loaded.model.network_entries();
                Verdict { model, version, golden_frames, networks, failure: None }
            }
            Err(error) => {
                let failure = Some(format!("{error:#}"));
                Verdict { model, version, golden_frames: 0, networks: Vec::new(), failure }
            }
        }
    }

    fn try_version(&self, id: &VersionId) -> anyhow::Result<TriedModel> {
        Ok(try_model(&self.0.fetch(id)?, &NetworkStore::default(), |_| ())?)
    }

    /// One more than any that there was.
    fn next_version(&self, scan: &Scan, name: &str) -> anyhow::Result<VersionId> {
        let settled = self.0.record(name)?.settled;
        let listed = scan.models.get(name).and_then(|listing| listing.versions.last_key_value());
        Ok(VersionId::after(name, listed.map_or(0, |(version, _)| *version).max(settled))?)
    }

    fn record(&self, name: &str, epoch: Option<u64>) -> anyhow::Result<ServingRecord> {
        let record = self.0.record(name)?;
        if let Some(epoch) = epoch.filter(|epoch| *epoch != record.epoch) {
            bail!("the epoch of {name} is {}, not {epoch}: what serves was changed since", record.epoch);
        }
        Ok(record)
    }
}

/// What a scan says of a model, where it is there.
fn model_info(name: &str, scan: &Scan) -> Option<ModelInfo> {
    let Listing { versions, record } = scan.models.get(name)?;
    Some(ModelInfo {
        name: name.to_owned(),
        default: scan.default.as_ref().is_some_and(|default| default.model == name),
        serving: record.stable,
        epoch: record.epoch,
        settled: record.settled,
        versions: versions.keys().rev().map(|&version| version_info(version, record)).collect(),
    })
}

fn version_info(version: u64, record: &ServingRecord) -> VersionInfo {
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
        networks: Vec::new(),
        card: None,
        history: Vec::new(),
    }
}
