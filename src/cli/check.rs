//! `roomsight check`: what is odd about labeled pictures.

use super::contact_sheet::{self, Card, Section};
use super::data::{self, ConfigArgs, DataArgs, LimitArgs};
use super::output::{self, say};
use anyhow::Context;
use clap::Args;
use roomsight_lab::check::{Examined, Finding, Oddity};
use roomsight_lab::dataset::{Dataset, Described};
use roomsight_recognition::model::{
    Candidate, Extractor, Sample, TrainError, Unit, all_opinions, answer_held_out,
};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;

/// The most pictures of a kind that are printed; `--json` has all.
const MAX_PRINTED: usize = 12;

/// Look for what is odd about labeled frames: copies, blurred and covered pictures, labels that look wrong
///
/// Pictures are compared, and each is answered by models that were trained without it: where they say another room, surely,
/// the label may be wrong. Nothing is changed and no model is written. Frames of rooms that are wrong can be moved to another
/// folder, or into a folder called elsewhere.
#[derive(Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    limits: LimitArgs,
    #[command(flatten)]
    config: ConfigArgs,
    /// Only look at the pictures; do not doubt labels, which takes as long as training
    #[arg(long)]
    pictures_only: bool,
    /// Also write a page that shows the pictures
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Print all findings as JSON
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    data: PathBuf,
    n_frames: usize,
    n_by_room: BTreeMap<String, usize>,
    findings: Vec<Told>,
    /// Why labels were not doubted, if so.
    #[serde(skip_serializing_if = "Option::is_none")]
    labels_unchecked: Option<String>,
}

/// A finding, and what its kind means.
#[derive(Serialize)]
struct Told {
    #[serde(flatten)]
    finding: Finding,
    heading: &'static str,
}

/// Checks, and prints what was found.
pub(super) fn run(args: &CheckArgs) -> anyhow::Result<()> {
    let dataset = args.data.open(None)?;
    dataset.check_names(&[])?;
    dataset.check_camera()?;
    let limits = args.limits.limits();
    let candidates = args.config.candidates(&dataset)?;
    let config = all_opinions(&candidates).context("there is nothing to train")?;
    let camera = args.config.camera(&dataset, &limits)?;
    let described = data::describe_quietly(&dataset, &Extractor::new(&config, camera), &limits)?;
    let examined = Examined { dataset: &dataset, described: &described };
    let (labels, labels_unchecked) = if args.pictures_only {
        (Vec::new(), Some("--pictures-only".to_owned()))
    } else {
        match doubted(&examined, &candidates) {
            Ok(findings) => (findings, None),
            Err(error) => (Vec::new(), Some(error.to_string())),
        }
    };
    let findings = [labels, examined.pictures()].concat();
    if let Some(path) = &args.html {
        let title = format!("{}: what is odd", args.data.data.display());
        contact_sheet::write(path, &title, &sections(&dataset, &findings), &dataset, &limits)?;
    }
    let n_frames = described.samples.len();
    let n_by_room = n_by_room(&described);
    if args.json {
        let told = |finding: Finding| Told { heading: finding.oddity.heading(), finding };
        let findings = findings.into_iter().map(told).collect();
        let report = Report { data: args.data.data.clone(), n_frames, n_by_room, findings, labels_unchecked };
        say!("{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        print(&dataset, &n_by_room, &findings, labels_unchecked.as_deref())?;
    }
    Ok(())
}

/// Labels that held-out answers contradict: of single pictures, whose neighbors in a drive are the best witnesses, and of whole
/// drives.
fn doubted(examined: &Examined, candidates: &[Candidate]) -> Result<Vec<Finding>, TrainError> {
    let samples: Vec<&Sample> = examined.described.samples.iter().collect();
    let answered = |unit: Unit, what: &str| {
        let bar = output::progress(what, 1);
        let answers = answer_held_out(&samples, candidates, unit, |step| {
            bar.set_length(step.n_steps as u64);
            bar.set_position(step.n_done as u64);
        });
        bar.finish_and_clear();
        answers
    };
    let mut findings = examined.labels(&answered(Unit::Frames, "doubting labels")?);
    if samples.iter().any(|sample| sample.sequence != samples[0].sequence) {
        findings.extend(examined.drives(&answered(Unit::Drives, "doubting drives")?));
    }
    Ok(findings)
}

fn n_by_room(described: &Described) -> BTreeMap<String, usize> {
    let mut n_by_room = BTreeMap::new();
    for sample in &described.samples {
        *n_by_room.entry(sample.room.clone()).or_default() += 1;
    }
    n_by_room
}

/// The findings of each kind, the gravest kind first.
fn by_oddity(findings: &[Finding]) -> impl Iterator<Item = (Oddity, Vec<&Finding>)> {
    Oddity::ALL.into_iter().filter_map(|oddity| {
        let of_kind: Vec<&Finding> = findings.iter().filter(|finding| finding.oddity == oddity).collect();
        (!of_kind.is_empty()).then_some((oddity, of_kind))
    })
}

fn sections(dataset: &Dataset, findings: &[Finding]) -> Vec<Section> {
    let card = |finding: &&Finding| Card {
        picture: finding.picture.clone(),
        lines: vec![dataset.name_of(&finding.picture), finding.room.clone(), finding.detail.clone()],
        beside: finding.other.iter().map(|other| (other.clone(), dataset.name_of(other))).collect(),
    };
    let section = |(oddity, of_kind): (Oddity, Vec<&Finding>)| Section {
        heading: oddity.heading().to_owned(),
        cards: of_kind.iter().map(card).collect(),
    };
    by_oddity(findings).map(section).collect()
}

fn print(
    dataset: &Dataset,
    n_by_room: &BTreeMap<String, usize>,
    findings: &[Finding],
    labels_unchecked: Option<&str>,
) -> io::Result<()> {
    let least = n_by_room.iter().min_by_key(|(_, n_frames)| **n_frames);
    say!("{} frames of {} rooms.", n_by_room.values().sum::<usize>(), n_by_room.len())?;
    if let Some((room, n_frames)) = least {
        say!("Fewest: {n_frames} of {room}.")?;
    }
    for (oddity, of_kind) in by_oddity(findings) {
        say!("\n{}: {}", oddity.heading(), of_kind.len())?;
        for finding in of_kind.iter().take(MAX_PRINTED) {
            let mut line = format!("  {}", dataset.name_of(&finding.picture));
            if !finding.detail.is_empty() {
                line += &format!(": {}", finding.detail);
            }
            if let Some(other) = &finding.other {
                line += &format!(" (as {})", dataset.name_of(other));
            }
            say!("{line}")?;
        }
        if of_kind.len() > MAX_PRINTED {
            say!("  and {} more: see --html or --json", of_kind.len() - MAX_PRINTED)?;
        }
    }
    if findings.is_empty() {
        say!("\nNothing odd was found.")?;
    }
    if let Some(why) = labels_unchecked {
        say!("\nLabels were not doubted: {why}")?;
    }
    Ok(())
}
