//! The shape of the free space around a robot, by its laser.
//!
//! How far the beams reach by direction tells places apart; what kind of place it is tell the [`numbers`] of Martínez Mozos et al.
//! Each of these is spread over bins (piecewise linear, as by Maji and Berg, "Max-margin additive classifiers for detection",
//! ICCV 2009), and the former turned into [`waves`], so that linear machines find what is not linear.

mod numbers;
mod waves;

use crate::look::scan::Scan;
use numbers::N_NUMBERS;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;
use waves::Waves;

/// How the scans of a laser are described.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LaserShape {
    /// How much of the surroundings is looked at, half of it to each side of ahead, in degrees from 90 to 360. Scans that do
    /// not reach so far say nothing; of those that reach farther the rest is left out.
    pub field_degrees: f32,
    /// What lies farther away is as far as this, in meters.
    pub max_range: f32,
}

impl Default for LaserShape {
    fn default() -> Self {
        Self { field_degrees: 180.0, max_range: 10.0 }
    }
}

/// Beams that are looked at, of however many there are.
const N_BEAMS: usize = 181;

/// Bins that each number is spread over.
const N_BINS: usize = 8;

/// Directions in which it is counted how far beams reach, and the bins of that.
const N_SECTORS: usize = 6;
const N_DISTANCES: usize = 12;

/// Directions of [`Waves`].
const N_WAVES: usize = 512;

/// How much the numbers count beside how far beams reach, as a share of an inner product.
const SHARE_OF_NUMBERS: f32 = 0.14;

static WAVES: LazyLock<Waves> = LazyLock::new(|| Waves::draw(N_WAVES, N_SECTORS * N_DISTANCES));

/// The share of beams that must meet something for a scan to say anything.
const FEWEST_ECHOES: f32 = 0.1;

impl LaserShape {
    /// The length of [`LaserShape::describe`].
    pub const N_DIMENSIONS: usize = N_NUMBERS * N_BINS + 2 * N_WAVES;

    /// What is wrong with the parameters, if anything.
    pub(crate) fn check(&self) -> Result<(), String> {
        if !(90.0..=360.0).contains(&self.field_degrees) {
            return Err(format!("field_degrees must be from 90 to 360, not {}", self.field_degrees));
        }
        if !(1.0..=100.0).contains(&self.max_range) {
            return Err(format!("max_range must be from 1 to 100 meters, not {}", self.max_range));
        }
        Ok(())
    }

    /// Whether a scan reaches as far to both sides as is looked at.
    pub fn is_covered_by(&self, scan: &Scan) -> bool {
        self.angles().all(|angle| scan.beam_at(angle).is_some())
    }

    /// What a scan shows: [`LaserShape::N_DIMENSIONS`] numbers of length 1 together; none where it is not covered, or hardly a
    /// beam met anything.
    pub fn describe(&self, scan: &Scan) -> Vec<f32> {
        let beams = self.angles().map(|angle| scan.beam_at(angle)).collect::<Option<Vec<usize>>>();
        let Some(beams) = beams else { return Vec::new() };
        let ranges: Vec<Option<f32>> = beams.into_iter().map(|beam| scan.range_of(beam)).collect();
        let n_echoes = ranges.iter().flatten().count();
        if (n_echoes as f32) < FEWEST_ECHOES * N_BEAMS as f32 {
            return Vec::new();
        }
        let ranges: Vec<f32> = ranges
            .into_iter()
            .map(|range| range.map_or(self.max_range, |range| range.min(self.max_range)))
            .collect();
        let numbers = self.numbers(&ranges);
        let mut shape = vec![0.0; N_NUMBERS * N_BINS];
        for (number, bins) in numbers.iter().zip(shape.chunks_exact_mut(N_BINS)) {
            spread(*number, bins);
        }
        let mut reach = vec![0.0; N_SECTORS * N_DISTANCES];
        for (beam, range) in ranges.iter().enumerate() {
            let sector = beam * N_SECTORS / N_BEAMS;
            let bins = &mut reach[sector * N_DISTANCES..][..N_DISTANCES];
            spread(root(*range, self.max_range), bins);
        }
        // The inner product of roots of counts is how much two histograms overlap (Bhattacharyya 1943).
        reach.iter_mut().for_each(|count| *count = (*count / N_BEAMS as f32).sqrt());
        let mut described = of_length(shape, SHARE_OF_NUMBERS.sqrt());
        described.extend(of_length(WAVES.of(&reach), (1.0 - SHARE_OF_NUMBERS).sqrt()));
        described
    }

    /// The directions that are looked at, in radians.
    fn angles(&self) -> impl Iterator<Item = f32> {
        (0..N_BEAMS).map(|beam| self.angle(beam))
    }

    /// That of one of [`N_BEAMS`].
    fn angle(&self, beam: usize) -> f32 {
        // All around, the last beam is not the first once more.
        let n_steps = if self.field_degrees >= 360.0 { N_BEAMS } else { N_BEAMS - 1 };
        (beam as f32 / n_steps as f32 - 0.5) * self.field_degrees.to_radians()
    }
}

/// A number that is not negative, from 0 to 1 at `scale`: small ones matter more.
fn root(value: f32, scale: f32) -> f32 {
    (value.max(0.0) / scale).sqrt().min(1.0)
}

/// Spreads a number from 0 to 1 over the two bins nearest to it.
fn spread(number: f32, bins: &mut [f32]) {
    let last = bins.len() - 1;
    let place = number.clamp(0.0, 1.0) * last as f32;
    let bin = (place as usize).min(last - 1);
    bins[bin] += 1.0 - (place - bin as f32);
    bins[bin + 1] += place - bin as f32;
}

/// The same direction with this length.
fn of_length(mut values: Vec<f32>, length: f32) -> Vec<f32> {
    let before = values.iter().map(|value| value * value).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    values.iter_mut().for_each(|value| *value *= length / before);
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f32::consts::{PI, TAU};

    /// In a rectangular room, so far from its walls: right, left, behind, ahead.
    pub(super) fn in_room([right, left, behind, ahead]: [f32; 4], start: f32, n_beams: usize) -> Scan {
        let step = -2.0 * start / (n_beams - 1) as f32;
        let range = |beam: usize| {
            let (sin, cos) = (start + beam as f32 * step).sin_cos();
            let x = if cos > 0.0 { ahead / cos } else { -behind / cos };
            let y = if sin > 0.0 { left / sin } else { -right / sin };
            x.min(y)
        };
        Scan::new(start, step, 30.0, (0..n_beams).map(range).collect()).unwrap()
    }

    fn likeness(shape: &LaserShape, one: &Scan, other: &Scan) -> f32 {
        shape.describe(one).iter().zip(shape.describe(other)).map(|(one, other)| one * other).sum()
    }

    #[test]
    fn rooms_are_told_from_corridors_and_from_themselves_only_by_where_one_stands() {
        let shape = LaserShape::default();
        let room = in_room([2.0, 2.0, 2.0, 3.0], -PI / 2.0, 181);
        let near = in_room([1.8, 2.2, 2.0, 2.8], -PI / 2.0, 181);
        let corridor = in_room([0.9, 0.9, 5.0, 9.0], -PI / 2.0, 181);
        assert!((likeness(&shape, &room, &room) - 1.0).abs() < 1e-5);
        let [same, other] = [near, corridor].map(|scan| likeness(&shape, &room, &scan));
        assert!(same > 0.8 && other < 0.6, "{same}, {other}");
    }

    #[test]
    fn lasers_of_other_resolutions_and_fields_show_the_same() {
        let shape = LaserShape::default();
        let room = [2.0, 3.0, 4.0, 2.5];
        let coarse = in_room(room, -PI / 2.0, 181);
        for other in [in_room(room, -PI / 2.0, 721), in_room(room, -0.75 * PI, 1081), in_room(room, -PI, 721)]
        {
            let likeness = likeness(&shape, &coarse, &other);
            assert!(likeness > 0.98, "{likeness}");
        }
        let narrow = in_room(room, -PI / 4.0, 181);
        assert!(!shape.is_covered_by(&narrow) && shape.describe(&narrow).is_empty());
        let around = LaserShape { field_degrees: 360.0, ..LaserShape::default() };
        assert!(!around.is_covered_by(&coarse) && around.is_covered_by(&in_room(room, -PI, 721)));
    }

    #[test]
    fn a_laser_that_meets_nothing_says_nothing() {
        let covered = Scan::new(-PI / 2.0, PI / 180.0, 8.0, vec![0.0; 181]).unwrap();
        assert!(LaserShape::default().describe(&covered).is_empty());
    }

    #[test]
    fn beams_that_end_where_they_begin_give_numbers() {
        for range in [1e-45, 1e-30, 1e-10, 1e-3] {
            let scan = Scan::new(-PI / 2.0, PI / 180.0, 8.0, vec![range; 181]).unwrap();
            let numbers = LaserShape::default().describe(&scan);
            assert!(!numbers.is_empty() && numbers.iter().all(|number| number.is_finite()), "{range}");
        }
    }

    proptest! {
        #[test]
        fn any_scan_is_described_by_finite_numbers_of_length_1(
            ranges in prop::collection::vec(prop_oneof![
                8 => 0.0_f32..40.0, 1 => Just(f32::NAN), 1 => Just(f32::INFINITY), 1 => Just(-1.0), 1 => Just(1e-30)
            ], 181..400),
            field_degrees in prop_oneof![Just(180.0_f32), Just(360.0), 90.0_f32..360.0],
            max_range in 1.0_f32..100.0,
        ) {
            let step = TAU / ranges.len() as f32;
            let scan = Scan::new(-PI, step, 30.0, ranges).unwrap();
            let shape = LaserShape { field_degrees, max_range };
            let numbers = shape.describe(&scan);
            if !numbers.is_empty() {
                prop_assert_eq!(numbers.len(), LaserShape::N_DIMENSIONS);
                let length: f32 = numbers.iter().map(|number| number * number).sum();
                prop_assert!((length - 1.0).abs() < 1e-4, "{}", length);
            }
        }
    }
}
