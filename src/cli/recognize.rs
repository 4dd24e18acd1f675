//! `roomsight recognize`: the room of single frames, or of all of a recording.

mod recorded;

use super::data::{self, LimitArgs, RecordingArgs};
use super::output::{self, say};
use crate::cli::manners::note;
use anyhow::{bail, ensure};
use clap::Args;
use roomsight_lab::check::other_camera;
use roomsight_lab::dataset::{self, Frame, Taking};
use roomsight_protocol::rest::NearestFrame;
use roomsight_recognition::model::{
    self, Features, Model, N_NEAREST, NearFrame, PoseEstimate, Recognition, Scratch, Unknown, by_probability,
};
use roomsight_vision::image::Limits;
use serde::Serialize;
use std::io;
use std::path::{Path, PathBuf};

/// Tell which room frames show
///
/// Of a recording (MCAP, rosbag2, ROS 1 bags) all pictures of a topic are answered, in their order. With --output, the answers,
/// the filter's and what was seen go to a new recording beside the pictures, to be looked at in Foxglove.
#[derive(Args)]
pub(super) struct RecognizeArgs {
    /// Folder of the model, as `train` wrote it, or of its versions, of which the highest answers
    model: PathBuf,
    /// Image files, folders of them, or recordings
    #[arg(required = true)]
    frames: Vec<PathBuf>,
    /// Of one recording: write the answers and the pictures to this file, as MCAP
    #[arg(short, long, value_name = "MCAP", conflicts_with_all = ["explain", "json"])]
    output: Option<PathBuf>,
    /// With --output: let the filter take how far the robot went, by its odometry in the recording, instead of the time
    #[arg(long, requires = "output")]
    odometry: bool,
    #[command(flatten)]
    recordings: RecordingArgs,
    #[command(flatten)]
    limits: LimitArgs,
    /// How many of the most probable rooms to print
    #[arg(long, default_value_t = 3, value_parser = data::at_least(1))]
    top: usize,
    /// Also tell why: the training frames that are most like each frame, as each opinion of the model sees them, and where it
    /// was taken, of models that were trained on frames with poses
    #[arg(long)]
    explain: bool,
    /// Print the answers as JSON
    #[arg(long)]
    json: bool,
}

/// One line of `--json`.
#[derive(Serialize)]
struct Line<'a> {
    frame: &'a Path,
    room: &'a str,
    probability: f32,
    known: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    unknown: Option<Unknown>,
    #[serde(skip_serializing_if = "Option::is_none")]
    novelty: Option<f32>,
    keypoints: usize,
    probabilities: Vec<(&'a str, f32)>,
    #[serde(skip_serializing_if = "Option::is_none")]
    nearest: Option<Vec<NearestFrame>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pose: Option<PoseEstimate>,
}

/// Answers every frame that can be read; fails at the end when one could not.
pub(super) fn run(args: &RecognizeArgs) -> anyhow::Result<()> {
    let model = data::load_model(&args.model)?.model;
    let limits = args.limits.limits();
    let mut scratch = Scratch::default();
    let mut table = output::table(["frame", "room", "probability", "known", "others"]);
    let (mut reasons, mut n_failed) = (Vec::new(), 0);
    let frames = frames_of(args, &model)?;
    if let Some(output) = &args.output {
        let is_one = args.frames.len() == 1 && roomsight_recording::is_called_so(&args.frames[0]);
        ensure!(is_one, "--output takes one recording");
        return recorded::answer(&model, &frames, output, &limits);
    }
    for Asked { path, frame } in &frames {
        let features = match look(path, frame.as_ref(), &model, &limits, &mut scratch) {
            Ok(features) => features,
            Err(error) => {
                eprintln!("{}", output::explained(&error));
                n_failed += 1;
                continue;
            }
        };
        let recognition = model.classify(&features);
        let mut line = line(&model, path, &recognition, args.top);
        if args.explain {
            line.nearest = Some(nearest(&model, &features));
            line.pose = model.pose(&features);
        }
        if args.json {
            say!("{}", serde_json::to_string(&line)?)?;
        } else {
            let others = line.probabilities.iter().skip(1);
            let others: Vec<String> = others.map(|(room, p)| format!("{room} {p:.2}")).collect();
            table.add_row([
                output::path_cell(path),
                line.room.to_owned(),
                format!("{:.2}", line.probability),
                line.unknown.map_or("yes".to_owned(), |why| format!("no: {why}")),
                others.join(", "),
            ]);
            reasons.push(line);
        }
    }
    if !args.json && n_failed < frames.len() {
        output::keep_first_column(&mut table);
        say!("{table}")?;
    }
    if args.explain {
        reasons.iter().try_for_each(say_why)?;
    }
    if n_failed > 0 {
        bail!("{n_failed} of {} frames could not be read", frames.len());
    }
    Ok(())
}

/// What a model sees of a picture, and of the scan beside it.
fn look(
    path: &Path,
    frame: Option<&Frame>,
    model: &Model,
    limits: &Limits,
    scratch: &mut Scratch,
) -> anyhow::Result<Features> {
    let image = match frame {
        Some(frame) => recorded::read(frame, model, limits)?,
        None => data::read_frame(path, model.extractor(), limits)?,
    };
    if image.damaged_rows() > 0 {
        eprintln!("{}: {} rows are damaged or missing", path.display(), image.damaged_rows());
    }
    let aspect = image.width() as f64 / image.height() as f64;
    if let Some(why) = other_camera(model.camera().projection.kind(), aspect) {
        note!("note: {}: the model is of another camera: its shape is odd, {why}", path.display());
    }
    let scan = frame.map(|frame| recorded::scan(frame, model)).transpose()?.flatten();
    Ok(model.features(model::Frame { image: &image, scan: scan.as_deref() }, scratch))
}

/// A picture to be answered.
struct Asked {
    path: PathBuf,
    /// Of a recording; none where it is a file.
    frame: Option<Frame>,
}

/// All that are asked for.
fn frames_of(args: &RecognizeArgs, model: &Model) -> anyhow::Result<Vec<Asked>> {
    let mut frames = Vec::new();
    let file = |path: PathBuf| Asked { path, frame: None };
    for path in &args.frames {
        if roomsight_recording::is_called_so(path) {
            let taking =
                Taking { laser: model.wants_scans(), odometry: args.odometry, ..args.recordings.taking() };
            let dataset = dataset::open_for(path, model.rooms(), &taking)?.with_unlabeled();
            data::report_all(&dataset);
            let recorded = |frame: Frame| Asked { path: frame.path.clone(), frame: Some(frame) };
            frames.extend(dataset.frames.into_iter().map(recorded));
        } else if path.is_dir() {
            frames.extend(data::pictures_in(path)?.into_iter().map(file));
        } else {
            frames.push(file(path.clone()));
        }
    }
    Ok(frames)
}

/// Prints the reasons of an answer.
fn say_why(line: &Line) -> io::Result<()> {
    say!("\n{}: {}", line.frame.display(), line.room)?;
    if let Some(PoseEstimate { pose, radius }) = &line.pose {
        let angle = pose.angle.to_degrees();
        say!(
            "taken at ({:.2} m, {:.2} m), heading {angle:.0} degrees, give or take {radius:.2} m",
            pose.x,
            pose.y
        )?;
    }
    let mut table = output::table(["most like", "shows", "nearness", "keypoints", "as seen by"]);
    for near in line.nearest.iter().flatten() {
        let keypoints = if near.points.is_empty() { "-".to_owned() } else { near.points.len().to_string() };
        let frame = if near.frame.is_empty() { "a frame without a name" } else { &near.frame };
        let nearness = format!("{:.2}", near.nearness);
        table.add_row([frame, &near.room, &nearness, &keypoints, &near.opinion]);
    }
    say!("{table}")
}

fn nearest(model: &Model, features: &Features) -> Vec<NearestFrame> {
    let near = |near: NearFrame| NearestFrame {
        opinion: near.opinion,
        frame: near.name,
        drive: near.drive,
        room: model.rooms()[near.room_idx].clone(),
        nearness: near.nearness,
        points: near.points,
    };
    model.nearest(features, N_NEAREST).into_iter().map(near).collect()
}

fn line<'a>(model: &'a Model, frame: &'a Path, recognition: &Recognition, top: usize) -> Line<'a> {
    let room = |idx: usize| (model.rooms()[idx].as_str(), recognition.probabilities[idx]);
    let probabilities = by_probability(&recognition.probabilities, Some(top)).into_iter().map(room).collect();
    Line {
        frame,
        room: &model.rooms()[recognition.room_idx],
        probability: recognition.probability(),
        known: recognition.known,
        unknown: recognition.unknown,
        novelty: recognition.novelty,
        keypoints: recognition.n_keypoints,
        probabilities,
        nearest: None,
        pose: None,
    }
}
