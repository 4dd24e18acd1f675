//! What the robot senses beside pictures, and how it stops.

use super::*;

/// How far it is to a wall along a direction, by the plan; infinite where there is none.
fn to_wall(walls: &[Wall], [x, y]: [f32; 2], angle: f32) -> f32 {
    let (sin, cos) = angle.sin_cos();
    let meets = |Wall { from, to }: &Wall| {
        let (along, from) = ([to[0] - from[0], to[1] - from[1]], [from[0] - x, from[1] - y]);
        let slope = cos * along[1] - sin * along[0];
        let distance = (from[0] * along[1] - from[1] * along[0]) / slope;
        let share = (from[0] * sin - from[1] * cos) / slope;
        ((0.0..=1.0).contains(&share) && distance > 0.0).then_some(distance)
    };
    walls.iter().filter_map(meets).fold(f32::INFINITY, f32::min)
}

#[test]
fn a_laser_measures_how_far_the_walls_are_or_what_stands_before_them() {
    let (simulation, walls) = (any(), any().walls());
    let (mut n_beams, mut n_at_wall, mut n_beyond) = (0, 0, 0);
    for frame_idx in (0..simulation.n_frames()).step_by(37) {
        let Pose { x, y, heading } = simulation.pose(frame_idx);
        let origin = [x + heading.cos() * 0.15, y + heading.sin() * 0.15];
        for (degree, range) in simulation.scan(frame_idx).into_iter().enumerate() {
            let Some(range) = range else { continue };
            let angle = heading + (degree as f32 - 90.0).to_radians();
            let wall = to_wall(&walls, origin, angle);
            n_beams += 1;
            n_at_wall += usize::from((range - wall).abs() < 0.2);
            n_beyond += usize::from(range > wall + 0.2);
        }
    }
    assert!(n_beams > 1000 && 5 * n_at_wall > n_beams, "{n_at_wall} of {n_beams} at walls");
    assert!(50 * n_beyond < n_beams, "{n_beyond} of {n_beams} beyond walls");
}

#[test]
fn at_a_stop_scans_differ_by_noise_alone() {
    let stopping = small(&SequenceSpec { has_stops: true, ..spec(Illumination::Cloudy, 1) });
    let stands = |idx: &usize| stopping.pose(*idx) == stopping.pose(idx + 1);
    let idx = (0..stopping.n_frames() - 1).find(stands).unwrap();
    let [one, other] = [idx, idx + 1].map(|idx| stopping.scan(idx));
    assert_eq!(one, stopping.scan(idx));
    assert_ne!(one, other);
    let both = one.into_iter().zip(other).filter_map(|(one, other)| Some((one?, other?)));
    assert!(both.clone().count() > 160);
    assert!(both.into_iter().all(|(one, other)| (one - other).abs() < 0.12));
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
