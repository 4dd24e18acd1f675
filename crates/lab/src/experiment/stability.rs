//! Keypoints found again in other light: Lu, table 2.
//!
//! The paper counts correct matches by eye. Here frames of two drives are paired by where they were taken. Keypoints
//! match when each is the other's nearest by descriptor and clearly nearer than the second (Lowe, "Distinctive image
//! features from scale-invariant keypoints", IJCV 60, 2004, section 7.1). Between two panoramas of one place all
//! bearings turn by the same angle, while heights stay: a match is correct when it agrees with the turn that most
//! matches of its pair agree on, and with its own height. A wrong match does so by chance about once in 200.

use super::{Drive, ExperimentError, Matches};
use crate::dataset::Pose;
use rayon::prelude::*;
use roomsight_recognition::model::{Config, Extractor, Scratch, Seen};
use roomsight_vision::camera::Projection;
use roomsight_vision::image::Limits;
use roomsight_vision::matrix::Matrix;
use std::f64::consts::{PI, TAU};

/// At most this many pairs are compared, spread evenly over the drive.
const MAX_PAIRS: usize = 40;

/// Frames of a pair were taken at most this far from each other, in meters.
const MAX_DISTANCE: f64 = 0.5;

/// And with headings at most this far apart, in radians.
const MAX_TURN: f64 = PI / 9.0;

/// The nearest descriptor is nearer than the second by this factor (Lowe).
const RATIO: f32 = 0.8;

/// How far a correct match may be from the turn of its pair, in radians: 5 degrees.
const BEARING_TOLERANCE: f64 = PI / 36.0;

/// How far a correct match may be from its height, as a share of the mirror's or the frame's.
const HEIGHT_TOLERANCE: f64 = 0.1;

/// Compares frames of two drives that were taken at the same places.
pub(super) fn measure(drives: [&Drive; 2], config: &Config) -> Result<Matches, ExperimentError> {
    let pairs = pairs(drives);
    let stride = pairs.len().div_ceil(MAX_PAIRS).max(1);
    let pairs: Vec<[usize; 2]> = pairs.into_iter().step_by(stride).collect();
    let extractors = drives.map(|drive| Extractor::new(config, drive.camera.clone()));
    let compare = |scratches: &mut [Scratch; 2], pair: &[usize; 2]| {
        let [of_first, of_second] = scratches;
        let first = Panorama::new(drives[0], pair[0], (&extractors[0], of_first))?;
        let second = Panorama::new(drives[1], pair[1], (&extractors[1], of_second))?;
        Some(count(&first, &second))
    };
    let counts: Vec<[usize; 4]> = pairs.par_iter().map_init(Default::default, compare).flatten().collect();
    if counts.is_empty() {
        return Err(ExperimentError::Impossible(format!(
            "no frames of {} and {} were taken within {MAX_DISTANCE} m of each other with nearly the same heading",
            drives[0].sequence, drives[1].sequence
        )));
    }
    let mean = |idx: usize| counts.iter().map(|count| count[idx] as f64).sum::<f64>() / counts.len() as f64;
    Ok(Matches { n_pairs: counts.len(), found: [mean(0), mean(1)], matched: mean(2), correct: mean(3) })
}

/// For each frame of the first drive the one of the second that was taken nearest, where there is one near enough.
fn pairs(drives: [&Drive; 2]) -> Vec<[usize; 2]> {
    let [poses, others] = drives.map(|drive| {
        let frames = drive.dataset.frames.iter().enumerate();
        frames.filter_map(|(idx, frame)| Some((idx, frame.pose?))).collect::<Vec<(usize, Pose)>>()
    });
    let nearest = |&(idx, pose): &(usize, Pose)| {
        let distance = |other: &Pose| (other.x - pose.x).hypot(other.y - pose.y);
        let alike = others.iter().filter(|(_, other)| turn(pose.angle, other.angle).abs() <= MAX_TURN);
        let (other_idx, other) = alike.min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)))?;
        (distance(other) <= MAX_DISTANCE).then_some([idx, *other_idx])
    };
    poses.iter().filter_map(nearest).collect()
}

/// From one angle to another, from -pi to pi.
fn turn(from: f64, to: f64) -> f64 {
    (to - from + PI).rem_euclid(TAU) - PI
}

/// The keypoints of a frame that shows all round.
struct Panorama {
    /// Of each keypoint: the bearing in radians, and the height as a share.
    directions: Vec<(f64, f64)>,
    descriptors: Matrix,
}

impl Panorama {
    /// None for a frame that cannot be read or does not show all round.
    fn new(
        drive: &Drive,
        frame_idx: usize,
        (extractor, scratch): (&Extractor, &mut Scratch),
    ) -> Option<Self> {
        let image = drive.dataset.frames[frame_idx].read(&Limits::default()).ok()?;
        let features = extractor.extract(&image, scratch);
        let (width, height) = (image.width(), image.height());
        let direction = |x: f32, y: f32| match drive.camera.projection {
            Projection::Perspective => None,
            Projection::Equirectangular => {
                Some((f64::from(x) / width as f64 * TAU, f64::from(y) / height as f64))
            }
            Projection::Omnidirectional(mirror) => {
                let (dx, dy, radius) = mirror.polar(x, y, width);
                Some((
                    f64::from(dy).atan2(f64::from(dx)),
                    f64::from(radius / (mirror.outer_radius * width as f32)),
                ))
            }
        };
        let scale = features.scale;
        let local = features.seen.iter().find_map(Seen::local)?;
        let directions =
            local.keypoints.iter().map(|keypoint| direction(keypoint.x * scale, keypoint.y * scale));
        Some(Self { directions: directions.collect::<Option<_>>()?, descriptors: local.descriptors.clone() })
    }
}

/// Found in the first, in the second, matched, and correct.
fn count(first: &Panorama, second: &Panorama) -> [usize; 4] {
    let forth = clearly_nearest(&first.descriptors, &second.descriptors);
    let back = clearly_nearest(&second.descriptors, &first.descriptors);
    let moves: Vec<(f64, f64)> = forth
        .iter()
        .enumerate()
        .filter_map(|(idx, other)| {
            let other = other.filter(|&other| back[other] == Some(idx))?;
            let (from, to) = (first.directions[idx], second.directions[other]);
            Some((turn(from.0, to.0), to.1 - from.1))
        })
        .collect();
    [first.directions.len(), second.directions.len(), moves.len(), n_agreeing(&moves)]
}

/// How many turns and changes of height agree with the turn that most agree with.
fn n_agreeing(moves: &[(f64, f64)]) -> usize {
    let agreeing = |&(consensus, _): &(f64, f64)| {
        let agrees = |&&(angle, rise): &&(f64, f64)| {
            turn(consensus, angle).abs() <= BEARING_TOLERANCE && rise.abs() <= HEIGHT_TOLERANCE
        };
        moves.iter().filter(agrees).count()
    };
    moves.iter().map(agreeing).max().unwrap_or_default()
}

/// For each row, the other row that is nearest by far, if one is.
fn clearly_nearest(rows: &Matrix, others: &Matrix) -> Vec<Option<usize>> {
    let nearest = |row: &[f32]| {
        let squared = |other: &[f32]| row.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
        let (mut best, mut second) = ((f32::INFINITY, None), f32::INFINITY);
        for (idx, other) in others.rows().enumerate() {
            let distance = squared(other);
            if distance < best.0 {
                second = best.0;
                best = (distance, Some(idx));
            } else {
                second = second.min(distance);
            }
        }
        best.1.filter(|_| best.0 < RATIO * RATIO * second)
    };
    rows.rows().map(nearest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_are_mutual_clear_and_agree_on_a_turn() {
        // Each keypoint has a descriptor of its own; the last two are alike, and so not clear.
        let descriptors = |order: [usize; 6]| {
            let mut matrix = Matrix::new(6);
            for idx in order {
                let mut row = [0.0; 6];
                row[idx.min(4)] = 1.0;
                matrix.push_row(&row);
            }
            matrix
        };
        let bearings = [0.1, 1.0, 2.0, 3.1, 4.0, 5.0];
        let first = Panorama {
            directions: bearings.map(|bearing| (bearing, 0.5)).to_vec(),
            descriptors: descriptors([0, 1, 2, 3, 4, 5]),
        };
        // All turn by half a radian, over the seam too; the third is not where it should be.
        let mut second = Panorama {
            directions: bearings.map(|bearing| (turn(0.0, bearing + 0.5), 0.52)).to_vec(),
            descriptors: descriptors([0, 1, 2, 3, 4, 5]),
        };
        assert_eq!(count(&first, &second), [6, 6, 4, 4]);
        second.directions[2].0 += 0.3;
        assert_eq!(count(&first, &second), [6, 6, 4, 3]);
        second.directions[1].1 += 0.3;
        assert_eq!(count(&first, &second), [6, 6, 4, 2]);
    }

    #[test]
    fn chance_matches_agree_seldom() {
        use rand::{Rng, SeedableRng};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let moves: Vec<(f64, f64)> =
            (0..200).map(|_| (random.random_range(-PI..PI), random.random_range(-0.7..0.7))).collect();
        assert!(n_agreeing(&moves) < 10, "{}", n_agreeing(&moves));
    }
}
