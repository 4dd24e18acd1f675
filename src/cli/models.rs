//! `roomsight models`: what there is and what serves, in a repository or in a running service.

mod local;
mod print;

pub(super) use local::Local;

use super::output::say;
use super::service::ServiceArgs;
use crate::repository::package::pack;
use crate::repository::{Canary, Change};
use anyhow::{Context, bail};
use clap::{Args, Subcommand, ValueEnum};
use roomsight_client::Client;
use roomsight_protocol::rest::{LabelJson, ModelInfo, VersionInfo};
use roomsight_protocol::version_id::{VersionId, is_name};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::{fs, io};
use tokio::runtime::Runtime;

/// Show and change which models there are and which serve
///
/// In a repository (--models), or in a running service (--url). A service that runs on the repository
/// follows what is changed there.
#[derive(Args)]
pub(super) struct ModelsArgs {
    #[command(flatten)]
    store: StoreArgs,
    /// Print JSON
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: ModelsCommand,
}

/// Where the models are.
#[derive(Args)]
struct StoreArgs {
    #[command(flatten)]
    repository: RepositoryArgs,
    /// A running service, instead of a repository, such as http://127.0.0.1:8080
    #[arg(long, global = true, value_name = "URL", conflicts_with = "models")]
    url: Option<String>,
    #[command(flatten)]
    service: ServiceArgs,
}

/// A repository.
#[derive(Args)]
pub(super) struct RepositoryArgs {
    /// The repository: a folder with each model as NAME/VERSION/ in it, or s3://BUCKET/PREFIX
    #[arg(long, global = true, value_name = "DIR", default_value = "models")]
    models: String,
    #[command(flatten)]
    cache: CacheArgs,
}

/// Where models from a bucket are kept.
#[derive(Args)]
pub(super) struct CacheArgs {
    /// Where models from a bucket are kept
    #[arg(long, global = true, value_name = "DIR", default_value = "models-cache")]
    #[arg(env = "ROOMSIGHT_MODELS_CACHE")]
    pub models_cache: PathBuf,
}

/// What to do.
#[derive(Subcommand)]
enum ModelsCommand {
    /// List the models, their versions, and what these serve as
    List,
    /// Show one model, or one version with its card
    Show {
        /// NAME or NAME/VERSION
        target: Target,
    },
    /// Add a version: it is tried first, and never changes after
    Push {
        /// The model's folder, as train writes it, or a tar, tar.gz or zip of it
        model: PathBuf,
        /// NAME, for the next number, or NAME/VERSION
        target: Target,
    },
    /// Let a version serve
    Activate {
        /// The version
        #[arg(value_name = "NAME/VERSION")]
        id: VersionId,
        #[command(flatten)]
        expected: Expected,
    },
    /// Let the version serve that served before
    Rollback {
        /// The model
        #[arg(value_parser = name)]
        name: String,
        #[command(flatten)]
        expected: Expected,
    },
    /// Load versions and let them answer their golden frames, in a repository
    Verify {
        /// NAME or NAME/VERSION [default: all there are]
        target: Option<Target>,
    },
    /// Remove a version that does not serve
    Delete {
        /// The version
        #[arg(value_name = "NAME/VERSION")]
        id: VersionId,
        #[command(flatten)]
        expected: Expected,
    },
    /// Let a model answer requests that name none, from now on
    Default {
        /// The model
        #[arg(value_parser = name)]
        name: String,
    },
    /// Try a version on a share of the robots (canary), or beside the stable one (shadow)
    Label(LabelArgs),
}

/// A label, and what is to carry it.
#[derive(Args)]
struct LabelArgs {
    /// The label
    label: Label,
    /// NAME/VERSION, or NAME with --remove
    target: Target,
    /// Of a canary: the share of the robots that it answers, above 0 and below 1
    #[arg(long, value_name = "SHARE", conflicts_with = "remove")]
    share: Option<f64>,
    /// Take the label away
    #[arg(long)]
    remove: bool,
    #[command(flatten)]
    expected: Expected,
}

/// A label that a version gets beside the stable one.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Label {
    /// Answers a share of the robots
    Canary,
    /// Sees what the stable version sees, and answers nobody
    Shadow,
}

/// What a change builds on.
#[derive(Args)]
struct Expected {
    /// Do nothing unless the model's epoch, which `show` tells, is still this
    #[arg(long, value_name = "N")]
    epoch: Option<u64>,
}

/// `NAME` or `NAME/VERSION`.
#[derive(Clone)]
struct Target {
    name: String,
    version: Option<u64>,
}

/// A repository or a service.
enum Store {
    Local(Local),
    Service(Client, Runtime),
}

/// Does it, and prints what is then so.
pub(super) fn run(args: &ModelsArgs) -> anyhow::Result<()> {
    let store = Store::open(args)?;
    let json = args.json;
    match &args.command {
        ModelsCommand::List => tell(json, &store.list()?, |models| print::models(models)),
        ModelsCommand::Show { target: Target { name, version: None } } => {
            tell(json, &store.model(name)?, print::model)
        }
        ModelsCommand::Show { target: Target { name, version: Some(version) } } => {
            let id = VersionId::new(name, *version);
            tell(json, &store.version(&id)?, |version| print::version(&id, version))
        }
        ModelsCommand::Push { model, target } => {
            let id = store.push(model, target)?;
            tell_done(json, &id, "is there; `models list` tells whether it serves, `models activate` lets it")
        }
        ModelsCommand::Activate { id, expected } => {
            store.activate(id, expected.epoch)?;
            tell_done(json, id, "serves")
        }
        ModelsCommand::Rollback { name, expected } => {
            let version = store.rollback(name, expected.epoch)?.serving;
            let version = version.context("nothing serves after the rollback")?;
            tell_done(json, &VersionId::new(name, version), "serves")
        }
        ModelsCommand::Verify { target } => store.verify(json, target.as_ref()),
        ModelsCommand::Delete { id, expected } => {
            store.delete(id, expected.epoch)?;
            tell_done(json, id, "is gone")
        }
        ModelsCommand::Default { name } => tell(json, &store.set_default(name)?, |model| {
            Ok(say!("{} answers requests that name no model", model.name)?)
        }),
        ModelsCommand::Label(args) => tell(json, &store.label(args)?, print::model),
    }
}

impl Store {
    fn open(args: &ModelsArgs) -> anyhow::Result<Self> {
        let StoreArgs { repository, url, service } = &args.store;
        let Some(url) = url else {
            let adds = matches!(args.command, ModelsCommand::Push { .. });
            let open = if adds { Local::open_to_add } else { Local::open };
            return Ok(Self::Local(open(&repository.models, &repository.cache.models_cache)?));
        };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        Ok(Self::Service(service.client(url)?, runtime))
    }

    fn list(&self) -> anyhow::Result<Vec<ModelInfo>> {
        match self {
            Self::Local(local) => local.list(),
            Self::Service(client, runtime) => Ok(runtime.block_on(client.models())?.models),
        }
    }

    fn model(&self, name: &str) -> anyhow::Result<ModelInfo> {
        match self {
            Self::Local(local) => local.model(name),
            Self::Service(client, runtime) => Ok(runtime.block_on(client.model(name))?),
        }
    }

    fn version(&self, id: &VersionId) -> anyhow::Result<VersionInfo> {
        match self {
            Self::Local(local) => local.version(id),
            Self::Service(client, runtime) => Ok(runtime.block_on(client.version(id))?),
        }
    }

    fn push(&self, model: &Path, Target { name, version }: &Target) -> anyhow::Result<VersionId> {
        match self {
            Self::Local(local) => local.push(model, name, *version),
            Self::Service(client, runtime) => {
                let body = body_of(model).with_context(|| model.display().to_string())?;
                let next = || -> anyhow::Result<VersionId> {
                    let models = runtime.block_on(client.models())?.models;
                    let highest = models.iter().find(|model| model.name == *name).map(highest_version);
                    Ok(VersionId::after(name, highest.unwrap_or(0))?)
                };
                let id = version.map_or_else(next, |version| Ok(VersionId::new(name, version)))?;
                runtime.block_on(client.upload(&id, body))?;
                Ok(id)
            }
        }
    }

    fn activate(&self, id: &VersionId, epoch: Option<u64>) -> anyhow::Result<()> {
        match self {
            Self::Local(local) => local.change(&id.name, Change::Activate(id.version), epoch).map(drop),
            Self::Service(client, runtime) => Ok(runtime.block_on(client.activate(id, epoch)).map(drop)?),
        }
    }

    fn rollback(&self, name: &str, epoch: Option<u64>) -> anyhow::Result<ModelInfo> {
        match self {
            Self::Local(local) => local.change(name, Change::Rollback, epoch),
            Self::Service(client, runtime) => Ok(runtime.block_on(client.rollback(name, epoch))?),
        }
    }

    fn set_default(&self, name: &str) -> anyhow::Result<ModelInfo> {
        match self {
            Self::Local(local) => local.set_default(name),
            Self::Service(client, runtime) => Ok(runtime.block_on(client.set_default(name))?),
        }
    }

    fn delete(&self, id: &VersionId, epoch: Option<u64>) -> anyhow::Result<()> {
        match self {
            Self::Local(local) => local.delete(id, epoch),
            Self::Service(client, runtime) => Ok(runtime.block_on(client.delete(id, epoch))?),
        }
    }

    fn label(&self, args: &LabelArgs) -> anyhow::Result<ModelInfo> {
        let LabelArgs { label, target: Target { name, version }, share, remove, expected } = args;
        let given = match (version, remove) {
            (Some(_), false) if share.is_some() != (*label == Label::Canary) => {
                bail!("a canary needs a --share of the robots; a shadow answers none")
            }
            (Some(version), false) => Some(LabelJson { version: *version, share: *share }),
            (None, true) => None,
            (None, false) => {
                bail!("which version of {name}? Give it as {name}/VERSION, or --remove the label")
            }
            (Some(_), true) => bail!("--remove takes the label from whatever has it: give {name} alone"),
        };
        match self {
            Self::Local(local) => local.change(name, label.change(given), expected.epoch),
            Self::Service(client, runtime) => {
                let label = label.name();
                Ok(match given {
                    Some(given) => runtime.block_on(client.set_label(name, label, &given, expected.epoch))?,
                    None => runtime.block_on(client.remove_label(name, label, expected.epoch))?,
                })
            }
        }
    }

    fn verify(&self, json: bool, target: Option<&Target>) -> anyhow::Result<()> {
        let Self::Local(local) = self else {
            bail!("a service tries versions itself: `models list` tells those that failed, and why");
        };
        let verdicts = local.verify(target)?;
        let n_failed = verdicts.iter().filter(|verdict| verdict.failure.is_some()).count();
        tell(json, &verdicts, |verdicts| print::verdicts(verdicts))?;
        if n_failed > 0 {
            bail!("{n_failed} of {} versions would not serve", verdicts.len());
        }
        Ok(())
    }
}

impl Label {
    fn name(self) -> &'static str {
        match self {
            Self::Canary => "canary",
            Self::Shadow => "shadow",
        }
    }

    /// Giving it to a version, or taking it away.
    fn change(self, given: Option<LabelJson>) -> Change {
        match self {
            Self::Canary => Change::Canary(given.map(|LabelJson { version, share }| {
                // Out of range, where it was not said: no canary has such a share.
                Canary { version, share: share.unwrap_or(0.0) }
            })),
            Self::Shadow => Change::Shadow(given.map(|given| given.version)),
        }
    }
}

impl std::str::FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if is_name(text) {
            return Ok(Self { name: text.to_owned(), version: None });
        }
        let VersionId { name, version } =
            text.parse().map_err(|error| format!("give NAME or NAME/VERSION, such as lab/3: {error}"))?;
        Ok(Self { name, version: Some(version) })
    }
}

/// Reads the name of a model.
pub(super) fn name(text: &str) -> Result<String, String> {
    let wrong = || "a name has letters, digits, - _ and dots inside".to_owned();
    is_name(text).then(|| text.to_owned()).ok_or_else(wrong)
}

/// What is uploaded of a model's folder, or of an archive of it: that is read by the service.
fn body_of(model: &Path) -> io::Result<Vec<u8>> {
    if model.is_file() {
        return fs::read(model);
    }
    let mut body = Vec::new();
    pack(model, &mut body)?;
    Ok(body)
}

/// The highest version that a model has, or had: a number that was used serves no more by itself.
fn highest_version(model: &ModelInfo) -> u64 {
    model.versions.iter().map(|version| version.version).max().unwrap_or(0).max(model.settled)
}

fn tell<T: Serialize>(
    json: bool,
    told: &T,
    print: impl FnOnce(&T) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    if json { Ok(say!("{}", serde_json::to_string_pretty(told)?)?) } else { print(told) }
}

fn tell_done(json: bool, id: &VersionId, what: &str) -> anyhow::Result<()> {
    let VersionId { name, version } = id;
    tell(json, &serde_json::json!({"model": name, "version": version}), |_| Ok(say!("{id} {what}")?))
}
