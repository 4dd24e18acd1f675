//! `roomsight serve`: the HTTP service.

mod lan;

use super::mistakes::nearest;
use super::output::say;
use super::{limits, log};
use crate::http::{self, App, ReloadError, Reloaded};
use crate::settings::{ENVIRONMENT_PREFIX, Settings};
use anyhow::{Context, bail};
use clap::Args;
use std::collections::HashMap;
use std::convert::Infallible;
use std::future::pending;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use tokio::net::{TcpListener, TcpSocket};

/// How many connections may wait to be accepted: a fleet that comes back at once. The system may allow fewer.
const BACKLOG: u32 = 4096;
/// Variables with the settings' prefix that are none of them.
const OTHER_VARIABLES: [&str; 2] = ["config", "onnx_runtime"];
/// The most bytes of answers that the system keeps for a caller who does not read, as far as it can be told.
const SEND_BUFFER_BYTES: u32 = 256 << 10;

/// Serve models over HTTP
///
/// Settings come from the defaults, then the file of --config, then the environment (ROOMSIGHT_QUEUE
/// sets `queue`), then flags. --print-config shows all of them.
#[derive(Args)]
pub(super) struct ServeArgs {
    /// Where models are: a folder with each as NAME/VERSION/ in it, one model's folder, or s3://BUCKET/PREFIX
    /// [default: models]
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Keep data sets, labels and trainings of the page in this folder, made where it is not there; without it the page
    /// shows and changes models only
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Whether newer versions come to serve by themselves: latest or manual [default: latest]
    #[arg(long, value_parser = ["latest", "manual"])]
    policy: Option<String>,
    /// The model of requests that name none [default: the one that `models default` named]
    #[arg(long, value_name = "NAME")]
    model: Option<String>,
    /// Where to listen [default: 127.0.0.1:8080]
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<String>,
    /// Let phones and laptops of this network in: listen on all addresses, over TLS with a certificate that is made here once,
    /// and print an address and a QR code that signs a phone in
    #[arg(long, requires = "data")]
    lan: bool,
    /// Threads that recognize [default: one a core]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Serve callers without a key on an address that others can reach
    #[arg(long)]
    allow_anonymous: bool,
    /// How log lines look [default: human]
    #[arg(long, value_name = "FORMAT", value_parser = ["human", "json"])]
    log_format: Option<String>,
    /// Any other setting, as often as needed
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair)]
    set: Vec<(String, String)>,
    /// A TOML file of settings
    #[arg(long, value_name = "FILE", env = "ROOMSIGHT_CONFIG")]
    config: Option<PathBuf>,
    /// Print the settings that would be used, hashes of keys left out, and end
    #[arg(long)]
    print_config: bool,
}

/// Serves until told to stop.
pub(super) fn run(args: &ServeArgs) -> anyhow::Result<()> {
    let mut settings = Settings::load(args.config.as_deref(), environment(), flags(args))?;
    if args.lan && !args.print_config {
        lan::prepare(&mut settings, args.listen.is_none())?;
    }
    if args.print_config {
        say!("{}", settings.to_toml()?.trim_end())?;
        return Ok(());
    }
    misspelled(environment().map(|(name, _)| name));
    let log = log::start(&settings)?;
    let served = serve(args, settings);
    log.end();
    served
}

fn serve(args: &ServeArgs, settings: Settings) -> anyhow::Result<()> {
    limits::raise_open_files(&settings);
    let address = address(&settings)?;
    let allows_anyone = settings.allow_anonymous || address.ip().is_loopback();
    let runtime = tokio::runtime::Runtime::new()?;
    let hangups = {
        let _inside = runtime.enter();
        limits::survive_large_files();
        hangups()
    };
    let app = App::start(settings)?;
    let owner = if args.lan { app.owner()? } else { None };
    if app.is_open() && !allows_anyone {
        bail!(
            "others could reach {address} without a key: make one with `roomsight key new`, \
             or give --allow-anonymous"
        );
    }
    let served = runtime.block_on(async {
        let listener = listen(address)?;
        let scheme = if app.speaks_tls() { "https" } else { "http" };
        let url = format!("{scheme}://{}", listener.local_addr()?);
        if http::has_page() {
            tracing::info!("listening on {url}, which shows a page; documentation at {url}/docs");
        } else {
            tracing::info!("listening on {url}, documentation at {url}/docs; this program was built without the page");
        }
        if args.lan {
            lan::invite(&app, owner.as_deref(), listener.local_addr()?)?;
        }
        if !address.ip().is_loopback() && !app.speaks_tls() {
            tracing::warn!(
                "keys and frames can be read on their way to {address}: set `tls_certificate` and `tls_key`, \
                 or let a proxy end TLS before the service"
            );
        }
        tokio::select! {
            served = http::serve(app.clone(), listener, stop_signal()) => served.context("the service failed"),
            never = reload_when_told(&app, args, hangups) => match never {},
        }
    });
    // A model that is still being loaded is not waited for.
    runtime.shutdown_background();
    served
}

/// Takes an address.
pub(super) fn listen(address: SocketAddr) -> anyhow::Result<TcpListener> {
    let listening = || {
        let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
        // A service that starts again need not wait for connections of the one before.
        #[cfg(unix)]
        socket.set_reuseaddr(true)?;
        socket.set_send_buffer_size(SEND_BUFFER_BYTES)?;
        socket.bind(address)?;
        socket.listen(BACKLOG)
    };
    listening().with_context(|| format!("cannot listen on {address}; choose another address with --listen"))
}

/// Names the variables that look like settings and are none. Others put names of their own under our prefix, so that only what is
/// nearly a setting is told.
fn misspelled(variables: impl Iterator<Item = String>) {
    let Ok(settings) = toml::Table::try_from(Settings::default()) else { return };
    for variable in variables {
        let Some(name) = variable.strip_prefix(ENVIRONMENT_PREFIX).map(str::to_lowercase) else { continue };
        if settings.contains_key(&name) || OTHER_VARIABLES.contains(&name.as_str()) {
            continue;
        }
        if let Some(meant) = nearest(&name, settings.keys().map(String::as_str)) {
            eprintln!("{variable} is no setting; did you mean {ENVIRONMENT_PREFIX}{}?", meant.to_uppercase());
        }
    }
}

fn pair(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("it is not NAME=VALUE")?;
    Ok((name.trim().to_owned(), value.trim().to_owned()))
}

/// The environment; what is not Unicode is no setting.
pub(super) fn environment() -> impl Iterator<Item = (String, String)> {
    std::env::vars_os()
        .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)))
}

/// The settings that were given as flags.
fn flags(args: &ServeArgs) -> HashMap<String, String> {
    let mut flags: HashMap<String, String> = args.set.iter().cloned().collect();
    let given = [
        ("models", args.models.as_ref().map(|path| path.to_string_lossy().into_owned())),
        ("data", args.data.as_ref().map(|path| path.to_string_lossy().into_owned())),
        ("policy", args.policy.clone()),
        ("model", args.model.clone()),
        ("listen", args.listen.clone()),
        ("threads", args.threads.map(|n| n.to_string())),
        ("allow_anonymous", args.allow_anonymous.then(|| true.to_string())),
        ("log_format", args.log_format.clone()),
    ];
    for (name, value) in given {
        flags.extend(value.map(|value| (name.to_owned(), value)));
    }
    flags
}

/// Where to listen.
fn address(settings: &Settings) -> anyhow::Result<SocketAddr> {
    let unusable = || {
        format!(
            "the setting `listen` is wrong: {:?} is no HOST:PORT, such as 127.0.0.1:8080",
            settings.listen
        )
    };
    settings.listen.to_socket_addrs().with_context(unusable)?.next().with_context(unusable)
}

#[cfg(unix)]
type Hangups = tokio::signal::unix::Signal;
#[cfg(not(unix))]
type Hangups = Infallible;

/// SIGHUP from now on, also while models are loaded. Where it cannot be had it ends the process, as ever.
fn hangups() -> Option<Hangups> {
    #[cfg(unix)]
    return tokio::signal::unix::signal(tokio::signal::unix::SignalKind::hangup()).ok();
    #[cfg(not(unix))]
    return None;
}

/// Reads keys and certificates again whenever the process is told to (SIGHUP), for ever.
#[cfg(unix)]
async fn reload_when_told(app: &App, args: &ServeArgs, hangups: Option<Hangups>) -> Infallible {
    let Some(mut hangups) = hangups else { return pending().await };
    while hangups.recv().await.is_some() {
        let fresh = Settings::load(args.config.as_deref(), environment(), flags(args));
        match fresh.map_err(ReloadError::from).and_then(|fresh| app.reload(&fresh)) {
            Ok(reloaded) => tell(&reloaded, args.config.is_some()),
            Err(error) => tracing::error!(%error, "nothing is reloaded"),
        }
    }
    pending().await
}

#[cfg(not(unix))]
async fn reload_when_told(_: &App, _: &ServeArgs, _: Option<Hangups>) -> Infallible {
    pending().await
}

/// Tells the operator what a reload has done.
#[cfg(unix)]
fn tell(Reloaded { n_keys, tls, waiting }: &Reloaded, has_file: bool) {
    if has_file {
        tracing::info!(n_keys, "the keys are reloaded");
    } else {
        tracing::info!(
            "no keys are reloaded: there is no file of settings (--config) that could have changed"
        );
    }
    match tls {
        Some(Ok(())) => tracing::info!("the certificate is reloaded"),
        Some(Err(error)) => tracing::error!(%error, "the old certificate stays"),
        None => {}
    }
    if !waiting.is_empty() {
        tracing::warn!("changed, but takes a restart: {}", waiting.join(", "));
    }
}

/// Ready when the process is told to stop.
pub(super) async fn stop_signal() {
    let interrupt = async {
        // Where the signal cannot be had the service runs on.
        if tokio::signal::ctrl_c().await.is_err() {
            pending::<()>().await;
        }
    };
    #[cfg(unix)]
    let terminate = async {
        use tokio::signal::unix::{SignalKind, signal};
        match signal(SignalKind::terminate()) {
            Ok(mut stream) => {
                stream.recv().await;
            }
            Err(_) => pending().await,
        }
    };
    #[cfg(not(unix))]
    let terminate = pending::<()>();
    tokio::select! {
        () = interrupt => {}
        () = terminate => {}
    }
}
