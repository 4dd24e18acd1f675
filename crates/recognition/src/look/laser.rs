//! The shape of the free space around a robot, by its laser.
//!
//! The features are those of Martínez Mozos, Stachniss and Burgard, "Supervised learning of places from range data using
//! AdaBoost" (ICRA 2005), sections IV.A (of the beams) and IV.B (of the polygon between their ends), which tell kinds of places,
//! and beside them how far the beams reach by direction, which tells places of a kind apart. Each number is spread over bins
//! (piecewise linear, as by Maji and Berg, "Max-margin additive classifiers for detection", ICCV 2009), so that linear machines
//! find any function of it.

use crate::look::scan::Scan;
use serde::{Deserialize, Serialize};
use std::f32::consts::{PI, TAU};

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
const N_SECTORS: usize = 12;
const N_DISTANCES: usize = 10;

/// Numbers of beams and of their polygon; see [`LaserShape::numbers`].
const N_NUMBERS: usize = 58;

/// The share of beams that must meet something for a scan to say anything.
const FEWEST_ECHOES: f32 = 0.1;

/// Ranges that count as no more than this, in meters, beside as far as is looked.
const CAPS: [f32; 2] = [2.0, 4.0];
/// From one beam to the next so much farther or nearer is a gap, in meters.
const GAPS: [f32; 4] = [0.25, 0.5, 1.0, 2.0];
/// The same as a share of the farther one.
const RELATIVE_GAPS: [f32; 2] = [0.5, 0.75];
/// Coefficients of Fourier of the ranges, and to each side of those of the polygon.
const N_WAVES: usize = 10;
const N_POLYGON_WAVES: i32 = 4;

impl LaserShape {
    /// The length of [`LaserShape::describe`].
    pub const N_DIMENSIONS: usize = N_NUMBERS * N_BINS + N_SECTORS * N_DISTANCES;

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
        if !self.is_covered_by(scan) {
            return Vec::new();
        }
        let ranges: Vec<Option<f32>> = self.angles().map(|angle| scan.range_at(angle)).collect();
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
        reach.iter_mut().for_each(|count| *count = count.sqrt());
        [shape, reach].into_iter().flat_map(half_of_length_1).collect()
    }

    /// The directions that are looked at, in radians.
    fn angles(&self) -> impl Iterator<Item = f32> {
        let field = self.field_degrees.to_radians();
        // All around, the last beam is not the first once more.
        let n_steps = if self.field_degrees >= 360.0 { N_BEAMS } else { N_BEAMS - 1 };
        (0..N_BEAMS).map(move |beam| (beam as f32 / n_steps as f32 - 0.5) * field)
    }

    /// [`N_NUMBERS`] numbers from 0 to 1.
    fn numbers(&self, ranges: &[f32]) -> Vec<f32> {
        let mut numbers = self.of_beams(ranges);
        numbers.extend(self.of_polygon(ranges));
        numbers.iter_mut().for_each(|number| *number = number.clamp(0.0, 1.0));
        numbers
    }

    /// Numbers of the ranges, section IV.A.
    fn of_beams(&self, ranges: &[f32]) -> Vec<f32> {
        let farthest = self.max_range;
        let mut numbers = Vec::with_capacity(N_NUMBERS);
        for cap in CAPS.into_iter().chain([farthest]) {
            let capped: Vec<f32> = ranges.iter().map(|range| range.min(cap)).collect();
            let [all, steps] = [Spread::of(&capped), Spread::of(&steps(&capped))];
            numbers.extend([root(all.mean, cap), root(all.deviation, cap)]);
            numbers.extend([root(steps.mean, 0.2 * cap), root(steps.deviation, 0.5 * cap)]);
        }
        let n_beyond = |values: &[f32], least: f32| values.iter().filter(|value| **value > least).count();
        let differences = steps(ranges);
        numbers.extend(GAPS.map(|gap| root(n_beyond(&differences, gap) as f32, 20.0)));
        let ratios: Vec<f32> =
            ranges.windows(2).map(|pair| pair[0].min(pair[1]) / pair[0].max(pair[1])).collect();
        let ratio = Spread::of(&ratios);
        numbers.extend([ratio.mean, root(ratio.deviation, 0.5)]);
        numbers.extend(
            RELATIVE_GAPS.map(|gap| root(ratios.iter().filter(|ratio| **ratio < gap).count() as f32, 20.0)),
        );
        let longest = ranges.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let shares: Vec<f32> = ranges.iter().map(|range| range / longest).collect();
        let share = Spread::of(&shares);
        numbers.extend([
            share.mean,
            root(share.deviation, 0.5),
            root(Spread::of(ranges).kurtosis(ranges), 12.0),
        ]);
        let [first, second] = two_minima(ranges);
        let [at, other] = [first, second].map(|beam| self.end(beam, ranges[beam]));
        numbers.extend([
            root(ranges[first], farthest),
            root((at[0] - other[0]).hypot(at[1] - other[1]), farthest),
            (second as f32 - first as f32).abs() / N_BEAMS as f32,
        ]);
        // However the robot is turned, these stay nearly the same.
        let mean = Spread::of(ranges).mean.max(f32::MIN_POSITIVE);
        let wave = |number: usize| {
            let points = ranges.iter().enumerate().map(|(beam, range)| {
                let phase = TAU * (number * beam) as f32 / N_BEAMS as f32;
                [range * phase.cos(), range * phase.sin()]
            });
            length_of_mean(points)
        };
        numbers.extend((1..=N_WAVES).map(|number| root(wave(number) / mean, 1.0)));
        numbers
    }

    /// Numbers of the polygon between the ends of the beams, section IV.B.
    fn of_polygon(&self, ranges: &[f32]) -> Vec<f32> {
        let farthest = self.max_range;
        let mut points: Vec<[f32; 2]> =
            ranges.iter().enumerate().map(|(beam, range)| self.end(beam, *range)).collect();
        if self.field_degrees < 360.0 {
            points.push([0.0, 0.0]);
        }
        let next = |idx: usize| points[(idx + 1) % points.len()];
        let pairs = || points.iter().enumerate().map(|(idx, point)| (*point, next(idx)));
        let area = pairs().map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f32>().abs() / 2.0;
        let perimeter: f32 = pairs().map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).sum();
        let perimeter = perimeter.max(f32::MIN_POSITIVE);
        let n_points = points.len() as f32;
        let center = [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f32>() / n_points);
        let from_center: Vec<[f32; 2]> =
            points.iter().map(|point| [point[0] - center[0], point[1] - center[1]]).collect();
        let distances: Vec<f32> = from_center.iter().map(|point| point[0].hypot(point[1])).collect();
        let distance = Spread::of(&distances);
        let farthest_from_center = distances.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let relative: Vec<f32> = distances.iter().map(|distance| distance / farthest_from_center).collect();
        let relative = Spread::of(&relative);
        let moment = |p: i32, q: i32| {
            from_center.iter().map(|point| point[0].powi(p) * point[1].powi(q)).sum::<f32>() / n_points
        };
        let [xx, yy, xy] = [moment(2, 0), moment(0, 2), moment(1, 1)];
        let (half_sum, half_gap) = ((xx + yy) / 2.0, ((xx - yy) / 2.0).hypot(xy));
        let [major, minor] = [half_sum + half_gap, half_sum - half_gap].map(|value| value.max(0.0).sqrt());
        let turned = xy.atan2((xx - yy) / 2.0);
        // The first invariants of Hu ("Visual pattern recognition by moment invariants", 1962), by size.
        let scale = (2.0 * half_sum).max(f32::MIN_POSITIVE).powf(1.5);
        let [xxx, yyy, xxy, xyy] = [moment(3, 0), moment(0, 3), moment(2, 1), moment(1, 2)];
        let third = ((xxx - 3.0 * xyy).hypot(3.0 * xxy - yyy)) / scale;
        let fourth = ((xxx + xyy).hypot(xxy + yyy)) / scale;
        let mut numbers = vec![
            root(area, farthest * farthest),
            root(perimeter, 8.0 * farthest),
            root(area / perimeter, 2.0),
            4.0 * PI * area / (perimeter * perimeter),
            root(distance.mean, farthest),
            root(distance.deviation, 0.5 * farthest),
            relative.mean,
            root(relative.deviation, 0.5),
            root(major, farthest),
            root(minor, farthest),
            minor / major.max(f32::MIN_POSITIVE),
            f32::midpoint(turned.cos(), 1.0),
            f32::midpoint(turned.sin(), 1.0),
            root(third, 2.0),
            root(fourth, 2.0),
        ];
        let wave = |number: i32| {
            let turned = from_center.iter().enumerate().map(|(idx, [x, y])| {
                let (sin, cos) = (-TAU * number as f32 * idx as f32 / n_points).sin_cos();
                [x * cos - y * sin, x * sin + y * cos]
            });
            length_of_mean(turned)
        };
        let first = wave(1).max(f32::MIN_POSITIVE);
        let others = (-N_POLYGON_WAVES..=N_POLYGON_WAVES).filter(|number| ![0, 1].contains(number));
        numbers.extend(others.map(|number| root(wave(number) / first, 1.0)));
        numbers
    }

    /// Where a beam ends, in meters, ahead being the first axis.
    fn end(&self, beam: usize, range: f32) -> [f32; 2] {
        let angle = self.angles().nth(beam).unwrap_or_default();
        [range * angle.cos(), range * angle.sin()]
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

/// The same direction with the length that makes two of them one of length 1.
fn half_of_length_1(mut values: Vec<f32>) -> Vec<f32> {
    let length = values.iter().map(|value| value * value).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    let scale = 0.5_f32.sqrt() / length;
    values.iter_mut().for_each(|value| *value *= scale);
    values
}

/// From each value to the next.
fn steps(values: &[f32]) -> Vec<f32> {
    values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect()
}

fn length_of_mean(points: impl ExactSizeIterator<Item = [f32; 2]>) -> f32 {
    let n_points = points.len() as f32;
    let [x, y] = points.fold([0.0; 2], |sum, point| [sum[0] + point[0], sum[1] + point[1]]);
    (x / n_points).hypot(y / n_points)
}

/// The two beams that end nearest, each nearer than those beside it; the same twice where only one is.
fn two_minima(ranges: &[f32]) -> [usize; 2] {
    let is_minimum = |beam: &usize| {
        let beside = [beam.checked_sub(1), Some(beam + 1)].into_iter().flatten();
        beside.filter_map(|idx| ranges.get(idx)).all(|other| ranges[*beam] <= *other)
    };
    let mut minima: Vec<usize> = (0..ranges.len()).filter(is_minimum).collect();
    minima.sort_by(|one, other| ranges[*one].total_cmp(&ranges[*other]));
    let first = minima.first().copied().unwrap_or_default();
    [first, minima.get(1).copied().unwrap_or(first)]
}

/// Mean and standard deviation.
#[derive(Clone, Copy)]
struct Spread {
    mean: f32,
    deviation: f32,
}

impl Spread {
    fn of(values: &[f32]) -> Self {
        let n_values = values.len() as f32;
        let mean = values.iter().sum::<f32>() / n_values;
        let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f32>() / n_values;
        Self { mean, deviation: variance.sqrt() }
    }

    /// How much of the deviation of these values comes of few of them; 0 where all are the same.
    fn kurtosis(self, values: &[f32]) -> f32 {
        let fourth =
            values.iter().map(|value| (value - self.mean).powi(4)).sum::<f32>() / values.len() as f32;
        if self.deviation > 0.0 { fourth / self.deviation.powi(4) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// In a rectangular room, so far from its walls: right, left, behind, ahead.
    fn in_room([right, left, behind, ahead]: [f32; 4], start: f32, n_beams: usize) -> Scan {
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
    fn polygons_of_known_rooms_have_the_known_numbers() {
        let shape = LaserShape { field_degrees: 360.0, max_range: 20.0 };
        let scan = in_room([3.0, 3.0, 3.0, 3.0], -PI, 3601);
        let ranges: Vec<f32> = shape.angles().map(|angle| scan.range_at(angle).unwrap()).collect();
        assert_eq!(shape.numbers(&ranges).len(), N_NUMBERS);
        let numbers = shape.of_polygon(&ranges);
        let square = |share: f32, scale: f32| share * share * scale;
        let (area, perimeter) = (square(numbers[0], 400.0), square(numbers[1], 160.0));
        assert!((area - 36.0).abs() < 0.3, "{area}");
        assert!((perimeter - 24.0).abs() < 0.3, "{perimeter}");
        assert!((numbers[3] - PI / 4.0).abs() < 0.02, "of a square: {}", numbers[3]);
        assert!((numbers[10] - 1.0).abs() < 0.02, "as long as wide: {}", numbers[10]);
        let mean = square(shape.of_beams(&ranges)[8], 20.0);
        // The mean distance to the sides of a square, over all directions.
        let expected = 3.0 * 4.0 / PI * (1.0 + 2.0_f32.sqrt()).ln();
        assert!((mean - expected).abs() < 0.02, "{mean} instead of {expected}");
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
