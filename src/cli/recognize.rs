//! `roomsight recognize`: the room of single frames.

use super::data::{self, LimitArgs};
use super::output::{self, say};
use crate::model::{Model, Recognition, Scratch, Unknown};
use anyhow::bail;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Tell which room frames show
#[derive(Args)]
pub(super) struct RecognizeArgs {
    /// Folder of the model, as `train` wrote it, or of its versions, of which the highest answers
    model: PathBuf,
    /// Image files, or folders of them
    #[arg(required = true)]
    frames: Vec<PathBuf>,
    #[command(flatten)]
    limits: LimitArgs,
    /// How many of the most probable rooms to print
    #[arg(long, default_value_t = 3, value_parser = data::at_least(1))]
    top: usize,
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
}

/// Answers every frame that can be read; fails at the end when one could not.
pub(super) fn run(args: &RecognizeArgs) -> anyhow::Result<()> {
    let model = data::load_model(&args.model)?.model;
    let limits = args.limits.limits();
    let mut scratch = Scratch::default();
    let mut table = output::table(["frame", "room", "probability", "known", "keypoints", "others"]);
    let mut n_failed = 0;
    let mut frames = Vec::new();
    for path in &args.frames {
        if path.is_dir() {
            frames.extend(data::pictures_in(path)?);
        } else {
            frames.push(path.clone());
        }
    }
    for path in &frames {
        let recognition = match data::read_frame(path, model.extractor(), &limits) {
            Ok(image) => {
                if image.damaged_rows() > 0 {
                    eprintln!("{}: {} rows are damaged or missing", path.display(), image.damaged_rows());
                }
                model.recognize(&image, &mut scratch)
            }
            Err(error) => {
                eprintln!("{}", output::explained(&error));
                n_failed += 1;
                continue;
            }
        };
        let line = line(&model, path, &recognition, args.top);
        if args.json {
            say!("{}", serde_json::to_string(&line)?)?;
        } else {
            let others = line.probabilities.iter().skip(1);
            let others: Vec<String> = others.map(|(room, p)| format!("{room} {p:.2}")).collect();
            table.add_row([
                path.display().to_string(),
                line.room.to_owned(),
                format!("{:.2}", line.probability),
                line.unknown.map_or("yes".to_owned(), |why| format!("no: {why}")),
                line.keypoints.to_string(),
                others.join(", "),
            ]);
        }
    }
    if !args.json && n_failed < frames.len() {
        say!("{table}")?;
    }
    if n_failed > 0 {
        bail!("{n_failed} of {} frames could not be read", frames.len());
    }
    Ok(())
}

fn line<'a>(model: &'a Model, frame: &'a Path, recognition: &Recognition, top: usize) -> Line<'a> {
    let rooms = model.places().iter().map(String::as_str);
    let mut probabilities: Vec<(&str, f32)> = rooms.zip(recognition.probabilities.iter().copied()).collect();
    probabilities.sort_by(|a, b| b.1.total_cmp(&a.1));
    probabilities.truncate(top);
    Line {
        frame,
        room: &model.places()[recognition.place_idx],
        probability: recognition.probability(),
        known: recognition.known,
        unknown: recognition.unknown,
        novelty: recognition.novelty,
        keypoints: recognition.n_keypoints,
        probabilities,
    }
}
