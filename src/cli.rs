//! The commands of `roomsight`: one file a command.
//!
//! Exit codes: 0 done, 1 failed (the reason is on standard error), 2 a wrong command line,
//! 3 a gate of `train` or `replay` failed, 130 interrupted.

mod answering;
mod check;
mod contact_sheet;
mod data;
mod data_directory;
mod demo;
mod describe;
mod evaluate;
mod experiment;
mod forget;
mod health;
mod inspect;
mod key;
mod limits;
mod log;
mod manners;
mod mistakes;
mod models;
mod output;
mod progress_lines;
mod recognize;
mod replay;
#[cfg(feature = "ros")]
mod ros;
mod serve;
mod service;
mod shell;
mod simulate;
mod stream;
mod train;
mod tune;
mod validate;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use manners::Manners;
use roomsight_vision::network::Runtime;
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The exit code where all went well but the figures are not what was asked for.
const GATE_FAILED: u8 = 3;

/// Tells a robot which room it is in.
///
/// Train a model on labeled frames, measure it, and serve it over HTTP.
#[derive(Parser)]
#[command(name = "roomsight", version, max_term_width = 100)]
struct Cli {
    /// The library of ONNX Runtime, for models that look through networks [default: the one in networks/, or in the
    /// folder networks/ beside this program]
    #[arg(long, global = true, value_name = "FILE", env = "ROOMSIGHT_ONNX_RUNTIME")]
    onnx_runtime: Option<PathBuf>,
    #[command(flatten)]
    manners: Manners,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Demo(demo::DemoArgs),
    Check(check::CheckArgs),
    Describe(describe::DescribeArgs),
    Train(train::TrainArgs),
    Forget(forget::ForgetArgs),
    Evaluate(evaluate::EvaluateArgs),
    Validate(validate::ValidateArgs),
    Tune(tune::TuneArgs),
    Experiment(experiment::ExperimentArgs),
    Recognize(recognize::RecognizeArgs),
    Inspect(inspect::InspectArgs),
    Serve(serve::ServeArgs),
    Models(models::ModelsArgs),
    Replay(replay::ReplayArgs),
    Stream(stream::StreamArgs),
    #[cfg(feature = "ros")]
    Ros(Box<ros::RosArgs>),
    Data(data_directory::DataDirectoryArgs),
    Key(key::KeyArgs),
    Health(health::HealthArgs),
    Simulate(simulate::SimulateArgs),
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
}

/// Parses the command line, runs the command, and reports its failure on standard error.
pub fn main() -> ExitCode {
    let Cli { onnx_runtime, manners, command } = parsed();
    manners.adopt();
    roomsight_client::install_provider();
    match onnx_runtime {
        Some(library) => Runtime::name_library(library),
        None => look_beside_the_program(),
    }
    match run(command) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever reads the output (`| head`) has seen enough.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("roomsight: {}", mistakes::reworded(&output::explained(&error)));
            if error.is::<output::GateFailed>() { GATE_FAILED.into() } else { ExitCode::FAILURE }
        }
    }
}

/// The command line; where it is wrong this says so and ends the process.
fn parsed() -> Cli {
    let matches = Cli::command().color(Manners::color_of_arguments()).get_matches();
    Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
}

/// ONNX Runtime may lie where the program does.
fn look_beside_the_program() {
    if let Ok(program) = std::env::current_exe()
        && let Some(folder) = program.parent()
    {
        Runtime::look_into(folder.join("networks"));
    }
}

fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Describe(args) => describe::run(&args),
        Command::Train(args) => train::run(&args),
        Command::Forget(args) => forget::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Tune(args) => tune::run(&args),
        Command::Experiment(args) => experiment::run(&args),
        Command::Recognize(args) => recognize::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Serve(args) => serve::run(&args),
        Command::Models(args) => models::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Stream(args) => stream::run(&args),
        #[cfg(feature = "ros")]
        Command::Ros(args) => ros::run(&args),
        Command::Data(args) => data_directory::run(&args),
        Command::Key(args) => key::run(&args),
        Command::Health(args) => health::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Completions(args) => shell::complete(&args),
        Command::Man(args) => shell::write_manual(&args),
    }
}

/// Runs the command of these arguments, the program's name left out.
fn parse_and_run(arguments: &[&Path]) -> anyhow::Result<()> {
    let arguments = arguments.iter().map(|argument| argument.as_os_str());
    run(Cli::try_parse_from([OsStr::new("roomsight")].into_iter().chain(arguments))?.command)
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}
