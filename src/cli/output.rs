//! What all commands share in what they print: progress bars and tables.

use super::manners::{Manners, ProgressForm};
use super::progress_lines::ProgressLines;
use comfy_table::{ColumnConstraint, ContentArrangement, Table, TableComponent, presets};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use roomsight_lab::evaluate::{Evaluation, Knowledge, N_BINS, Rate};
use roomsight_protocol::rest::NetworkInfo;
use roomsight_recognition::model::{Addition, Card, EarlyAnswers};
use std::ops::Deref;
use std::path::Path;
use std::{env, io};
use terminal_size::terminal_size;

/// The most rooms whose confusion matrix is read as one.
const MAX_CONFUSION_ROOMS: usize = 10;

/// Letters of a room's name above a confusion matrix that is too wide otherwise.
const SHORT_NAME: usize = 6;

/// Letters of a path in a table on a terminal.
const MAX_PATH: usize = 20;

/// The most pairs of rooms that are listed instead of a confusion matrix.
const MAX_PAIRS: usize = 10;

/// Lines of progress are for programs, which show them to people.
const LINES_PER_SECOND: u8 = 4;

/// Prints a line on standard output. Unlike with `println!`, a reader that has left is an error.
macro_rules! say {
    ($($format:tt)*) => {{
        use std::io::Write as _;
        writeln!(std::io::stdout(), $($format)*)
    }};
}
pub(super) use say;

/// Gates that did not hold; the program then ends with an exit code of its own.
#[derive(Debug, thiserror::Error)]
#[error("failed: {0}")]
pub struct GateFailed(pub String);

/// An error and its causes on one line, each said once: some errors repeat their cause.
pub fn explained(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(ToString::to_string).filter(|cause| !cause.is_empty()) {
        if text.is_empty() {
            text = cause;
        } else if !text.ends_with(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// How this program was called, to show commands that work as they are printed.
pub fn program() -> String {
    env::args_os().next().map_or_else(|| "roomsight".to_owned(), |name| quoted(Path::new(&name)))
}

/// An argument as it is typed in a shell.
pub fn quoted(argument: &Path) -> String {
    let text = argument.to_string_lossy();
    let is_plain = |letter: char| letter.is_alphanumeric() || "-_./=,@:+".contains(letter);
    if !text.is_empty() && text.chars().all(is_plain) {
        text.into_owned()
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// A progress bar on standard error that goes when it is dropped; silent when that is no terminal. With --verbose it leaves a line
/// that says how long the work took.
pub struct Progress {
    bar: ProgressBar,
    label: String,
}

impl Deref for Progress {
    type Target = ProgressBar;

    fn deref(&self) -> &ProgressBar {
        &self.bar
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
        if Manners::adopted().verbose {
            eprintln!("{}: {:.1} s", self.label, self.bar.elapsed().as_secs_f64());
        }
    }
}

/// A progress bar for work of `n_steps`.
pub fn progress(label: &str, n_steps: usize) -> Progress {
    let manners = Manners::adopted();
    let (target, template) = match manners.progress {
        _ if manners.quiet => (ProgressDrawTarget::hidden(), ""),
        ProgressForm::Lines => {
            let lines = ProgressDrawTarget::term_like_with_hz(Box::new(ProgressLines), LINES_PER_SECOND);
            (lines, "{prefix} {pos}/{len}")
        }
        ProgressForm::Bars => {
            (ProgressDrawTarget::stderr(), "{prefix:>20} [{bar:40}] {pos}/{len} {eta} left {wide_msg}")
        }
    };
    let style = ProgressStyle::with_template(template);
    let bar = ProgressBar::with_draw_target(Some(n_steps as u64), target)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "))
        .with_prefix(label.to_owned());
    Progress { bar, label: label.to_owned() }
}

/// An empty table in the style of all tables, with this header.
pub fn table<H: Into<comfy_table::Row>>(header: H) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::UTF8_HORIZONTAL_ONLY)
        .remove_style(TableComponent::HorizontalLines)
        .remove_style(TableComponent::MiddleIntersections)
        .set_header(header);
    if let Some(width) = width() {
        let width = width.min(usize::from(u16::MAX)) as u16;
        table.set_content_arrangement(ContentArrangement::Dynamic).set_width(width);
    }
    table
}

/// A path for a table: its end where a terminal would not hold all of it.
pub fn path_cell(path: &Path) -> String {
    let text = path.display().to_string();
    let n_letters = text.chars().count();
    if width().is_none() || n_letters <= MAX_PATH {
        return text;
    }
    std::iter::once('\u{2026}').chain(text.chars().skip(n_letters + 1 - MAX_PATH)).collect()
}

/// Keeps the first column of a table from being broken, where the terminal is narrow.
pub fn keep_first_column(table: &mut Table) {
    if let Some(column) = table.column_mut(0) {
        column.set_constraint(ColumnConstraint::ContentWidth);
    }
}

/// What is said of a model's network.
pub fn network_text(NetworkInfo { name, blake3, bytes }: &NetworkInfo) -> String {
    format!("{name}, {:.1} MB, digest {blake3}", *bytes as f64 / 1e6)
}

/// What a card says, as rows of a table.
pub fn card_rows(card: &Card) -> Vec<(&'static str, String)> {
    let mut rows = Vec::new();
    if !card.description.is_empty() {
        rows.push(("description", card.description.clone()));
    }
    let simulated = if card.simulated { ", simulated" } else { "" };
    rows.push(("trained on", format!("{} frames{simulated}: {}", card.n_frames, card.sequences.join(", "))));
    if let Some(choice) = &card.choice {
        let tried: Vec<String> = choice
            .tallies
            .iter()
            .map(|tally| format!("{} {}/{}", tally.name, tally.n_right, tally.n_frames))
            .collect();
        let why = format!("{}: right on held-out frames: {}", choice.tally().name, tried.join(", "));
        rows.push(("chosen", why));
    }
    if let Some(early) = &card.early {
        rows.push(("without asking all", early_text(early)));
    }
    for Addition { sequence, n_frames, forget, n_before, n_left } in &card.additions {
        let trade = format!("kept {n_before} before, {n_left} since, at --forget {forget}");
        rows.push(("added later", format!("{n_frames} frames: {sequence} ({trade})")));
    }
    for measured in &card.measured {
        rows.push(("measured", format!("{:.4} of {} ({})", measured.rate, measured.n_frames, measured.data)));
    }
    rows.push(("trained by", card.trained_by.clone()));
    rows
}

/// How held-out frames were answered without asking all opinions.
pub fn early_text(EarlyAnswers { n_held_out, n_frames, n_right, n_right_by_all }: &EarlyAnswers) -> String {
    format!(
        "{n_frames} of {n_held_out} held-out frames, {n_right} right where asking all answers {n_right_by_all} right"
    )
}

/// Prints the rates and the confusion matrix where it fits the terminal, with names of rooms cut short if need be; else the rate
/// of each room and the pairs of rooms that are taken for each other most often.
pub fn print_evaluation(evaluation: &Evaluation) -> io::Result<()> {
    let fits =
        |table: &Table| width().is_none_or(|width| table.lines().all(|line| line.chars().count() <= width));
    let is_small = evaluation.rooms.len() <= MAX_CONFUSION_ROOMS;
    let lengths = [usize::MAX, SHORT_NAME].into_iter().filter(|_| is_small);
    let matrix = lengths.map(|length| confusion(evaluation, length)).find(fits);
    if let Some(matrix) = matrix {
        say!("{matrix}")?;
    } else {
        let mut by_room = table(["room", "frames", "rate"]);
        for (room, room_rate) in evaluation.rooms.iter().zip(&evaluation.by_room) {
            by_room.add_row([room.clone(), room_rate.n_frames.to_string(), rate(room_rate)]);
        }
        say!("{by_room}")?;
        print_worst_pairs(evaluation)?;
    }
    let mut rates = table(["", "correct", "frames", "rate"]);
    let mut add = |name: &str, of: &Rate| {
        rates.add_row([name.to_owned(), of.n_correct.to_string(), of.n_frames.to_string(), rate(of)]);
    };
    add("all frames", &evaluation.overall);
    if evaluation.only_border.n_frames > 0 {
        add("within 0.5 m of a room border", &evaluation.only_border);
        add("farther from borders", &evaluation.without_border);
    }
    say!("{rates}")?;
    if let Some(mean) = evaluation.mean_by_room {
        say!("Mean over rooms: {mean:.4}")?;
    }
    Ok(())
}

/// The confusion matrix, with names of rooms above it of at most so many letters.
fn confusion(evaluation: &Evaluation, length: usize) -> Table {
    let mut header = vec!["shown \\ answered".to_owned()];
    header.extend(evaluation.rooms.iter().map(|room| shortened(room, length)));
    header.push("rate".to_owned());
    let mut confusion = table(header);
    confusion.set_content_arrangement(ContentArrangement::Disabled);
    for (idx, (room, counts)) in evaluation.rooms.iter().zip(&evaluation.confusion).enumerate() {
        let mut row = vec![room.clone()];
        row.extend(counts.iter().map(|&count| if count == 0 { "-".to_owned() } else { count.to_string() }));
        row.push(rate(&evaluation.by_room[idx]));
        confusion.add_row(row);
    }
    confusion
}

/// A name of at most so many letters, the last a dot where some were cut off.
fn shortened(name: &str, length: usize) -> String {
    if name.chars().count() <= length {
        return name.to_owned();
    }
    name.chars().take(length - 1).chain(['.']).collect()
}

fn print_worst_pairs(evaluation: &Evaluation) -> io::Result<()> {
    let mut pairs = Vec::new();
    for (shown, counts) in evaluation.rooms.iter().zip(&evaluation.confusion) {
        for (answered, &n_frames) in evaluation.rooms.iter().zip(counts) {
            if shown != answered && n_frames > 0 {
                pairs.push((n_frames, shown, answered));
            }
        }
    }
    if pairs.is_empty() {
        return Ok(());
    }
    pairs.sort_by_key(|(n_frames, ..)| std::cmp::Reverse(*n_frames));
    let mut table = table(["shown", "answered", "frames"]);
    for (n_frames, shown, answered) in pairs.into_iter().take(MAX_PAIRS) {
        table.add_row([shown.clone(), answered.clone(), n_frames.to_string()]);
    }
    say!("{table}")
}

/// How many letters fit a line of standard output: as COLUMNS says, or the terminal; `None` where there is neither.
fn width() -> Option<usize> {
    let told =
        env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok()).filter(|columns| *columns > 0);
    told.or_else(|| Some(usize::from(terminal_size()?.0.0)))
}

/// Prints what "known" is worth.
pub fn print_knowledge(knowledge: &Knowledge) -> io::Result<()> {
    let Knowledge { known, right_known, new_unknown, auroc, calibration_error, .. } = knowledge;
    let mut table = table(["known", "", "of", "rate"]);
    let mut add = |name: &str, of: &Rate| {
        table.add_row([name.to_owned(), of.n_correct.to_string(), of.n_frames.to_string(), rate(of)]);
    };
    add("right answers that are known", right_known);
    add("known answers that are right", known);
    if new_unknown.n_frames > 0 {
        add("frames of other rooms that are unknown", new_unknown);
    }
    say!("{table}")?;
    if let Some(auroc) = auroc {
        say!("Novelty tells other rooms from trained ones with an AUROC of {auroc:.3}.")?;
    }
    if let Some(error) = calibration_error {
        say!("Probabilities are {error:.3} off on average (expected calibration error, {N_BINS} bins).")?;
    }
    Ok(())
}

/// A rate with four digits, or a dash where there is none.
pub fn rate(rate: &Rate) -> String {
    rate.rate.map_or("-".to_owned(), |rate| format!("{rate:.4}"))
}
