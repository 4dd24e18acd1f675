//! Sequences of COLD with scans and odometry beside their pictures.

use super::*;
use crate::cold_layout::tdf;
use crate::simulate::{self, Lab, Route, SequenceSpec, Simulation};
use roomsight_recognition::model::LaserShape;

const SEQUENCE: &str = "cold-freiburg/part_a/seq1_night1";

/// Two frames, of seconds 1 and 2, with these lines beside them.
fn sensed(scans: &str, odometry: &str) -> TempDir {
    let set = cold_tree(&[SEQUENCE]);
    let folder = set.path().join(SEQUENCE).join("odom_scans");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("scans.tdf"), scans).unwrap();
    fs::write(folder.join("odom.tdf"), odometry).unwrap();
    set
}

fn taken(set: &TempDir) -> Dataset {
    let taking = Taking { laser: true, odometry: true, ..Taking::default() };
    open_for(set.path(), &[], &taking).unwrap().with_camera(CameraKind::Perspective).unwrap()
}

#[test]
fn the_scan_and_the_pose_nearest_in_time_belong_to_a_frame() {
    let scan = |time: f64, range: f32| tdf::scan_line(time, &[Some(range); 181]);
    let scans = [scan(2.1, 3.0), scan(0.95, 1.0), scan(1.2, 2.0)].concat();
    let pose = |time, x| tdf::odometry_line(time, [x, 0.0], 0.0);
    let dataset = taken(&sensed(&scans, &[pose(1.0, 5.0), pose(3.0, 9.0)].concat()));
    let range = |frame: &Frame| frame.read_scan().unwrap().unwrap().ranges()[90];
    assert_eq!(dataset.frames.iter().map(range).collect::<Vec<_>>(), [1.0, 3.0]);
    let x = |frame: &Frame| frame.odometry.map(|pose| pose.x);
    assert_eq!(dataset.frames.iter().map(x).collect::<Vec<_>>(), [Some(5.0), None], "a second is too far");
    assert_eq!(dataset.problems, []);
}

#[test]
fn lines_that_cannot_be_read_are_told_and_the_others_taken() {
    let good = tdf::scan_line(1.0, &[Some(2.0); 181]);
    let few = tdf::scan_line(1.0, &[Some(2.0); 3]);
    let set = sensed(&format!("{good}\n{few}0 0 181 1 0 cut\n"), "0 0 0 1 0 2\n");
    let dataset = taken(&set);
    assert_eq!(dataset.frames.iter().filter(|frame| frame.scan.is_some()).count(), 1);
    let reasons = reasons(&dataset).join("; ");
    assert!(reasons.contains("a scan has from 16 to") && reasons.contains("181 ranges"), "{reasons}");
    assert!(reasons.contains("no field 8"), "{reasons}");
}

#[test]
fn that_there_is_none_is_noted_where_it_is_wanted() {
    let set = cold_tree(&[SEQUENCE]);
    let dataset = taken(&set);
    assert_eq!(dataset.laser(), None);
    let notes = told(&set, &dataset.notes).join("; ");
    assert!(notes.contains("odom_scans/scans.tdf: no such file") && notes.contains("odom.tdf"), "{notes}");
    assert_eq!(open(set.path()).unwrap().notes, []);
}

#[test]
fn that_scans_are_there_is_known_where_they_are_not_taken() {
    assert!(open(sensed("", "").path()).unwrap().has_other_scans);
    assert!(!taken(&sensed("", "")).has_other_scans);
    assert!(!open(cold_tree(&[SEQUENCE]).path()).unwrap().has_other_scans);
}

#[test]
fn what_the_simulated_robot_sensed_is_read_beside_its_frames() {
    let root = tempfile::tempdir().unwrap();
    let spec = SequenceSpec {
        lab: Lab::Saarbruecken,
        part: simulate::Part::B,
        route: Route::Standard,
        illumination: simulate::Illumination::Night,
        run: 2,
        seed: 0,
        frames_per_second: 0.1,
        has_stops: false,
    };
    let simulation = Simulation::with_size(&spec, [64, 48]).unwrap();
    simulation.write(&[simulate::CameraKind::Perspective], root.path(), &|_| ()).unwrap();
    let plain = open(root.path()).unwrap();
    assert!(plain.frames.iter().all(|frame| frame.scan.is_none() && frame.odometry.is_none()));
    assert_eq!(plain.laser(), None);
    let taking = Taking { laser: true, odometry: true, ..Taking::default() };
    let dataset = open_for(root.path(), &[], &taking).unwrap();
    assert_eq!((&dataset.problems, &dataset.notes), (&vec![], &vec![]));
    assert_eq!(dataset.laser(), Some(LaserShape::default()));
    let odometry = simulation.odometry();
    for (idx, frame) in dataset.frames.iter().enumerate() {
        let scan = frame.read_scan().unwrap().unwrap();
        let expected = simulation.scan(idx);
        let is_same = |(found, expected): (&f32, &Option<f32>)| match expected {
            Some(expected) => (found - expected).abs() < 1e-3,
            None => found.is_infinite(),
        };
        assert!(scan.ranges().iter().zip(&expected).all(is_same));
        let (found, expected) = (frame.odometry.unwrap(), odometry[idx]);
        assert!((found.x - f64::from(expected.x)).hypot(found.y - f64::from(expected.y)) < 1e-5);
    }
    let since = dataset.frames[3].interval_to(&dataset.frames[4]).unwrap();
    assert!((since.seconds - 10.0).abs() < 1e-3 && since.motion.unwrap().meters > 1.0, "{since:?}");
    assert_eq!(plain.frames[3].interval_to(&plain.frames[4]).unwrap().motion, None);
    let speed = plain.transitions(&plain.rooms()).learned_speed().unwrap();
    assert!((0.15..0.31).contains(&speed), "by where frames were taken: {speed}");
}
