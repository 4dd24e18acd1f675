//! Which training frames are most like a frame, and where they were taken.

use crate::look::features::Features;
use crate::model::Model;
use crate::model::pose::{Pose, PoseEstimate, Vote};
use crate::opinions::{Near, Opinion};

/// So many frames of each opinion tell where a frame was taken.
const N_VOTERS: usize = 10;

/// A vote counts by this power of how near its frame is, relative to the opinion's nearest.
const SHARPNESS: f64 = 4.0;

/// So many training frames, as each opinion sees them, are enough to explain an answer.
pub const N_NEAREST: usize = 3;

/// A training frame that is like a frame, as an opinion sees both.
#[derive(Clone, Debug, PartialEq)]
pub struct NearFrame {
    /// The opinion.
    pub opinion: String,
    /// What the frame is called, such as its path in the data set; may be empty.
    pub name: String,
    /// The drive that it comes from; empty when unknown.
    pub drive: String,
    /// Index into [`Model::rooms`] of the room that it shows.
    pub room_idx: usize,
    /// How near it is, 1 being the same: the share of the frame's keypoints that found it, or the cosine between
    /// both vectors.
    pub nearness: f32,
    /// Where it was taken, if that is known.
    pub pose: Option<Pose>,
    /// Where the keypoints are that found it, as column and row in the frame as it came, in pixels.
    pub points: Vec<[f32; 2]>,
}

impl Model {
    /// Where training frames were taken, as far as they came with poses: the index of the room and the pose of each.
    pub fn positions(&self) -> impl Iterator<Item = (usize, Pose)> {
        let posed = |(frame_idx, &label)| Some((label, self.learned.pose(frame_idx)?));
        self.learned.labels.iter().enumerate().filter_map(posed)
    }

    /// The training frames that are most like a frame: up to `n_frames` of each opinion that keeps frames, the nearest first.
    pub fn nearest(&self, features: &Features, n_frames: usize) -> Vec<NearFrame> {
        let by_opinion = |(name, opinion): (&str, &Opinion)| {
            let near = |near: Near| NearFrame {
                opinion: name.to_owned(),
                name: self.learned.name(near.frame_idx).unwrap_or_default().to_owned(),
                drive: self.learned.drive(near.frame_idx).to_owned(),
                room_idx: self.learned.labels[near.frame_idx],
                nearness: near.nearness,
                pose: self.learned.pose(near.frame_idx),
                points: near.points.iter().map(|point| point.map(|at| at * features.scale)).collect(),
            };
            // What was trained by versions before this was kept has no frames.
            let is_learned = |near: &Near| near.frame_idx < self.learned.n_frames();
            let nearest = opinion.nearest(features, n_frames).into_iter();
            nearest.filter(is_learned).map(near).collect::<Vec<_>>()
        };
        self.opinions().flat_map(by_opinion).collect()
    }

    /// Where a frame was taken, as far as the frames tell that are most like it. `None` where no drive came with poses, or
    /// nothing is like it.
    pub fn pose(&self, features: &Features) -> Option<PoseEstimate> {
        if !self.learned.has_poses() {
            return None;
        }
        let mut votes = Vec::new();
        for (_, opinion) in self.opinions() {
            let nearest = opinion.nearest(features, N_VOTERS);
            let largest = nearest.first().map_or(0.0, |near| near.nearness).max(f32::MIN_POSITIVE);
            let vote = |near: &Near| {
                let pose = self.learned.pose(near.frame_idx)?;
                let weight = opinion.weight * f64::from(near.nearness / largest).max(0.0).powf(SHARPNESS);
                Some(Vote { pose, weight })
            };
            votes.extend(nearest.iter().filter_map(vote));
        }
        PoseEstimate::of(&votes)
    }
}
