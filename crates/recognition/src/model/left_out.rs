//! How a model would do at places that were never trained: rooms are left out in turn, from what was described already.

use crate::model::config::Config;
use crate::model::held_out::{Answer, Decided, Fusion};
use crate::model::known::{Outcome, Outcomes};
use crate::model::novelty::{Novelty, Observed};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::collections::{BTreeMap, BTreeSet};

/// The most groups that rooms are dealt into, of which one is left out at a time.
const MAX_GROUPS: usize = 5;

/// So many frames of left-out rooms, or of elsewhere, are enough: more of the one would drown the other.
pub(crate) const ENOUGH_FRAMES: usize = 300;

/// A training without one fold and without some rooms, which decides the frames of the fold: so those of trained rooms and
/// those of others were decided alike.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Round {
    pub(crate) fold: usize,
    /// The samples that it trains on.
    pub(crate) training: Vec<usize>,
    /// The samples that it decides.
    pub(crate) frames: Vec<RoundFrame>,
}

/// A sample that a round decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RoundFrame {
    pub(crate) sample_idx: usize,
    /// Whether its room was left out.
    pub(crate) is_new: bool,
}

/// A frame that a round decided.
#[derive(Clone, Debug)]
pub(crate) struct RoundDecision {
    /// Tells it from others, whichever opinions decided it.
    pub(crate) number: usize,
    pub(crate) fold: usize,
    pub(crate) decided: Decided,
    /// Whether its room was left out, or it shows none.
    pub(crate) is_new: bool,
}

/// The rounds for samples of these folds and rooms: as few as decide enough frames of left-out rooms and leave out each room once
/// at least. None where fewer than three rooms leave nothing to tell apart.
pub(crate) fn rounds(folds: &[usize], labels: &[usize], seed: u64) -> Vec<Round> {
    let n_rooms = labels.iter().max().map_or(0, |last| last + 1);
    let n_folds = folds.iter().max().map_or(0, |last| last + 1);
    let mut rooms: Vec<usize> = (0..n_rooms).collect();
    rooms.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    let n_groups = n_rooms.min(MAX_GROUPS);
    let mut group_of = vec![0; n_rooms];
    rooms.iter().enumerate().for_each(|(rank, &room)| group_of[room] = rank % n_groups);
    let (mut rounds, mut n_new) = (Vec::new(), 0);
    for turn in 0..n_groups {
        // Each turn is about one group more.
        let each_was_left_out = n_folds + turn > n_groups;
        if each_was_left_out && n_new >= ENOUGH_FRAMES {
            break;
        }
        for fold in 0..n_folds {
            let is_left_out = |idx: usize| group_of[labels[idx]] == (fold + turn) % n_groups;
            let in_fold = |idx: &usize| folds[*idx] == fold;
            let all = || 0..folds.len();
            let training: Vec<usize> = all().filter(|idx| !in_fold(idx) && !is_left_out(*idx)).collect();
            let trained: BTreeSet<usize> = training.iter().map(|&idx| labels[idx]).collect();
            if trained.len() < 2 {
                continue;
            }
            let frame = |sample_idx| RoundFrame { sample_idx, is_new: is_left_out(sample_idx) };
            let frames = all().filter(in_fold).map(frame);
            let frames = frames.filter(|frame| frame.is_new || trained.contains(&labels[frame.sample_idx]));
            let frames: Vec<RoundFrame> = frames.collect();
            n_new += frames.iter().filter(|frame| frame.is_new).count();
            rounds.push(Round { fold, training, frames });
        }
    }
    if n_new == 0 { Vec::new() } else { rounds }
}

/// What tells new places, and which answers are known.
pub(crate) struct Judged {
    pub(crate) novelty: Option<Novelty>,
    /// By sample: how new each held-out frame looks to what was fitted without its fold.
    pub(crate) novelties: BTreeMap<usize, f32>,
    /// Of held-out frames, by sample, and of frames of left-out rooms, by the number of the decision.
    pub(crate) outcomes: Outcomes,
}

/// Fits what tells new places to decisions of rounds, and chooses thresholds. `answers` are those to held-out samples, of
/// these folds.
pub(crate) fn judge(
    config: &Config,
    fusion: &Fusion,
    answers: &BTreeMap<usize, Answer>,
    folds: &[usize],
    decisions: &[RoundDecision],
    n_rooms: usize,
) -> Judged {
    let decided: Vec<(&RoundDecision, Answer)> = decisions
        .iter()
        .map(|decision| (decision, fusion.answer(config, &decision.decided, n_rooms)))
        .collect();
    let mut observed: Vec<(usize, Observed)> = decided
        .iter()
        .map(|(decision, answer)| {
            (decision.fold, Observed { signs: answer.signs.clone(), is_new: decision.is_new })
        })
        .collect();
    // Where no room was left out.
    if observed.iter().all(|(_, observed)| observed.is_new) {
        let known = |(idx, answer): (&usize, &Answer)| {
            (folds[*idx], Observed { signs: answer.signs.clone(), is_new: false })
        };
        observed.extend(answers.iter().map(known));
    }
    let fit = |is_wanted: &dyn Fn(usize) -> bool| {
        let wanted = observed.iter().filter(|(fold, _)| is_wanted(*fold));
        Novelty::fit(config, &wanted.map(|(_, observed)| observed.clone()).collect::<Vec<_>>())
    };
    let novelty = fit(&|_| true);
    let all_folds: BTreeSet<usize> = folds.iter().copied().collect();
    let without: BTreeMap<usize, Option<Novelty>> = all_folds
        .into_iter()
        .map(|fold| (fold, fit(&|other| other != fold).or_else(|| novelty.clone())))
        .collect();
    let of = |fold: usize, answer: &Answer| without[&fold].as_ref().map(|novelty| novelty.of(&answer.signs));
    let novelties: BTreeMap<usize, f32> =
        answers.iter().filter_map(|(&idx, answer)| Some((idx, of(folds[idx], answer)?))).collect();
    let held_out: BTreeMap<usize, Outcome> =
        answers.iter().map(|(&idx, answer)| (idx, answer.outcome(novelties.get(&idx).copied()))).collect();
    let left_out: BTreeMap<usize, Outcome> = decided
        .iter()
        .filter(|(decision, _)| decision.is_new)
        .map(|(decision, answer)| (decision.number, answer.outcome(of(decision.fold, answer))))
        .collect();
    Judged { novelty, novelties, outcomes: Outcomes::new([held_out, left_out], &config.calibration) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_room_is_left_out_and_never_trained_then() {
        // Twelve samples of four rooms, in three folds.
        let (folds, labels): (Vec<usize>, Vec<usize>) = (0..12).map(|idx| (idx % 3, idx / 3)).unzip();
        let rounds = rounds(&folds, &labels, 1);
        assert_eq!(rounds.len(), 12, "all, since there are few frames");
        let mut left_out = BTreeSet::new();
        for round in &rounds {
            let trained: BTreeSet<usize> = round.training.iter().map(|&idx| labels[idx]).collect();
            assert!(round.training.iter().all(|&idx| folds[idx] != round.fold));
            for frame in &round.frames {
                assert_eq!(folds[frame.sample_idx], round.fold);
                assert_eq!(frame.is_new, !trained.contains(&labels[frame.sample_idx]));
                left_out.extend(frame.is_new.then_some(labels[frame.sample_idx]));
            }
        }
        assert_eq!(left_out.len(), 4);
    }

    #[test]
    fn many_frames_take_one_turn_and_two_rooms_none() {
        let (folds, labels): (Vec<usize>, Vec<usize>) = (0..3000).map(|idx| (idx % 5, idx / 300)).unzip();
        assert_eq!(rounds(&folds, &labels, 1).len(), 5);
        // Of two folds each leaves out one of five groups a turn.
        let two_folds: Vec<usize> = folds.iter().map(|fold| fold % 2).collect();
        let rounds_of_two = rounds(&two_folds, &labels, 1);
        let new = rounds_of_two.iter().flat_map(|round| &round.frames).filter(|frame| frame.is_new);
        assert_eq!(new.map(|frame| labels[frame.sample_idx]).collect::<BTreeSet<_>>().len(), 10);
        let (folds, labels): (Vec<usize>, Vec<usize>) = (0..12).map(|idx| (idx % 3, idx / 6)).unzip();
        assert_eq!(rounds(&folds, &labels, 1), []);
        assert_eq!(rounds(&[], &[], 1), []);
    }
}
