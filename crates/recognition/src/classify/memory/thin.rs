//! Which frames a memory that is too large forgets.

use super::Origin;
use super::lists::Lists;

/// Stands for two frames whose words are all in common.
const ALL: usize = 1 << 16;

/// Whether each frame is kept so that at most `max_descriptors` are left, by the rule that `Memory::learn` tells.
pub(super) fn kept(lists: &Lists, origins: &[Origin], n_rooms: usize, max_descriptors: usize) -> Vec<bool> {
    let words = words_of_frames(lists, origins.len());
    let mut rooms: Vec<Room> = (0..n_rooms).map(|room_idx| Room::new(room_idx, origins, &words)).collect();
    let mut n_descriptors = lists.n_rows();
    let mut kept = vec![true; origins.len()];
    while n_descriptors > max_descriptors {
        // The first of several with as many.
        let with_a_choice = rooms.iter_mut().rev().filter(|room| room.frame_idxs.len() > 1);
        let Some(largest) = with_a_choice.max_by_key(|room| room.n_descriptors) else { break };
        let frame_idx = largest.forget(&words);
        n_descriptors -= words[frame_idx].len();
        kept[frame_idx] = false;
    }
    kept
}

/// The words of each frame's descriptors, ascending.
fn words_of_frames(lists: &Lists, n_frames: usize) -> Vec<Vec<u32>> {
    let mut words = vec![Vec::new(); n_frames];
    for list_idx in 0..lists.lengths().len() {
        lists
            .frames_of(list_idx)
            .iter()
            .for_each(|&frame_idx| words[frame_idx as usize].push(list_idx as u32));
    }
    words
}

/// The frames of a room that are still kept.
struct Room {
    n_descriptors: usize,
    /// Ascending.
    frame_idxs: Vec<usize>,
    /// Of each frame the later one that is most like it. Empty until the room has to forget.
    likenesses: Vec<Likeness>,
}

#[derive(Clone, Copy)]
struct Likeness {
    /// Up to [`ALL`].
    share: usize,
    /// The later frame.
    of: usize,
}

impl Room {
    fn new(room_idx: usize, origins: &[Origin], words: &[Vec<u32>]) -> Self {
        let is_here = |&frame_idx: &usize| origins[frame_idx].room_idx == room_idx;
        let frame_idxs: Vec<usize> = (0..origins.len()).filter(is_here).collect();
        let n_descriptors = frame_idxs.iter().map(|&frame_idx| words[frame_idx].len()).sum();
        Self { n_descriptors, frame_idxs, likenesses: Vec::new() }
    }

    /// Forgets one of at least two frames, and tells which.
    fn forget(&mut self, words: &[Vec<u32>]) -> usize {
        if self.likenesses.is_empty() {
            self.likenesses =
                (0..self.frame_idxs.len()).map(|position| self.likeness(position, words)).collect();
        }
        // The last has no later one.
        let with_a_later = 0..self.frame_idxs.len() - 1;
        let position =
            with_a_later.rev().max_by_key(|&position| self.likenesses[position].share).unwrap_or(0);
        let frame_idx = self.frame_idxs.remove(position);
        self.likenesses.remove(position);
        self.n_descriptors -= words[frame_idx].len();
        for position in 0..position {
            if self.likenesses[position].of == frame_idx {
                self.likenesses[position] = self.likeness(position, words);
            }
        }
        frame_idx
    }

    /// The later frame that is most like the one at this position, ties to the first.
    fn likeness(&self, position: usize, words: &[Vec<u32>]) -> Likeness {
        let frame_idx = self.frame_idxs[position];
        let later = self.frame_idxs[position + 1..].iter().rev();
        let likeness = |&of: &usize| Likeness { share: share_in_common(&words[frame_idx], &words[of]), of };
        let alone = Likeness { share: 0, of: frame_idx };
        later.map(likeness).max_by_key(|likeness| likeness.share).unwrap_or(alone)
    }
}

/// How many of two frames' words are in common, of the fewer, from 0 to [`ALL`]. A frame without any is like all.
fn share_in_common(a: &[u32], b: &[u32]) -> usize {
    let (mut i, mut j, mut n_common) = (0, 0, 0);
    while i < a.len() && j < b.len() {
        n_common += usize::from(a[i] == b[j]);
        let (of_a, of_b) = (a[i], b[j]);
        i += usize::from(of_a <= of_b);
        j += usize::from(of_b <= of_a);
    }
    (n_common * ALL).checked_div(a.len().min(b.len())).unwrap_or(ALL)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_in_common_count_as_often_as_both_have_them() {
        assert_eq!(share_in_common(&[1, 1, 2, 5], &[1, 1, 1, 5, 6]), ALL * 3 / 4);
        assert_eq!(share_in_common(&[1, 2], &[3]), 0);
        assert_eq!(share_in_common(&[], &[3]), ALL);
    }
}
