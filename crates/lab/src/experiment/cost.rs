//! Time and memory: Lu, section 6.8. The only figures that differ from run to run, and so are never kept.

use super::{Cost, Drive, ExperimentError, Occlusion};
use crate::validate::{median, timed};
use roomsight_recognition::model::{BAG, Config, Extractor, Model, Sample, Scratch};
use roomsight_vision::image::Limits;
use std::env::consts::ARCH;
use std::fs;

/// At most this many frames are timed, spread evenly over the drive.
const MAX_FRAMES: usize = 100;

/// Trains on one drive and answers frames of another, on the thread that calls.
pub(super) fn measure([train, test]: [&Drive; 2], config: &Config) -> Result<Cost, ExperimentError> {
    let described = train.describe(config, Occlusion::default())?;
    let samples: Vec<&Sample> = described.samples.iter().collect();
    let (training, training_ms) = timed(|| Model::train(&samples, config, train.camera.clone(), |_| ()));
    let impossible = |error: &dyn std::fmt::Display| ExperimentError::Impossible(error.to_string());
    let model = training.map_err(|error| impossible(&error))?.model;
    let model_bytes = model.to_bytes().map_err(|error| impossible(&error))?.len();
    let extractor = Extractor::new(config, train.camera.clone());
    let mut scratch = Scratch::default();
    let mut times: [Vec<f64>; 3] = Default::default();
    let stride = test.dataset.frames.len().div_ceil(MAX_FRAMES).max(1);
    let limits = Limits::default();
    for frame in test.dataset.frames.iter().step_by(stride) {
        let Ok(bytes) = fs::read(&frame.path) else { continue };
        let (image, decode_ms) = timed(|| extractor.decode(&bytes, &limits));
        let Ok(image) = image else { continue };
        let (features, features_ms) = timed(|| extractor.extract(&image, &mut scratch));
        let (_, classify_ms) = timed(|| model.classify(&features));
        let of_frame = [features_ms, classify_ms, decode_ms + features_ms + classify_ms];
        times.iter_mut().zip(of_frame).for_each(|(times, time)| times.push(time));
    }
    let bag = model.sizes().remove(BAG).unwrap_or_default();
    let n_dimensions = config.machines().map_or(0, |machines| machines.descriptor.n_dimensions());
    let [features_ms, classify_ms, whole_ms] = times.map(median);
    Ok(Cost {
        cpu: cpu_name(),
        features_ms,
        classify_ms,
        whole_ms,
        training_s: training_ms / 1000.0,
        model_bytes,
        vocabulary: [bag.n_words.unwrap_or_default(), n_dimensions],
        n_support_vectors: bag.n_support_vectors,
    })
}

/// What the system calls its CPU; its architecture where it does not say.
fn cpu_name() -> String {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let mut names = info.lines().filter_map(|line| line.strip_prefix("model name")?.split_once(": "));
    names.next().map_or_else(|| ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}
