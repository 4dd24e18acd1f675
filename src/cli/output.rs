//! What all commands share in what they print: progress bars and tables.

use comfy_table::{Table, presets};
use indicatif::{ProgressBar, ProgressStyle};

/// A progress bar on standard error for work of `n_steps`; silent when that is no terminal.
pub fn progress(label: &str, n_steps: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{prefix:>20} [{bar:40}] {pos}/{len} {eta} left");
    ProgressBar::new(n_steps as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "))
        .with_prefix(label.to_owned())
}

/// An empty table in the style of all tables, with this header.
pub fn table<H: Into<comfy_table::Row>>(header: H) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::UTF8_HORIZONTAL_ONLY).set_header(header);
    table
}
