//! `roomsight tune`: parameters by cross-validation.

use super::data::{self, ConfigArgs, DataArgs, FoldArgs, LimitArgs};
use super::output::{self, say};
use anyhow::{Context, bail};
use clap::Args;
use roomsight_lab::dataset::{Dataset, Described};
use roomsight_lab::evaluate::Summary;
use roomsight_lab::validate::{self, Method, Protocol};
use roomsight_recognition::model::{
    Candidate, Config, Extractor, OpinionConfig, TrainError, Tries, all_opinions,
};
use roomsight_vision::camera::Camera;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The most configurations that are tried; one more list of values multiplies them.
const MAX_CONFIGS: usize = 1000;

/// Find parameters by cross-validation over sequences, and write them as a configuration
///
/// Models are trained on some sequences and answer the others. Without --try each opinion tries what it has to try, one
/// parameter after the other, answering alone; then the combinations of opinions that --effort has are tried. With --try
/// every combination of the values is. Of equal rates the configured values are taken, or else the cheaper ones. The rate of
/// the best is flattering, since it was chosen by it: measure it on sequences that had no part in this, with
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
    /// Values of one parameter, such as classifier.c=0.1,1,10 or opinions.vector.c=1,10; give it as often as needed
    /// [default: some for each opinion]
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

/// What may be tried: some values of parameters, or a combination of opinions.
#[derive(Clone, Serialize)]
struct Trial {
    /// What the combination of opinions is called, where it is one that an effort has.
    #[serde(skip_serializing_if = "Option::is_none")]
    candidate: Option<String>,
    /// As `NAME=VALUE`.
    parameters: Vec<String>,
    #[serde(skip)]
    config: Config,
}

impl Trial {
    fn name(&self) -> String {
        self.candidate.clone().unwrap_or_else(|| self.parameters.join(" "))
    }
}

/// How it did.
#[derive(Clone, Serialize)]
struct Tried {
    #[serde(flatten)]
    trial: Trial,
    /// Over the seeds.
    rate: Option<Summary>,
    /// Over the seeds, of the mean of the rooms' rates.
    #[serde(rename = "mean_by_place")]
    mean_by_room: Option<Summary>,
    /// Why it cannot be trained, if so.
    impossible: Option<String>,
    /// Whether it is what was written.
    taken: bool,
}

/// Which one is taken of some that were tried, by their indices.
struct Choice {
    taken: usize,
    /// All that have its rate, in their order; it is one of them.
    equal: Vec<usize>,
    /// Why it is taken of these.
    reason: &'static str,
}

/// Tries what there is to try, prints it, and writes the best.
pub(super) fn run(args: &TuneArgs) -> anyhow::Result<()> {
    if args.output.exists() {
        bail!("{} exists already: choose another file", args.output.display());
    }
    // All configurations are read before the long work starts.
    let grid: Vec<Trial> = match &args.tries[..] {
        [] => Vec::new(),
        tries => {
            let base = args.config.read()?;
            let with = |parameters| args.trial(&base, parameters);
            combinations(tries)?.into_iter().map(with).collect::<anyhow::Result<_>>()?
        }
    };
    let dataset = args.data.open(None)?;
    dataset.check()?;
    args.folds.check(&dataset)?;
    let camera = args.config.camera(&dataset, &args.limits.limits())?;
    let candidates = if grid.is_empty() { args.config.candidates(&dataset)? } else { Vec::new() };
    let n_steps = grid.len() + n_tries(&candidates);
    let bar = output::progress("trying", n_steps);
    let (described, tried, choices) = (None, Vec::new(), Vec::new());
    let mut tuner = Tuner { args, dataset: &dataset, camera, described, bar, tried, choices };
    let taken = if candidates.is_empty() {
        let base = args.config.read()?;
        tuner.best_of_all(grid, Some(&base))?
    } else {
        tuner.best_of_opinions(&candidates)?
    };
    tuner.bar.finish_and_clear();
    let Some(taken) = taken else {
        let reason = tuner.tried.iter().find_map(|tried| tried.impossible.as_deref());
        bail!("nothing of this can be trained: {}", reason.unwrap_or("nothing was tried"));
    };
    tuner.tried[taken].taken = true;
    write_new(&args.output, &toml::to_string_pretty(&tuner.tried[taken].trial.config)?)?;
    if args.json {
        say!("{}", serde_json::to_string_pretty(&tuner.tried)?)?;
    } else {
        print(&tuner.tried, &tuner.choices, &args.output)?;
    }
    Ok(())
}

impl TuneArgs {
    /// A configuration changed by these parameters.
    fn trial(&self, config: &Config, parameters: Vec<String>) -> anyhow::Result<Trial> {
        let config = self.config.with(config, &parameters)?;
        Ok(Trial { candidate: None, parameters, config })
    }
}

/// How much is tried by [`Tuner::best_of_opinions`].
fn n_tries(candidates: &[Candidate]) -> usize {
    let all = all_opinions(candidates).map(|config| config.opinions).unwrap_or_default();
    let values = all.values().flat_map(OpinionConfig::tries).map(|tries| tries.values.len());
    values.sum::<usize>() + candidates.len()
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
    bar: output::Progress,
    tried: Vec<Tried>,
    /// What was taken of what, the last of all at the end.
    choices: Vec<Choice>,
}

impl Tuner<'_> {
    /// The index of the best of these; `usual` is preferred to others that do as well. None where nothing can be trained.
    fn best_of_all(&mut self, trials: Vec<Trial>, usual: Option<&Config>) -> anyhow::Result<Option<usize>> {
        let first = self.tried.len();
        for trial in trials {
            self.bar.set_message(trial.name());
            let before = self.tried.iter().find(|tried| tried.trial.config == trial.config).cloned();
            let tried = match before {
                Some(before) => Tried { trial, ..before },
                None => self.measure(trial)?,
            };
            self.tried.push(tried);
            self.bar.inc(1);
        }
        let choice = choose(&self.tried, first, usual);
        let taken = choice.as_ref().map(|choice| choice.taken);
        self.choices.extend(choice);
        Ok(taken)
    }

    /// The best of some candidates, after each of their opinions has tried what there is to try, one parameter after the
    /// other.
    fn best_of_opinions(&mut self, candidates: &[Candidate]) -> anyhow::Result<Option<usize>> {
        let Some(all) = all_opinions(candidates) else { return Ok(None) };
        let mut chosen: BTreeMap<&String, Vec<String>> = BTreeMap::new();
        for (name, opinion) in &all.opinions {
            let mut alone = all.with_opinions(|other| other == name);
            for Tries { parameter, values } in opinion.tries() {
                let with = |value: &&str| {
                    self.args.trial(&alone, vec![format!("opinions.{name}.{parameter}={value}")])
                };
                let trials = values.iter().map(with).collect::<anyhow::Result<_>>()?;
                if let Some(taken) = self.best_of_all(trials, Some(&alone))? {
                    let Trial { config, parameters, .. } = self.tried[taken].trial.clone();
                    alone = config;
                    chosen.entry(name).or_default().extend(parameters);
                }
            }
        }
        let with_chosen = |candidate: &Candidate| {
            let names = candidate.config.opinions.keys();
            let parameters = names.filter_map(|name| chosen.get(name)).flatten().cloned().collect();
            let trial = self.args.trial(&candidate.config, parameters)?;
            Ok(Trial { candidate: Some(candidate.name.clone()), ..trial })
        };
        let trials = candidates.iter().map(with_chosen).collect::<anyhow::Result<_>>()?;
        self.best_of_all(trials, None)
    }

    fn measure(&mut self, trial: Trial) -> anyhow::Result<Tried> {
        let described = match self.described.take() {
            Some((before, described)) if before.extraction() == trial.config.extraction() => described,
            _ => {
                let extractor = Extractor::new(&trial.config, self.camera.clone());
                data::describe_to_train(self.dataset, &extractor, &self.args.limits.limits())?
            }
        };
        let (_, described) = self.described.insert((trial.config.clone(), described));
        let protocol = Protocol::Sequences(self.args.folds.folds);
        let (mut rates, mut means) = (Vec::new(), Vec::new());
        for seed in 0..self.args.folds.seeds {
            let rounds = validate::rounds(&described.samples, &protocol, seed);
            if rounds.is_empty() {
                bail!("no room has sequences both to train and to answer: drive through the rooms again");
            }
            let seeded = Config { seed, ..trial.config.clone() };
            let method = Method::of(&seeded);
            let answers = validate::run(&described.samples, &rounds, &method, &seeded, &self.camera, |_| ());
            let answers = match answers {
                Ok(answers) => answers.concat(),
                // The others may work.
                Err(error) => return Ok(Tried::impossible(trial, &error)),
            };
            let evaluation = validate::evaluate(self.dataset, described, &answers);
            rates.extend(evaluation.overall.rate);
            means.extend(evaluation.mean_by_room);
        }
        let (rate, mean_by_room) = (Summary::of(&rates), Summary::of(&means));
        Ok(Tried { trial, rate, mean_by_room, impossible: None, taken: false })
    }
}

impl Tried {
    fn impossible(trial: Trial, error: &TrainError) -> Self {
        Self { trial, rate: None, mean_by_room: None, impossible: Some(error.to_string()), taken: false }
    }
}

/// Of those from `first` on the one with the highest mean rate. Of equal ones it is `usual`; else the cheapest, or the first
/// candidate, since these stand in the order of preference. None where nothing could be trained.
fn choose(tried: &[Tried], first: usize, usual: Option<&Config>) -> Option<Choice> {
    let mean = |idx: usize| tried[idx].rate.map_or(f64::MIN, |rate| rate.mean);
    let rated: Vec<usize> = (first..tried.len()).filter(|&idx| tried[idx].rate.is_some()).collect();
    let best = rated.iter().map(|&idx| mean(idx)).reduce(f64::max)?;
    // Means of the same rates in another order differ in their last bits.
    let equal: Vec<usize> = rated.into_iter().filter(|&idx| best - mean(idx) < 1e-9).collect();
    if let Some(&taken) = equal.iter().find(|&&idx| Some(&tried[idx].trial.config) == usual) {
        return Some(Choice { taken, equal, reason: "it is what is configured" });
    }
    let &first = equal.first()?;
    if tried[first].trial.candidate.is_some() {
        return Some(Choice { taken: first, equal, reason: "it comes first in the order of preference" });
    }
    let cheaper = |&&a: &&usize, &&b: &&usize| cost(&tried[a].trial).total_cmp(&cost(&tried[b].trial));
    let &taken = equal.iter().min_by(cheaper)?;
    let is_cheapest = equal.iter().any(|&idx| cost(&tried[idx].trial) > cost(&tried[taken].trial));
    let reason =
        if is_cheapest { "it is the cheapest or simplest" } else { "it comes first, and none is cheaper" };
    Some(Choice { taken, equal, reason })
}

/// How much a trial costs against others of the same parameters: time and memory grow with their values, but fall with
/// thresholds and steps. What is no number costs the same.
fn cost(trial: &Trial) -> f64 {
    let factor = |parameter: &String| {
        let (name, value) = parameter.split_once('=')?;
        let value: f64 = value.trim().parse().ok()?;
        let falls = name.contains("threshold") || name.ends_with("step");
        Some(if falls { -value } else { value })
    };
    trial.parameters.iter().filter_map(factor).sum()
}

fn write_new(path: &Path, text: &str) -> anyhow::Result<()> {
    let write = || OpenOptions::new().write(true).create_new(true).open(path)?.write_all(text.as_bytes());
    write().with_context(|| path.display().to_string())
}

fn print(tried: &[Tried], choices: &[Choice], output: &Path) -> anyhow::Result<()> {
    let mut table = output::table(["", "mean", "std", "by room"]);
    let digits = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
    for tried in tried {
        table.add_row([
            tried.trial.name(),
            digits(tried.rate.map(|rate| rate.mean)),
            digits(tried.rate.and_then(|rate| rate.std)),
            digits(tried.mean_by_room.map(|rate| rate.mean)),
        ]);
    }
    say!("{table}")?;
    for tried in tried {
        if let Some(reason) = &tried.impossible {
            say!("{}: cannot be trained, {reason}", tried.trial.name())?;
        }
    }
    for choice in choices.iter().filter(|choice| choice.equal.len() > 1) {
        say!("{}", choice.text(tried))?;
    }
    let Some(last) = choices.last() else { return Ok(()) };
    let Trial { candidate, parameters, .. } = &tried[last.taken].trial;
    let words: Vec<&str> = candidate.iter().chain(parameters).map(String::as_str).collect();
    let word = if last.equal.len() > 1 { "Taken" } else { "Best" };
    say!("\n{word}: {}. {} holds it, for --config.", words.join(" "), output.display())?;
    say!("Its rate is flattering: measure it on sequences that had no part in this.")?;
    Ok(())
}

impl Choice {
    /// Which do equally well, and why one of them is taken.
    fn text(&self, tried: &[Tried]) -> String {
        let equal: Vec<String> = self.equal.iter().map(|&idx| tried[idx].trial.name()).collect();
        let taken = tried[self.taken].trial.name();
        format!("Equal rates: {}. Taken is {taken}: {}.", equal.join(", "), self.reason)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Trials of these parameters with these rates; without any they cannot be trained.
    fn tried(trials: &[(&str, Option<f64>)]) -> Vec<Tried> {
        let args = ConfigArgs::of_parameters(&[]);
        let base = args.read().unwrap();
        let of = |&(parameters, rate): &(&str, Option<f64>)| {
            let parameters: Vec<String> = parameters.split(' ').map(str::to_owned).collect();
            let trial = Trial { candidate: None, config: args.with(&base, &parameters).unwrap(), parameters };
            let rate = rate.and_then(|rate| Summary::of(&[rate]));
            Tried { trial, rate, mean_by_room: None, impossible: None, taken: false }
        };
        trials.iter().map(of).collect()
    }

    #[test]
    fn of_equal_rates_the_configured_or_the_cheaper_one_is_taken_and_all_are_named() {
        let usual = ConfigArgs::of_parameters(&[]).read().unwrap();
        let chosen = |trials: &[(&str, Option<f64>)], usual: Option<&Config>| {
            let tried = tried(trials);
            choose(&tried, 0, usual).map(|choice| choice.text(&tried))
        };
        let equal = [
            ("classifier.c=10", Some(0.9)),
            ("classifier.c=1", Some(0.9)),
            ("classifier.c=0.1", Some(0.9)),
            ("classifier.c=3", Some(0.8)),
            ("classifier.c=5", None),
        ];
        let text = |taken| {
            format!("Equal rates: classifier.c=10, classifier.c=1, classifier.c=0.1. Taken is {taken}.")
        };
        let configured = text("classifier.c=1: it is what is configured");
        assert_eq!(chosen(&equal, Some(&usual)), Some(configured));
        assert_eq!(chosen(&equal, None), Some(text("classifier.c=0.1: it is the cheapest or simplest")));

        // A higher threshold finds less.
        let thresholds =
            [("detector.threshold.fixed=20", Some(0.9)), ("detector.threshold.fixed=40", Some(0.9))];
        assert!(chosen(&thresholds, None).unwrap().contains("Taken is detector.threshold.fixed=40"));
        assert_eq!(chosen(&equal[4..], Some(&usual)), None);

        // Candidates stand in the order of preference, whatever was taken for them.
        let mut candidates = tried(&equal[..3]);
        candidates.iter_mut().for_each(|tried| tried.trial.candidate = Some(tried.trial.parameters.concat()));
        assert_eq!(choose(&candidates, 1, None).unwrap().taken, 1);
    }

    #[test]
    fn what_is_tried_by_default_fits_the_opinion() {
        let bag = ["kind=linear_svm", "kind=kernel_svm", "kernel={kind='sigmoid'}", "kind=boost"];
        let matching = ["kind=match_svm", "inner={kind='correlation', gamma=2}", "inner={kind='linear'}"];
        let configs = [("bag", "kernel_svm", &bag[..]), ("descriptors", "match_svm", &matching[..])];
        for (representation, classifier, changes) in configs {
            for change in changes {
                let kind = format!("classifier.kind={classifier}");
                let memory = "opinions.memory={kind='memory'}".to_owned();
                let patterns = "opinions.patterns={kind='patterns'}".to_owned();
                let representation = format!("representation.kind={representation}");
                let parameters = [representation, kind, format!("classifier.{change}"), memory, patterns];
                let args = ConfigArgs::of_parameters(&parameters);
                let config = args.read().unwrap();
                for (name, opinion) in &config.opinions {
                    assert!(!opinion.tries().is_empty());
                    for Tries { parameter, values } in opinion.tries() {
                        for value in values {
                            let parameters = [format!("opinions.{name}.{parameter}={value}")];
                            let changed = args.with(&config, &parameters).unwrap();
                            assert_eq!(changed.extraction(), config.extraction());
                        }
                    }
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
