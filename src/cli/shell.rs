//! `roomsight completions` and `roomsight man`: what shells and manuals know of the commands.

use super::Cli;
use anyhow::Context;
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use std::path::PathBuf;
use std::{fs, io};

/// What the program is called.
const NAME: &str = "roomsight";

/// Print what completes commands and options in a shell
///
/// For bash: roomsight completions bash > ~/.local/share/bash-completion/completions/roomsight
#[derive(Args)]
pub(super) struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

/// Write manual pages, one a command
///
/// Then: man -l FOLDER/roomsight-train.1
#[derive(Args)]
pub(super) struct ManArgs {
    /// The folder that gets them; it is made where there is none
    folder: PathBuf,
}

/// Prints the completions.
pub(super) fn complete(args: &CompletionsArgs) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), NAME, &mut script);
    io::Write::write_all(&mut io::stdout(), &script)?;
    Ok(())
}

/// Writes the pages.
pub(super) fn write_manual(args: &ManArgs) -> anyhow::Result<()> {
    let told = || args.folder.display().to_string();
    fs::create_dir_all(&args.folder).with_context(told)?;
    clap_mangen::generate_to(Cli::command(), &args.folder).with_context(told)
}
