//! A memory of the local features of all frames, by which rooms are told as places that were seen before.

use crate::classify::memory;
use crate::classify::memory::{Memory, MemoryError, Origin, Parts, Recall};
use crate::file::arrays::{Array, Arrays, require};
use crate::file::error::FormatError;
use crate::look::lens::Lens;
use crate::look::sight::{Seen, Sight};
use crate::opinions::calibration::Way;
use crate::opinions::error::{AddError, TrainError};
use crate::opinions::machines::{MACHINE_SIGNS, signs_of};
use crate::opinions::{
    Added, Chosen, Clue, Left, Likeness, Near, Recognizer, Said, Shape, Sign, Size, Tries,
};
use roomsight_vision::describe::Descriptor;
use roomsight_vision::detect::Detector;
use roomsight_vision::matrix::Matrix;
use serde::{Deserialize, Serialize};

/// Seeds the words of a memory that has outgrown its first ones.
const LATER_SEED: u64 = 0;

/// Which local features are remembered, and how.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MemoryConfig {
    /// What is remembered.
    pub features: Remembered,
    /// How it is kept and found.
    pub memory: memory::Config,
}

/// What is remembered of a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Remembered {
    /// Described keypoints.
    Keypoints {
        /// How they are found.
        #[serde(default)]
        detector: Detector,
        /// How they are described.
        #[serde(default)]
        descriptor: Descriptor,
    },
    /// The cells of a network's grid.
    Grid {
        /// The network.
        #[serde(default)]
        lens: Lens,
        /// Which of its grids.
        grid: String,
    },
    /// The keypoints of a network that finds and describes them as XFeat does.
    Xfeat {
        /// The network.
        lens: Lens,
        /// The most keypoints of a frame.
        #[serde(default = "three_hundred")]
        target: usize,
    },
}

fn three_hundred() -> usize {
    300
}

impl Default for Remembered {
    fn default() -> Self {
        Self::Keypoints { detector: Detector::default(), descriptor: Descriptor::default() }
    }
}

impl MemoryConfig {
    pub(crate) fn sight(&self) -> Sight {
        match &self.features {
            Remembered::Keypoints { detector, descriptor } => {
                Sight::Keypoints { detector: detector.clone(), descriptor: descriptor.clone() }
            }
            Remembered::Grid { lens, grid } => Sight::Grid { lens: lens.clone(), grid: grid.clone() },
            Remembered::Xfeat { lens, target } => Sight::XFeat { lens: lens.clone(), target: *target },
        }
    }

    pub(crate) fn lens_mut(&mut self) -> Option<&mut Lens> {
        match &mut self.features {
            Remembered::Keypoints { .. } => None,
            Remembered::Grid { lens, .. } | Remembered::Xfeat { lens, .. } => Some(lens),
        }
    }

    pub(crate) fn check(&self) -> Result<(), String> {
        self.memory.check()
    }

    /// Words are drawn.
    pub(crate) fn is_random(&self) -> bool {
        true
    }

    pub(crate) fn tries(&self) -> Vec<Tries> {
        vec![
            Tries { parameter: "memory.n_neighbors", values: &["5", "10", "20"] },
            Tries { parameter: "memory.n_dimensions", values: &["32", "64"] },
        ]
    }

    pub(crate) fn way(&self) -> Way {
        Way::Softmax { prior_slope: 6.0 }
    }

    /// How many frames of each room make its decision values count half of what they count with very many: a memory tells
    /// places that it has seen, and what a network sees of a place tells of others like it as well. Measured over
    /// sets of real frames.
    fn n_frames_to_count_half(&self) -> f32 {
        match self.features {
            Remembered::Keypoints { .. } | Remembered::Xfeat { .. } => 25.0,
            Remembered::Grid { .. } => 10.0,
        }
    }

    pub(crate) fn prior_weight(&self) -> f64 {
        1.0
    }

    pub(crate) fn signs(&self) -> &'static [Sign] {
        &SIGNS
    }
}

/// What a search tells of how familiar a frame is; see [`signs`].
const SIGNS: [Sign; 7] = [
    MACHINE_SIGNS[0],
    MACHINE_SIGNS[1],
    Sign { name: "score", prior_weight: 0.3 },
    Sign { name: "score_gap", prior_weight: 0.3 },
    Sign { name: "share", prior_weight: 0.3 },
    Sign { name: "votes", prior_weight: 0.3 },
    Sign { name: "nearest", prior_weight: 0.3 },
];

/// The memory; frames are numbered as the model has learned them.
#[derive(Clone, Debug)]
pub(crate) struct Remembrance {
    config: MemoryConfig,
    memory: Memory,
}

impl Remembrance {
    /// The logarithms of each room's score and, of keypoints, of its best frame's votes over the means of all rooms', which
    /// do not depend on how near descriptors are altogether; they count less where a room has few frames. Cells of a
    /// grid lie in other places of the next frame, so that no single frame has them all.
    fn decide(&self, recall: &Recall) -> Vec<f32> {
        let scores = &recall.room_scores;
        let mut best_votes = vec![0.0_f32; scores.len()];
        for frame in &recall.frames {
            let best = &mut best_votes[self.memory.origins()[frame.frame_idx].room_idx];
            *best = best.max(frame.votes);
        }
        let n_of_room = self.memory.origins().len() as f32 / scores.len().max(1) as f32;
        let share = n_of_room / (n_of_room + self.config.n_frames_to_count_half());
        if let Remembered::Grid { .. } = self.config.features {
            return over_mean(scores).map(|score| share * score).collect();
        }
        let parts = over_mean(scores).zip(over_mean(&best_votes));
        parts.map(|(score, votes)| share * (score + votes) / 2.0).collect()
    }
}

/// What a search tells of how familiar a frame is, in the order of [`SIGNS`]: the largest decision value and how far it is above
/// the second, the largest score, how far that is above the second room's, its share in all scores, the most votes for
/// one frame, and how near the nearest descriptors are.
fn signs(recall: &Recall, values: &[f32]) -> Vec<f32> {
    let best = recall.best_score();
    let share = best / recall.room_scores.iter().sum::<f32>().max(f32::MIN_POSITIVE);
    let farthest = 4.0;
    let nearest = -recall.mean_nearest.unwrap_or(farthest);
    let of_recall = [best, recall.gap(), share, recall.most_votes(), nearest];
    signs_of(values).into_iter().chain(of_recall).collect()
}

/// The logarithm of each over the mean of all; 0 where all are 0.
fn over_mean(scores: &[f32]) -> impl Iterator<Item = f32> {
    let mean = scores.iter().sum::<f32>() / scores.len().max(1) as f32;
    scores.iter().map(move |score| if mean > 0.0 { (score / mean + LEAST_SCORE).ln() } else { 0.0 })
}

/// Added to scores before their logarithm is taken, in means of all rooms: a room without any is not impossible.
const LEAST_SCORE: f32 = 1e-3;

impl Recognizer for Remembrance {
    type Config = MemoryConfig;
    type Prepared = memory::Prepared;

    fn prepare(config: &MemoryConfig, frames: &[&Seen], seed: u64) -> Result<Self::Prepared, TrainError> {
        Ok(memory::Prepared::new(&descriptors_of(frames), &config.memory, seed)?)
    }

    fn train(
        config: &MemoryConfig,
        prepared: &memory::Prepared,
        _: &[&Seen],
        chosen: &Chosen,
    ) -> Result<Self, TrainError> {
        let origin = |(&frame_idx, &room_idx)| (frame_idx, Origin { room_idx, frame_idx });
        let origins: Vec<_> = chosen.frame_idxs.iter().zip(chosen.labels).map(origin).collect();
        Ok(Self { config: config.clone(), memory: prepared.memory(&origins, chosen.n_classes) })
    }

    fn answer(&self, seen: &Seen) -> Option<Said> {
        let recall = self.memory.recall(seen.descriptors()?);
        let values = self.decide(&recall);
        let signs = signs(&recall, &values);
        Some(Said { values, signs })
    }

    fn check_addition(&self) -> Result<(), AddError> {
        Ok(())
    }

    fn add(&self, added: &Added) -> Result<Self, AddError> {
        let mut memory = self.memory.clone();
        memory.renumber(added.n_rooms, |origin| Origin {
            room_idx: added.of_earlier[origin.room_idx],
            ..*origin
        });
        let first = added.labels.len() - added.frames.len();
        let origins = (first..).zip(&added.labels[first..]);
        let origins = origins.map(|(frame_idx, &room_idx)| Origin { room_idx, frame_idx });
        let frames: Vec<(&Matrix, Origin)> = descriptors_of(added.frames).into_iter().zip(origins).collect();
        memory.learn(&frames, LATER_SEED);
        Ok(Self { memory, config: self.config.clone() })
    }

    fn without(&self, left: &Left) -> Result<Self, AddError> {
        let mut memory = self.memory.clone();
        memory.retain(|origin| left.is_left[origin.frame_idx]);
        let mut new_idx = 0;
        let new_idxs: Vec<usize> = left
            .is_left
            .iter()
            .map(|&is_left| {
                new_idx += usize::from(is_left);
                new_idx.saturating_sub(1)
            })
            .collect();
        memory.renumber(left.n_rooms, |origin| {
            let frame_idx = new_idxs[origin.frame_idx];
            Origin { room_idx: left.labels[frame_idx], frame_idx }
        });
        Ok(Self { memory, config: self.config.clone() })
    }

    /// What each keypoint found nearest in the room.
    fn clues(&self, seen: &Seen, room_idx: usize) -> Vec<Clue> {
        let (Some(local), Some(descriptors)) = (seen.local(), seen.descriptors()) else { return Vec::new() };
        let recall = self.memory.recall(descriptors);
        let origin = |matched: &memory::Match| self.memory.origins()[matched.frame_idx];
        let mut of_room: Vec<&memory::Match> =
            recall.matches.iter().filter(|matched| origin(matched).room_idx == room_idx).collect();
        // The nearest of each keypoint comes first.
        of_room.dedup_by_key(|matched| matched.descriptor_idx);
        let clue = |matched: &memory::Match| {
            let keypoint = &local.keypoints[matched.descriptor_idx];
            let likeness = Likeness::Frame(origin(matched).frame_idx);
            Clue {
                x: keypoint.x,
                y: keypoint.y,
                likeness,
                weight: matched.margin / descriptors.n_rows() as f32,
            }
        };
        of_room.into_iter().map(clue).collect()
    }

    /// By votes. A descriptor may have found several frames.
    fn nearest(&self, seen: &Seen, n_frames: usize) -> Vec<Near> {
        let (Some(local), Some(descriptors)) = (seen.local(), seen.descriptors()) else { return Vec::new() };
        let recall = self.memory.recall(descriptors);
        let near = |votes: &memory::FrameVotes| {
            let of_frame = recall.matches.iter().filter(|matched| matched.frame_idx == votes.frame_idx);
            let point = |matched: &memory::Match| {
                let keypoint = &local.keypoints[matched.descriptor_idx];
                [keypoint.x, keypoint.y]
            };
            let points: Vec<[f32; 2]> = of_frame.map(point).collect();
            Near {
                frame_idx: self.memory.origins()[votes.frame_idx].frame_idx,
                nearness: points.len() as f32 / descriptors.n_rows().max(1) as f32,
                points,
            }
        };
        recall.frames.iter().take(n_frames).map(near).collect()
    }

    fn to_arrays(&self) -> Vec<Array> {
        let Parts { components, offsets, scale, words, codes, list_lengths, frame_idxs, origins } =
            self.memory.to_parts();
        let width = components.n_rows().max(1);
        let frame_idxs = frame_idxs.iter().map(|&idx| idx as usize).collect::<Vec<_>>();
        vec![
            Array::matrix("memory.components", &components),
            Array::vector("memory.offsets", &offsets),
            Array::vector("memory.scale", &[scale]),
            Array::bytes("memory.words", [words.len() / width, width], &words),
            Array::bytes("memory.codes", [codes.len() / width, width], &codes),
            Array::counts("memory.list_lengths", list_lengths.iter().copied()),
            Array::counts("memory.frames", frame_idxs.into_iter()),
            Array::counts("memory.rooms", origins.iter().map(|origin| origin.room_idx)),
            Array::counts("memory.learned", origins.iter().map(|origin| origin.frame_idx)),
        ]
    }

    fn from_arrays(config: &MemoryConfig, shape: Shape, arrays: &Arrays) -> Result<Self, FormatError> {
        let components = arrays.matrix("memory.components")?;
        require(components.n_cols() == shape.n_dimensions, "its memory is of other descriptors")?;
        let width = components.n_rows();
        let rows = |name| {
            let ([_, n_cols], values) = arrays.bytes(name)?;
            require(n_cols == width, "its memory has descriptors of another length")?;
            Ok::<_, FormatError>(values)
        };
        let scale = arrays.vector("memory.scale")?;
        require(scale.len() == 1, "its memory has no scale")?;
        let (rooms, learned) = (arrays.counts("memory.rooms")?, arrays.counts("memory.learned")?);
        require(rooms.len() == learned.len(), "the frames of its memory have other numbers of rooms")?;
        require(
            learned.iter().all(|&frame_idx| frame_idx < shape.n_frames),
            "its memory has a frame that it has not learned",
        )?;
        let origins = rooms.into_iter().zip(learned);
        let parts = Parts {
            components,
            offsets: arrays.vector("memory.offsets")?,
            scale: scale[0],
            words: rows("memory.words")?,
            codes: rows("memory.codes")?,
            list_lengths: arrays.counts("memory.list_lengths")?,
            frame_idxs: arrays.numbers("memory.frames")?,
            origins: origins.map(|(room_idx, frame_idx)| Origin { room_idx, frame_idx }).collect(),
        };
        let memory = Memory::from_parts(parts, &config.memory, shape.n_rooms);
        let memory = memory.map_err(|error: MemoryError| FormatError::Damaged(error.to_string()))?;
        Ok(Self { config: config.clone(), memory })
    }

    fn size(&self) -> Size {
        Size { n_kept: self.memory.n_descriptors(), ..Size::default() }
    }
}

/// The descriptors of each frame.
fn descriptors_of<'a>(frames: &[&'a Seen]) -> Vec<&'a Matrix> {
    frames.iter().filter_map(|seen| seen.local()).map(|local| &local.descriptors).collect()
}
