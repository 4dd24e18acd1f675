//! `roomsight demo`: the whole way from frames to answers over HTTP, in about a minute.
//!
//! Every step but the drive is one of the commands, echoed as it could be typed.

mod robots;

use super::output::{program, quoted, say};
use super::serve;
use crate::http::{self, App};
use crate::settings::Settings;
use anyhow::{Context, bail, ensure};
use clap::Args;
use robots::Robot;
use roomsight_lab::dataset::{self, Frame};
use roomsight_protocol::inbox::InboxRule;
use serde::Deserialize;
use std::fs;
use std::future::{Future, pending};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::runtime::Runtime;
use tokio::sync::oneshot;
use tokio::task::spawn_blocking;
use tokio::time::{MissedTickBehavior, interval};

const DRIVES: &str = "cloudy1,cloudy2,cloudy3,night1,sunny1";
const TRAINED_ON: &str = "*cloudy1,*cloudy2";
const EVALUATED_ON: &str = "*cloudy3,*night1,*sunny1";
const DRIVEN: &str = "*night1";

/// A frame every 0.6 m: enough to tell four rooms apart, few enough for a demo.
const FRAMES_PER_SECOND: &str = "0.5";

/// Between two frames of the drive: slow enough to watch, much faster than a robot.
const PACE: Duration = Duration::from_millis(60);

/// Longer than any answer takes on a machine that works.
const PATIENCE: Duration = Duration::from_secs(10);

/// Show everything in about a minute: simulate, train, evaluate, serve, and post frames like a robot
///
/// Simulates a lab, trains on cloudy drives through it, evaluates on other drives in other light, serves
/// the model and posts the frames of a drive by night one by one. Then it goes on serving until Ctrl-C, while robots drive
/// through the lab, so that you can see them on the service's page. All figures are of simulated frames.
#[derive(Args)]
pub(super) struct DemoArgs {
    /// End after the drive instead of going on serving
    #[arg(long)]
    exit: bool,
    /// Where to listen, on this machine only [default: 127.0.0.1:8080; with --exit any free port]
    #[arg(long, value_name = "HOST:PORT", value_parser = loopback)]
    listen: Option<SocketAddr>,
    /// Keep frames and models in this folder; a next demo takes the frames from it [default: a temporary
    /// folder]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

/// Runs the demo until its end, or until told to stop.
pub(super) fn run(args: &DemoArgs) -> anyhow::Result<()> {
    let runtime = Runtime::new()?;
    let temporary;
    let folder = match &args.data {
        Some(folder) => folder,
        None => {
            temporary = TempDir::with_prefix("roomsight-demo-")?;
            &temporary.path().to_owned()
        }
    };
    let result = runtime.block_on(show(args, Files::new(folder)));
    // Whoever stops the demo does not want to wait for the training.
    runtime.shutdown_background();
    result
}

/// Where things lie.
#[derive(Clone)]
struct Files {
    frames: PathBuf,
    models: PathBuf,
    /// What the service keeps.
    data: PathBuf,
    /// A version that is not there yet.
    model: PathBuf,
}

impl Files {
    fn new(folder: &Path) -> Self {
        let models = folder.join("models");
        let mut version = 1;
        let model = loop {
            let model = models.join(format!("demo/{version}"));
            if !model.exists() {
                break model;
            }
            version += 1;
        };
        Self { frames: folder.join("frames"), data: folder.join("data"), models, model }
    }
}

async fn show(args: &DemoArgs, files: Files) -> anyhow::Result<()> {
    // Before the work, so that an address that is taken is told at once.
    let listener = serve::listen(args.listen.unwrap_or(default_address(args.exit)))?;
    let url = format!("http://{}", listener.local_addr()?);
    let to_prepare = files.clone();
    match unless_stopped(spawn_blocking(move || prepare(&to_prepare))).await {
        Some(prepared) => prepared??,
        None => return Ok(()),
    }
    let drive_frames = dataset::open(&files.frames)?.with_sequences(DRIVEN)?.frames;

    let (models, data) = (files.models.clone(), files.data.clone());
    let app = App::start(Settings { models, data, ..Settings::default() })?;
    let (stop, stopped) = oneshot::channel::<()>();
    let service = tokio::spawn(http::serve(app, listener, async {
        // A sender that is dropped says stop as well.
        stopped.await.unwrap_or(());
    }));
    let story = async {
        drive(&url, &drive_frames).await?;
        if !args.exit {
            let frame = drive_frames.first().context("the drive has no frame")?;
            keep_doubted(&url).await?;
            let _driving = robots::drive(&url, robots_of(&files)?);
            suggest(&url, &files, &frame.path)?;
            pending::<()>().await;
        }
        anyhow::Ok(())
    };
    let told = unless_stopped(story).await;
    drop(stop);
    service.await?.context("the service failed")?;
    told.unwrap_or(Ok(()))
}

/// What comes of the work, or none where the process is told to stop before it is done.
async fn unless_stopped<T>(work: impl Future<Output = T>) -> Option<T> {
    tokio::select! {
        result = work => Some(result),
        () = serve::stop_signal() => None,
    }
}

/// Simulates, trains, evaluates.
fn prepare(files: &Files) -> anyhow::Result<()> {
    let (frames, model) = (files.frames.as_path(), files.model.as_path());
    say!("A robot drives through a lab that does not exist: every figure below is of simulated frames.")?;
    command(&[
        "simulate".as_ref(),
        frames,
        "--camera=omni".as_ref(),
        format!("--illumination={DRIVES}").as_ref(),
        format!("--frames-per-second={FRAMES_PER_SECOND}").as_ref(),
    ])?;
    say!("\nTrain on two drives under clouds.")?;
    let sequences = format!("--sequences={TRAINED_ON}");
    command(&["train".as_ref(), frames, sequences.as_ref(), "--output".as_ref(), model])?;
    say!("\nEvaluate on other drives, in other light.")?;
    let sequences = format!("--sequences={EVALUATED_ON}");
    command(&["evaluate".as_ref(), model, frames, sequences.as_ref()])
}

/// Echoes a command as it could be typed, and runs it.
fn command(arguments: &[&Path]) -> anyhow::Result<()> {
    let typed: Vec<String> = arguments.iter().map(|argument| quoted(argument)).collect();
    say!("\n$ {} {}", program(), typed.join(" "))?;
    super::parse_and_run(arguments)
}

/// What the demo reads of an answer.
#[derive(Deserialize)]
struct Answer {
    room: String,
    known: bool,
    probability: f32,
}

/// Posts the frames in their order and prints the answers as they come.
async fn drive(url: &str, frames: &[Frame]) -> anyhow::Result<()> {
    ensure!(!frames.is_empty(), "the drive has no frame");
    let url = format!("{url}/v1/recognize?robot=demo");
    say!("\nNow the robot drives by night and posts every simulated frame to {url}\n")?;
    let client = roomsight_client::http(PATIENCE).build()?;
    let mut pace = interval(PACE);
    pace.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let width = frames.iter().map(|frame| frame.room.len()).max().unwrap_or(0);
    say!("frame  {:width$}  {:width$}  probability  known        ms", "is in", "is told")?;
    let mut latencies = Vec::new();
    let mut n_correct = 0;
    for (frame_idx, frame) in frames.iter().enumerate() {
        let bytes = fs::read(&frame.path).with_context(|| frame.path.display().to_string())?;
        pace.tick().await;
        let posted = Instant::now();
        let answer = post(&client, &url, bytes).await?;
        let latency_ms = posted.elapsed().as_secs_f64() * 1000.0;
        latencies.push(latency_ms);
        let is_correct = answer.room == frame.room;
        n_correct += usize::from(is_correct);
        let Answer { room, known, probability } = answer;
        let (known, remark) = (if known { "yes" } else { "no" }, if is_correct { "" } else { "  wrong" });
        say!(
            "{frame_idx:5}  {:width$}  {room:width$}  {probability:11.2}  {known:5}  {latency_ms:8.1}{remark}",
            frame.room
        )?;
    }
    latencies.sort_by(f64::total_cmp);
    let (median, largest) = (latencies[latencies.len() / 2], latencies[latencies.len() - 1]);
    let rate = n_correct as f64 / frames.len() as f64;
    say!(
        "\n{n_correct} of {} simulated frames answered correctly ({rate:.4}). \
         Latency: median {median:.1} ms, largest {largest:.1} ms.",
        frames.len()
    )?;
    Ok(())
}

/// Lets the inbox keep what the model doubts: nobody lives in the lab.
async fn keep_doubted(url: &str) -> anyhow::Result<()> {
    let rule = InboxRule { all: true, ..InboxRule::default() };
    let client = roomsight_client::http(PATIENCE).build()?;
    let answer = client.put(format!("{url}/v1/inbox/rule")).json(&rule).send().await?;
    ensure!(answer.status().is_success(), "the service answered {}", answer.status());
    Ok(())
}

/// A robot for each drive that did not train, named after its light.
fn robots_of(files: &Files) -> anyhow::Result<Vec<Robot>> {
    let frames = dataset::open(&files.frames)?.with_sequences(EVALUATED_ON)?.frames;
    let mut robots: Vec<Robot> = Vec::new();
    for frame in frames {
        let name = frame.sequence.rsplit('_').next().unwrap_or(&frame.sequence);
        match robots.iter_mut().find(|robot| robot.name == name) {
            Some(robot) => robot.frames.push(frame),
            None => robots.push(Robot { name: name.to_owned(), frames: vec![frame] }),
        }
    }
    Ok(robots)
}

async fn post(client: &reqwest::Client, url: &str, frame: Vec<u8>) -> anyhow::Result<Answer> {
    let request = client.post(url).header("content-type", "image/jpeg").body(frame);
    let response = request.send().await?;
    let status = response.status();
    if !status.is_success() {
        bail!("the service answered {status}: {}", response.text().await?);
    }
    Ok(response.json().await?)
}

/// Says what to try while the service runs.
fn suggest(url: &str, files: &Files, frame: &Path) -> anyhow::Result<()> {
    let (program, model) = (program(), quoted(&files.model));
    let form = quoted(Path::new(&format!("frame=@{}", frame.display())));
    let frame = quoted(frame);
    if http::has_page() {
        say!(
            "\nThe service runs on, and simulated robots drive through the lab. Watch them in a browser:\n\n  {url}/\n"
        )?;
        say!("In another terminal, in this folder, try:\n")?;
    } else {
        say!(
            "\nThe service runs on, without its page, which takes Node 20. In another terminal, in this folder, try:\n"
        )?;
    }
    say!("  curl -F {form} {url}/v1/recognize\n")?;
    say!("  {program} recognize {model} {frame}\n")?;
    say!("  {program} inspect {frame} --model {model} --output seen.png\n")?;
    say!("Read what the service can do: {url}/docs\n")?;
    say!("Train on your own rooms, with a folder of frames for each room in MY_ROOMS, and serve them:\n")?;
    say!("  {program} train MY_ROOMS --output models/mine/1")?;
    say!("  {program} serve --models models --model mine --listen 127.0.0.1:8081\n")?;
    say!("Ctrl-C ends the demo.")?;
    Ok(())
}

fn default_address(exit: bool) -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], if exit { 0 } else { 8080 }))
}

/// The demo has no keys: nobody else may reach it.
fn loopback(text: &str) -> Result<SocketAddr, String> {
    match text.parse::<SocketAddr>() {
        Ok(address) if address.ip().is_loopback() => Ok(address),
        Ok(_) => Err("the demo serves this machine only, such as 127.0.0.1:8081".to_owned()),
        Err(_) => Err("give an address and a port, such as 127.0.0.1:8081".to_owned()),
    }
}
