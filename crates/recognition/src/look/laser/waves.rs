//! Rows by whose inner products a linear machine does nearly what one with the Gaussian kernel does: cosines and sines along
//! random directions that are orthogonal to each other in groups (Yu et al., "Orthogonal random features", NeurIPS 2016, after
//! Rahimi and Recht 2007).

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::TAU;

/// The kernel is exp(-gamma d^2) at the distance d.
const GAMMA: f32 = 2.0;

/// Draws the directions: all models have the same.
const SEED: u64 = 1;

/// The directions for rows of one length.
pub(super) struct Waves {
    directions: Vec<Vec<f32>>,
}

impl Waves {
    /// So many for rows of so many numbers.
    pub(super) fn draw(n_directions: usize, n_numbers: usize) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(SEED);
        let mut directions: Vec<Vec<f32>> = Vec::with_capacity(n_directions);
        while directions.len() < n_directions {
            let group = directions.len() - directions.len() % n_numbers;
            let mut direction = normals(&mut random, n_numbers);
            // By Gram and Schmidt; those of the group have length 1.
            for other in &directions[group..] {
                let along = product(&direction, other);
                direction.iter_mut().zip(other).for_each(|(value, other)| *value -= along * other);
            }
            scale(&mut direction, 1.0);
            directions.push(direction);
        }
        for direction in &mut directions {
            // As long as ones whose numbers are all drawn.
            let drawn = normals(&mut random, n_numbers);
            scale(direction, product(&drawn, &drawn).sqrt() * (2.0 * GAMMA).sqrt());
        }
        Self { directions }
    }

    /// Two numbers a direction, of length 1 together.
    pub(super) fn of(&self, row: &[f32]) -> Vec<f32> {
        let unit = (1.0 / self.directions.len() as f32).sqrt();
        let pair = |direction: &Vec<f32>| {
            let (sin, cos) = product(direction, row).sin_cos();
            [unit * cos, unit * sin]
        };
        self.directions.iter().flat_map(pair).collect()
    }
}

/// Numbers of the standard normal distribution, by Box and Muller (1958).
fn normals(random: &mut ChaCha8Rng, n_numbers: usize) -> Vec<f32> {
    let mut draw = || {
        let (radius, angle) = (random.random_range(f32::MIN_POSITIVE..1.0), random.random_range(0.0..TAU));
        (-2.0 * radius.ln()).sqrt() * angle.cos()
    };
    (0..n_numbers).map(|_| draw()).collect()
}

fn product(one: &[f32], other: &[f32]) -> f32 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

/// Gives a row this length.
fn scale(row: &mut [f32], length: f32) {
    let scale = length / product(row, row).sqrt().max(f32::MIN_POSITIVE);
    row.iter_mut().for_each(|value| *value *= scale);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inner_products_are_nearly_the_kernel() {
        let waves = Waves::draw(512, 72);
        let mut random = ChaCha8Rng::seed_from_u64(7);
        for distance in [0.0_f32, 0.2, 0.5, 0.8, 1.2] {
            let one = normals(&mut random, 72).into_iter().map(|value| value * 0.1).collect::<Vec<f32>>();
            let mut step = normals(&mut random, 72);
            scale(&mut step, distance.max(f32::MIN_POSITIVE));
            let other: Vec<f32> = one.iter().zip(&step).map(|(one, step)| one + step).collect();
            let found = product(&waves.of(&one), &waves.of(&other));
            let kernel = (-GAMMA * distance * distance).exp();
            assert!((found - kernel).abs() < 0.1, "{found} instead of {kernel} at {distance}");
        }
    }
}
