//! `roomsight replay`: recorded frames against a running service, as robots would send them.
//!
//! Open loop: a frame leaves when it is due, whatever became of those before it, and its latency counts from
//! when it was due. A service that stands still therefore shows in every frame that was due meanwhile.

mod frames;
mod lasting;
mod page;
mod report;
mod robot;
mod schedule;
mod tally;

use super::data::{self, DataArgs};
use super::output::{self, say};
use super::serve;
use super::service::ServiceArgs;
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use frames::Frames;
use report::{GateArgs, Report, Setting};
use robot::{Drive, Feed};
use roomsight_client::{Client, ClientError, LastingStream, Stream};
use roomsight_lab::dataset::Dataset;
use roomsight_protocol::stream::{Configure, FilterChoice, Hello, Mode};
use schedule::{Rate, Track};
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::pin::pin;
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};
use tally::{Percentiles, Tally};
use tokio::sync::{Semaphore, watch};
use tokio::task::JoinSet;
use tokio::time::{Instant, interval};

/// How often the progress is shown.
const TICK: Duration = Duration::from_millis(200);

/// Play recorded frames against a running service, as robots would
///
/// Prints latency, frame age, drops, errors and accuracy. Latency counts from when a frame was due, not from
/// when it could be sent. Exit code 3 where a gate (--max-p99, --max-errors, --max-drops, --min-accuracy) fails.
#[derive(Args)]
pub(super) struct ReplayArgs {
    #[command(flatten)]
    data: DataArgs,
    /// The service
    #[arg(long, default_value = "http://127.0.0.1:8080")]
    url: String,
    #[command(flatten)]
    service: ServiceArgs,
    /// The model that answers [default: the service's]
    #[arg(long, value_name = "NAME")]
    model: Option<String>,
    /// A stream a robot, or a call a frame
    #[arg(long, value_enum, default_value = "stream")]
    transport: Transport,
    /// As recorded, so many frames a second, or max: each when the one before has gone. The filter knows the
    /// times between frames: faster than recorded, it judges a robot that drives so much faster
    #[arg(long, default_value = "recorded")]
    rate: Rate,
    /// How many robots send at once; each begins with another sequence, and a little later than the one before
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = data::at_least(1))]
    robots: usize,
    /// What the service does with frames that come too fast [default: latest]
    #[arg(long, value_enum)]
    mode: Option<ModeName>,
    /// With --mode sampled: the least time between two frames that are looked at
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..))]
    interval: Option<u64>,
    /// Filter the answers of a stream [default: as the service does]
    #[arg(long, overrides_with = "no_filter")]
    filter: bool,
    /// Do not filter them
    #[arg(long)]
    no_filter: bool,
    /// Go on with streams whose service breaks or stops, for so long, as robots do: on the same service, or on another behind
    /// the same address. What went down with a service counts as dropped, lost [default: they end]
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..))]
    patience: Option<u64>,
    /// With --transport rest: how many calls at most are under way at one time
    #[arg(long, default_value_t = 64, value_name = "N", value_parser = data::at_least(1))]
    connections: usize,
    /// Send no frame after this [default: until the last frame]
    #[arg(long, value_name = "SECONDS")]
    duration: Option<f64>,
    /// Begin again after the last frame, until --duration, --limit or Ctrl-C
    #[arg(long = "loop")]
    again: bool,
    /// The most frames that each robot sends
    #[arg(long, value_name = "N", value_parser = data::at_least(1))]
    limit: Option<usize>,
    #[command(flatten)]
    gates: GateArgs,
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
    /// Write a page with charts
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Transport {
    /// A call for each frame
    Rest,
    /// A WebSocket for each robot
    Stream,
}

#[derive(Clone, Copy, ValueEnum)]
enum ModeName {
    /// A newer frame takes the place of one that waits
    Latest,
    /// None is dropped: the sender is held back
    Lossless,
    /// At most one frame an interval is looked at
    Sampled,
}

/// Plays, prints what came of it, and fails where a gate does.
pub(super) fn run(args: &ReplayArgs) -> anyhow::Result<()> {
    let is_about_streams = args.mode.is_some() || args.filter || args.no_filter || args.interval.is_some();
    if args.transport == Transport::Rest && (is_about_streams || args.patience.is_some()) {
        bail!(
            "--mode, --interval, --filter and --patience are of streams: leave them out, or --transport rest"
        );
    }
    let dataset = args.data.open_with_unlabeled(None)?;
    if dataset.frames.is_empty() {
        bail!("{} holds no labeled frame", args.data.data.display());
    }
    dataset.check_camera().context("choose one with --camera")?;
    let track = Track::new(&dataset.frames, args.rate)
        .context("the frames have no recorded times: give --rate, such as --rate 5")?;
    let runtime = tokio::runtime::Runtime::new()?;
    let played = runtime.block_on(play(args, dataset, &track));
    runtime.shutdown_background();
    let (report, tally) = played?;
    if args.json {
        say!("{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        report.print()?;
    }
    if let Some(path) = &args.html {
        fs::write(path, page::html(&report, &tally)).with_context(|| path.display().to_string())?;
    }
    Ok(report.gates_hold()?)
}

/// The way frames go.
enum Way {
    Stream(Vec<Stream>),
    Lasting(Vec<LastingStream>),
    Rest(Client),
}

async fn play(args: &ReplayArgs, dataset: Dataset, track: &Track) -> anyhow::Result<(Report, Tally)> {
    let client = args.service.client(&args.url)?;
    let rooms = dataset.rooms();
    // Connected before the clock runs.
    let way = connect(args, client.clone()).await.with_context(|| format!("cannot play to {}", args.url))?;
    let setting = setting(args, &way, &rooms).await;
    let drive = Arc::new(Drive {
        frames: Arc::new(tokio::task::spawn_blocking(|| Frames::load(dataset.frames)).await?),
        tally: Mutex::new(Tally::new()?),
        start: (Instant::now(), SystemTime::now()),
        is_paced: args.rate != Rate::Max,
        end: end(args)?,
    });
    let (stop, stopped) = watch::channel(false);
    let feeds = (0..args.robots).map(|robot_idx| feed(args, &drive, track, robot_idx, &stopped));
    let mut robots = JoinSet::new();
    match way {
        Way::Stream(streams) => {
            for (feed, stream) in feeds.zip(streams) {
                robots.spawn(robot::stream(drive.clone(), feed, stream));
            }
        }
        Way::Lasting(streams) => {
            for (feed, stream) in feeds.zip(streams) {
                robots.spawn(lasting::stream(drive.clone(), feed, stream));
            }
        }
        Way::Rest(client) => {
            let connections = Arc::new(Semaphore::new(args.connections));
            for feed in feeds {
                robots.spawn(robot::post(drive.clone(), feed, client.clone(), connections.clone()));
            }
        }
    }
    watch_over(args, track, &drive, robots, stop).await;
    let duration = drive.start.0.elapsed();
    let mut tally = Tally::new()?;
    std::mem::swap(&mut *drive.tally(), &mut tally);
    let mut report = Report::new(setting, duration, &tally);
    report.judge(&args.gates);
    Ok((report, tally))
}

async fn connect(args: &ReplayArgs, client: Client) -> Result<Way, ClientError> {
    if args.transport == Transport::Rest {
        // Whether it is there at all.
        client.is_ready().await?;
        return Ok(Way::Rest(client));
    }
    if let Some(patience) = args.patience.map(Duration::from_secs) {
        let mut streams = Vec::with_capacity(args.robots);
        for robot_idx in 0..args.robots {
            streams.push(client.lasting_stream(&configure(args, robot_idx), patience).await?);
        }
        return Ok(Way::Lasting(streams));
    }
    let mut streams = Vec::with_capacity(args.robots);
    for robot_idx in 0..args.robots {
        streams.push(client.stream(&configure(args, robot_idx)).await?);
    }
    Ok(Way::Stream(streams))
}

fn configure(args: &ReplayArgs, robot_idx: usize) -> Configure {
    Configure {
        robot: Some(robot_name(robot_idx)),
        model: args.model.clone(),
        mode: args.mode.map(|mode| match mode {
            ModeName::Latest => Mode::Latest,
            ModeName::Lossless => Mode::Lossless,
            ModeName::Sampled => Mode::Sampled,
        }),
        interval_ms: args.interval,
        filter: (args.filter || args.no_filter).then_some(FilterChoice::Switch(args.filter)),
        ..Configure::default()
    }
}

fn robot_name(robot_idx: usize) -> String {
    format!("replay-{robot_idx}")
}

/// What the report says of the conditions.
async fn setting(args: &ReplayArgs, way: &Way, rooms: &[String]) -> Setting {
    let serving = match way {
        Way::Stream(streams) => streams.first().map(Stream::hello).map(Serving::from),
        Way::Lasting(streams) => streams.first().map(LastingStream::hello).map(Serving::from),
        // A robot's key may not be allowed to ask: then it stays open.
        Way::Rest(client) => serving(args, client).await,
    };
    let mode = args.mode.as_ref().and_then(ValueEnum::to_possible_value);
    let mode = mode.map_or("latest".to_owned(), |mode| mode.get_name().to_owned());
    let known: Option<BTreeSet<&String>> = serving.as_ref().map(|serving| serving.rooms.iter().collect());
    let is_unknown = |room: &&String| known.as_ref().is_some_and(|known| !known.contains(room));
    let (transport, rate) = (args.transport, args.rate);
    Setting {
        url: args.url.clone(),
        data: args.data.data.display().to_string(),
        simulated: data::is_simulated(&args.data.data),
        transport: if transport == Transport::Rest { "rest" } else { "stream" },
        rate: match rate {
            Rate::Recorded => "recorded".to_owned(),
            Rate::PerSecond(rate) => format!("{rate} frames/s"),
            Rate::Max => "max".to_owned(),
        },
        robots: args.robots,
        mode: (transport == Transport::Stream).then_some(mode),
        model: serving.as_ref().map(|serving| format!("{}/{}", serving.name, serving.version)),
        unknown_rooms: rooms.iter().filter(is_unknown).cloned().collect(),
    }
}

/// The model that answers.
struct Serving {
    name: String,
    version: u64,
    rooms: Vec<String>,
}

impl From<&Hello> for Serving {
    fn from(hello: &Hello) -> Self {
        Self { name: hello.model.name.clone(), version: hello.model.version, rooms: hello.rooms.clone() }
    }
}

async fn serving(args: &ReplayArgs, client: &Client) -> Option<Serving> {
    let list = client.models().await.ok()?;
    let name = args.model.as_ref().or(list.default.as_ref())?;
    let model = list.models.iter().find(|model| &model.name == name)?;
    let version = model.versions.iter().find(|version| Some(version.version) == model.serving)?;
    Some(Serving { name: name.clone(), version: version.version, rooms: version.rooms.clone()? })
}

fn end(args: &ReplayArgs) -> anyhow::Result<Duration> {
    let Some(seconds) = args.duration else { return Ok(Duration::MAX) };
    Duration::try_from_secs_f64(seconds).ok().with_context(|| format!("--duration {seconds} is no time"))
}

/// How many frames a robot sends; none where only the time or Ctrl-C ends it.
fn n_frames(args: &ReplayArgs, track: &Track) -> Option<usize> {
    let round = (!args.again).then(|| track.n_frames());
    round.into_iter().chain(args.limit).min()
}

fn feed(
    args: &ReplayArgs,
    drive: &Drive,
    track: &Track,
    robot_idx: usize,
    stopped: &watch::Receiver<bool>,
) -> Feed {
    let n_frames = n_frames(args, track).unwrap_or(usize::MAX);
    Feed {
        robot: robot_name(robot_idx),
        model: args.model.clone(),
        is_followed: robot_idx == 0,
        // Robots do not shoot at the same instant.
        offset: track.mean_gap().mul_f64(robot_idx as f64 / args.robots as f64),
        ahead: drive.frames.clone().ahead(track.schedule(robot_idx, n_frames, drive.end)),
        stopped: stopped.clone(),
    }
}

/// Shows the progress until all robots are done. Ctrl-C makes them send nothing more.
async fn watch_over(
    args: &ReplayArgs,
    track: &Track,
    drive: &Drive,
    mut robots: JoinSet<()>,
    stop: watch::Sender<bool>,
) {
    let bar = output::progress("replaying", n_frames(args, track).map_or(0, |n| n * args.robots));
    let mut ticks = interval(TICK);
    let mut stop_signal = pin!(serve::stop_signal());
    let mut is_stopped = false;
    loop {
        tokio::select! {
            robot = robots.join_next() => if robot.is_none() { break },
            () = &mut stop_signal, if !is_stopped => {
                is_stopped = true;
                stop.send_replace(true);
            }
            _ = ticks.tick() => {
                let tally = drive.tally();
                bar.set_position(tally.n_sent);
                let p99 = Percentiles::of(&tally.latency).map_or(0.0, |latency| latency.p99);
                let n_errors: u64 = tally.errors.values().sum();
                bar.set_message(format!(
                    "p99 {p99:.1} ms, {} dropped, {n_errors} errors, {} late",
                    tally.n_dropped(),
                    tally.n_late
                ));
            }
        }
    }
    bar.finish_and_clear();
}
