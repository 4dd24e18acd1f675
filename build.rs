//! Tells the crate which sources it is made of.

#[path = "build/sources.rs"]
mod sources;

use std::path::Path;
use std::{env, io};

fn main() -> io::Result<()> {
    let package = env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default();
    let package = Path::new(&package);
    println!("cargo::rustc-env=ROOMSIGHT_ANSWER_SOURCES={}", sources::of_answers(package)?);
    println!("cargo::rustc-env=ROOMSIGHT_SIMULATION_SOURCES={}", sources::of_simulation(package)?);
    for watched in ["build.rs", "build", "src", "Cargo.lock"] {
        println!("cargo::rerun-if-changed={watched}");
    }
    Ok(())
}
