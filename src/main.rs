//! The `roomsight` command.

use mimalloc::MiMalloc;
use std::process::ExitCode;

// Frames are taken by one thread and given back by another: the C library's allocator grows by that for a long time.
#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

fn main() -> ExitCode {
    roomsight::cli::main()
}
