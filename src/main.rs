//! The `roomsight` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    roomsight::cli::main()
}
