//! What the robot senses beside pictures, and how it stops.

use super::*;

#[test]
fn a_laser_measures_how_far_the_walls_are() {
    let simulation = any();
    let Plan { rooms, .. } = simulation.scene.plan();
    for frame_idx in (0..simulation.n_frames()).step_by(37) {
        let Pose { x, y, .. } = simulation.pose(frame_idx);
        let room = rooms.iter().find(|room| room.rect.contains(x, y)).unwrap();
        let [width, depth] = room.rect.size();
        let ranges: Vec<f32> = simulation.scan(frame_idx).into_iter().flatten().collect();
        assert!(ranges.len() > 170, "{} beams come back", ranges.len());
        let nearest = ranges.iter().copied().fold(f32::INFINITY, f32::min);
        assert!(nearest < width.hypot(depth), "frame {frame_idx}: {nearest} m");
        // Nothing stands where the robot drives.
        assert!(nearest > 0.1, "frame {frame_idx}: {nearest} m");
    }
}

#[test]
fn light_changes_nothing_of_a_scan() {
    let with = |illumination| {
        let simulation = small(&spec(illumination, 1));
        // The way differs from drive to drive: what is compared is where both begin, in the corridor.
        simulation.scan(0).into_iter().flatten().sum::<f32>()
    };
    let [cloudy, night] = [Illumination::Cloudy, Illumination::Night].map(with);
    assert!((cloudy / night - 1.0).abs() < 0.2, "{cloudy}, {night}");
}

fn far(from: Pose, to: Pose) -> f32 {
    (to.x - from.x).hypot(to.y - from.y)
}

#[test]
fn odometry_is_right_from_step_to_step_and_drifts_with_the_way() {
    let simulation = any();
    let odometry = simulation.odometry();
    assert_eq!(odometry.len(), simulation.n_frames());
    let way = |idx: usize| f64::from(far(simulation.pose(idx), simulation.pose(idx + 1)));
    for idx in 0..odometry.len() - 1 {
        let told = f64::from(far(odometry[idx], odometry[idx + 1]));
        assert!((told - way(idx)).abs() < 0.08 * way(idx) + 1e-6, "{told} m instead of {} m", way(idx));
    }
    // In the coordinates that begin with the drive.
    let (first, last) = (simulation.pose(0), simulation.pose(odometry.len() - 1));
    let true_way = f64::from(far(first, last));
    let drift = (f64::from(far(odometry[odometry.len() - 1], odometry[0])) - true_way).abs();
    assert!(drift > 0.01, "{drift} m after {} frames", odometry.len());
}

#[test]
fn a_robot_that_stops_sees_the_same_for_a_while_and_comes_to_the_end() {
    let stopping = small(&SequenceSpec { has_stops: true, ..spec(Illumination::Cloudy, 1) });
    let driving = any();
    assert!(stopping.n_frames() > driving.n_frames() + 50, "{}", stopping.n_frames());
    let n_standing =
        (1..stopping.n_frames()).filter(|&idx| stopping.pose(idx) == stopping.pose(idx - 1)).count();
    assert!(n_standing + 20 > stopping.n_frames() - driving.n_frames(), "{n_standing}");
    let [end, expected] = [&stopping, driving].map(|simulation| simulation.pose(simulation.n_frames() - 1));
    assert!(far(end, expected) < 0.1);
    let odometry = stopping.odometry();
    let stands = |idx: &usize| stopping.pose(*idx) == stopping.pose(idx + 1);
    assert!((0..odometry.len() - 1).filter(stands).all(|idx| odometry[idx] == odometry[idx + 1]));
}
