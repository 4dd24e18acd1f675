//! What linear machines over bags make of each keypoint.

use crate::classify::svm::{LinearSvm, Scheme};
use crate::look::local::LocalFeatures;
use crate::vocabulary::Vocabulary;

/// How much each keypoint of a frame with these words adds to the decision value of a room: an equal share of what
/// each block of the frame's row adds that it counts in.
pub(super) fn keypoint_weights(
    vocabulary: &Vocabulary,
    svm: &LinearSvm,
    frame: &LocalFeatures,
    words: &[u32],
    room_idx: usize,
) -> Vec<f32> {
    let row = vocabulary.row_of_words(frame.described(), words);
    let width = vocabulary.block_width();
    let blocks = || words.iter().zip(&frame.spots).map(|(&word, &spot)| vocabulary.blocks(word, spot));
    let mut counts = vec![0.0; row.len() / width];
    blocks().flatten().for_each(|block| counts[block] += 1.0);
    let share = |block: usize| {
        let added_by = |column: usize| {
            let signed = signed_machines(svm, room_idx);
            let sum: f32 = signed.map(|(machine, sign)| sign * svm.weights().row(machine)[column]).sum();
            sum * row[column]
        };
        (block * width..(block + 1) * width).map(added_by).sum::<f32>() / f32::max(counts[block], 1.0)
    };
    let shares: Vec<f32> = (0..counts.len()).map(share).collect();
    blocks().map(|blocks| blocks.map(|block| shares[block]).sum()).collect()
}

/// The machines that speak of a room, and whether their positive side is it.
fn signed_machines(svm: &LinearSvm, room_idx: usize) -> impl Iterator<Item = (usize, f32)> {
    let n_rooms = svm.n_classes();
    let one_vs_all = (svm.scheme() == Scheme::OneVsAll).then_some((room_idx, 1.0));
    let pairs = (0..n_rooms).flat_map(move |a| (a + 1..n_rooms).map(move |b| (a, b))).enumerate();
    let one_vs_one = pairs.filter_map(move |(machine, (a, b))| {
        let sign = if a == room_idx { 1.0 } else { -1.0 };
        (one_vs_all.is_none() && (a == room_idx || b == room_idx)).then_some((machine, sign))
    });
    one_vs_all.into_iter().chain(one_vs_one)
}
