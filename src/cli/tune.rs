//! `roomsight tune`: parameters by cross-validation.

use super::data::{self, ConfigArgs, DataArgs};
use super::output::{self, say};
use crate::camera::Camera;
use crate::dataset::{Dataset, Described};
use crate::evaluate::Summary;
use crate::model::{Config, Extractor};
use crate::validate::{self, Protocol};
use anyhow::{Context, bail};
use clap::Args;
use serde::Serialize;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// What is tried when nothing is asked for.
const DEFAULT_TRIES: [&str; 2] = ["classifier.c=0.1,1,10", "representation.n_words=300,1000"];

/// The most configurations that are tried; one more list of values multiplies them.
const MAX_CONFIGS: usize = 1000;

/// Find parameters by cross-validation over sequences, and write them as a configuration
///
/// Every combination of the values is trained on some sequences and answers the others. The rate of the best
/// one is flattering, since it was chosen by it: measure it on sequences that had no part in this, with
/// `validate --config` or `evaluate`.
#[derive(Args)]
pub(super) struct TuneArgs {
    #[command(flatten)]
    data: DataArgs,
    /// File for the best configuration, as TOML, for --config
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Values of one parameter, such as classifier.c=0.1,1,10; give it as often as needed [default:
    /// classifier.c=0.1,1,10 and representation.n_words=300,1000]
    #[arg(long = "try", value_name = "NAME=VALUE,...")]
    tries: Vec<String>,
    /// Into how many folds the sequences are dealt
    #[arg(long, default_value_t = 5, value_name = "N", value_parser = data::at_least(2))]
    folds: usize,
    /// How often to repeat, with seeds 0, 1, 2, ...
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    #[command(flatten)]
    config: ConfigArgs,
    /// Print the rates as JSON
    #[arg(long)]
    json: bool,
}

/// One combination of values, and how it did.
#[derive(Serialize)]
struct Tried {
    /// As `NAME=VALUE`.
    parameters: Vec<String>,
    /// Over the seeds.
    rate: Option<Summary>,
    /// Over the seeds, of the mean of the rooms' rates.
    mean_by_place: Option<Summary>,
    #[serde(skip)]
    config: Config,
}

/// Tries all combinations, prints them, and writes the best.
pub(super) fn run(args: &TuneArgs) -> anyhow::Result<()> {
    if args.output.exists() {
        bail!("{} exists already: choose another file", args.output.display());
    }
    let tries =
        if args.tries.is_empty() { DEFAULT_TRIES.map(str::to_owned).to_vec() } else { args.tries.clone() };
    // All configurations are read before the long work starts.
    let configs: Vec<(Vec<String>, Config)> = combinations(&tries)?
        .into_iter()
        .map(|parameters| Ok((parameters.clone(), args.config.read_with(&parameters)?)))
        .collect::<anyhow::Result<_>>()?;
    let dataset = args.data.open(None)?;
    dataset.check()?;
    let camera = args.config.camera(&dataset)?;
    let mut tuner = Tuner { args, dataset: &dataset, camera, described: None };
    let bar = output::progress("trying", configs.len());
    let mut tried = Vec::new();
    for (parameters, config) in configs {
        bar.set_message(parameters.join(" "));
        tried.push(tuner.measure(parameters, config)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let Some(best) = best_of(&tried) else { bail!("nothing could be measured") };
    write_new(&args.output, &toml::to_string_pretty(&best.config)?)?;
    if args.json {
        say!("{}", serde_json::to_string_pretty(&tried)?)?;
    } else {
        print(&tried, best, &args.output)?;
    }
    Ok(())
}

/// Every combination of the values of `NAME=VALUE,...` lists, the last list changing fastest.
fn combinations(tries: &[String]) -> anyhow::Result<Vec<Vec<String>>> {
    let mut combinations = vec![Vec::new()];
    for list in tries {
        let (name, values) =
            list.split_once('=').with_context(|| format!("{list}: give NAME=VALUE,VALUE"))?;
        let extended = combinations.iter().flat_map(|parameters: &Vec<String>| {
            values.split(',').map(move |value| [&parameters[..], &[format!("{name}={value}")]].concat())
        });
        combinations = extended.collect();
        if combinations.len() > MAX_CONFIGS {
            bail!("more than {MAX_CONFIGS} combinations: try fewer values at once");
        }
    }
    Ok(combinations)
}

struct Tuner<'a> {
    args: &'a TuneArgs,
    dataset: &'a Dataset,
    camera: Camera,
    /// The frames as the last configuration described them.
    described: Option<(Config, Described)>,
}

impl Tuner<'_> {
    fn measure(&mut self, parameters: Vec<String>, config: Config) -> anyhow::Result<Tried> {
        let described = match self.described.take() {
            Some((before, described)) if before.extraction() == config.extraction() => described,
            _ => data::describe(self.dataset, &Extractor::new(&config, self.camera.clone()))?,
        };
        let (_, described) = self.described.insert((config.clone(), described));
        let (mut rates, mut means) = (Vec::new(), Vec::new());
        for seed in 0..self.args.seeds {
            let rounds = validate::rounds(&described.samples, &Protocol::Sequences(self.args.folds), seed);
            if rounds.is_empty() {
                bail!("no room has sequences both to train and to answer: drive through the rooms again");
            }
            let config = Config { seed, ..config.clone() };
            let answers = validate::run(&described.samples, &rounds, (&config, &self.camera), || ())?;
            let evaluation = validate::evaluate(self.dataset, described, &answers);
            rates.extend(evaluation.overall.rate);
            means.extend(evaluation.mean_by_place);
        }
        Ok(Tried { parameters, rate: Summary::of(&rates), mean_by_place: Summary::of(&means), config })
    }
}

/// The highest mean rate, the first of equal ones.
fn best_of(tried: &[Tried]) -> Option<&Tried> {
    let mean = |tried: &Tried| tried.rate.map_or(f64::NEG_INFINITY, |rate| rate.mean);
    tried.iter().rev().max_by(|a, b| mean(a).total_cmp(&mean(b)))
}

fn write_new(path: &Path, text: &str) -> anyhow::Result<()> {
    let write = || OpenOptions::new().write(true).create_new(true).open(path)?.write_all(text.as_bytes());
    write().with_context(|| path.display().to_string())
}

fn print(tried: &[Tried], best: &Tried, output: &Path) -> anyhow::Result<()> {
    let mut table = output::table(["", "mean", "std", "by room"]);
    let digits = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
    for tried in tried {
        table.add_row([
            tried.parameters.join(" "),
            digits(tried.rate.map(|rate| rate.mean)),
            digits(tried.rate.and_then(|rate| rate.std)),
            digits(tried.mean_by_place.map(|rate| rate.mean)),
        ]);
    }
    say!("{table}")?;
    say!("\nBest: {}. {} holds it, for --config.", best.parameters.join(" "), output.display())?;
    say!("Its rate is flattering: measure it on sequences that had no part in this.")?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_combined_and_bad_lists_named() {
        let lists =
            |lists: &[&str]| combinations(&lists.iter().map(|&list| list.to_owned()).collect::<Vec<_>>());
        let combined = lists(&["classifier.c=1,10", "seed=2"]).unwrap();
        assert_eq!(combined, [["classifier.c=1", "seed=2"], ["classifier.c=10", "seed=2"]]);
        assert!(lists(&["classifier.c"]).unwrap_err().to_string().contains("NAME=VALUE"));
        let ten = "seed=1,2,3,4,5,6,7,8,9,10";
        assert!(lists(&[ten; 4]).unwrap_err().to_string().contains("fewer values"));
    }
}
