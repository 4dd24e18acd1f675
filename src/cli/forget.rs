//! `roomsight forget`: a model without some of what it has learned.

use super::data;
use super::output::{self, say};
use anyhow::bail;
use clap::Args;
use roomsight_recognition::model::Forgotten;
use std::path::PathBuf;

/// Write a model that has forgotten drives or rooms
///
/// The frames themselves are not needed. Words and the like stay as they are; the other drives and rooms are told
/// apart by what is left of them, calibrated on the held-out answers to those.
#[derive(Args)]
pub(super) struct ForgetArgs {
    /// Folder of the model
    model: PathBuf,
    /// New folder for the model without them
    #[arg(short, long, value_name = "MODEL")]
    output: PathBuf,
    /// Forget the frames of this drive; give it as often as needed
    #[arg(long = "drive", value_name = "NAME", required_unless_present = "rooms")]
    drives: Vec<String>,
    /// Forget this room; give it as often as needed
    #[arg(long = "room", value_name = "NAME")]
    rooms: Vec<String>,
}

/// Forgets, and writes what is left. Golden frames are left out: they may show what was forgotten.
pub(super) fn run(args: &ForgetArgs) -> anyhow::Result<()> {
    if args.output.exists() {
        bail!("{} exists already; a model never changes: choose another folder", args.output.display());
    }
    let mut model = data::load_model(&args.model)?.model;
    let drives = args.drives.iter().map(|drive| Forgotten::Drive(drive));
    for forgotten in drives.chain(args.rooms.iter().map(|room| Forgotten::Room(room))) {
        model = model.without(forgotten)?;
    }
    model.save(&args.output, &[])?;
    say!(
        "{} knows {} rooms from {} frames. Try it:",
        args.output.display(),
        model.rooms().len(),
        model.card().n_frames
    )?;
    say!("  {} recognize {} FRAME.jpg", output::program(), output::quoted(&args.output))?;
    Ok(())
}
