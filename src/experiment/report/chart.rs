//! Charts as SVG, colored by the style sheet of the report so that they follow light and dark.

use super::super::{Drives, Measured, Plan, Rates};
use crate::page::chart::{
    LEFT, N_COLORS, PLOT_HEIGHT, TOP, WIDTH, framed, label, legend, polyline, rate_axis, y_of,
};
use crate::page::escape;
use std::collections::BTreeMap;

/// Means of a plan as groups of bars, a group a row, with the deviations as whiskers.
pub fn bars(plan: &Plan, measured: &[Measured]) -> String {
    let (rows, columns) = plan.axes();
    let group = (WIDTH - LEFT) / rows.len() as f64;
    let bar = (group * 0.8 / columns.len() as f64).min(40.0);
    let mut svg = rate_axis() + &legend(&columns);
    for (row_idx, row) in rows.iter().enumerate() {
        let start = LEFT + row_idx as f64 * group + 0.1 * group;
        for (column_idx, column) in columns.iter().enumerate() {
            let Some(rate) = rate(plan, measured, (row, column)) else { continue };
            let (x, y) = (start + column_idx as f64 * bar, y_of(rate.mean));
            let (height, color) = (y_of(0.0) - y, column_idx % N_COLORS);
            let width = bar - 2.0;
            svg += &format!(
                "<rect class=\"f{color}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\">\
                 <title>{}, {}: {:.4}</title></rect>\n",
                escape(row),
                escape(column),
                rate.mean
            );
            if let Some(std) = rate.std {
                let (middle, low, high) = (x + width / 2.0, y_of(rate.mean - std), y_of(rate.mean + std));
                svg += &format!(
                    "<line x1=\"{middle:.1}\" x2=\"{middle:.1}\" y1=\"{low:.1}\" y2=\"{high:.1}\" stroke=\"currentColor\"/>\n"
                );
            }
        }
    }
    let mut height = TOP + PLOT_HEIGHT + 20.0;
    for (row_idx, row) in rows.iter().enumerate() {
        // Long names stand on lines in turn.
        let y = TOP + PLOT_HEIGHT + 16.0 + (row_idx % 4) as f64 * 13.0;
        svg += &label(LEFT + (row_idx as f64 + 0.5) * group, y, row);
        height = height.max(y + 8.0);
    }
    framed(&svg, height)
}

/// Means of a plan as lines, a line a column over the rows.
pub fn lines(plan: &Plan, measured: &[Measured]) -> String {
    let (rows, columns) = plan.axes();
    let step = (WIDTH - LEFT - 30.0) / (rows.len().max(2) - 1) as f64;
    let x_of = |row_idx: usize| LEFT + 10.0 + row_idx as f64 * step;
    let mut svg = rate_axis() + &legend(&columns);
    for (column_idx, column) in columns.iter().enumerate() {
        let color = column_idx % N_COLORS;
        let point = |(row_idx, row): (usize, &&str)| {
            let mean = rate(plan, measured, (row, column))?.mean;
            Some((x_of(row_idx), y_of(mean), mean))
        };
        let points: Vec<(f64, f64, f64)> = rows.iter().enumerate().filter_map(point).collect();
        svg += &polyline(color, points.iter().map(|&(x, y, _)| (x, y)));
        for (x, y, mean) in points {
            svg += &format!(
                "<circle class=\"f{color}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"><title>{}: {mean:.4}</title></circle>\n",
                escape(column)
            );
        }
    }
    for (row_idx, row) in rows.iter().enumerate() {
        svg += &label(x_of(row_idx), TOP + PLOT_HEIGHT + 16.0, row);
    }
    framed(&svg, TOP + PLOT_HEIGHT + 26.0)
}

/// Where the robot was, a dot a frame colored by its room, errors ringed; nothing without positions.
pub fn map(drives: &Drives, measured: &Rates) -> String {
    let mut dots = Vec::new();
    for (drive_idx, answers) in &measured.best_answers {
        for answer in answers {
            let frame = &drives.get(*drive_idx).dataset.frames[answer.frame_idx];
            if let Some(pose) = frame.pose {
                dots.push((pose.x, pose.y, frame.place.as_str(), answer.place.as_str()));
            }
        }
    }
    let bounds = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)))
    };
    let (left, right) = bounds(&mut dots.iter().map(|dot| dot.0));
    let (bottom, top) = bounds(&mut dots.iter().map(|dot| dot.1));
    if dots.is_empty() {
        return String::new();
    }
    let scale = ((WIDTH - 40.0) / (right - left).max(1.0)).min(420.0 / (top - bottom).max(1.0));
    let mut color_of = BTreeMap::new();
    for dot in &dots {
        let n_places = color_of.len();
        color_of.entry(dot.2).or_insert(n_places % N_COLORS);
    }
    let places: Vec<&str> = {
        let mut places: Vec<(&str, usize)> = color_of.iter().map(|(place, color)| (*place, *color)).collect();
        places.sort_by_key(|&(_, color)| color);
        places.into_iter().map(|(place, _)| place).collect()
    };
    let mut svg = legend(&places);
    for &(x, y, place, answered) in &dots {
        let (x, y) = (20.0 + (x - left) * scale, TOP + 10.0 + (top - y) * scale);
        svg += &format!("<circle class=\"f{}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\"/>\n", color_of[place]);
        if place != answered {
            svg += &format!(
                "<circle class=\"error\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\"><title>{} answered as {}</title></circle>\n",
                escape(place),
                escape(answered)
            );
        }
    }
    framed(&svg, TOP + 20.0 + (top - bottom) * scale)
}

fn rate<'m>(
    plan: &Plan,
    measured: &'m [Measured],
    (row, column): (&str, &str),
) -> Option<&'m crate::evaluate::Summary> {
    let found = plan.cells.iter().zip(measured).find(|(cell, _)| cell.row == row && cell.column == column);
    found.and_then(|(_, measured)| measured.rates()?.rate.as_ref())
}
