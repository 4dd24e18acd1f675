//! `roomsight simulate`: writes sequences of the simulated lab.

use super::output::{self, say};
use anyhow::Context;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use roomsight_lab::simulate::{
    CameraKind, Illumination, Lab, Part, Route, SequenceSpec, SequenceSummary, Simulation,
};
use std::io;
use std::path::PathBuf;

/// Write simulated sequences, laid out like the COLD database
///
/// A ray caster drives a robot with two cameras through a lab that does not exist. Without options:
/// Saarbruecken part B, standard path, the six sequences of the papers' experiments. The same options
/// write the same bytes; sequences that are there already are kept.
#[derive(Args)]
pub(super) struct SimulateArgs {
    /// Folder to write to: new, empty, or written by this command before
    out: PathBuf,
    /// Which lab's list of rooms
    #[arg(long, default_value = "saarbruecken", value_parser = named(Lab::ALL, Lab::name))]
    lab: Lab,
    /// Which part of the lab
    #[arg(long, default_value = "b", value_parser = named(Part::ALL, Part::name))]
    part: Part,
    /// Visit the standard rooms, or all
    #[arg(long = "path", default_value = "standard", value_parser = named(Route::ALL, Route::name))]
    route: Route,
    /// Sequences: cloudy, night or sunny, each with a number
    #[arg(
        long = "illumination",
        value_delimiter = ',',
        value_name = "LIGHT",
        default_value = "cloudy1,cloudy2,night1,night2,sunny1,sunny2",
        value_parser = parse_drive
    )]
    drives: Vec<(Illumination, u32)>,
    /// Which camera's frames: std is the perspective one, omni the omnidirectional one
    #[arg(long, default_value = "both", value_parser = ["std", "omni", "both"])]
    camera: String,
    /// Draws rooms, furniture and drives; another seed is another lab
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Frames per second at 0.3 m/s; fewer make shorter sequences of the same way
    #[arg(long, default_value_t = 5.0, value_name = "RATE")]
    frames_per_second: f32,
    /// Let the robot stop now and then, as where somebody is in its way
    #[arg(long)]
    stops: bool,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

/// Writes the sequences one after the other and prints what they contain.
pub(super) fn run(args: &SimulateArgs) -> anyhow::Result<()> {
    let cameras: Vec<CameraKind> = match CameraKind::from_name(&args.camera) {
        Some(camera) => vec![camera],
        None => CameraKind::ALL.to_vec(),
    };
    let mut summaries = Vec::new();
    for &(illumination, run) in &args.drives {
        let spec = SequenceSpec {
            lab: args.lab,
            part: args.part,
            route: args.route,
            illumination,
            run,
            seed: args.seed,
            frames_per_second: args.frames_per_second,
            has_stops: args.stops,
        };
        let simulation = Simulation::new(&spec)?;
        let label = format!("{}{run}", illumination.name());
        let bar = output::progress(&label, simulation.n_frames() * cameras.len());
        let summary = simulation.write(&cameras, &args.out, &|n_frames| bar.inc(n_frames as u64));
        bar.finish_and_clear();
        summaries.push(summary.with_context(|| format!("simulating {label}"))?);
    }
    if args.json {
        say!("{}", serde_json::to_string_pretty(&summaries)?)?;
    } else {
        print_table(&summaries)?;
    }
    Ok(())
}

fn print_table(summaries: &[SequenceSummary]) -> io::Result<()> {
    let mut table = output::table(["simulated sequence", "frames", "places", ""]);
    for summary in summaries {
        let room = |(room, n_frames): (&String, &usize)| format!("{room} {n_frames}");
        let rooms: Vec<String> = summary.n_frames_by_room.iter().map(room).collect();
        let note = if summary.was_kept { "kept" } else { "written" };
        table.add_row([
            summary.folder.display().to_string(),
            summary.n_frames.to_string(),
            rooms.join(", "),
            note.to_owned(),
        ]);
    }
    say!("{table}")
}

/// A parser of names that lists them in the help.
fn named<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let names = PossibleValuesParser::new(all.iter().map(|&one| name(one)));
    names.try_map(move |given| all.iter().copied().find(|&one| name(one) == given).ok_or("no such name"))
}

/// Reads a light and the number of the drive in it, such as `cloudy1`.
fn parse_drive(text: &str) -> Result<(Illumination, u32), String> {
    let digits_at = text.find(|c: char| c.is_ascii_digit()).unwrap_or(text.len());
    let (light, run) = text.split_at(digits_at);
    match (Illumination::from_name(light), run.parse()) {
        (Some(illumination), Ok(run @ 1..)) => Ok((illumination, run)),
        _ => Err("give cloudy, night or sunny with a number from 1 on, such as night2".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drives_are_a_light_and_a_number_from_one_on() {
        assert_eq!(parse_drive("night12"), Ok((Illumination::Night, 12)));
        for wrong in ["night", "night0", "1", "dawn1", "night-1", "night1x", ""] {
            assert!(parse_drive(wrong).is_err(), "{wrong}");
        }
    }
}
