//! `roomsight key`: keys of those who may call the service.

use super::output::say;
use crate::access::{Key, Role};
use anyhow::anyhow;
use clap::{Args, Subcommand};

/// Make keys for those who may call the service
#[derive(Args)]
pub(super) struct KeyArgs {
    #[command(subcommand)]
    command: KeyCommand,
}

#[derive(Subcommand)]
enum KeyCommand {
    /// Make a key and print it, once, with the line for the settings
    New {
        /// What it allows: robot (post frames), viewer (read models) or admin (everything)
        #[arg(long)]
        role: Role,
        /// Whose it is
        #[arg(long)]
        name: String,
        /// The robots that it alone speaks for, with the role robot [default: any that no key is bound to]
        #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
        robots: Vec<String>,
    },
}

/// Makes a key and prints it.
pub(super) fn run(args: &KeyArgs) -> anyhow::Result<()> {
    let KeyCommand::New { role, name, robots } = &args.command;
    let mut random = [0; 32];
    getrandom::fill(&mut random).map_err(|error| anyhow!("the system gives no random numbers: {error}"))?;
    let (secret, key) = Key::new(*role, name, &random)?;
    let key = key.bound_to(robots.iter().map(String::as_str))?;
    say!("The key; it is shown only now:\n\n    {secret}\n")?;
    say!("The settings of the service (a file, or --set keys=..., or ROOMSIGHT_KEYS):\n")?;
    say!("    keys = [\"{}\"]\n", key.to_line())?;
    say!("A caller sends it as `Authorization: Bearer {secret}`.")?;
    Ok(())
}
