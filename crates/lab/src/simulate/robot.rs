//! The robot's drive: a smooth path through the rooms at constant speed.

use super::Route;
use super::plan::{Plan, Rect, Room, RoomKind, Side};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f32::consts::PI;

/// The robot's speed, in meters a second.
pub const SPEED: f32 = 0.3;

/// Where the robot stands: meters in the plan, heading in radians from the x axis, in (-pi, pi].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Along the corridor, in meters.
    pub x: f32,
    /// Across the corridor, in meters.
    pub y: f32,
    /// Counterclockwise from the x axis, in radians.
    pub heading: f32,
}

/// A smooth curve in the floor plane, by its length.
#[derive(Clone, Debug)]
pub(super) struct Trajectory {
    points: Vec<[f32; 2]>,
    /// The length of the curve up to each point.
    lengths: Vec<f32>,
}

impl Trajectory {
    /// Through the corridor to its far end and back, into every room of the path on the way. Each
    /// drive differs a little: lanes, distances from walls, the sense of the round in a room, and
    /// whether a room is visited on the way out or on the way back.
    pub fn draw(plan: &Plan, route: Route, rng: &mut ChaCha8Rng) -> Self {
        let corridor = plan.rooms[0].rect;
        let half_lane = corridor.size()[1] * rng.random_range(0.14..0.22);
        let is_visited = |room: &&Room| room.is_standard || route == Route::Extended;
        let mut rooms: Vec<&Room> = plan.rooms[1..].iter().filter(is_visited).collect();
        rooms.sort_by(|a, b| a.entrance_center().total_cmp(&b.entrance_center()));
        let (on_return, on_way): (Vec<&Room>, Vec<&Room>) =
            rooms.into_iter().partition(|_| rng.random_bool(0.25));

        let [start, end] = [corridor.x0 + 0.7, corridor.x1 - 0.8];
        let mut waypoints = vec![[start, -half_lane]];
        for room in on_way {
            visit(room, -half_lane, &mut waypoints, rng);
        }
        waypoints.extend([[end, -half_lane], [end, half_lane]]);
        for room in on_return.into_iter().rev() {
            visit(room, half_lane, &mut waypoints, rng);
        }
        waypoints.push([start, half_lane]);
        Self::through(&waypoints)
    }

    /// The curve that rounds off the corners of a polyline.
    fn through(waypoints: &[[f32; 2]]) -> Self {
        let points = (0..4).fold(subdivided(waypoints), |points, _| cut_corners(&points));
        let mut lengths = vec![0.0];
        for pair in points.windows(2) {
            let step = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            lengths.push(lengths[lengths.len() - 1] + step);
        }
        Self { points, lengths }
    }

    /// The length of the whole curve, in meters.
    pub fn length(&self) -> f32 {
        self.lengths.last().copied().unwrap_or(0.0)
    }

    /// Points of the curve, about a decimeter apart.
    pub fn points(&self) -> Vec<[f32; 2]> {
        (0..(self.length() * 10.0) as usize).map(|step| self.point_at(step as f32 * 0.1)).collect()
    }

    /// The pose after driving this far; the ends for distances beyond them.
    pub fn pose_at(&self, distance: f32) -> Pose {
        const HEADING_REACH: f32 = 0.12;
        let [x, y] = self.point_at(distance);
        let ahead = self.point_at((distance + HEADING_REACH).min(self.length()));
        let behind = self.point_at((distance - HEADING_REACH).max(0.0));
        Pose { x, y, heading: (ahead[1] - behind[1]).atan2(ahead[0] - behind[0]) }
    }

    /// How fast the robot turns there, in radians a second, counterclockwise.
    pub fn turn_rate(&self, distance: f32) -> f32 {
        const STEP: f32 = 0.03;
        let turn = self.pose_at(distance + STEP).heading - self.pose_at(distance - STEP).heading;
        wrapped(turn) / (2.0 * STEP) * SPEED
    }

    fn point_at(&self, distance: f32) -> [f32; 2] {
        let after = self.lengths.partition_point(|&length| length <= distance);
        let idx = after.clamp(1, self.points.len() - 1);
        let [from, to] = [self.points[idx - 1], self.points[idx]];
        let step = self.lengths[idx] - self.lengths[idx - 1];
        let share = ((distance - self.lengths[idx - 1]) / step.max(1e-6)).clamp(0.0, 1.0);
        [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
    }
}

/// The angle in (-pi, pi] that points the same way.
pub(super) fn wrapped(angle: f32) -> f32 {
    let angle = angle.rem_euclid(2.0 * PI);
    if angle > PI { angle - 2.0 * PI } else { angle }
}

/// Appends the way from the corridor's lane into a room, once round it, and out again.
fn visit(room: &Room, lane: f32, waypoints: &mut Vec<[f32; 2]>, rng: &mut ChaCha8Rng) {
    let door_x = room.entrance_center() + rng.random_range(-0.06..0.06);
    let (door_y, inward) = match room.entrance() {
        Side::South => (room.rect.y0, 1.0),
        _ => (room.rect.y1, -1.0),
    };
    let entry = [[door_x, lane], [door_x, door_y], [door_x, door_y + 0.75 * inward]];
    let round = round_trip(room);
    let jitter = [rng.random_range(-0.08..0.08), rng.random_range(-0.08..0.08)];
    let (near_y, far_y) = if inward > 0.0 { (round.y0, round.y1) } else { (round.y1, round.y0) };
    let mut corners = [[round.x0, near_y], [round.x0, far_y], [round.x1, far_y], [round.x1, near_y]]
        .map(|[x, y]| [x + jitter[0], y + jitter[1]]);
    if rng.random_bool(0.5) {
        corners.reverse();
    }
    waypoints.extend(entry);
    waypoints.extend(corners);
    waypoints.extend(entry.into_iter().rev());
}

/// The rectangle that the robot drives round in a room: clear of the furniture along the walls.
fn round_trip(room: &Room) -> Rect {
    const SMALLEST: f32 = 0.7;
    let margin = match room.kind {
        RoomKind::ConferenceRoom => 0.85,
        RoomKind::Bathroom => 1.65,
        _ => 1.3,
    };
    let [center_x, center_y] = room.rect.center();
    let half = room.rect.size().map(|size| (size / 2.0 - margin).max(SMALLEST / 2.0));
    Rect { x0: center_x - half[0], y0: center_y - half[1], x1: center_x + half[0], y1: center_y + half[1] }
}

/// The same polyline with more points, so that a corner is rounded off within half of `REACH`.
fn subdivided(points: &[[f32; 2]]) -> Vec<[f32; 2]> {
    const REACH: f32 = 0.8;
    let mut dense = vec![points[0]];
    for pair in points.windows(2) {
        let [dx, dy] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
        let n_parts = (dx.hypot(dy) / REACH).ceil().max(1.0);
        for part in 1..=n_parts as usize {
            let share = part as f32 / n_parts;
            dense.push([pair[0][0] + share * dx, pair[0][1] + share * dy]);
        }
    }
    dense
}

/// One step of Chaikin's corner cutting (1974): every inner corner becomes two points at a quarter of
/// its sides; the ends stay.
fn cut_corners(points: &[[f32; 2]]) -> Vec<[f32; 2]> {
    let mut cut = vec![points[0]];
    for pair in points.windows(2) {
        for share in [0.25, 0.75] {
            cut.push([0, 1].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis])));
        }
    }
    cut.push(points[points.len() - 1]);
    cut
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Lab, Part, seeded};

    fn drive(route: Route, seed: u64) -> (Plan, Trajectory) {
        let plan = Plan::draw(Lab::Saarbruecken, Part::B, &mut seeded(&[1]));
        let trajectory = Trajectory::draw(&plan, route, &mut seeded(&[seed]));
        (plan, trajectory)
    }

    #[test]
    fn every_room_of_the_path_is_visited_and_no_other() {
        for (route, n_rooms) in [(Route::Standard, 4), (Route::Extended, 5)] {
            for seed in 0..8 {
                let (plan, trajectory) = drive(route, seed);
                let n_steps = (trajectory.length() / 0.06) as usize;
                let mut visited: Vec<usize> = (0..n_steps)
                    .map(|step| trajectory.pose_at(step as f32 * 0.06))
                    .map(|pose| plan.room_at(pose.x, pose.y))
                    .collect();
                visited.sort_unstable();
                visited.dedup();
                assert_eq!(visited.len(), n_rooms, "{route:?} by seed {seed}");
            }
        }
    }

    #[test]
    fn the_robot_keeps_clear_of_walls_but_at_doors_and_turns_gently() {
        let (plan, trajectory) = drive(Route::Extended, 3);
        for step in 0..(trajectory.length() / 0.06) as usize {
            let distance = step as f32 * 0.06;
            let pose = trajectory.pose_at(distance);
            let room = &plan.rooms[plan.room_at(pose.x, pose.y)];
            let at_door = plan.rooms[1..].iter().any(|room| {
                let door_y = if room.entrance() == Side::South { room.rect.y0 } else { room.rect.y1 };
                (pose.x - room.entrance_center()).abs() < 0.35 && (pose.y - door_y).abs() < 0.4
            });
            assert!(at_door || room.rect.border_distance(pose.x, pose.y) > 0.3, "{pose:?}");
            assert!(trajectory.turn_rate(distance).abs() < 2.5, "{pose:?}");
        }
    }
}
