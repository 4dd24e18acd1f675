//! Numbers of a scan: of the lengths of its beams, and of the polygon between their ends. After Martínez Mozos, Stachniss and
//! Burgard, "Supervised learning of places from range data using AdaBoost" (ICRA 2005), sections IV.A and IV.B.

use super::{LaserShape, N_BEAMS, root};
use std::f32::consts::{PI, TAU};

/// How many they are; see [`LaserShape::numbers`].
pub(super) const N_NUMBERS: usize = 58;

/// Ranges that count as no more than this, in meters, beside as far as is looked.
const CAPS: [f32; 2] = [2.0, 4.0];
/// From one beam to the next so much farther or nearer is a gap, in meters.
const GAPS: [f32; 4] = [0.25, 0.5, 1.0, 2.0];
/// The same as a share of the farther one.
const RELATIVE_GAPS: [f32; 2] = [0.5, 0.75];
/// Coefficients of Fourier of the ranges, and to each side of those of the polygon.
const N_RANGE_WAVES: usize = 10;
const N_POLYGON_WAVES: i32 = 4;

impl LaserShape {
    /// [`N_NUMBERS`] numbers from 0 to 1.
    pub(super) fn numbers(&self, ranges: &[f32]) -> Vec<f32> {
        let mut numbers = self.of_beams(ranges);
        numbers.extend(self.of_polygon(ranges));
        // Of beams that end where they begin, some are no numbers.
        let in_range = |number: &mut f32| *number = if *number > 0.0 { number.min(1.0) } else { 0.0 };
        numbers.iter_mut().for_each(in_range);
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
        numbers.extend((1..=N_RANGE_WAVES).map(|number| root(wave(number) / mean, 1.0)));
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
        let angle = self.angle(beam);
        [range * angle.cos(), range * angle.sin()]
    }
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
    use crate::look::laser::tests::in_room;

    #[test]
    fn polygons_of_known_rooms_have_the_known_numbers() {
        let shape = LaserShape { field_degrees: 360.0, max_range: 20.0 };
        let scan = in_room([3.0, 3.0, 3.0, 3.0], -PI, 3601);
        let ranges: Vec<f32> =
            shape.angles().map(|angle| scan.range_of(scan.beam_at(angle).unwrap()).unwrap()).collect();
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
}
