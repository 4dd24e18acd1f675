//! Tells the crate which sources it is made of.

#[path = "build/sources.rs"]
mod sources;

use std::path::Path;
use std::{env, io};

fn main() -> io::Result<()> {
    let package = env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default();
    let package = Path::new(&package);
    let version = env::var("CARGO_PKG_VERSION").unwrap_or_default();
    for (name, digest) in [
        ("ROOMSIGHT_ANSWER_SOURCES", sources::of_answers(package)?),
        ("ROOMSIGHT_SIMULATION_SOURCES", sources::of_simulation(package)?),
    ] {
        println!("cargo::rustc-env={name}={version}-{digest}");
    }
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=build");
    for watched in sources::watched(package) {
        println!("cargo::rerun-if-changed={}", watched.display());
    }
    Ok(())
}
