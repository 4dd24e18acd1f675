//! Frames that few opinions answer: cheap ones are asked first, and where they are sure, the others are not asked.
//!
//! An answer may be rejected at a price (Chow, "On optimum recognition error and reject tradeoff", IEEE Transactions on
//! Information Theory 1970); here the price of a cheap answer's rejection is the costlier look, as in cascades of classifiers
//! (Viola and Jones, "Robust Real-Time Face Detection", IJCV 2004). How sure is sure enough is found on held-out frames.

use crate::look::sight::Sight;
use crate::model::card::EarlyAnswers;
use crate::model::config::{ALWAYS_ALL, Config};
use crate::model::held_out::is_clear_gain;
use crate::model::known::{Known, NOVELTIES, Outcome, Outcomes, weight_of_new};
use crate::model::{Classification, Recognition};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The precision of early answers is shown when it would be this many standard deviations off by chance: one time in twenty.
const DEVIATIONS: f64 = 1.645;

/// Rooms that are left out of training are others than those that are met later, and look less new at times: this share of the
/// early answers that could be given is enough, if they are given to what looks least new.
const WORTH_CAUTION: f64 = 0.5;

/// What sure answers may be limited to, beside [`NOVELTIES`].
const LOW_NOVELTIES: [f32; 5] = [0.02, 0.01, 0.005, 0.002, 0.001];

/// Opinions that answer without the costlier ones where they are sure.
#[derive(Clone, Debug)]
pub(crate) struct Early {
    /// The model's with these opinions alone.
    pub(crate) config: Config,
    /// Which of the model's opinions they are, ascending.
    pub(crate) opinion_idxs: Vec<usize>,
    /// What they look at.
    pub(crate) sights: Arc<Vec<Sight>>,
    /// The opinions, calibrated, weighed and judged as in a model of them alone.
    pub(crate) classification: Classification,
    /// Which answers are sure, of those that are known.
    pub(crate) sure: Known,
}

/// The parts of a configuration that are asked before all opinions are: those that look in cheap ways, and those that look
/// in dearer ways beside them; none where all cost about the same, or all are always asked.
pub(crate) fn parts(config: &Config) -> Vec<Config> {
    if config.early_precision >= ALWAYS_ALL {
        return Vec::new();
    }
    let costs: BTreeSet<_> = config.opinions.values().map(|opinion| opinion.sight().cost()).collect();
    let up_to = |most| {
        config.with_opinions(|name| config.opinions.get(name).is_some_and(|of| of.sight().cost() <= most))
    };
    let mut parts: Vec<Config> = costs.into_iter().map(up_to).collect();
    parts.pop();
    parts
}

impl Early {
    /// `config` is a part of `of`, and the classification is its.
    pub(crate) fn new(config: Config, of: &Config, classification: Classification, sure: Known) -> Self {
        let names = of.opinions.keys().enumerate();
        let opinion_idxs = names.filter(|(_, name)| config.opinions.contains_key(*name)).map(|(idx, _)| idx);
        let opinion_idxs = opinion_idxs.collect();
        let sights = Arc::new(config.sights());
        Self { config, opinion_idxs, sights, classification, sure }
    }

    /// The answer of these opinions, where it is sure.
    pub(crate) fn sure_answer(&self, answer: Recognition) -> Option<Recognition> {
        let is_sure = answer.known && self.is_sure(answer.probability(), answer.novelty);
        is_sure.then_some(Recognition { is_early: true, ..answer })
    }

    /// Whether an answer is sure, of a frame that shows something.
    pub(crate) fn is_sure(&self, probability: f32, novelty: Option<f32>) -> bool {
        let known = self.classification.known;
        [known, Some(self.sure)].iter().all(|of| of.is_some_and(|of| of.holds(probability, novelty)))
    }
}

/// A held-out frame, or one whose room was left out, as parts answer it and as all opinions do.
#[derive(Clone, Debug)]
struct Case {
    /// What it counts.
    weight: f64,
    /// Whether its room was left out, so that no answer is right.
    is_new: bool,
    /// By each part; `None` where it saw nothing.
    by_part: Vec<Option<Outcome>>,
    /// Whether all opinions are right, or do not know it where its room was left out.
    is_right_by_all: bool,
}

/// Answers, weighed.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    n: f64,
    n_right: f64,
    /// Right, where all opinions are not.
    gained: f64,
    /// Not right, where all opinions are.
    lost: f64,
    /// Frames of left-out rooms that all opinions do not know, unweighed: one may weigh next to nothing.
    n_new_lost: f64,
}

impl Count {
    fn add(&mut self, case: &Case, part_idx: usize) {
        let (is_right, is_right_by_all) = (case.is_right(part_idx), case.is_right_by_all);
        let of = |is_counted: bool, weight: f64| if is_counted { weight } else { 0.0 };
        self.n += case.weight;
        self.n_right += of(is_right, case.weight);
        self.gained += of(is_right && !is_right_by_all, case.weight);
        self.lost += of(is_right_by_all && !is_right, case.weight);
        self.n_new_lost += of(case.is_new && is_right_by_all, 1.0);
    }

    /// Whether so many of the answers are surely right, those of all opinions are not clearly better, and these do not take
    /// clearly more new places for known ones.
    fn shows(&self, precision: f64) -> bool {
        !is_clear_gain(self.lost, self.gained)
            && !is_clear_gain(self.n_new_lost, 0.0)
            && lower_bound(self.n_right, self.n) >= precision
    }
}

/// The least share of which `n_right` of `n` are no surprise (Wilson, "Probable inference, the law of succession, and
/// statistical inference", JASA 1927).
fn lower_bound(n_right: f64, n: f64) -> f64 {
    if n <= 0.0 {
        return 0.0;
    }
    let (share, squared) = (n_right / n, DEVIATIONS * DEVIATIONS);
    let spread = (share * (1.0 - share) / n + squared / (4.0 * n * n)).sqrt();
    (share + squared / (2.0 * n) - DEVIATIONS * spread) / (1.0 + squared / n)
}

/// Which answers of each part are sure, where any may be, and how held-out frames were answered by these.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chosen {
    pub(crate) sure: Vec<Option<Known>>,
    /// None where no answer is sure.
    pub(crate) answers: Option<EarlyAnswers>,
}

/// Chooses thresholds for the answers of each part of the opinions, in the order of being asked: of those under which these
/// answers and the ones of parts before are shown to be as precise as wanted, and the answers of `all` opinions are not clearly
/// better, where one frame in twenty shows a place that was never trained, the most cautious that leave enough answers.
pub(crate) fn choose(all: &Outcomes, parts: &[&Outcomes], precision: f64) -> Chosen {
    let by_part = |of: fn(&Outcomes) -> &BTreeMap<usize, Outcome>, number: &usize| {
        parts.iter().map(|part| of(part).get(number).copied()).collect()
    };
    let is_known = |outcome: &Outcome| {
        all.known.is_some_and(|known| known.holds(outcome.probability, Some(outcome.novelty)))
    };
    let of_new = weight_of_new(all.held_out.len(), all.left_out.len());
    let held_out = all.held_out.iter().map(|(number, outcome)| Case {
        weight: 1.0,
        is_new: false,
        by_part: by_part(|of| &of.held_out, number),
        is_right_by_all: outcome.is_right,
    });
    let left_out = all.left_out.iter().map(|(number, outcome)| Case {
        weight: of_new,
        is_new: true,
        by_part: by_part(|of| &of.left_out, number),
        is_right_by_all: !is_known(outcome),
    });
    let (held_out, left_out): (Vec<Case>, Vec<Case>) = (held_out.collect(), left_out.collect());
    let mut open: Vec<&Case> = held_out.iter().chain(&left_out).collect();
    let mut count = Count::default();
    let mut sure = Vec::with_capacity(parts.len());
    for (part_idx, part) in parts.iter().enumerate() {
        let chosen = part.known.and_then(|known| choose_of(part_idx, &open, known, count, precision));
        if let Some(chosen) = chosen {
            let (answered, left): (Vec<_>, Vec<_>) =
                open.into_iter().partition(|case| case.is_sure(part_idx, chosen));
            answered.into_iter().for_each(|case| count.add(case, part_idx));
            open = left;
        }
        sure.push(chosen);
    }
    let answers = sure.iter().any(Option::is_some).then(|| EarlyAnswers::of(&held_out, &sure));
    Chosen { sure, answers }
}

/// The thresholds of one part, after `before` was answered: those of the least novelty that leave
/// [`WORTH_CAUTION`] of the answers.
fn choose_of(part_idx: usize, open: &[&Case], known: Known, before: Count, precision: f64) -> Option<Known> {
    let mut open: Vec<(&Case, Outcome)> =
        open.iter().filter_map(|case| Some((*case, case.by_part[part_idx]?))).collect();
    open.retain(|(_, outcome)| known.holds(outcome.probability, Some(outcome.novelty)));
    open.sort_by(|(_, a), (_, b)| b.probability.total_cmp(&a.probability));
    let novelties = NOVELTIES.into_iter().chain(LOW_NOVELTIES).filter(|of| *of <= known.most_novelty);
    let most_under = |most_novelty: f32| {
        let near: Vec<_> = open.iter().filter(|(_, outcome)| outcome.novelty <= most_novelty).collect();
        let mut count = before;
        let mut most = None;
        for equal in near.chunk_by(|(_, a), (_, b)| a.probability == b.probability) {
            equal.iter().for_each(|(case, _)| count.add(case, part_idx));
            if count.shows(precision) {
                let least_probability = equal[0].1.probability;
                most = Some((count.n_right - before.n_right, Known { least_probability, most_novelty }));
            }
        }
        most
    };
    let choices: Vec<(f64, Known)> = novelties.filter_map(most_under).collect();
    let most = choices.iter().map(|(n_right, _)| *n_right).fold(0.0, f64::max);
    choices.into_iter().rfind(|(n_right, _)| *n_right >= WORTH_CAUTION * most).map(|(_, sure)| sure)
}

impl Case {
    fn is_sure(&self, part_idx: usize, sure: Known) -> bool {
        let outcome = self.by_part[part_idx];
        outcome.is_some_and(|outcome| sure.holds(outcome.probability, Some(outcome.novelty)))
    }

    fn is_right(&self, part_idx: usize) -> bool {
        self.by_part[part_idx].is_some_and(|outcome| outcome.is_right)
    }
}

impl EarlyAnswers {
    fn of(held_out: &[Case], sure: &[Option<Known>]) -> Self {
        let mut answers = Self { n_held_out: held_out.len(), ..Self::default() };
        for case in held_out {
            let is_sure = |(part_idx, sure): (usize, &Option<Known>)| {
                sure.filter(|sure| case.is_sure(part_idx, *sure)).map(|_| part_idx)
            };
            if let Some(part_idx) = sure.iter().enumerate().find_map(is_sure) {
                answers.n_frames += 1;
                answers.n_right += usize::from(case.is_right(part_idx));
                answers.n_right_by_all += usize::from(case.is_right_by_all);
            }
        }
        answers
    }
}

#[cfg(test)]
mod tests;
