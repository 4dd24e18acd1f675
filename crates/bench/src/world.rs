//! Descriptors that cluster, as many as one likes, and a memory of them.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use roomsight_recognition::classify::memory::{Config, Memory, Origin, Prepared};
use roomsight_vision::matrix::Matrix;

const N_FRAMES: usize = 1600;
/// Of the frames that are remembered.
pub const N_PLACES: usize = 25;
const N_DESCRIPTORS: usize = 200;
const WIDTH: usize = 72;

/// Things that can be seen; real descriptors cluster as well.
const N_THINGS: usize = 4000;

/// Frames that show things, a little changed.
pub struct World {
    things: Vec<Vec<f32>>,
    random: ChaCha8Rng,
}

impl Default for World {
    fn default() -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let thing = |_| (0..WIDTH).map(|_| random.random_range(0.0..1.0f32).powi(4)).collect();
        let things = (0..N_THINGS).map(thing).collect();
        Self { things, random }
    }
}

impl World {
    /// 200 descriptors of 72 numbers, of unit length.
    pub fn frame(&mut self) -> Matrix {
        let mut rows = Matrix::new(WIDTH);
        for _ in 0..N_DESCRIPTORS {
            let thing = &self.things[self.random.random_range(0..N_THINGS)];
            let seen: Vec<f32> =
                thing.iter().map(|value| value + self.random.random_range(0.0..0.3)).collect();
            let length = seen.iter().map(|value| value * value).sum::<f32>().sqrt();
            rows.push_row(&seen.iter().map(|value| value / length).collect::<Vec<_>>());
        }
        rows
    }

    /// A memory of 1600 frames of [`N_PLACES`] places: 320,000 descriptors.
    pub fn remembered(&mut self) -> Memory {
        let frames: Vec<Matrix> = (0..N_FRAMES).map(|_| self.frame()).collect();
        let prepared = Prepared::new(&frames.iter().collect::<Vec<_>>(), &Config::default(), 1).unwrap();
        let origin = |frame_idx| Origin { room_idx: frame_idx % N_PLACES, frame_idx };
        let chosen: Vec<(usize, Origin)> =
            (0..N_FRAMES).map(|frame_idx| (frame_idx, origin(frame_idx))).collect();
        prepared.memory(&chosen, N_PLACES)
    }
}
