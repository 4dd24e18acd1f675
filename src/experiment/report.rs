//! Measured plans as one HTML file that needs no network, and as JSON.

mod chart;

use super::run::axes;
use super::{Cell, Chart, Drives, Experiment, KeypointCounts, Measured, Plan};
use crate::evaluate::{Evaluation, Summary};
use crate::page::{escape, page};
use serde::Serialize;
use std::fmt::Write;

/// A plan and the figures of its cells, in their order.
#[derive(Serialize)]
pub struct Entry {
    /// What was done.
    pub plan: Plan,
    /// What came out.
    pub measured: Vec<Measured>,
}

/// What a report is about.
#[derive(Serialize)]
pub struct Report<'a> {
    /// Whether the frames are simulated: then no figure of a paper stands beside its own.
    pub simulated: bool,
    /// Every figure is over this many seeds.
    pub n_seeds: u64,
    /// Every which frame of a drive was taken.
    pub stride: usize,
    /// The drives.
    pub drives: Vec<String>,
    /// The experiments.
    pub entries: &'a [Entry],
}

impl Report<'_> {
    /// The figures for machines.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }

    /// The report for people. `drives` are those of the experiments.
    pub fn to_html(&self, drives: &Drives) -> String {
        let kind = if self.simulated { "simulated frames" } else { "COLD" };
        let mut body = format!(
            "<h1>Experiments on {kind}</h1>\n<p>Shares of frames answered with the right room: mean \u{b1} standard \
             deviation over {} seeds, the best in parentheses. {} of {} drives.{}</p>\n",
            self.n_seeds,
            if self.stride == 1 { "All frames".to_owned() } else { format!("One frame in {}", self.stride) },
            self.drives.len(),
            if self.simulated {
                " The frames are simulated: the figures of the papers, which are of the COLD database, cannot be \
                 compared with them and are left out."
            } else {
                " Below each figure: what the paper prints."
            },
        );
        self.entries.iter().for_each(|entry| body += &self.section(entry, drives));
        page(&format!("roomsight: experiments on {kind}"), &body)
    }

    fn section(&self, entry: &Entry, drives: &Drives) -> String {
        let Entry { plan, measured } = entry;
        let mut html = format!(
            "<section><h2>{}</h2>\n<p class=\"source\">{}</p>\n",
            escape(&plan.title),
            escape(plan.source)
        );
        html += &match (plan.experiment, plan.chart) {
            (Experiment::Keypoints, _) => keypoint_table(plan, measured),
            (_, Chart::Bars) => self.rate_table(plan, measured) + &chart::bars(plan, measured),
            (_, Chart::Lines) => self.rate_table(plan, measured) + &chart::lines(plan, measured),
        };
        if plan.experiment == Experiment::Best {
            for (cell, measured) in plan.cells.iter().zip(measured) {
                html += &confusion(cell, measured);
                html += &chart::map(drives, measured);
            }
        }
        if plan.experiment == Experiment::Categorical {
            plan.cells
                .iter()
                .zip(measured)
                .for_each(|(cell, measured)| html += &by_place(cell, &measured.best));
        }
        if !plan.differences.is_empty() {
            html += "<p class=\"source\">Otherwise than in the paper: ";
            html += &plan.differences.iter().map(|text| escape(text)).collect::<Vec<_>>().join("; ");
            html += ".</p>\n";
        }
        html + "</section>\n"
    }

    fn rate_table(&self, plan: &Plan, measured: &[Measured]) -> String {
        table(plan, measured, |cell, measured| {
            let printed = cell.printed.filter(|_| !self.simulated);
            let printed = printed.map_or(String::new(), |rate| format!("<br><i>{}</i>", digits(rate)));
            summary(measured.rate.as_ref()) + &printed
        })
    }
}

/// `.9876 ± .0012 (.9899)`.
pub fn summary(summary: Option<&Summary>) -> String {
    let Some(summary) = summary else { return "-".to_owned() };
    let std = summary.std.map_or(String::new(), |std| format!(" \u{b1} {}", digits(std)));
    format!("{}{std} ({})", digits(summary.mean), digits(summary.best))
}

/// Four digits, the point first.
fn digits(rate: f64) -> String {
    let text = format!("{rate:.4}");
    text.strip_prefix('0').map_or(text.clone(), str::to_owned)
}

fn keypoint_table(plan: &Plan, measured: &[Measured]) -> String {
    table(plan, measured, |_, measured| {
        let KeypointCounts { least, mean, most } = measured.keypoints;
        format!("{mean:.0} ({least} to {most})")
    })
}

fn table(plan: &Plan, measured: &[Measured], content: impl Fn(&Cell, &Measured) -> String) -> String {
    let (rows, columns) = axes(plan);
    let mut html = "<div class=\"wide\"><table><tr><th></th>".to_owned();
    columns.iter().for_each(|column| html += &format!("<th>{}</th>", escape(column)));
    html += "</tr>\n";
    for row in rows {
        html += &format!("<tr><th>{}</th>", escape(row));
        for column in &columns {
            let found =
                plan.cells.iter().zip(measured).find(|(cell, _)| cell.row == row && cell.column == **column);
            html += &format!(
                "<td>{}</td>",
                found.map_or(String::new(), |(cell, measured)| content(cell, measured))
            );
        }
        html += "</tr>\n";
    }
    html + "</table></div>\n"
}

fn confusion(cell: &Cell, measured: &Measured) -> String {
    let best = &measured.best;
    let mut html = format!(
        "<h3>{}, best seed ({})</h3>\n<p class=\"source\">Near room borders {} of {} frames are right, elsewhere {} of \
         {}.</p>\n<div class=\"wide\"><table><tr><th>shown \\ answered</th>",
        escape(&cell.name()),
        measured.best_seed,
        best.only_border.n_correct,
        best.only_border.n_frames,
        best.without_border.n_correct,
        best.without_border.n_frames,
    );
    best.places.iter().for_each(|place| html += &format!("<th>{}</th>", escape(place)));
    html += "</tr>\n";
    for (place, counts) in best.places.iter().zip(&best.confusion) {
        html += &format!("<tr><th>{}</th>", escape(place));
        counts.iter().for_each(|count| html += &format!("<td>{count}</td>"));
        html += "</tr>\n";
    }
    html + "</table></div>\n"
}

fn by_place(cell: &Cell, evaluation: &Evaluation) -> String {
    let mut html = format!("<p>{}: ", escape(&cell.name()));
    let rates = evaluation
        .places
        .iter()
        .zip(&evaluation.by_place)
        .filter_map(|(place, rate)| Some(format!("{} {}", escape(place), digits(rate.rate?))));
    // Writing to a string cannot fail.
    let _ = write!(html, "{}", rates.collect::<Vec<_>>().join(", "));
    html + " (best seed)</p>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_read_as_mean_deviation_and_best() {
        assert_eq!(summary(Summary::of(&[0.5, 0.75]).as_ref()), ".6250 \u{b1} .1768 (.7500)");
        assert_eq!(summary(Summary::of(&[1.0]).as_ref()), "1.0000 (1.0000)");
        assert_eq!(summary(None), "-");
    }
}
