//! The tables of a measured plan.

use super::super::{Cell, Cost, Experiment, Matches, Measured, Plan, Rates};
use super::Entry;
use super::table::{Column, Table, Value};
use crate::evaluate::Rate;
use std::collections::BTreeSet;

impl Entry {
    /// All its tables, the one of its plan first.
    pub fn tables(&self) -> Vec<Table> {
        let Self { plan, measured, .. } = self;
        let mut tables = vec![match plan.experiment {
            Experiment::Stability => matches(plan, measured),
            Experiment::Keypoints => keypoints(plan, measured),
            Experiment::Cost => costs(plan, measured),
            _ => rates(plan, measured),
        }];
        let all_rates =
            || plan.cells.iter().zip(measured).filter_map(|(cell, one)| Some((cell, one.rates()?)));
        match plan.experiment {
            Experiment::Best => tables.extend(all_rates().map(|(cell, rates)| confusion(plan, cell, rates))),
            Experiment::Categorical => tables.push(by_room(plan, &all_rates().collect::<Vec<_>>())),
            _ => {}
        }
        if self.simulated {
            tables.iter_mut().for_each(|table| table.notes.push("Simulated frames.".to_owned()));
        }
        tables
    }
}

/// Means over the seeds, a column a column of the plan, each with the paper's beside it where it prints any.
fn rates(plan: &Plan, measured: &[Measured]) -> Table {
    let n_seeds = measured.iter().filter_map(|one| Some(one.rates()?.rate?.n_runs)).max().unwrap_or(1);
    let mut note = "Percent of the frames that are answered with the right room".to_owned();
    note += &match n_seeds {
        1 => ".".to_owned(),
        n_seeds => format!(
            ": mean \u{b1} standard deviation over {n_seeds} seeds (the best seed); a single number is one run, \
             where nothing is random."
        ),
    };
    let mut notes = vec![note];
    let (_, names) = plan.axes();
    let is_printed = |name: &str| plan.cells.iter().any(|cell| cell.column == name && cell.printed.is_some());
    if names.iter().any(|name| is_printed(name)) {
        notes.push("Under \u{201c}paper\u{201d}: what the paper prints.".to_owned());
    }
    let rate = |cell: &Cell, measured: &Measured| {
        let rate = measured.rates().and_then(|rates| rates.rate).map_or(Value::Missing, Value::Summary);
        let printed = cell.printed.map_or(Value::Missing, Value::Rate);
        if is_printed(&cell.column) { vec![rate, printed] } else { vec![rate] }
    };
    let columns = |name: &str| {
        let own = Column::summary(format!("{name} (%)"));
        let printed = is_printed(name).then(|| Column::single(format!("{name}, paper (%)")));
        [own].into_iter().chain(printed).collect()
    };
    Table { notes, ..laid_out(plan, measured, columns, rate) }
}

fn keypoints(plan: &Plan, measured: &[Measured]) -> Table {
    let value = |_: &Cell, measured: &Measured| {
        vec![measured.rates().map_or(Value::Missing, |rates| Value::Keypoints(rates.keypoints))]
    };
    let notes = vec!["Keypoints of a frame: mean over the frames (least to most).".to_owned()];
    Table { notes, ..laid_out(plan, measured, |name| vec![Column::keypoints(name)], value) }
}

/// The rows and columns of a plan, with some columns for each of its own.
fn laid_out(
    plan: &Plan,
    measured: &[Measured],
    columns: impl Fn(&str) -> Vec<Column>,
    values: impl Fn(&Cell, &Measured) -> Vec<Value>,
) -> Table {
    let (row_names, column_names) = plan.axes();
    let values_of = |row: &str, column: &str| {
        let mut cells = plan.cells.iter().zip(measured);
        let found = cells.find(|(cell, _)| cell.row == row && cell.column == column);
        found.map_or_else(
            || vec![Value::Missing; columns(column).len()],
            |(cell, measured)| values(cell, measured),
        )
    };
    let row = |row: &&str| {
        let values = column_names.iter().flat_map(|column| values_of(row, column)).collect();
        ((*row).to_owned(), values)
    };
    Table {
        columns: column_names.iter().flat_map(|name| columns(name)).collect(),
        rows: row_names.iter().map(row).collect(),
        ..empty(plan)
    }
}

/// A table without rows that is named after the experiment.
fn empty(plan: &Plan) -> Table {
    Table {
        name: plan.experiment.to_string(),
        title: format!("{} ({})", plan.title, plan.source),
        notes: Vec::new(),
        corner: plan.rows_are.to_owned(),
        columns: Vec::new(),
        rows: Vec::new(),
    }
}

/// Two drives compared, a row a cell.
fn matches(plan: &Plan, measured: &[Measured]) -> Table {
    const COLUMNS: [&str; 5] =
        ["found in cloudy1", "found in the other drive", "matched", "correct", "pairs of frames"];
    let values = |measured: &Measured| match measured {
        Measured::Matches(Matches { found: [first, second], matched, correct, n_pairs }) => {
            let numbers = [(first, 0), (second, 0), (matched, 1), (correct, 1)];
            let numbers = numbers.map(|(&number, n_decimals)| Value::Number(number, n_decimals));
            numbers.into_iter().chain([Value::Count(*n_pairs)]).collect()
        }
        _ => vec![Value::Missing; COLUMNS.len()],
    };
    Table {
        notes: vec!["Keypoints: means over the pairs of frames.".to_owned()],
        columns: COLUMNS.map(Column::single).to_vec(),
        rows: plan.cells.iter().zip(measured).map(|(cell, one)| (cell.name(), values(one))).collect(),
        ..empty(plan)
    }
}

/// Time and memory, a row a cell.
fn costs(plan: &Plan, measured: &[Measured]) -> Table {
    const COLUMNS: [&str; 8] = [
        "features (ms)",
        "classification (ms)",
        "whole frame (ms)",
        "training (s)",
        "model (kB)",
        "words",
        "numbers a word",
        "support vectors",
    ];
    let values = |measured: &Measured| match measured {
        Measured::Cost(cost) => {
            let [n_words, n_dimensions] = cost.vocabulary;
            let support_vectors: Vec<String> = cost.n_support_vectors.iter().map(usize::to_string).collect();
            vec![
                Value::Number(cost.features_ms, 1),
                Value::Number(cost.classify_ms, 2),
                Value::Number(cost.whole_ms, 1),
                Value::Number(cost.training_s, 1),
                Value::Number(cost.model_bytes as f64 / 1000.0, 0),
                Value::Count(n_words),
                Value::Count(n_dimensions),
                Value::Text(support_vectors.join(", ")),
            ]
        }
        _ => vec![Value::Missing; COLUMNS.len()],
    };
    let cpus: BTreeSet<&str> = measured
        .iter()
        .filter_map(|measured| match measured {
            Measured::Cost(Cost { cpu, .. }) => Some(cpu.as_str()),
            _ => None,
        })
        .collect();
    let note = |cpu: &str| {
        format!(
            "Medians over frames, on one thread of {cpu}; training on all threads, from described frames."
        )
    };
    Table {
        notes: cpus.into_iter().map(note).collect(),
        columns: COLUMNS.map(Column::single).to_vec(),
        rows: plan.cells.iter().zip(measured).map(|(cell, one)| (cell.row.clone(), values(one))).collect(),
        ..empty(plan)
    }
}

fn confusion(plan: &Plan, cell: &Cell, rates: &Rates) -> Table {
    let best = &rates.best;
    let right = |(room, rate): (&str, &Rate)| {
        (rate.n_frames > 0)
            .then(|| format!("{room}, {} of {} frames are answered right.", rate.n_correct, rate.n_frames))
    };
    let borders =
        [("Near room borders", &best.only_border), ("Away from room borders", &best.without_border)];
    let counts = |(room, counts): (&String, &Vec<usize>)| {
        (room.clone(), counts.iter().map(|&count| Value::Count(count)).collect())
    };
    Table {
        name: format!("{}-confusion-{}", plan.experiment, slug(&cell.name())),
        title: format!("{}: which rooms are answered", cell.name()),
        notes: [format!(
            "Frames by the room that they show (row) and the room that is answered (column), seed {}.",
            rates.best_seed
        )]
        .into_iter()
        .chain(borders.into_iter().filter_map(right))
        .collect(),
        corner: "shown \\ answered".to_owned(),
        columns: best.rooms.iter().map(Column::single).collect(),
        rows: best.rooms.iter().zip(&best.confusion).map(counts).collect(),
    }
}

/// The rates of the rooms, a row a cell.
fn by_room(plan: &Plan, rates: &[(&Cell, &Rates)]) -> Table {
    let rooms: BTreeSet<&String> = rates.iter().flat_map(|(_, rates)| &rates.best.rooms).collect();
    let rate_of = |rates: &Rates, room: &String| {
        let room_idx = rates.best.rooms.iter().position(|other| other == room);
        room_idx.and_then(|idx| rates.best.by_room[idx].rate).map_or(Value::Missing, Value::Rate)
    };
    let row = |(cell, rates): &(&Cell, &Rates)| {
        (cell.name(), rooms.iter().map(|room| rate_of(rates, room)).collect())
    };
    Table {
        name: format!("{}-rooms", plan.experiment),
        title: format!("{}: each room", plan.title),
        notes: vec!["Percent of the frames of each room that are answered right, best seed.".to_owned()],
        columns: rooms.iter().map(|room| Column::single(format!("{room} (%)"))).collect(),
        rows: rates.iter().map(row).collect(),
        ..empty(plan)
    }
}

/// A name as part of a file's: small letters and digits, all else one hyphen.
fn slug(name: &str) -> String {
    let letters = name.to_lowercase();
    let words = letters.split(|letter: char| !letter.is_ascii_alphanumeric());
    words.filter(|word| !word.is_empty()).collect::<Vec<_>>().join("-")
}
