//! Models as tables.

use super::local::Verdict;
use crate::cli::output::{self, say};
use roomsight_protocol::rest::{ModelInfo, ShadowInfo, VersionInfo};
use roomsight_protocol::version_id::VersionId;
use roomsight_recognition::model::Card;
use serde::Serialize;

/// All versions of all models.
pub(super) fn models(models: &[ModelInfo]) -> anyhow::Result<()> {
    versions(models)?;
    if let Some(default) = models.iter().find(|model| model.default) {
        say!("{} answers requests that name no model", default.name)?;
    }
    Ok(())
}

fn versions(models: &[ModelInfo]) -> anyhow::Result<()> {
    let mut table = output::table(["model", "version", "state", "serves as", ""]);
    for ModelInfo { name, versions, .. } in models {
        for (version_idx, version) in versions.iter().enumerate() {
            let name = if version_idx == 0 { name.as_str() } else { "" };
            let [number, state] = [version.version.to_string(), word(&version.state)];
            table.add_row([name.to_owned(), number, state, labels(version), remark(version)]);
        }
    }
    Ok(say!("{table}")?)
}

/// One model.
pub(super) fn model(model: &ModelInfo) -> anyhow::Result<()> {
    models(std::slice::from_ref(model))?;
    Ok(say!("Epoch {}", model.epoch)?)
}

/// One version with its card.
pub(super) fn version(id: &VersionId, version: &VersionInfo) -> anyhow::Result<()> {
    let mut table = output::table(["version".to_owned(), id.to_string()]);
    let mut add = |name: &str, value: String| {
        if !value.is_empty() {
            table.add_row([name.to_owned(), value]);
        }
    };
    add("state", word(&version.state));
    add("serves as", labels(version));
    add("remark", remark(version));
    add("rooms", version.rooms.as_deref().unwrap_or_default().join(", "));
    version.networks.iter().for_each(|network| add("network", output::network_text(network)));
    if let Some(card) = &version.card {
        let card: Card = serde_json::from_value(card.clone())?;
        output::card_rows(&card).into_iter().for_each(|(name, value)| add(name, value));
    }
    add("digest", version.digest.clone().unwrap_or_default());
    for change in &version.history {
        add(&word(&change.state), change.at.clone());
    }
    Ok(say!("{table}")?)
}

/// What came of trying versions.
pub(super) fn verdicts(verdicts: &[Verdict]) -> anyhow::Result<()> {
    let mut table = output::table(["model", "version", "golden frames", "networks", ""]);
    for Verdict { model, version, golden_frames, networks, failure } in verdicts {
        let [number, golden_frames] = [version.to_string(), golden_frames.to_string()];
        let networks: Vec<&str> = networks.iter().map(|network| network.name.as_str()).collect();
        let verdict = failure.as_deref().unwrap_or("good").to_owned();
        table.add_row([model.clone(), number, golden_frames, networks.join(", "), verdict]);
    }
    Ok(say!("{table}")?)
}

fn labels(version: &VersionInfo) -> String {
    let label = |label: &String| match version.share {
        Some(share) if label == "canary" => format!("canary of {share}"),
        _ => label.clone(),
    };
    version.labels.iter().map(label).collect::<Vec<_>>().join(", ")
}

/// Why it does not serve, or how it compares.
fn remark(version: &VersionInfo) -> String {
    match (&version.failure, &version.shadow) {
        (Some(failure), _) => format!("{} failed: {}", failure.stage, failure.reason),
        (None, Some(ShadowInfo { compared, agreed, .. })) => {
            format!("agrees in {agreed} of {compared} frames")
        }
        (None, None) => String::new(),
    }
}

/// The word that a value is in JSON.
fn word(value: &impl Serialize) -> String {
    let json = serde_json::to_value(value).unwrap_or_default();
    json.as_str().unwrap_or_default().to_owned()
}
