//! `cargo run -p roomsight-recognition --example recognize MODEL FRAME...`: the room of each frame.

use roomsight_recognition::Recognizer;
use std::error::Error;
use std::path::Path;
use std::{env, fs};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args().skip(1);
    let model = arguments.next().ok_or("give the folder of a model, and frames")?;
    let mut recognizer = Recognizer::open(Path::new(&model))?;
    for frame in arguments {
        let answer = recognizer.recognize(&fs::read(&frame)?)?;
        let known = if answer.known { "known" } else { "unknown" };
        println!("{frame}: {} ({:.2}, {known})", recognizer.room(&answer), answer.probability());
    }
    Ok(())
}
