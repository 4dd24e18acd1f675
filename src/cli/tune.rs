//! `roomsight tune`: parameters by cross-validation.

use super::data::{self, ConfigArgs, DataArgs, FoldArgs, LimitArgs};
use super::output::{self, say};
use crate::camera::Camera;
use crate::dataset::{Dataset, Described};
use crate::evaluate::Summary;
use crate::model::{Classifier, Config, Extractor, Representation, TrainError};
use crate::svm::{InnerKernel, KernelConfig, KernelFunction, MatchConfig};
use crate::validate::{self, Method, Protocol};
use anyhow::{Context, bail};
use clap::Args;
use serde::Serialize;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

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
    #[command(flatten)]
    limits: LimitArgs,
    /// File for the best configuration, as TOML, for --config
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Values of one parameter, such as classifier.c=0.1,1,10; give it as often as needed [default: some for the
    /// cost of errors, gamma and the number of words, as far as the configuration has them]
    #[arg(long = "try", value_name = "NAME=VALUE,...")]
    tries: Vec<String>,
    #[command(flatten)]
    folds: FoldArgs,
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
    /// Why it cannot be trained, if so.
    impossible: Option<String>,
    #[serde(skip)]
    config: Config,
}

/// Tries all combinations, prints them, and writes the best.
pub(super) fn run(args: &TuneArgs) -> anyhow::Result<()> {
    if args.output.exists() {
        bail!("{} exists already: choose another file", args.output.display());
    }
    let tries = if args.tries.is_empty() { default_tries(&args.config.read()?) } else { args.tries.clone() };
    // All configurations are read before the long work starts.
    let configs: Vec<(Vec<String>, Config)> = combinations(&tries)?
        .into_iter()
        .map(|parameters| Ok((parameters.clone(), args.config.read_with(&parameters)?)))
        .collect::<anyhow::Result<_>>()?;
    let dataset = args.data.open(None)?;
    dataset.check()?;
    args.folds.check(&dataset)?;
    let camera = args.config.camera(&dataset, &args.limits.limits())?;
    let mut tuner = Tuner { args, dataset: &dataset, camera, described: None };
    let bar = output::progress("trying", configs.len());
    let mut tried = Vec::new();
    for (parameters, config) in configs {
        bar.set_message(parameters.join(" "));
        tried.push(tuner.measure(parameters, config)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let Some(best) = best_of(&tried) else {
        let reason = tried.iter().find_map(|tried| tried.impossible.as_deref());
        bail!("no combination can be trained: {}", reason.unwrap_or("nothing was tried"));
    };
    write_new(&args.output, &toml::to_string_pretty(&best.config)?)?;
    if args.json {
        say!("{}", serde_json::to_string_pretty(&tried)?)?;
    } else {
        print(&tried, best, &args.output)?;
    }
    Ok(())
}

/// What is tried when nothing is asked for.
fn default_tries(config: &Config) -> Vec<String> {
    let Some(machines) = config.machines() else { return Vec::new() };
    let of_classifier: &[&str] = match &machines.classifier {
        Classifier::LinearSvm(_) => &["classifier.c=0.1,1,10"],
        Classifier::KernelSvm(KernelConfig { kernel, .. }) => match kernel {
            KernelFunction::Linear | KernelFunction::HistogramIntersection => {
                &["classifier.machines.c=0.1,1,10"]
            }
            _ => &["classifier.machines.c=1,10", "classifier.kernel.gamma=0.5,2,8"],
        },
        Classifier::MatchSvm(MatchConfig { inner: InnerKernel::Linear, .. }) => {
            &["classifier.machines.c=0.1,1,10"]
        }
        Classifier::MatchSvm(_) => &["classifier.machines.c=1,10", "classifier.inner.gamma=2,4,8"],
        Classifier::Boost(_) => &["classifier.n_rounds=50,200,800"],
    };
    let of_words: &[&str] = match machines.representation {
        Representation::Bag(_) => &["representation.n_words=300,1000"],
        Representation::Descriptors {} => &[],
    };
    of_classifier.iter().chain(of_words).map(|&list| list.to_owned()).collect()
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
            _ => {
                let extractor = Extractor::new(&config, self.camera.clone());
                data::describe_to_train(self.dataset, &extractor, &self.args.limits.limits())?
            }
        };
        let (_, described) = self.described.insert((config.clone(), described));
        let protocol = Protocol::Sequences(self.args.folds.folds);
        let (mut rates, mut means) = (Vec::new(), Vec::new());
        for seed in 0..self.args.folds.seeds {
            let rounds = validate::rounds(&described.samples, &protocol, seed);
            if rounds.is_empty() {
                bail!("no room has sequences both to train and to answer: drive through the rooms again");
            }
            let seeded = Config { seed, ..config.clone() };
            let method = Method::of(&seeded);
            let answers =
                validate::run(&described.samples, &rounds, &method, (&seeded, &self.camera), |_| ());
            let answers = match answers {
                Ok(answers) => answers.concat(),
                // The others may work.
                Err(error) => return Ok(Tried::impossible(parameters, config, &error)),
            };
            let evaluation = validate::evaluate(self.dataset, described, &answers);
            rates.extend(evaluation.overall.rate);
            means.extend(evaluation.mean_by_place);
        }
        let (rate, mean_by_place) = (Summary::of(&rates), Summary::of(&means));
        Ok(Tried { parameters, rate, mean_by_place, impossible: None, config })
    }
}

impl Tried {
    fn impossible(parameters: Vec<String>, config: Config, error: &TrainError) -> Self {
        Self { parameters, rate: None, mean_by_place: None, impossible: Some(error.to_string()), config }
    }
}

/// The highest mean rate, the first of equal ones; none where nothing could be trained.
fn best_of(tried: &[Tried]) -> Option<&Tried> {
    let rated = tried.iter().filter_map(|tried| Some((tried, tried.rate?.mean))).rev();
    rated.max_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(tried, _)| tried)
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
    for tried in tried {
        if let Some(reason) = &tried.impossible {
            say!("{}: cannot be trained, {reason}", tried.parameters.join(" "))?;
        }
    }
    say!("\nBest: {}. {} holds it, for --config.", best.parameters.join(" "), output.display())?;
    say!("Its rate is flattering: measure it on sequences that had no part in this.")?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_tried_by_default_fits_the_classifier() {
        let bag = ["kind=linear_svm", "kind=kernel_svm", "kernel={kind='sigmoid'}", "kind=boost"];
        let matching = ["kind=match_svm", "inner={kind='correlation', gamma=2}", "inner={kind='linear'}"];
        let configs = [("bag", "kernel_svm", &bag[..]), ("descriptors", "match_svm", &matching[..])];
        for (representation, classifier, changes) in configs {
            for change in changes {
                let kind = format!("classifier.kind={classifier}");
                let parameters =
                    [format!("representation.kind={representation}"), kind, format!("classifier.{change}")];
                let args = ConfigArgs::of_parameters(&parameters);
                let tries = default_tries(&args.read().unwrap());
                for combination in combinations(&tries).unwrap() {
                    args.read_with(&combination).unwrap();
                }
            }
        }
    }

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
