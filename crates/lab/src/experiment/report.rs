//! Measured plans as one HTML file that needs no network, as tables for papers, and as JSON.

mod chart;
mod map;
mod table;
mod tables;

pub use table::{Table, Value};

use super::paper::{COLD, Paper};
use super::{Cell, Chart, Drives, Experiment, Measured, Plan};
use crate::page::{escape, page};
use serde::Serialize;
use std::collections::BTreeSet;
use std::rc::Rc;

/// The folder of the tables' files, beside the page that links to them.
pub const TABLES_FOLDER: &str = "tables";

/// A plan and the figures of its cells, in their order.
#[derive(Serialize)]
pub struct Entry {
    /// What was done.
    pub plan: Plan,
    /// What came out.
    pub measured: Vec<Measured>,
    /// Whether the frames are simulated.
    #[serde(skip)]
    pub simulated: bool,
    /// The drives that it was done on.
    #[serde(skip)]
    pub drives: Rc<Drives>,
}

/// What made a report, for whoever wants to make it again: nothing of the machine.
#[derive(Serialize)]
pub struct Origin {
    /// The version of roomsight.
    pub roomsight: &'static str,
    /// The digest of its sources that answers depend on.
    pub sources: &'static str,
    /// The command line.
    pub command: String,
    /// When it was finished, in UTC.
    pub created: String,
}

/// What a report is about.
#[derive(Serialize)]
pub struct Report<'a> {
    /// What made it.
    pub origin: Origin,
    /// Whether the frames are simulated: then no figure of a paper stands beside its own.
    pub simulated: bool,
    /// The most seeds that a figure is over, from seed 0 on.
    pub n_seeds: u64,
    /// Every which frame of a drive was taken.
    pub stride: usize,
    /// What was measured on.
    pub data: Data,
    /// The experiments.
    pub entries: &'a [Entry],
}

/// The frames of all experiments.
#[derive(Serialize)]
pub struct Data {
    /// The drives, sorted.
    pub drives: Vec<String>,
    /// How many frames of them were taken, of all cameras.
    pub n_frames: usize,
    /// The digest (BLAKE3) of these frames, of their rooms and positions, and of the cameras.
    pub blake3: String,
}

impl Data {
    /// Of all drives of the entries; those of one camera follow each other.
    pub fn of(entries: &[Entry]) -> Self {
        let mut cameras: Vec<&Rc<Drives>> = entries.iter().map(|entry| &entry.drives).collect();
        cameras.dedup_by(|later, earlier| Rc::ptr_eq(later, earlier));
        let drives = || cameras.iter().flat_map(|drives| drives.iter());
        let mut hasher = blake3::Hasher::new();
        drives().for_each(|drive| {
            hasher.update(drive.digest.as_bytes());
        });
        let names: BTreeSet<&String> = drives().map(|drive| &drive.sequence).collect();
        Self {
            drives: names.into_iter().cloned().collect(),
            n_frames: drives().map(|drive| drive.dataset.frames.len()).sum(),
            blake3: hasher.finalize().to_hex().to_string(),
        }
    }
}

impl Report<'_> {
    /// The figures for machines.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }

    /// The report for people.
    pub fn to_html(&self) -> String {
        let kind = if self.simulated { "simulated frames" } else { "COLD" };
        let mut body = format!("<h1>Experiments on {kind}</h1>\n<p>");
        body += if self.simulated {
            "The frames are simulated: the figures of the papers, which are of the COLD database, cannot be compared \
             with these and are left out."
        } else {
            "The figures of the papers are of the COLD database. They stand beside these where lab and camera are theirs."
        };
        body += "</p>\n";
        body += &(self.facts() + &self.references() + &self.contents());
        self.entries.iter().for_each(|entry| body += &self.section(entry));
        page(&format!("roomsight: experiments on {kind}"), &body)
    }

    /// What it takes to make it again.
    fn facts(&self) -> String {
        let Self { origin, data, .. } = self;
        let frames = match self.stride {
            1 => "all their frames".to_owned(),
            stride => format!("of each drive one frame in {stride} (--stride or --quick)"),
        };
        let seeds = match self.n_seeds {
            1 => "0".to_owned(),
            n_seeds => format!("0 to {}; one run where nothing is random", n_seeds - 1),
        };
        let facts = [
            ("roomsight", format!("{}, digest of its sources {}", origin.roomsight, origin.sources)),
            ("command", origin.command.clone()),
            ("finished (UTC)", origin.created.clone()),
            ("drives", format!("{}: {}", data.drives.len(), data.drives.join(", "))),
            ("frames", format!("{} of all cameras: {frames}", data.n_frames)),
            (
                "digest of the data",
                format!("{} (BLAKE3 of frames, rooms, positions and cameras)", data.blake3),
            ),
            ("seeds", seeds),
        ];
        let row = |(name, fact): (&str, String)| format!("<dt>{name}</dt><dd>{}</dd>\n", escape(&fact));
        format!("<dl>\n{}</dl>\n", facts.map(row).concat())
    }

    /// Whose experiments these are.
    fn references(&self) -> String {
        let papers: BTreeSet<Paper> =
            self.entries.iter().filter_map(|entry| entry.plan.experiment.paper()).collect();
        let item = |citation: &str| format!("<li>{}.</li>\n", escape(citation));
        let items: String = papers.into_iter().map(Paper::citation).chain([COLD]).map(item).collect();
        format!("<section><h2>Papers</h2>\n<ul>\n{items}</ul></section>\n")
    }

    fn contents(&self) -> String {
        let item = |Entry { plan, .. }: &Entry| {
            let (id, title) = (plan.experiment, escape(&plan.title));
            format!(
                "<li><a href=\"#{id}\">{title}</a> <span class=\"source\">{}</span></li>\n",
                escape(plan.source)
            )
        };
        let items: String = self.entries.iter().map(item).collect();
        format!("<section><h2>Contents</h2>\n<nav><ol>\n{items}</ol></nav></section>\n")
    }

    fn section(&self, entry: &Entry) -> String {
        let Entry { plan, measured, drives, .. } = entry;
        let mut html = format!(
            "<section id=\"{}\"><h2>{}</h2>\n<p class=\"source\">{}</p>\n",
            plan.experiment,
            escape(&plan.title),
            escape(plan.source)
        );
        let tables = entry.tables();
        let mut tables = tables.iter();
        html += &tables.next().map(|table| table.to_html(TABLES_FOLDER)).unwrap_or_default();
        html += &match plan.chart {
            Chart::Bars => chart::bars(plan, measured),
            Chart::Lines => chart::lines(plan, measured),
            Chart::Table => String::new(),
        };
        let mut maps = measured
            .iter()
            .filter(|_| plan.experiment == Experiment::Best)
            .filter_map(|one| Some(map::map(drives, one.rates()?)));
        for table in tables {
            html += &format!("<h3>{}</h3>\n{}", escape(&table.title), table.to_html(TABLES_FOLDER));
            html += &maps.next().unwrap_or_default();
        }
        for reason in impossible(plan, measured) {
            html += &format!("<p class=\"source\">{}</p>\n", escape(&reason));
        }
        if let Some(printed) = plan.printed {
            html += &format!("<p class=\"source\">In the paper: <i>{}</i>.</p>\n", escape(printed));
        }
        if !plan.differences.is_empty() {
            html += "<p class=\"source\">Otherwise than in the paper:</p>\n<ul class=\"source\">\n";
            plan.differences.iter().for_each(|text| html += &format!("<li>{}</li>\n", escape(text)));
            html += "</ul>\n";
        }
        html + "</section>\n"
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
