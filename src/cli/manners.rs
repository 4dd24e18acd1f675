//! How much a command says beside what it is asked for, and whether in color.

use clap::{Args, ColorChoice, ValueEnum};
use std::env;
use std::io::{IsTerminal, stderr};
use std::sync::OnceLock;

/// Options of all commands.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(super) struct Manners {
    /// Say nothing but errors and what is asked for: no notes, no progress
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Also say how long each step took; `serve` logs more
    #[arg(short, long, global = true)]
    pub verbose: bool,
    /// Whether to print in color: auto is in terminals, where NO_COLOR is not set
    #[arg(long, global = true, value_name = "WHEN", default_value_t = ColorChoice::Auto)]
    pub color: ColorChoice,
    /// How long work tells how far it has come: bars in terminals, or lines `progress: WHAT 12/300` for programs that read
    /// them
    #[arg(long, global = true, value_name = "HOW", default_value = "bars")]
    pub progress: ProgressForm,
}

/// How long work tells how far it has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum ProgressForm {
    #[default]
    Bars,
    Lines,
}

static MANNERS: OnceLock<Manners> = OnceLock::new();

impl Manners {
    /// Those of this process from now on.
    pub(super) fn adopt(self) {
        // Only the first counts; there is one command a process, and those that it calls.
        let _ = MANNERS.set(self);
    }

    /// Those of this process.
    pub(super) fn adopted() -> Self {
        MANNERS.get().copied().unwrap_or_default()
    }

    /// What was asked for before the command line is parsed, for its own errors and help.
    pub(super) fn color_of_arguments() -> ColorChoice {
        let mut arguments = env::args().skip_while(|argument| !argument.starts_with("--color"));
        let value = arguments.next().and_then(|argument| match argument.split_once('=') {
            Some((_, value)) => Some(value.to_owned()),
            None => arguments.next(),
        });
        match value.as_deref() {
            Some("always") => ColorChoice::Always,
            Some("never") => ColorChoice::Never,
            _ => ColorChoice::Auto,
        }
    }

    /// Whether standard error gets colors; see https://no-color.org.
    pub(super) fn has_color(self) -> bool {
        match self.color {
            ColorChoice::Always => true,
            ColorChoice::Never => false,
            ColorChoice::Auto => {
                let is_forbidden = env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
                !is_forbidden && stderr().is_terminal()
            }
        }
    }
}

/// Prints a line on standard error, unless --quiet is given.
macro_rules! note {
    ($($format:tt)*) => {
        if !$crate::cli::manners::Manners::adopted().quiet {
            eprintln!($($format)*);
        }
    };
}
pub(super) use note;
