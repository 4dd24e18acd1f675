//! What a memory says of a frame.

use super::Memory;
use roomsight_vision::simd::Nearest;

/// What a memory says of a frame. Distances are squared ones of coded descriptors, which are of unit length: from 0
/// to 4.
#[derive(Clone, Debug, PartialEq)]
pub struct Recall {
    /// What each place got, by its index: the sum of the margins, divided by the number of the frame's descriptors.
    pub room_scores: Vec<f32>,
    /// The remembered frames that got anything, most votes first, ties by index.
    pub frames: Vec<FrameVotes>,
    /// The remembered descriptors behind these votes, by the frame's descriptors, nearest first.
    pub matches: Vec<Match>,
    /// The distance of the frame's descriptors to the nearest remembered one, on average. `None` where there are
    /// none to compare.
    pub mean_nearest: Option<f32>,
}

/// What a remembered frame got.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameVotes {
    /// Its index among [`Memory::origins`].
    pub frame_idx: usize,
    /// The sum of its margins, divided by the number of the answered frame's descriptors.
    pub votes: f32,
}

/// A descriptor of the answered frame and the nearest one of a remembered frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// The row of the descriptor.
    pub descriptor_idx: usize,
    /// The index of the remembered frame among [`Memory::origins`].
    pub frame_idx: usize,
    /// How much nearer it is than the background.
    pub margin: f32,
}

impl Recall {
    /// The scores of what was found nearest to each of a frame's descriptors, the background last.
    pub(super) fn new(memory: &Memory, nearest: &Nearest, n_descriptors: usize) -> Self {
        // The sums are of whole numbers, so their order does not matter.
        let one = memory.coding.scale().powi(2);
        let average = |sum: u64| (sum as f64 / f64::from(one) / n_descriptors.max(1) as f64) as f32;
        let mut of_rooms = vec![0u64; memory.n_rooms];
        let mut of_frames = vec![0u64; memory.origins.len()];
        let mut matches = Vec::new();
        let (mut nearest_sum, mut n_found) = (0u64, 0u64);
        let mut found: Vec<(u32, usize)> = Vec::new();
        for descriptor_idx in 0..n_descriptors {
            found.clear();
            let columns = nearest.of(descriptor_idx);
            found.extend(columns.map(|(distance, column)| (distance, memory.lists.frame_idx(column))));
            let Some(&(background, _)) = found.last() else { continue };
            nearest_sum += u64::from(found[0].0);
            n_found += 1;
            for (rank, &(distance, frame_idx)) in found.iter().enumerate() {
                let margin = u64::from(background - distance);
                let room_idx = memory.origins[frame_idx].room_idx;
                let mut nearer = found[..rank].iter().map(|&(_, frame_idx)| frame_idx);
                if margin == 0 || nearer.clone().any(|nearer| nearer == frame_idx) {
                    continue;
                }
                of_frames[frame_idx] += margin;
                matches.push(Match { descriptor_idx, frame_idx, margin: margin as f32 / one });
                if !nearer.any(|nearer| memory.origins[nearer].room_idx == room_idx) {
                    of_rooms[room_idx] += margin;
                }
            }
        }
        let voted = of_frames.iter().enumerate().filter(|&(_, &votes)| votes > 0);
        let mut by_votes: Vec<(usize, u64)> = voted.map(|(frame_idx, &votes)| (frame_idx, votes)).collect();
        by_votes.sort_by_key(|&(frame_idx, votes)| (std::cmp::Reverse(votes), frame_idx));
        let frame = |(frame_idx, votes)| FrameVotes { frame_idx, votes: average(votes) };
        Self {
            room_scores: of_rooms.into_iter().map(average).collect(),
            frames: by_votes.into_iter().map(frame).collect(),
            matches,
            mean_nearest: (n_found > 0)
                .then(|| (nearest_sum as f64 / f64::from(one) / n_found as f64) as f32),
        }
    }

    /// The place with the largest score, ties to the first. `None` where no place got anything.
    pub fn best_room(&self) -> Option<usize> {
        let larger = |best: Option<usize>, (room_idx, &score): (usize, &f32)| match best {
            Some(best) if self.room_scores[best] >= score => Some(best),
            _ => (score > 0.0).then_some(room_idx).or(best),
        };
        self.room_scores.iter().enumerate().fold(None, larger)
    }

    /// The largest score.
    pub fn best_score(&self) -> f32 {
        self.room_scores.iter().copied().fold(0.0, f32::max)
    }

    /// How far the largest score is above the second; above 0 where there is no second place.
    pub fn gap(&self) -> f32 {
        let (mut best, mut second) = (0.0f32, 0.0f32);
        for &score in &self.room_scores {
            second = second.max(score.min(best));
            best = best.max(score);
        }
        best - second
    }

    /// The most votes for one remembered frame.
    pub fn most_votes(&self) -> f32 {
        self.frames.first().map_or(0.0, |frame| frame.votes)
    }
}
