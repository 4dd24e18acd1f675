//! Where in a frame words are counted: whole frames, or parts of them that are counted apart (Lazebnik, Schmid,
//! Ponce, "Beyond bags of features: spatial pyramid matching for recognizing natural scene categories", 2006).

use roomsight_vision::camera::Spot;
use serde::{Deserialize, Serialize};

/// The most levels, of which the last has 64 parts of a pyramid, or 8 bands.
const MAX_LEVELS: usize = 4;

/// Which parts of a frame have their own counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Pooling {
    /// None: words are counted over the whole frame.
    // With braces, serde refuses the parameters of others beside it.
    Whole {},
    /// The frame, its quarters, their quarters and so on; of a camera that sees all around, the bands.
    Pyramid {
        /// 1 is the whole frame, 2 quarters as well, and so on; at most 4.
        levels: usize,
    },
    /// The frame, its halves by height, their halves and so on; in a mirror, rings. Turning a camera that sees all
    /// around changes none of them.
    Bands {
        /// 1 is the whole frame, 2 halves as well, and so on; at most 4.
        levels: usize,
    },
}

impl Default for Pooling {
    fn default() -> Self {
        Self::Whole {}
    }
}

/// Parts of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Parts {
    levels: usize,
    /// Whether parts are halved from left to right as well.
    are_quartered: bool,
}

impl Pooling {
    /// The parts of frames of a camera that does or does not see all around.
    pub(super) fn parts(self, sees_all_around: bool) -> Parts {
        match self {
            Self::Whole {} => Parts { levels: 1, are_quartered: false },
            Self::Pyramid { levels } => Parts { levels, are_quartered: !sees_all_around },
            Self::Bands { levels } => Parts { levels, are_quartered: false },
        }
    }

    pub(super) fn is_whole(&self) -> bool {
        matches!(self, Self::Whole {})
    }

    /// What is wrong with the parameters, if anything.
    pub(super) fn check(self) -> Result<(), String> {
        match self {
            Self::Pyramid { levels } | Self::Bands { levels } if !(1..=MAX_LEVELS).contains(&levels) => {
                Err(format!("words are pooled at 1 to {MAX_LEVELS} levels, not {levels}"))
            }
            _ => Ok(()),
        }
    }
}

impl Parts {
    /// The number of parts of all levels together.
    pub(super) fn n_parts(self) -> usize {
        (0..self.levels).map(|level| self.n_at(level)).sum()
    }

    /// How much a word counts in each part: finer parts for more, 1 in all over the levels (equation 3 of the
    /// paper).
    pub(super) fn weights(self) -> impl Iterator<Item = f32> {
        (0..self.levels).flat_map(move |level| {
            let n_finer = (self.levels - level.max(1)) as f32;
            std::iter::repeat_n((-n_finer).exp2(), self.n_at(level))
        })
    }

    /// The part of each level that a spot is in.
    pub(super) fn of(self, spot: Spot) -> impl Iterator<Item = usize> {
        let mut first = 0;
        (0..self.levels).map(move |level| {
            let n_rows = 1 << level;
            // Casts send what is below 0 to 0.
            let at = |share: f32| ((share * n_rows as f32) as usize).min(n_rows - 1);
            let part = if self.are_quartered {
                at(spot.down) * n_rows + at(spot.across.unwrap_or_default())
            } else {
                at(spot.down)
            };
            let part = first + part;
            first += self.n_at(level);
            part
        })
    }

    fn n_at(self, level: usize) -> usize {
        if self.are_quartered { 1 << (2 * level) } else { 1 << level }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use roomsight_vision::camera::{Camera, Mirror, Projection};

    fn parts_at(pooling: Pooling, across: f32, down: f32) -> Vec<usize> {
        pooling.parts(false).of(Spot { across: Some(across), down }).collect()
    }

    #[test]
    fn a_spot_is_in_one_part_of_each_level() {
        let pyramid = Pooling::Pyramid { levels: 3 };
        assert_eq!(parts_at(pyramid, 0.0, 0.0), [0, 1, 5]);
        assert_eq!(parts_at(pyramid, 0.99, 0.3), [0, 2, 12]);
        assert_eq!(parts_at(pyramid, 1.0, 1.0), [0, 4, 20]);
        assert_eq!(parts_at(Pooling::Bands { levels: 3 }, 0.6, 0.6), [0, 2, 5]);
        assert_eq!(parts_at(Pooling::Whole {}, 0.6, 0.6), [0]);
        // Rounding may send a spot beyond a rim.
        assert_eq!(parts_at(pyramid, -0.01, 1.01), [0, 3, 17]);
    }

    #[test]
    fn a_word_counts_one_over_all_levels() {
        for levels in 1..=4 {
            for pooling in [Pooling::Pyramid { levels }, Pooling::Bands { levels }] {
                let parts = pooling.parts(false);
                let weights: Vec<f32> = parts.weights().collect();
                assert_eq!(weights.len(), parts.n_parts());
                let spot = Spot { across: Some(0.3), down: 0.8 };
                assert_eq!(parts.of(spot).map(|part| weights[part]).sum::<f32>(), 1.0);
            }
        }
        let parts = Pooling::Pyramid { levels: 3 }.parts(false);
        let weights: Vec<f32> = parts.weights().collect();
        assert_eq!((weights[0], weights[1], weights[20]), (0.25, 0.25, 0.5));
    }

    #[test]
    fn cameras_that_see_all_around_have_bands() {
        let (pyramid, bands) = (Pooling::Pyramid { levels: 2 }, Pooling::Bands { levels: 2 });
        assert_eq!(pyramid.parts(false).n_parts(), 5);
        assert_eq!(pyramid.parts(true), bands.parts(true));
        assert_eq!(bands.parts(false), bands.parts(true));
    }

    #[test]
    fn absurd_parameters_are_refused() {
        for levels in [0, 5, usize::MAX] {
            assert!(Pooling::Pyramid { levels }.check().is_err());
            assert!(Pooling::Bands { levels }.check().is_err());
        }
        assert_eq!(Pooling::Pyramid { levels: 4 }.check(), Ok(()));
        assert!(toml::from_str::<Pooling>("kind = 'whole'\nlevels = 2").is_err());
    }

    proptest! {
        #[test]
        fn turning_leaves_bands_and_rings_as_they_are(
            radius in 0.06f32..0.44, angle in 0.0f32..6.3, turn in 0.0f32..6.3, height in 0.0f32..100.0,
            columns in 0.0f32..200.0,
        ) {
            let mirror = Mirror { center_x: 0.5, center_y: 0.5, inner_radius: 0.05, outer_radius: 0.45 };
            let parts = Pooling::Pyramid { levels: 4 }.parts(true);
            // Off the rings' borders, where rounding decides.
            prop_assume!(((radius - 0.05) * 20.0).fract().clamp(0.001, 0.999) == ((radius - 0.05) * 20.0).fract());
            let view = Camera::new(Projection::Omnidirectional(mirror)).view(300, 300);
            let ring = |angle: f32| {
                let spot = view.spot(150.0 + 300.0 * radius * angle.cos(), 150.0 + 300.0 * radius * angle.sin());
                prop_assert_eq!(spot.across, None);
                Ok(parts.of(spot).collect::<Vec<_>>())
            };
            prop_assert_eq!(ring(angle)?, ring(angle + turn)?);
            let view = Camera::new(Projection::Equirectangular).view(200, 100);
            let band = |x: f32| parts.of(view.spot(view.column(x), height)).collect::<Vec<_>>();
            prop_assert_eq!(band(0.0), band(columns));
        }
    }
}
