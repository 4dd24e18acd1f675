//! `roomsight describe`: frames to files with what was seen of them.

use super::data::{self, ConfigArgs, DataArgs, LimitArgs};
use super::output::{self, say};
use anyhow::{Context, bail};
use clap::Args;
use roomsight_lab::dataset::{Dataset, Shard};
use roomsight_lab::part::Part;
use roomsight_lab::simulate::MARKER_FILE;
use roomsight_recognition::model::{Extractor, all_opinions};
use serde::Serialize;
use std::fs;
use std::path::PathBuf;

/// Describe frames once, into files that stand in for the pictures
///
/// The heavy part of training, which many machines can share: each describes a part of the same data into the same folder
/// (--part 1/8, 2/8, ...). The folder of parts is then a data set for train, evaluate, validate, tune and check, which give what they
/// give for the pictures, with the same options. A part that is there already is kept, if nothing of it has changed.
#[derive(Args)]
pub(super) struct DescribeArgs {
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    limits: LimitArgs,
    #[command(flatten)]
    config: ConfigArgs,
    /// Folder for the parts, made where it is not there
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Which part of the frames, and of how many
    #[arg(long, value_name = "NUMBER/OF", default_value_t = Part::WHOLE)]
    part: Part,
    /// Describe as this model looks at frames, to measure it or to add to it, instead of for training anew
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["config", "parameters", "opinions", "effort", "mask", "camera"])]
    like: Option<PathBuf>,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    output: PathBuf,
    part: Part,
    n_frames: usize,
    /// Whether it was there already.
    was_there: bool,
}

/// Describes a part, unless it is there.
pub(super) fn run(args: &DescribeArgs) -> anyhow::Result<()> {
    let limits = args.limits.limits();
    let (dataset, extractor) = match &args.like {
        Some(folder) => {
            let model = data::load_model(folder)?.model;
            let dataset = args.data.open(Some(&model))?;
            dataset.check_names(model.rooms())?;
            (dataset, model.extractor().clone())
        }
        None => {
            let dataset = args.data.open(None)?;
            dataset.check_names(&[])?;
            dataset.check_camera()?;
            let candidates = args.config.candidates(&dataset)?;
            let config = all_opinions(&candidates).context("there is nothing to describe for")?;
            let camera = args.config.camera(&dataset, &limits)?;
            (dataset, Extractor::new(&config, camera))
        }
    };
    if dataset.described_projection().is_some() {
        bail!("{} is described already", args.data.data.display());
    }
    let n_frames = dataset.frames.len();
    let dataset = dataset.with_part(args.part);
    if dataset.frames.is_empty() {
        bail!("part {} of {n_frames} frames is empty: make fewer parts", args.part);
    }
    // Before they are read: of a picture that changes meanwhile it is not known which one was seen.
    let key = dataset.part_key(&extractor);
    let before = Shard::find(&args.output, args.part, &key);
    let was_there = before.is_some();
    let shard = match before {
        Some(shard) => shard,
        None => described(args, &dataset, key, &extractor)?,
    };
    if args.json {
        let (output, n_frames) = (args.output.clone(), shard.n_frames());
        let report = Report { output, part: args.part, n_frames, was_there };
        return Ok(say!("{}", serde_json::to_string_pretty(&report)?)?);
    }
    let folder = output::quoted(&args.output);
    let verb = if was_there { "is there already" } else { "is written" };
    say!("Part {} {verb}: {} frames in {folder}.", args.part, shard.n_frames())?;
    if args.part == Part::WHOLE && args.like.is_none() {
        say!("To train on it: {} train {folder} -o MODEL", output::program())?;
    }
    Ok(())
}

fn described(
    args: &DescribeArgs,
    dataset: &Dataset,
    key: String,
    extractor: &Extractor,
) -> anyhow::Result<Shard> {
    let described = data::describe(dataset, extractor, &args.limits.limits())?;
    let shard = dataset.write_part(args.part, key, &described, extractor, &args.output)?;
    if data::is_simulated(&args.data.data) {
        let marker = args.output.join(MARKER_FILE);
        fs::write(&marker, "Described from simulated frames.\n")
            .with_context(|| marker.display().to_string())?;
    }
    Ok(shard)
}
