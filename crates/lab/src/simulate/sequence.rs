//! Sequences on disk.

use super::walls::{WALLS_FILE, Wall};
use super::{CameraKind, Pose, SequenceSpec, Simulation};
use crate::cold_layout::{LABEL_FILE, LABEL_FOLDER, ODOMETRY_FILE, SCAN_FILE, SENSES_FOLDER, tdf};
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

const JPEG_QUALITY: u8 = 88;
/// The file that tells a simulated root from a real one, and says what is in it.
pub const MARKER_FILE: &str = "SIMULATED.txt";

/// Why a sequence was not simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// Not a rate that a camera has.
    #[error("{0} frames a second: choose a rate above 0 and up to 30")]
    FrameRate(f32),
    /// Simulated frames must not end up among other files.
    #[error("{} is not empty and was not made by this command (it has no {MARKER_FILE}): choose another folder", .0.display())]
    ForeignFolder(PathBuf),
    /// The disk is full, or the folder may not be written.
    #[error("cannot write {}: {source}", .path.display())]
    Write {
        /// What could not be written.
        path: PathBuf,
        /// The system's word.
        source: io::Error,
    },
    /// The encoder refused a frame.
    #[error("cannot encode a frame: {0}")]
    Encode(#[from] image::ImageError),
}

/// What a sequence has in it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SequenceSummary {
    /// Where it is.
    pub folder: PathBuf,
    /// Frames of each camera.
    pub n_frames: usize,
    /// How many frames of each place, by label.
    pub n_frames_by_room: BTreeMap<String, usize>,
    /// Whether it was there already, made by the same code from the same specification.
    pub was_kept: bool,
}

impl Simulation {
    /// Writes the sequence below `root`: the frames of `cameras`, `localization/places.lst`, odometry and scans, and the walls
    /// for maps. Calls `progress` with the number of frames that were written since the last call.
    ///
    /// A sequence appears under its name when it is complete; what an interrupted run leaves behind ends
    /// in `.partial`. One that is there already is kept if it is the same, replaced otherwise.
    ///
    /// # Errors
    ///
    /// [`SimulateError`]: a root with foreign files in it, a failure to write.
    pub fn write(
        &self,
        cameras: &[CameraKind],
        root: &Path,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<SequenceSummary, SimulateError> {
        let mut records = Records::open(root)?;
        let folder = root.join(self.spec.folder());
        let record = record(&self.spec, cameras);
        let was_kept = records.lines.contains(&record) && folder.is_dir();
        if !was_kept {
            let partial = folder.with_extension("partial");
            remove(&partial)?;
            write_frames(self, cameras, &partial, progress)?;
            write_labels(self, &partial)?;
            write_senses(self, &partial)?;
            records.forget(&self.spec)?;
            remove(&folder)?;
            fs::rename(&partial, &folder).map_err(failed(&folder))?;
            records.add(record)?;
        }
        let mut n_frames_by_room = BTreeMap::new();
        for frame_idx in 0..self.n_frames() {
            *n_frames_by_room.entry(self.place(frame_idx).to_owned()).or_default() += 1;
        }
        Ok(SequenceSummary { folder, n_frames: self.n_frames(), n_frames_by_room, was_kept })
    }
}

fn write_frames(
    simulation: &Simulation,
    cameras: &[CameraKind],
    folder: &Path,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<(), SimulateError> {
    for camera in cameras {
        let frames = folder.join(camera.folder());
        fs::create_dir_all(&frames).map_err(failed(&frames))?;
    }
    (0..simulation.n_frames()).into_par_iter().try_for_each(|frame_idx| {
        for camera in cameras {
            let path = folder.join(camera.folder()).join(simulation.file_name(frame_idx));
            let jpeg = encoded(&simulation.render(frame_idx, *camera))?;
            fs::write(&path, jpeg).map_err(failed(&path))?;
            progress(1);
        }
        Ok(())
    })
}

fn write_labels(simulation: &Simulation, folder: &Path) -> Result<(), SimulateError> {
    let line = |idx: usize| format!("{} {}\n", simulation.file_name(idx), simulation.place(idx));
    let labels: String = (0..simulation.n_frames()).map(line).collect();
    let localization = folder.join(LABEL_FOLDER);
    fs::create_dir_all(&localization).map_err(failed(&localization))?;
    let path = localization.join(LABEL_FILE);
    fs::write(&path, labels).map_err(failed(&path))?;
    let path = folder.join(WALLS_FILE);
    fs::write(&path, Wall::to_csv(&simulation.walls())).map_err(failed(&path))
}

fn write_senses(simulation: &Simulation, folder: &Path) -> Result<(), SimulateError> {
    let n_frames = simulation.n_frames();
    let scan = |idx: usize| tdf::scan_line(simulation.time(idx), &simulation.scan(idx));
    let scans: Vec<String> = (0..n_frames).into_par_iter().map(scan).collect();
    let line = |(idx, Pose { x, y, heading }): (usize, Pose)| {
        tdf::odometry_line(simulation.time(idx), [x, y].map(f64::from), heading.into())
    };
    let odometry: String = simulation.odometry().into_iter().enumerate().map(line).collect();
    let senses = folder.join(SENSES_FOLDER);
    fs::create_dir_all(&senses).map_err(failed(&senses))?;
    for (file, lines) in [(ODOMETRY_FILE, odometry), (SCAN_FILE, scans.concat())] {
        let path = senses.join(file);
        fs::write(&path, lines).map_err(failed(&path))?;
    }
    Ok(())
}

fn encoded(frame: &RgbImage) -> Result<Vec<u8>, SimulateError> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).encode_image(frame)?;
    Ok(bytes)
}

/// The marker file: a heading, then a line for each complete sequence.
struct Records {
    path: PathBuf,
    lines: Vec<String>,
}

impl Records {
    /// Reads the marker of a root, or makes both; refuses a root with files but without a marker.
    fn open(root: &Path) -> Result<Self, SimulateError> {
        fs::create_dir_all(root).map_err(failed(root))?;
        let path = root.join(MARKER_FILE);
        match fs::read_to_string(&path) {
            Ok(text) => Ok(Self { path, lines: text.lines().map(str::to_owned).collect() }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                if fs::read_dir(root).map_err(failed(root))?.next().is_some() {
                    return Err(SimulateError::ForeignFolder(root.to_owned()));
                }
                let heading = "These frames are SIMULATED by roomsight. They are laid out like the COLD \
                               database but are not part of it.";
                let records = Self { path, lines: vec![heading.to_owned(), String::new()] };
                records.save()?;
                Ok(records)
            }
            Err(source) => Err(SimulateError::Write { path, source }),
        }
    }

    fn add(&mut self, record: String) -> Result<(), SimulateError> {
        self.lines.push(record);
        self.save()
    }

    /// Drops what was said of a sequence.
    fn forget(&mut self, spec: &SequenceSpec) -> Result<(), SimulateError> {
        let name = format!("{} ", spec.folder().display());
        self.lines.retain(|line| !line.starts_with(&name));
        self.save()
    }

    fn save(&self) -> Result<(), SimulateError> {
        fs::write(&self.path, self.lines.join("\n") + "\n").map_err(failed(&self.path))
    }
}

/// What made a sequence, on one line.
fn record(spec: &SequenceSpec, cameras: &[CameraKind]) -> String {
    let cameras: Vec<&str> = cameras.iter().map(|camera| camera.folder()).collect();
    format!(
        "{} seed {} frames_per_second {} stops {} cameras {} sources {}",
        spec.folder().display(),
        spec.seed,
        spec.frames_per_second,
        spec.has_stops,
        cameras.join(","),
        env!("ROOMSIGHT_SIMULATION_SOURCES"),
    )
}

fn remove(folder: &Path) -> Result<(), SimulateError> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(failed(folder)(error)),
        _ => Ok(()),
    }
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> SimulateError {
    let path = path.to_owned();
    |source| SimulateError::Write { path, source }
}
