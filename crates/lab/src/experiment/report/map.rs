//! Where frames were taken, and which were answered wrong.

use super::super::{Drives, Rates};
use crate::page::chart::{LEFT, N_COLORS, TOP, WIDTH, framed, label, legend, round_ticks, x_labels, y_title};
use crate::page::escape;
use crate::simulate::Wall;

/// The most that a map takes of the height of the page.
const MAX_HEIGHT: f64 = 420.0;

/// A frame on the map.
struct Dot<'a> {
    x: f64,
    y: f64,
    room: &'a str,
    answered: &'a str,
}

/// From meters to the picture: both axes have the same scale.
struct Area {
    left: f64,
    right: f64,
    bottom: f64,
    top: f64,
    scale: f64,
}

impl Area {
    /// Round all points, with half a meter on each side.
    fn round(points: impl Iterator<Item = (f64, f64)>) -> Self {
        const MARGIN: f64 = 0.5;
        let mut area = Self { left: f64::MAX, right: f64::MIN, bottom: f64::MAX, top: f64::MIN, scale: 1.0 };
        for (x, y) in points {
            area.left = area.left.min(x - MARGIN);
            area.right = area.right.max(x + MARGIN);
            area.bottom = area.bottom.min(y - MARGIN);
            area.top = area.top.max(y + MARGIN);
        }
        let fitting = (WIDTH - LEFT - 20.0) / (area.right - area.left);
        area.scale = fitting.min(MAX_HEIGHT / (area.top - area.bottom));
        area
    }

    fn x(&self, meters: f64) -> f64 {
        LEFT + (meters - self.left) * self.scale
    }

    fn y(&self, meters: f64) -> f64 {
        TOP + (self.top - meters) * self.scale
    }

    /// Both axes in meters, with a grid.
    fn axes(&self) -> String {
        const LABEL_DISTANCE: f64 = 50.0;
        let (foot, end) = (self.y(self.bottom), self.x(self.right));
        let n_ticks = |pixels: f64| ((pixels / LABEL_DISTANCE) as usize).max(2);
        let columns = round_ticks([self.left, self.right], n_ticks(end - LEFT));
        let rows = round_ticks([self.bottom, self.top], n_ticks(foot - TOP));
        let line = |[x1, x2]: [f64; 2], [y1, y2]: [f64; 2]| {
            format!("<line class=\"grid\" x1=\"{x1:.1}\" x2=\"{x2:.1}\" y1=\"{y1:.1}\" y2=\"{y2:.1}\"/>\n")
        };
        let mut svg = String::new();
        columns.iter().for_each(|&x| svg += &line([self.x(x); 2], [TOP, foot]));
        for &y in &rows {
            svg += &line([LEFT, end], [self.y(y); 2]);
            svg += &label(LEFT - 16.0, self.y(y) + 4.0, &y.to_string());
        }
        svg += &x_labels(columns.iter().map(|&x| (self.x(x), x.to_string())), foot + 16.0);
        svg + &label((LEFT + end) / 2.0, foot + 34.0, "x (m)") + &y_title(foot - TOP, "y (m)")
    }
}

/// A dot a frame colored by its room, errors ringed, between the walls where they are known; nothing without positions.
pub fn map(drives: &Drives, measured: &Rates) -> String {
    let mut dots = Vec::new();
    let mut walls: Vec<Wall> = Vec::new();
    for (drive_idx, answers) in &measured.best_answers {
        let drive = drives.get(*drive_idx);
        walls.extend(drive.walls());
        for answer in answers {
            let frame = &drive.dataset.frames[answer.frame_idx];
            if let Some(pose) = frame.pose {
                dots.push(Dot { x: pose.x, y: pose.y, room: &frame.room, answered: &answer.room });
            }
        }
    }
    if dots.is_empty() {
        return String::new();
    }
    let corners = walls.iter().flat_map(|wall| [wall.from, wall.to]).map(|[x, y]| (x.into(), y.into()));
    let area = Area::round(dots.iter().map(|dot| (dot.x, dot.y)).chain(corners));
    let mut rooms: Vec<&str> = dots.iter().map(|dot| dot.room).collect();
    rooms.sort_unstable();
    rooms.dedup();
    let mut svg = area.axes() + &legend(&rooms);
    for Wall { from: [x1, y1], to: [x2, y2] } in walls {
        let [x1, x2] = [x1, x2].map(|x| area.x(x.into()));
        let [y1, y2] = [y1, y2].map(|y| area.y(y.into()));
        svg +=
            &format!("<line class=\"wall\" x1=\"{x1:.1}\" x2=\"{x2:.1}\" y1=\"{y1:.1}\" y2=\"{y2:.1}\"/>\n");
    }
    for Dot { x, y, room, answered } in &dots {
        let (x, y) = (area.x(*x), area.y(*y));
        let color = rooms.iter().position(|other| other == room).unwrap_or(0) % N_COLORS;
        svg += &format!("<circle class=\"f{color}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\"/>\n");
        if room != answered {
            svg += &format!(
                "<circle class=\"error\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\"><title>{} answered as {}</title></circle>\n",
                escape(room),
                escape(answered)
            );
        }
    }
    framed(&svg, area.y(area.bottom) + 42.0)
}
