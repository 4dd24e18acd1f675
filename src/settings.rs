//! What an operator may set: defaults, then a file, then the environment, then flags.

mod durations;
mod hidden;
mod outside;

pub use hidden::{Broker, BrokerUrl, NatsUrl, Secret};

use crate::access::{Key, Sites, check_together};
use config::{Config, Environment, File, FileFormat};
use roomsight_recognition::model::MAX_MODEL_BYTES;
use roomsight_vision::image;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The prefix of the environment's names: `ROOMSIGHT_QUEUE` sets `queue`.
pub const ENVIRONMENT_PREFIX: &str = "ROOMSIGHT_";
/// The longest life of a session, in milliseconds.
const MAX_SESSION_MS: u64 = 30 * 24 * 3_600_000;
/// The most keys that streams are sealed with: one that was, while another comes to be.
const MAX_RESUME_KEYS: usize = 2;
const MIN_RESUME_KEY_BYTES: usize = 32;

/// All settings of the service. [`Settings::default`] is what runs when nothing is set.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Where to listen, `host:port`.
    pub listen: String,
    /// Where models are: a folder `NAME/VERSION/`, one model's folder, or `s3://BUCKET/PREFIX`.
    pub models: PathBuf,
    /// Whether a newer version of a model comes to serve by itself.
    pub policy: Policy,
    /// How often the models are looked at for what is new, in milliseconds; 0: never.
    pub models_poll_ms: u64,
    /// Where versions from a bucket are kept.
    pub models_cache: PathBuf,
    /// The longest upload of a version, in bytes, also when it is unpacked; at most 1 GiB.
    pub max_model_bytes: u64,
    /// The most uploads of versions at one time.
    pub max_uploads: usize,
    /// Where data sets, labels, trainings, keys and the audit of the page are kept, a folder; empty: nowhere, and the page
    /// shows and changes models only.
    pub data: PathBuf,
    /// The model of requests that name none; empty: the one that the repository names, which is at first the first
    /// by name.
    pub model: String,
    /// Who may call, one `role:name:hash` each, or `role:name:hash:robot+robot` where a key is bound to robots;
    /// `roomsight key new` makes them.
    pub keys: Vec<Key>,
    /// Names that the service answers to without keys, `name` or `name:port`, beside those of this machine
    /// alone and all addresses.
    pub hosts: Vec<String>,
    /// The origins whose pages may call from a browser, such as `https://dashboard.example`.
    pub origins: Vec<String>,
    /// How long a browser stays signed in, in milliseconds.
    pub session_ms: u64,
    /// The service's certificate and those between it and its authority, a file of PEM; empty: no TLS.
    pub tls_certificate: PathBuf,
    /// The key of the certificate, a file of PEM.
    pub tls_key: PathBuf,
    /// Whose certificates callers must show, a file of PEM; empty: they need none.
    pub tls_client_ca: PathBuf,
    /// Serve callers without a key on an address that others can reach.
    pub allow_anonymous: bool,
    /// Threads that recognize; 0: one a core.
    pub threads: usize,
    /// Frames that may wait for a thread.
    pub queue: usize,
    /// The share of the queue and of the bytes of bodies that one caller may hold, above 0 and up to 1. A
    /// batch and the longest body always fit.
    pub caller_share: f64,
    /// The longest encoded frame, in bytes.
    pub max_frame_bytes: usize,
    /// The longest side of a frame, in pixels.
    pub max_frame_side: u32,
    /// The most pixels that are decoded of a frame; JPEGs of more are decoded at a half, a quarter or an
    /// eighth of their size, where the model needs no more.
    pub max_frame_pixels: u64,
    /// The most memory that decoding one frame may take, in bytes.
    pub max_decode_bytes: u64,
    /// The most frames in a batch.
    pub max_batch_frames: usize,
    /// The longest body of a batch, in bytes.
    pub max_batch_bytes: usize,
    /// The most bytes of all bodies held at one time.
    pub max_buffered_bytes: usize,
    /// The most open connections; further ones wait to be accepted.
    pub max_connections: usize,
    /// How long a connection may take to send a request's head, or stay idle, in milliseconds.
    pub header_timeout_ms: u64,
    /// How long a caller may take to send a body, in milliseconds.
    pub body_timeout_ms: u64,
    /// How long nothing of an answer may be taken by a caller before its connection is ended, in milliseconds.
    pub write_timeout_ms: u64,
    /// How long accepted requests may take to finish after a stop, in milliseconds.
    pub drain_timeout_ms: u64,
    /// The most streams at one time.
    pub max_streams: usize,
    /// The most streams of one caller: of one key; without keys of one robot's name, or of an address whose
    /// robots have none. 0: half of `max_streams`.
    pub max_streams_per_caller: usize,
    /// The most frames of a stream without an answer in the mode `lossless`.
    pub stream_window: usize,
    /// How many bytes of frames without an answer a stream may hold before it is read no further.
    pub max_stream_bytes: usize,
    /// How long a stream's message may take to come in, in milliseconds.
    pub stream_message_timeout_ms: u64,
    /// How often a stream is asked for a sign of life, in milliseconds. A connection that does not even
    /// acknowledge three of them has broken.
    pub stream_ping_ms: u64,
    /// How long no byte may come over a stream before it is closed, in milliseconds. Robots that answer pings
    /// only when they look for answers must look more often.
    pub stream_idle_timeout_ms: u64,
    /// How long a robot may take to read what it is sent, in milliseconds.
    pub stream_write_timeout_ms: u64,
    /// How long a stream waits for its robot when the connection broke, in milliseconds.
    pub stream_resume_ms: u64,
    /// What streams are sealed with that robots take to another service: the same for all that share robots, at least 32
    /// characters each. The first seals, two at most open; none: streams end with their service.
    pub resume_keys: Vec<Secret>,
    /// How old what was sealed may be, in milliseconds.
    pub resume_token_ms: u64,
    /// How long a robot's answers may be unknown before it counts as lost, in milliseconds.
    pub lost_after_ms: u64,
    /// How many bytes the robots' last frames may take that dashboards show; 0: none are kept.
    pub live_frames_bytes: usize,
    /// Where robots are recorded on request; empty: they are not.
    pub record_folder: PathBuf,
    /// How many bytes recordings may take together; where they do, those that run end.
    pub record_max_bytes: u64,
    /// Addresses that are told by POST what happens to robots and models.
    pub webhooks: Vec<String>,
    /// What what is told to them is signed with; empty: it is not signed.
    pub webhook_secret: Secret,
    /// The broker of MQTT that is told where robots are, as `mqtt://USER:PASSWORD@HOST:1883`; empty: none.
    pub mqtt: BrokerUrl,
    /// What topics begin with.
    pub mqtt_prefix: String,
    /// What the topics begin with by which Home Assistant finds the robots; empty: it does not.
    pub mqtt_discovery: String,
    /// The server of NATS over which services tell each other of their robots, as `nats://USER:PASSWORD@HOST:4222`; empty: none.
    pub nats: NatsUrl,
    /// What the subjects begin with: services with the same are a fleet.
    pub nats_prefix: String,
    /// What this service is called in its fleet; empty: as its machine, by the environment's `HOSTNAME`, else by chance.
    pub service_name: String,
    /// How log lines look.
    pub log_format: LogFormat,
    /// What is logged: `error`, `warn`, `info`, `debug`, or a filter as `roomsight=debug,warn`.
    pub log_level: String,
    /// The OpenTelemetry collector that gets traces, as `http://127.0.0.1:4318`; empty: the one that the
    /// environment's `OTEL_EXPORTER_OTLP_ENDPOINT` names, or none. Takes a program built with `otlp`.
    pub otlp_endpoint: String,
}

/// Which version of a model serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Policy {
    /// A version that is newer than all that served before, as soon as it is there; else as somebody decides.
    Latest,
    /// Only as somebody decides.
    Manual,
}

/// How log lines look.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// For people.
    Human,
    /// One JSON object a line.
    Json,
}

/// Why settings were refused.
#[derive(Debug, thiserror::Error)]
pub enum SettingsError {
    /// A file or value that cannot be read.
    #[error("the settings cannot be read: {0}")]
    Unreadable(#[from] config::ConfigError),
    /// A name or a value in the file that is none.
    #[error("{}, line {line}: {reason}", path.display())]
    File {
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        reason: String,
    },
    /// A value that TOML cannot say.
    #[error("the settings cannot be written as TOML: {0}")]
    Unwritable(#[from] toml::ser::Error),
    /// A value that cannot work.
    #[error("the setting `{name}` is wrong: {reason}")]
    Wrong {
        name: &'static str,
        /// What is wrong and what would be right.
        reason: String,
    },
}

impl Default for Settings {
    fn default() -> Self {
        let frame = image::Limits::default();
        Self {
            listen: "127.0.0.1:8080".into(),
            models: "models".into(),
            policy: Policy::Latest,
            models_poll_ms: 2000,
            models_cache: "models-cache".into(),
            max_model_bytes: 256 << 20,
            max_uploads: 4,
            data: PathBuf::new(),
            model: String::new(),
            keys: Vec::new(),
            hosts: Vec::new(),
            origins: Vec::new(),
            session_ms: 3_600_000,
            tls_certificate: PathBuf::new(),
            tls_key: PathBuf::new(),
            tls_client_ca: PathBuf::new(),
            allow_anonymous: false,
            threads: 0,
            queue: 64,
            caller_share: 0.5,
            max_frame_bytes: frame.max_bytes,
            max_frame_side: frame.max_side,
            max_frame_pixels: frame.max_pixels,
            max_decode_bytes: frame.max_memory,
            max_batch_frames: 16,
            max_batch_bytes: 64 << 20,
            max_buffered_bytes: 256 << 20,
            max_connections: 1024,
            header_timeout_ms: 30_000,
            body_timeout_ms: 10_000,
            write_timeout_ms: 5_000,
            drain_timeout_ms: 10_000,
            max_streams: 1024,
            max_streams_per_caller: 0,
            stream_window: 16,
            max_stream_bytes: 32 << 20,
            stream_message_timeout_ms: 120_000,
            stream_ping_ms: 15_000,
            stream_idle_timeout_ms: 180_000,
            stream_write_timeout_ms: 10_000,
            stream_resume_ms: 30_000,
            resume_keys: Vec::new(),
            resume_token_ms: 3_600_000,
            lost_after_ms: 10_000,
            live_frames_bytes: 32 << 20,
            record_folder: PathBuf::new(),
            record_max_bytes: 1 << 30,
            webhooks: Vec::new(),
            webhook_secret: Secret::default(),
            mqtt: BrokerUrl::default(),
            mqtt_prefix: "roomsight".into(),
            mqtt_discovery: "homeassistant".into(),
            nats: NatsUrl::default(),
            nats_prefix: "roomsight".into(),
            service_name: String::new(),
            log_format: LogFormat::Human,
            log_level: "info".into(),
            otlp_endpoint: String::new(),
        }
    }
}

impl Settings {
    /// Layers a TOML file, the environment's `ROOMSIGHT_...` and flags over the defaults. Both
    /// `environment` and `flags` map names to values; lists are separated by commas.
    pub fn load(
        file: Option<&Path>,
        environment: impl IntoIterator<Item = (String, String)>,
        flags: HashMap<String, String>,
    ) -> Result<Self, SettingsError> {
        let defaults = Config::try_from(&Self::default())?;
        let mut layers = Config::builder().add_source(defaults);
        if let Some(path) = file {
            layers = layers.add_source(File::from(path).format(FileFormat::Toml));
        }
        // Others put names of their own under our prefix (Kubernetes announces a service that is
        // called roomsight as ROOMSIGHT_PORT), so that only the names of settings count.
        let known = toml::Table::try_from(Self::default())?;
        let environment = environment
            .into_iter()
            .filter_map(|(name, value)| Some((name.strip_prefix(ENVIRONMENT_PREFIX)?.to_lowercase(), value)))
            .filter(|(name, _)| known.contains_key(name))
            .collect();
        let layered = layers.add_source(texts(environment)).add_source(texts(flags)).build();
        let settings: Self = layered
            .and_then(Config::try_deserialize)
            .map_err(|error| file.and_then(mistake_in).unwrap_or(SettingsError::Unreadable(error)))?;
        settings.check()?;
        Ok(settings)
    }

    /// The settings as a TOML file, hashes of keys and secrets left out.
    pub fn to_toml(&self) -> Result<String, SettingsError> {
        Ok(toml::to_string_pretty(self)?)
    }

    /// The names of all settings but `keys` that differ from others.
    pub fn changes_to(&self, other: &Self) -> Result<Vec<String>, SettingsError> {
        let (old, new) = (toml::Table::try_from(self)?, toml::Table::try_from(other)?);
        let names = old.into_iter().filter(|(name, value)| name != "keys" && new.get(name) != Some(value));
        let mut names: Vec<String> = names.map(|(name, _)| name).collect();
        // Of these the tables do not say all.
        for (name, is_same) in [
            ("webhook_secret", self.webhook_secret == other.webhook_secret),
            ("resume_keys", self.resume_keys == other.resume_keys),
            ("mqtt", self.mqtt == other.mqtt),
            ("nats", self.nats == other.nats),
        ] {
            if !is_same && !names.iter().any(|other| other == name) {
                names.push(name.to_owned());
            }
        }
        Ok(names)
    }

    /// Whether there is a data directory.
    pub fn keeps_data(&self) -> bool {
        !self.data.as_os_str().is_empty()
    }

    /// The number of recognizing threads.
    pub fn n_threads(&self) -> usize {
        match self.threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            n => n,
        }
    }

    /// The longest body.
    pub fn largest_body(&self) -> usize {
        self.max_frame_bytes.max(self.max_batch_bytes)
    }

    /// The names that the service answers to, and the pages that may call it.
    ///
    /// # Errors
    /// What is no name, or no page.
    pub fn sites(&self) -> Result<Sites, SettingsError> {
        Sites::new(&self.hosts, &self.listen, &self.origins)
            .map_err(|error| SettingsError::Wrong { name: error.setting(), reason: error.to_string() })
    }

    /// What decoding a frame is limited to.
    pub fn frame_limits(&self) -> image::Limits {
        image::Limits {
            max_bytes: self.max_frame_bytes,
            max_side: self.max_frame_side,
            max_pixels: self.max_frame_pixels,
            max_memory: self.max_decode_bytes,
            ..image::Limits::default()
        }
    }

    fn check(&self) -> Result<(), SettingsError> {
        let n_slots = self.n_threads() + self.queue;
        let largest_body = self.largest_body();
        let wrong = |name, reason: String| Err(SettingsError::Wrong { name, reason });
        if self.threads > 1024 {
            return wrong("threads", "more than 1024 threads; 0 means one a core".into());
        }
        if let Err(error) = check_together(&self.keys) {
            return wrong("keys", error.to_string());
        }
        self.sites()?;
        self.check_outside()?;
        if !(1000..=MAX_SESSION_MS).contains(&self.session_ms) {
            return wrong("session_ms", format!("it must be from 1000 to {MAX_SESSION_MS}, 30 days"));
        }
        if self.max_connections == 0 || self.max_connections > 1_000_000 {
            return wrong("max_connections", "it must be from 1 to 1000000".into());
        }
        if self.queue > 1_000_000 {
            return wrong("queue", "it must be at most 1000000".into());
        }
        if !(self.caller_share > 0.0 && self.caller_share <= 1.0) {
            return wrong("caller_share", "it must be above 0 and at most 1, as 0.5 for one half".into());
        }
        if self.write_timeout_ms == 0 {
            return wrong("write_timeout_ms", "it must be at least 1; 5000 suits slow networks too".into());
        }
        if self.max_batch_frames == 0 || self.max_batch_frames > n_slots {
            return wrong(
                "max_batch_frames",
                format!("a batch must fit the queue: set it from 1 to {n_slots}, or raise `queue`"),
            );
        }
        if self.max_model_bytes == 0 || self.max_model_bytes > MAX_MODEL_BYTES {
            return wrong(
                "max_model_bytes",
                format!("it must be from 1 to {MAX_MODEL_BYTES}: no longer model is read"),
            );
        }
        if self.max_uploads == 0 || self.max_uploads > 1000 {
            return wrong("max_uploads", "it must be from 1 to 1000".into());
        }
        for (name, value) in [
            ("header_timeout_ms", self.header_timeout_ms),
            ("body_timeout_ms", self.body_timeout_ms),
            ("drain_timeout_ms", self.drain_timeout_ms),
            ("stream_idle_timeout_ms", self.stream_idle_timeout_ms),
            ("stream_write_timeout_ms", self.stream_write_timeout_ms),
        ] {
            if value == 0 {
                return wrong(name, "no call can be made in no time: set it to 1 or more".into());
            }
        }
        if self.max_streams > 1_000_000 {
            return wrong("max_streams", "it must be at most 1000000".into());
        }
        if self.stream_window == 0 || self.stream_window > 1024 {
            return wrong("stream_window", "it must be from 1 to 1024".into());
        }
        if self.max_stream_bytes == 0 {
            return wrong("max_stream_bytes", "it must be at least 1: then a stream holds one frame".into());
        }
        if self.max_streams_per_caller > self.max_streams {
            return wrong(
                "max_streams_per_caller",
                "it must be at most `max_streams`; 0 means half of it".into(),
            );
        }
        if self.stream_message_timeout_ms == 0 {
            return wrong("stream_message_timeout_ms", "it must be at least 1; 120000 is two minutes".into());
        }
        if self.stream_ping_ms == 0 || self.stream_ping_ms > self.stream_idle_timeout_ms {
            return wrong("stream_ping_ms", "it must be from 1 to `stream_idle_timeout_ms`".into());
        }
        if self.resume_keys.len() > MAX_RESUME_KEYS
            || self.resume_keys.iter().any(|key| key.reveal().len() < MIN_RESUME_KEY_BYTES)
        {
            return wrong(
                "resume_keys",
                format!(
                    "there may be {MAX_RESUME_KEYS}, of {MIN_RESUME_KEY_BYTES} characters or more: `openssl rand -hex 32` \
                     prints one"
                ),
            );
        }
        if !self.otlp_endpoint.is_empty() {
            if !cfg!(feature = "otlp") {
                let reason =
                    "this program sends no traces; build it with `cargo build --release --features otlp`";
                return wrong("otlp_endpoint", reason.into());
            }
            if !self.otlp_endpoint.starts_with("http://") {
                let reason =
                    "it must begin with http://; for TLS give a collector beside the service, which has it";
                return wrong("otlp_endpoint", reason.into());
            }
        }
        if largest_body > self.max_buffered_bytes || self.max_buffered_bytes > u32::MAX as usize {
            return wrong(
                "max_buffered_bytes",
                format!("it must hold the largest body: set it from {largest_body} to {}", u32::MAX),
            );
        }
        Ok(())
    }
}

/// What is wrong in a file by itself, and where; the layers together do not know lines.
fn mistake_in(path: &Path) -> Option<SettingsError> {
    let text = std::fs::read_to_string(path).ok()?;
    let error = toml::from_str::<Settings>(&text).err()?;
    let line = 1 + text[..error.span()?.start].matches('\n').count();
    Some(SettingsError::File { path: path.to_owned(), line, reason: error.message().to_owned() })
}

/// A layer of settings that come as texts.
fn texts(values: HashMap<String, String>) -> Environment {
    Environment::default()
        .source(Some(values))
        .try_parsing(true)
        .list_separator(",")
        .with_list_parse_key("keys")
        .with_list_parse_key("hosts")
        .with_list_parse_key("origins")
        .with_list_parse_key("webhooks")
        .with_list_parse_key("resume_keys")
}

#[cfg(test)]
mod tests;
