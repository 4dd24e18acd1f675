//! Measured plans as one HTML file that needs no network, and as JSON.

mod chart;

use super::{Cell, Chart, Cost, Drives, Experiment, KeypointCounts, Matches, Measured, Plan, Rates};
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
            (Experiment::Cost, _) => cost_table(plan, measured),
            (_, Chart::Table) => self.figure_table(plan, measured),
            (_, Chart::Bars) => self.figure_table(plan, measured) + &chart::bars(plan, measured),
            (_, Chart::Lines) => self.figure_table(plan, measured) + &chart::lines(plan, measured),
        };
        let rates = || plan.cells.iter().zip(measured).filter_map(|(cell, one)| Some((cell, one.rates()?)));
        if plan.experiment == Experiment::Best {
            rates().for_each(|(cell, rates)| html += &(confusion(cell, rates) + &chart::map(drives, rates)));
        }
        if plan.experiment == Experiment::Categorical {
            rates().for_each(|(cell, rates)| html += &by_place(cell, &rates.best));
        }
        for reason in impossible(plan, measured) {
            html += &format!("<p class=\"source\">{}</p>\n", escape(&reason));
        }
        if let Some(printed) = plan.printed.filter(|_| !self.simulated) {
            html += &format!("<p class=\"source\">In the paper: <i>{}</i>.</p>\n", escape(printed));
        }
        if !plan.differences.is_empty() {
            html += "<p class=\"source\">Otherwise than in the paper: ";
            html += &plan.differences.iter().map(|text| escape(text)).collect::<Vec<_>>().join("; ");
            html += ".</p>\n";
        }
        html + "</section>\n"
    }

    fn figure_table(&self, plan: &Plan, measured: &[Measured]) -> String {
        table(plan, measured, |cell, measured| {
            let printed = cell.printed.filter(|_| !self.simulated);
            let printed = printed.map_or(String::new(), |rate| format!("<br><i>{}</i>", digits(rate)));
            figure(measured) + &printed
        })
    }
}

/// What stands in a table's cell.
pub fn figure(measured: &Measured) -> String {
    match measured {
        Measured::Rates(rates) => summary(rates.rate.as_ref()),
        Measured::Matches(Matches { found: [first, second], matched, correct, .. }) => {
            format!("{first:.0} and {second:.0} found, {matched:.1} matched, {correct:.1} correct")
        }
        Measured::Cost(cost) => format!("{:.1} ms", cost.whole_ms),
        Measured::Impossible { .. } => "-".to_owned(),
    }
}

/// Why cells could not be measured, a line each.
pub fn impossible(plan: &Plan, measured: &[Measured]) -> Vec<String> {
    let reason = |(cell, measured): (&Cell, &Measured)| match measured {
        Measured::Impossible { reason } => Some(format!("{}: not measured, {reason}", cell.name())),
        _ => None,
    };
    plan.cells.iter().zip(measured).filter_map(reason).collect()
}

/// What [`cost_row`] gives.
pub const COST_COLUMNS: [&str; 7] =
    ["features", "classification", "whole frame", "training", "model", "words", "support vectors"];

/// What a model costs, as texts.
pub fn cost_row(cost: &Cost) -> [String; 7] {
    let [n_words, n_dimensions] = cost.vocabulary;
    let support_vectors: Vec<String> = cost.n_support_vectors.iter().map(usize::to_string).collect();
    [
        format!("{:.1} ms", cost.features_ms),
        format!("{:.2} ms", cost.classify_ms),
        format!("{:.1} ms", cost.whole_ms),
        format!("{:.1} s", cost.training_s),
        format!("{:.0} kB", cost.model_bytes as f64 / 1000.0),
        format!("{n_words} x {n_dimensions}"),
        support_vectors.join(", "),
    ]
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

/// What costs were measured on.
pub fn cpu(measured: &[Measured]) -> Option<&str> {
    measured.iter().find_map(|measured| match measured {
        Measured::Cost(cost) => Some(cost.cpu.as_str()),
        _ => None,
    })
}

fn keypoint_table(plan: &Plan, measured: &[Measured]) -> String {
    table(plan, measured, |_, measured| match measured.rates().map(|rates| rates.keypoints) {
        Some(KeypointCounts { least, mean, most }) => format!("{mean:.0} ({least} to {most})"),
        None => figure(measured),
    })
}

fn cost_table(plan: &Plan, measured: &[Measured]) -> String {
    let row = |name: &str, texts: &[String], tag: &str| {
        let cells: String = texts.iter().map(|text| format!("<{tag}>{}</{tag}>", escape(text))).collect();
        format!("<tr><th>{}</th>{cells}</tr>\n", escape(name))
    };
    let mut html =
        "<div class=\"wide\"><table>".to_owned() + &row("", &COST_COLUMNS.map(str::to_owned), "th");
    for (cell, measured) in plan.cells.iter().zip(measured) {
        if let Measured::Cost(cost) = measured {
            html += &row(&cell.row, &cost_row(cost), "td");
        }
    }
    html += "</table></div>\n";
    let Some(cpu) = cpu(measured) else { return html };
    html + &format!(
        "<p class=\"source\">Medians over frames, on one thread of {}; training on all threads, from described \
         frames.</p>\n",
        escape(cpu)
    )
}

fn table(plan: &Plan, measured: &[Measured], content: impl Fn(&Cell, &Measured) -> String) -> String {
    let (rows, columns) = plan.axes();
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

fn confusion(cell: &Cell, rates: &Rates) -> String {
    let best = &rates.best;
    let mut html = format!(
        "<h3>{}, best seed ({})</h3>\n<p class=\"source\">Near room borders {} of {} frames are right, elsewhere {} of \
         {}.</p>\n<div class=\"wide\"><table><tr><th>shown \\ answered</th>",
        escape(&cell.name()),
        rates.best_seed,
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
