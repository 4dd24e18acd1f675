//! How a stream is configured, by its URL and by messages.

use super::inbox::MAX_TEXT_BYTES;
use crate::engine::registry::{Choice, Registry};
use crate::engine::text::check_name;
use crate::problem::Problem;
use roomsight_protocol::stream::{
    ClientMessage, Configure, FilterChoice, FilterSettings, Mode, StreamSettings,
};
use roomsight_recognition::filter::Trust;

/// The longest interval of the mode `sampled`, and the longest deadline, in milliseconds: an hour.
const MAX_MS: u64 = 3_600_000;

/// What a stream begins with: the default model, the mode `latest`, the filter on.
pub fn initial(registry: &Registry, key_name: Option<&str>) -> StreamSettings {
    StreamSettings {
        robot: key_name.map(str::to_owned),
        model: registry.default_name().unwrap_or_default(),
        mode: Mode::default(),
        interval_ms: None,
        sure_interval_ms: None,
        filter: Some(FilterSettings::default()),
        deadline_ms: None,
        top: None,
        explain: false,
    }
}

/// The settings after a change; what it leaves out stays.
///
/// # Errors
/// What cannot be: then nothing changes.
pub fn changed(
    settings: &StreamSettings,
    change: Configure,
    registry: &Registry,
) -> Result<StreamSettings, Problem> {
    let wrong = |text: String| Err(Problem::query(text));
    check_name("robot", change.robot.as_deref())?;
    if let Some(model) = &change.model {
        registry.choose(Some(model), &Choice::Serving, None)?;
    }
    let mode = change.mode.unwrap_or(settings.mode);
    let interval_ms = match (mode, change.interval_ms.or(settings.interval_ms)) {
        (Mode::Sampled, None) => return wrong("the mode `sampled` needs `interval_ms`".to_owned()),
        (Mode::Sampled, Some(interval)) if !(1..=MAX_MS).contains(&interval) => {
            return wrong(format!("`interval_ms` must be from 1 to {MAX_MS}"));
        }
        (Mode::Sampled, interval) => interval,
        (_, _) if change.interval_ms.is_some() => {
            return wrong("`interval_ms` is for the mode `sampled`".to_owned());
        }
        (_, _) => None,
    };
    let filter = match change.filter {
        None => settings.filter,
        Some(FilterChoice::Switch(false)) => None,
        Some(FilterChoice::Switch(true)) => Some(settings.filter.unwrap_or_default()),
        Some(FilterChoice::With(filter)) => Some(filter),
    };
    if let Some(Err(error)) = filter.map(|filter| Trust::try_from(filter.trust)) {
        return wrong(error.to_string());
    }
    let unless_zero = |given: Option<u64>, old: Option<u64>| given.map_or(old, |n| (n > 0).then_some(n));
    let sure_interval_ms = unless_zero(change.sure_interval_ms, settings.sure_interval_ms);
    let sure_interval_ms = match (sure_interval_ms, interval_ms, filter) {
        (None, _, _) => None,
        (Some(sure), Some(interval), Some(_)) if !(interval..=MAX_MS).contains(&sure) => {
            return wrong(format!("`sure_interval_ms` must be from `interval_ms` to {MAX_MS}"));
        }
        (sure, Some(_), Some(_)) => sure,
        _ if change.sure_interval_ms.is_some() => {
            return wrong("`sure_interval_ms` is for the mode `sampled`, with the filter".to_owned());
        }
        _ => None,
    };
    if change.deadline_ms.is_some_and(|deadline| deadline > MAX_MS) {
        return wrong(format!("`deadline_ms` must be at most {MAX_MS}"));
    }
    Ok(StreamSettings {
        robot: change.robot.or_else(|| settings.robot.clone()),
        model: change.model.unwrap_or_else(|| settings.model.clone()),
        mode,
        interval_ms,
        sure_interval_ms,
        filter,
        deadline_ms: unless_zero(change.deadline_ms, settings.deadline_ms),
        top: unless_zero(change.top.map(|n| n as u64), settings.top.map(|n| n as u64)).map(|n| n as usize),
        explain: change.explain.unwrap_or(settings.explain),
    })
}

/// What a text message configures; there is none where it is longer than is read.
///
/// # Errors
/// What is wrong with it.
pub fn read(message: Option<&str>) -> Result<Configure, Problem> {
    let message = message.ok_or_else(|| {
        Problem::query(format!(
            "the text message is longer than {MAX_TEXT_BYTES} bytes; frames are binary messages"
        ))
    })?;
    if !message.trim_start().starts_with('{') {
        let detail = r#"the text message is no JSON object such as {"type": "configure", "mode": "lossless"}; frames "#;
        return Err(Problem::query(format!(
            "{detail}are binary messages: the encoded image as it is, not base64"
        )));
    }
    let message = serde_json::from_str(message);
    let ClientMessage::Configure(change) =
        message.map_err(|error| Problem::query(format!("the text message cannot be read: {error}")))?;
    Ok(change)
}
