//! What callers read of models and their versions.

use super::{
    CANARY, Failure, PREVIOUS, RegisteredModel, Registry, SHADOW, STABLE, ServedModel, Serving, Tally,
    Version,
};
use roomsight_protocol::rest::{FailureInfo, ModelInfo, ModelName, NetworkInfo, ShadowInfo, VersionInfo};
use roomsight_recognition::model::{Model, NetworkEntry};
use std::sync::Arc;

/// The first 16 hexadecimal digits of a model's digest: what answers and metrics show of it.
pub fn short_digest(digest: &str) -> String {
    digest.chars().take(16).collect()
}

impl From<&ServedModel> for ModelName {
    fn from(served: &ServedModel) -> Self {
        Self {
            name: served.name.clone(),
            version: served.version,
            epoch: served.epoch,
            digest: short_digest(&served.digest),
        }
    }
}

/// What a caller reads of one model.
pub fn model_info(name: &str, entry: &RegisteredModel, registry: &Registry) -> ModelInfo {
    let serving = &registry.serving(name);
    let versions = entry.versions.iter().rev();
    ModelInfo {
        name: name.to_owned(),
        default: registry.default_name().as_deref() == Some(name),
        serving: serving.stable.as_ref().map(|served| served.version),
        epoch: entry.record.epoch,
        settled: entry.record.settled,
        versions: versions.map(|(&number, version)| version_info(number, version, serving)).collect(),
    }
}

/// What a caller reads of one version, its card left out.
pub fn version_info(number: u64, version: &Version, serving: &Serving) -> VersionInfo {
    let is_this = |served: &&Arc<ServedModel>| served.version == number;
    let canary = serving.canary.as_ref().filter(|(served, _)| is_this(&served));
    let shadow = serving.shadow.as_ref().filter(|shadow| is_this(&&shadow.served));
    let labels = [
        (STABLE, serving.stable.as_ref().is_some_and(|served| is_this(&served))),
        (CANARY, canary.is_some()),
        (SHADOW, shadow.is_some()),
        (PREVIOUS, serving.previous.as_ref().is_some_and(|served| is_this(&served))),
    ];
    let loaded = version.loaded();
    VersionInfo {
        version: number,
        state: version.state().name(),
        labels: labels.into_iter().filter(|(_, is_its)| *is_its).map(|(label, _)| label.to_owned()).collect(),
        failure: version.failure().map(FailureInfo::from),
        epoch: serving.answering().find(is_this).map(|served| served.epoch),
        share: canary.map(|(_, share)| *share),
        shadow: shadow.map(|shadow| ShadowInfo::from(shadow.tally())),
        digest: loaded.map(|loaded| loaded.digest.clone()),
        rooms: loaded.map(|loaded| loaded.model.rooms().to_vec()),
        networks: loaded.map_or_else(Vec::new, |loaded| network_infos(&loaded.model)),
        card: None,
        history: version.history(),
    }
}

/// The same with the model's card.
pub fn version_info_with_card(number: u64, version: &Version, serving: &Serving) -> VersionInfo {
    let card = version.loaded().and_then(|loaded| serde_json::to_value(loaded.model.card()).ok());
    VersionInfo { card, ..version_info(number, version, serving) }
}

/// Those that a model looks through.
pub fn network_infos(model: &Model) -> Vec<NetworkInfo> {
    let info = |NetworkEntry { name, blake3, n_bytes, .. }: NetworkEntry| NetworkInfo {
        name,
        blake3: blake3.into(),
        bytes: n_bytes,
    };
    model.network_entries().into_iter().map(info).collect()
}

impl From<Tally> for ShadowInfo {
    fn from(tally: Tally) -> Self {
        let Tally { n_compared, n_agreed, n_skipped, total_distance } = tally;
        let mean_distance = (n_compared > 0).then(|| total_distance / n_compared as f64);
        Self { compared: n_compared, agreed: n_agreed, skipped: n_skipped, mean_distance }
    }
}

impl From<&Failure> for FailureInfo {
    fn from(failure: &Failure) -> Self {
        Self { stage: failure.stage.to_string(), reason: failure.reason.clone() }
    }
}
