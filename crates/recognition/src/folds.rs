//! Held-out folds for calibration and validation.
//!
//! A robot's neighboring frames are nearly the same picture. When some of them train a model and
//! others measure it, they leak: the rate comes out too high, and probabilities fitted on it are too
//! sure. So [`folds`] keeps apart what it can:
//!
//! - With two sequences or more, a sequence is never split. Nothing leaks.
//! - With one sequence, each room is cut into contiguous blocks. Frames leak only where blocks meet.
//! - With no sequence known, frames are dealt at random. Neighbors leak if there are any, and nothing
//!   here can know.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// The fold of each frame, below `n_folds` (at least 1).
///
/// `sequences` (`""` = unknown) and `labels` have one entry a frame, in time order within a sequence.
/// Where some sequences are known, the frames of unknown ones count as one sequence. `seed` matters
/// only where no sequence is known. Folds stay empty when there are fewer sequences than folds, or
/// fewer frames.
///
/// Panics when the lengths differ or `n_folds` is 0.
pub fn folds(sequences: &[&str], labels: &[usize], n_folds: usize, seed: u64) -> Vec<usize> {
    assert_eq!(sequences.len(), labels.len(), "one sequence and one label a frame");
    assert!(n_folds > 0, "at least one fold");
    let names: BTreeSet<&str> = sequences.iter().copied().collect();
    match names.len() {
        0 => Vec::new(),
        1 if names.contains("") => stratified(labels, n_folds, seed),
        1 => contiguous(labels, n_folds),
        _ => whole_sequences(sequences, labels, n_folds),
    }
}

/// Spreads labels that lie in one fold only over all folds, in contiguous blocks of their frames, so that
/// every label of at least two frames can be both trained and held out.
///
/// For calibration: a room seen in one sequence only must not stay without held-out frames. Where the blocks
/// meet, neighbors leak; never measure rates on such folds.
pub fn spread_single_fold_labels(folds: &mut [usize], labels: &[usize], n_folds: usize) {
    for frames in frames_by_label(labels).values() {
        if frames.iter().all(|&frame_idx| folds[frame_idx] == folds[frames[0]]) {
            for (position, &frame_idx) in frames.iter().enumerate() {
                folds[frame_idx] = position * n_folds / frames.len();
            }
        }
    }
}

#[derive(Default)]
struct Group {
    n_frames: usize,
    labels: BTreeSet<usize>,
}

/// Longest sequence first, each goes where it brings the most labels into a second fold (a label of
/// one fold cannot be trained without it), then where the fewest frames are.
fn whole_sequences(sequences: &[&str], labels: &[usize], n_folds: usize) -> Vec<usize> {
    let mut groups: BTreeMap<&str, Group> = BTreeMap::new();
    for (sequence, label) in sequences.iter().zip(labels) {
        let group = groups.entry(sequence).or_default();
        group.n_frames += 1;
        group.labels.insert(*label);
    }
    let mut order: Vec<(&str, &Group)> = groups.iter().map(|(name, group)| (*name, group)).collect();
    order.sort_by_key(|(_, group)| Reverse(group.n_frames));

    let mut n_frames = vec![0; n_folds];
    let mut folds_of_label: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    let mut fold_of_sequence = BTreeMap::new();
    for (name, group) in order {
        let n_spread = |fold: usize| {
            let seen = group.labels.iter().filter_map(|label| folds_of_label.get(label));
            seen.filter(|folds| folds.len() == 1 && !folds.contains(&fold)).count()
        };
        let best = |fold: &usize| (Reverse(n_spread(*fold)), n_frames[*fold]);
        let fold = (0..n_folds).min_by_key(best).unwrap_or_default();
        n_frames[fold] += group.n_frames;
        for label in &group.labels {
            folds_of_label.entry(*label).or_default().insert(fold);
        }
        fold_of_sequence.insert(name, fold);
    }
    sequences.iter().map(|sequence| fold_of_sequence[sequence]).collect()
}

/// Each label's frames in `n_folds` runs of nearly equal length.
fn contiguous(labels: &[usize], n_folds: usize) -> Vec<usize> {
    let mut folds = vec![0; labels.len()];
    for frames in frames_by_label(labels).values() {
        for (position, frame_idx) in frames.iter().enumerate() {
            folds[*frame_idx] = position * n_folds / frames.len();
        }
    }
    folds
}

/// Each label's frames shuffled and dealt round, going on where the label before stopped.
fn stratified(labels: &[usize], n_folds: usize, seed: u64) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut folds = vec![0; labels.len()];
    let mut next = (0..n_folds).cycle();
    for mut frames in frames_by_label(labels).into_values() {
        frames.shuffle(&mut rng);
        for (frame_idx, fold) in frames.into_iter().zip(&mut next) {
            folds[frame_idx] = fold;
        }
    }
    folds
}

fn frames_by_label(labels: &[usize]) -> BTreeMap<usize, Vec<usize>> {
    let mut frames: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (frame_idx, label) in labels.iter().enumerate() {
        frames.entry(*label).or_default().push(frame_idx);
    }
    frames
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_a_single_fold_are_spread_in_blocks() {
        let labels = [0, 0, 0, 0, 1, 1, 2];
        let mut folds = [0, 0, 0, 0, 0, 1, 1];
        spread_single_fold_labels(&mut folds, &labels, 2);
        assert_eq!(folds, [0, 0, 1, 1, 0, 1, 0]);
    }
    use proptest::prelude::*;

    #[test]
    fn sequences_are_balanced_by_frames() {
        let sequences = ["long", "b", "long", "c", "long", "d"];
        assert_eq!(folds(&sequences, &[0; 6], 2, 0), [0, 1, 0, 1, 0, 1]);
    }

    #[test]
    fn a_label_of_two_sequences_comes_into_two_folds() {
        // By length alone, both sequences of label 1 would come into fold 1.
        let sequences = ["a", "a", "a", "a", "b", "c", "c"];
        let labels = [0, 0, 0, 0, 1, 1, 1];
        assert_eq!(folds(&sequences, &labels, 2, 0), [0, 0, 0, 0, 0, 1, 1]);
    }

    #[test]
    fn one_sequence_is_cut_into_blocks_of_each_room() {
        let labels = [0, 0, 1, 1, 1, 1, 0, 0];
        assert_eq!(folds(&["drive"; 8], &labels, 2, 0), [0, 0, 0, 0, 1, 1, 1, 1]);
    }

    #[test]
    fn without_sequences_every_fold_gets_its_share_of_every_room() {
        let labels: Vec<usize> = (0..60).map(|frame_idx| frame_idx % 3).collect();
        let folds_of = |seed| folds(&[""; 60], &labels, 5, seed);
        let mut counts = BTreeMap::new();
        for key in folds_of(1).into_iter().zip(&labels) {
            *counts.entry(key).or_insert(0) += 1;
        }
        assert_eq!(counts.len(), 15);
        assert!(counts.values().all(|&count| count == 4));
        assert_eq!(folds_of(1), folds_of(1));
        assert_ne!(folds_of(1), folds_of(2));
    }

    #[test]
    fn rooms_of_one_frame_do_not_all_come_into_one_fold() {
        let mut found = folds(&[""; 4], &[0, 1, 2, 3], 4, 0);
        found.sort_unstable();
        assert_eq!(found, [0, 1, 2, 3]);
    }

    proptest! {
        #[test]
        fn sequences_stay_whole_and_fill_the_folds(
            frames in proptest::collection::vec((0..9usize, 0..4usize), 0..80),
            n_folds in 1..6usize,
        ) {
            let names = ["", "a", "b", "c", "d", "e", "f", "g", "h"];
            let sequences: Vec<&str> = frames.iter().map(|(name_idx, _)| names[*name_idx]).collect();
            let labels: Vec<usize> = frames.iter().map(|(_, label)| *label).collect();
            let folds = folds(&sequences, &labels, n_folds, 0);
            prop_assert_eq!(folds.len(), frames.len());
            prop_assert!(folds.iter().all(|fold| *fold < n_folds));
            let fold_of: BTreeMap<&str, usize> = sequences.iter().copied().zip(folds.iter().copied()).collect();
            if fold_of.len() >= 2 {
                for (sequence, fold) in sequences.iter().zip(&folds) {
                    prop_assert_eq!(fold_of[sequence], *fold);
                }
                let used: BTreeSet<usize> = folds.iter().copied().collect();
                prop_assert_eq!(used.len(), n_folds.min(fold_of.len()));
            }
        }
    }
}
