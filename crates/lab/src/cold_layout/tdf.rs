//! The lines of `odom.tdf` and `scans.tdf`: numbers between spaces.
//!
//! | file | field, from 0 | what |
//! |---|---|---|
//! | both | 3, 4 | when, in Unix seconds and microseconds |
//! | `odom.tdf` | 8, 9, 11 | where, in meters, and the heading, in radians, in coordinates that begin with the drive |
//! | `scans.tdf` | 2 | how many ranges |
//! | `scans.tdf` | the last so many, from 16 on | the ranges, in meters |
//!
//! The database does not publish the layout; these are the fields that public readers of it take, and what the others hold is
//! not known. The scanner is a SICK LMS 200: half a circle ahead from right to left, in steps of a degree or half of one.

use roomsight_recognition::model::{Pose, Scan, ScanError};
use std::f32::consts::{PI, TAU};

const N_RANGES_FIELD: usize = 2;
const SECONDS_FIELD: usize = 3;
const X_FIELD: usize = 8;
const HEADING_FIELD: usize = 11;
const N_SCAN_FIELDS: usize = 16;

/// What the scanner gives for what is too far away begins here, in meters.
const TOO_FAR: f32 = 81.0;

/// What is written for what is too far away, in meters.
const NO_ECHO: f32 = 81.91;

/// What a line says, and when that was, in Unix seconds.
#[derive(Clone, Debug, PartialEq)]
pub struct Timed<T> {
    /// In seconds.
    pub time: f64,
    /// What was then.
    pub what: T,
}

/// Reads a line of `odom.tdf`.
///
/// # Errors
/// What is wrong with it.
pub fn read_odometry(line: &str) -> Result<Timed<Pose>, String> {
    let fields: Vec<&str> = line.split_ascii_whitespace().collect();
    let pose = Pose {
        x: number(&fields, X_FIELD)?,
        y: number(&fields, X_FIELD + 1)?,
        angle: number(&fields, HEADING_FIELD)?,
    };
    Ok(Timed { time: time(&fields)?, what: pose })
}

/// Reads a line of `scans.tdf`.
///
/// # Errors
/// What is wrong with it.
pub fn read_scan(line: &str) -> Result<Timed<Scan>, String> {
    let fields: Vec<&str> = line.split_ascii_whitespace().collect();
    let n_ranges = number(&fields, N_RANGES_FIELD)? as usize;
    let first = fields.len().checked_sub(n_ranges).filter(|first| *first >= N_SCAN_FIELDS);
    let first = first.ok_or_else(|| format!("{} fields do not hold {n_ranges} ranges", fields.len()))?;
    let ranges: Result<Vec<f32>, String> =
        (first..fields.len()).map(|idx| number(&fields, idx).map(|n| n as f32)).collect();
    let scan = scan(ranges?).map_err(|error| error.to_string())?;
    Ok(Timed { time: time(&fields)?, what: scan })
}

/// The ranges of beams as the database's scanner casts them, or all around where they are a full circle of degrees or parts of them.
fn scan(ranges: Vec<f32>) -> Result<Scan, ScanError> {
    let n_beams = ranges.len();
    let is_circle = n_beams > 0 && n_beams.is_multiple_of(360);
    let (start, step) = if is_circle {
        (-PI, TAU / n_beams as f32)
    } else {
        (-PI / 2.0, PI / n_beams.saturating_sub(1).max(1) as f32)
    };
    Scan::new(start, step, TOO_FAR, ranges)
}

/// A line of `odom.tdf`, with its end: where, in meters, and the heading, in radians.
pub fn odometry_line(time: f64, [x, y]: [f64; 2], heading: f64) -> String {
    format!("0 0 0 {} 2 0 6 {x:.6} {y:.6} 0.000000 {heading:.6} 0.000000 0.000000\n", stamp(time))
}

/// A line of `scans.tdf`, with its end. Where there is no range, nothing was met.
pub fn scan_line(time: f64, ranges: &[Option<f32>]) -> String {
    let mut line = format!("0 0 {} {}", ranges.len(), stamp(time));
    line.push_str(&" 0".repeat(N_SCAN_FIELDS - SECONDS_FIELD - 2));
    for range in ranges {
        line.push_str(&format!(" {:.3}", range.unwrap_or(NO_ECHO)));
    }
    line.push('\n');
    line
}

/// Seconds and microseconds.
fn stamp(time: f64) -> String {
    let microseconds = (time * 1e6).round().max(0.0) as u64;
    format!("{} {}", microseconds / 1_000_000, microseconds % 1_000_000)
}

fn time(fields: &[&str]) -> Result<f64, String> {
    Ok(number(fields, SECONDS_FIELD)? + number(fields, SECONDS_FIELD + 1)? * 1e-6)
}

fn number(fields: &[&str], idx: usize) -> Result<f64, String> {
    let field =
        fields.get(idx).ok_or_else(|| format!("it has {} fields, and no field {idx}", fields.len()))?;
    let number = field.parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| format!("field {idx} is no number: {field:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_written_is_read() {
        let pose = Pose { x: 1.5, y: -2.25, angle: 3.125 };
        let line = odometry_line(1_151_900_000.25, [1.5, -2.25], 3.125);
        assert_eq!(read_odometry(&line).unwrap(), Timed { time: 1_151_900_000.25, what: pose });
        let ranges: Vec<Option<f32>> = (0..181).map(|idx| (idx > 0).then_some(idx as f32 / 8.0)).collect();
        let read = read_scan(&scan_line(1_151_900_000.5, &ranges)).unwrap();
        assert_eq!(read.time, 1_151_900_000.5);
        assert!((read.what.field_degrees() - 180.0).abs() < 1e-3);
        assert_eq!(read.what, scan(ranges.iter().map(|range| range.unwrap_or(NO_ECHO)).collect()).unwrap());
        assert!(
            (read_scan(&scan_line(1.0, &[Some(1.0); 720])).unwrap().what.field_degrees() - 359.5).abs()
                < 1e-2
        );
    }

    #[test]
    fn lines_that_are_cut_or_none_are_refused() {
        let line = scan_line(7.0, &[Some(1.0); 181]);
        for line in
            ["", "0 0 181 1 2", "0 0 1e30 1 2", "0 0 x 1 2", &line[..40], &line.replace(" 181 ", " 3 ")]
        {
            assert!(read_scan(line).is_err(), "{line:?}");
        }
        assert!(read_odometry("0 0 0 1 2 2 0 6 1.0 2.0").unwrap_err().contains("no field 11"));
        assert!(read_odometry("0 0 0 1 2 2 0 6 1.0 inf 0 1").unwrap_err().contains("no number"));
    }

    proptest! {
        #[test]
        fn no_text_panics(text in ".{0,200}", numbers in prop::collection::vec(any::<f32>(), 0..40)) {
            let line: String = numbers.iter().map(|number| format!("{number} ")).collect();
            for line in [&text, &line] {
                let _ = (read_scan(line).is_ok(), read_odometry(line).is_ok());
            }
        }
    }
}
