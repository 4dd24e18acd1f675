//! Charts as SVG, colored by the style sheet of the report so that they follow light and dark.

use super::super::{Measured, Plan};
use super::table::percent;
use crate::evaluate::Summary;
use crate::page::chart::{
    LEFT, N_COLORS, PLOT_HEIGHT, TOP, WIDTH, framed, label, legend, polyline, rate_axis, text_width,
    x_labels, x_title, y_of,
};
use crate::page::escape;

/// Means of a plan as groups of bars, a group a row, with the deviations as whiskers.
pub fn bars(plan: &Plan, measured: &[Measured]) -> String {
    let (rows, columns) = plan.axes();
    let group = (WIDTH - LEFT) / rows.len() as f64;
    let bar = (group * 0.8 / columns.len() as f64).min(40.0);
    let mut svg = rate_axis() + &legend(&columns);
    for (row_idx, row) in rows.iter().enumerate() {
        let start = LEFT + (row_idx as f64 + 0.5) * group - columns.len() as f64 * bar / 2.0;
        for (column_idx, column) in columns.iter().enumerate() {
            let Some(rate) = rate(plan, measured, row, column) else { continue };
            let (x, y) = (start + column_idx as f64 * bar, y_of(rate.mean));
            let (height, color) = (y_of(0.0) - y, column_idx % N_COLORS);
            let width = bar - 2.0;
            svg += &format!(
                "<rect class=\"f{color}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\">\
                 <title>{}, {}: {} %</title></rect>\n",
                escape(row),
                escape(column),
                percent(rate.mean)
            );
            if let Some(std) = rate.std {
                let (middle, low, high) = (x + width / 2.0, y_of(rate.mean - std), y_of(rate.mean + std));
                svg += &format!(
                    "<line x1=\"{middle:.1}\" x2=\"{middle:.1}\" y1=\"{low:.1}\" y2=\"{high:.1}\" stroke=\"currentColor\"/>\n"
                );
            }
        }
    }
    // Long names stand on lines in turn.
    let widest = rows.iter().map(|row| text_width(row)).fold(0.0, f64::max);
    let n_lines = ((widest / group).ceil() as usize).clamp(1, 4);
    let y_of_line = |line: usize| TOP + PLOT_HEIGHT + 16.0 + line as f64 * 13.0;
    for (row_idx, row) in rows.iter().enumerate() {
        svg += &label(LEFT + (row_idx as f64 + 0.5) * group, y_of_line(row_idx % n_lines), row);
    }
    let foot = y_of_line(n_lines) + 5.0;
    svg += &x_title(foot, plan.rows_are);
    framed(&svg, foot + 8.0)
}

/// Means of a plan as lines, a line a column over the parameter of the rows.
pub fn lines(plan: &Plan, measured: &[Measured]) -> String {
    let (rows, columns) = plan.axes();
    let parameter_of = |row: &str| plan.cells.iter().find(|cell| cell.row == row)?.parameter;
    let mut rows: Vec<(f64, &str)> =
        rows.into_iter().filter_map(|row| Some((parameter_of(row)?, row))).collect();
    rows.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let [low, high] = [rows.first(), rows.last()].map(|row| row.map_or(0.0, |row| row.0));
    let scale = (WIDTH - LEFT - 40.0) / (high - low).max(f64::MIN_POSITIVE);
    let x_of = |parameter: f64| LEFT + 10.0 + (parameter - low) * scale;
    let mut svg = rate_axis() + &legend(&columns);
    for (column_idx, column) in columns.iter().enumerate() {
        let color = column_idx % N_COLORS;
        let point = |(parameter, row)| {
            let mean = rate(plan, measured, row, column)?.mean;
            Some((x_of(parameter), y_of(mean), row, mean))
        };
        let points: Vec<(f64, f64, &str, f64)> = rows.iter().copied().filter_map(point).collect();
        svg += &polyline(color, points.iter().map(|&(x, y, ..)| (x, y)));
        for (x, y, row, mean) in points {
            svg += &format!(
                "<circle class=\"f{color}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"><title>{}, {}: {} %</title></circle>\n",
                escape(row),
                escape(column),
                percent(mean)
            );
        }
    }
    let names = rows.iter().map(|&(parameter, _)| (x_of(parameter), parameter.to_string()));
    svg += &x_labels(names, TOP + PLOT_HEIGHT + 16.0);
    svg += &x_title(TOP + PLOT_HEIGHT + 34.0, plan.rows_are);
    framed(&svg, TOP + PLOT_HEIGHT + 42.0)
}

fn rate<'m>(plan: &Plan, measured: &'m [Measured], row: &str, column: &str) -> Option<&'m Summary> {
    let found = plan.cells.iter().zip(measured).find(|(cell, _)| cell.row == row && cell.column == column);
    found.and_then(|(_, measured)| measured.rates()?.rate.as_ref())
}

#[cfg(test)]
mod tests {
    use super::super::super::{Cell, Chart, Experiment, KeypointCounts, Occlusion, Rates, Work};
    use super::*;
    use crate::evaluate::Evaluation;
    use roomsight_recognition::model::Config;

    fn cell(parameter: f64) -> Cell {
        Cell {
            row: format!("k = {parameter}"),
            column: "night1".to_owned(),
            parameter: Some(parameter),
            config: Config::default(),
            work: Work::Rate { splits: Vec::new(), occlusion: Occlusion::default() },
            printed: None,
        }
    }

    fn rates(rate: f64) -> Measured {
        Measured::Rates(Box::new(Rates {
            rate: Summary::of(&[rate]),
            without_border: None,
            best: Evaluation::new(&[]),
            best_seed: 0,
            best_answers: Vec::new(),
            keypoints: KeypointCounts { least: 0, mean: 0.0, most: 0 },
        }))
    }

    #[test]
    fn numbers_lie_as_far_apart_on_the_axis_as_they_are() {
        let plan = Plan {
            experiment: Experiment::Words,
            title: String::new(),
            source: "",
            chart: Chart::Lines,
            rows_are: "number of words k",
            printed: None,
            differences: Vec::new(),
            // Whatever their order is.
            cells: [1000.0, 350.0, 400.0].map(cell).to_vec(),
        };
        let svg = lines(&plan, &[0.9, 0.5, 0.6].map(rates));
        let xs: Vec<f64> =
            svg.split("cx=\"").skip(1).map(|rest| rest.split('"').next().unwrap().parse().unwrap()).collect();
        let [x350, x400, x1000] = xs[..] else { panic!("{svg}") };
        assert!(((x1000 - x400) / (x400 - x350) - 12.0).abs() < 0.1, "{xs:?}");
        for text in
            ["number of words k</text>", "frames answered right (%)</text>", "k = 400, night1: 60.0 %"]
        {
            assert!(svg.contains(text), "{svg}");
        }
    }
}
