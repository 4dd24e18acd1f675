//! Plans to figures: models are trained, drives are answered, what was answered before is read.

use super::measured::{Answers, FrameAnswer};
use super::{
    Cache, Cell, Drive, Drives, ExperimentError, Matches, Measured, Occlusion, Plan, Rates, Split, Work,
    cost, stability,
};
use crate::dataset::Described;
use crate::part::Part;
use crate::validate;
use rayon::prelude::*;
use roomsight_recognition::model::{Config, Model, OpinionConfig, Sample};
use serde::Serialize;

/// The code that answers, as the build found it: answers that other code has kept are not read.
pub const SOURCES: &str = env!("ROOMSIGHT_ANSWER_SOURCES");

/// What is being done.
#[derive(Clone, Debug)]
pub struct Step {
    /// The cell, as `row, column`.
    pub cell: String,
    /// Steps done, of [`Plan::n_steps`].
    pub n_done: usize,
}

/// Measures the cells of a plan in their order. A cell that cannot be measured does not keep the others from it.
/// `on_step` is called before each step.
///
/// # Errors
/// A drive of which nothing can be read, a full disk.
pub fn run(
    plan: &Plan,
    drives: &Drives,
    n_seeds: u64,
    cache: &Cache,
    mut on_step: impl FnMut(Step),
) -> Result<Vec<Measured>, ExperimentError> {
    let mut runner = Runner { drives, cache, described: Vec::new(), trained: Vec::new() };
    let mut n_done = 0;
    let mut measured = Vec::with_capacity(plan.cells.len());
    for cell in &plan.cells {
        let n_seeds = cell.n_seeds(n_seeds);
        let on_seed = |seed: u64| on_step(Step { cell: cell.name(), n_done: n_done + seed as usize });
        let result = runner.measure(cell, n_seeds, on_seed);
        n_done += n_seeds as usize;
        measured.push(match result {
            Err(ExperimentError::Impossible(reason)) => Measured::Impossible { reason },
            result => result?,
        });
    }
    Ok(measured)
}

impl Plan {
    /// The cells of one part, one after the other, as those share models; none whose time is measured.
    pub fn with_part(mut self, part: Part) -> Self {
        self.cells.retain(|cell| !matches!(cell.work, Work::Cost { .. }));
        let range = part.range(self.cells.len());
        self.cells = self.cells.drain(range).collect();
        self
    }

    /// How many steps measuring it over this many seeds takes.
    pub fn n_steps(&self, n_seeds: u64) -> usize {
        self.cells.iter().map(|cell| cell.n_seeds(n_seeds) as usize).sum()
    }
}

impl Cell {
    /// What messages call it.
    pub fn name(&self) -> String {
        format!("{}, {}", self.row, self.column)
    }

    /// One where nothing is random: frames of known sequences are compared with each other.
    fn n_seeds(&self, n_seeds: u64) -> u64 {
        let is_random = self.config.opinions.values().any(OpinionConfig::is_random);
        match self.work {
            Work::Rate { .. } if is_random => n_seeds,
            _ => n_seeds.min(1),
        }
    }
}

/// What the frames of a drive look like depends on these.
type DescribedKey = (usize, String);

struct Runner<'a> {
    drives: &'a Drives,
    cache: &'a Cache,
    /// The drives described last, the oldest first.
    described: Vec<(DescribedKey, Described)>,
    /// The models trained last, the oldest first, and what they depend on.
    trained: Vec<(String, Model)>,
}

/// Models that are kept: those of all drives of a lab and ten seeds, since the next cell often tests the same ones.
/// With 1000 words they take half a megabyte each.
const MAX_TRAINED: usize = 64;

/// Models that keep frames and not words take up to a hundred megabytes each: those of all drives of a lab are
/// kept.
const MAX_TRAINED_WITHOUT_WORDS: usize = 6;

/// Drives that are kept described: the six of one lab and one more.
const MAX_DESCRIBED: usize = 7;

impl Runner<'_> {
    fn measure(
        &mut self,
        cell: &Cell,
        n_seeds: u64,
        mut on_seed: impl FnMut(u64),
    ) -> Result<Measured, ExperimentError> {
        let all_drives = self.drives;
        let get = |drive_idx: usize| all_drives.get(drive_idx);
        match &cell.work {
            Work::Rate { splits, occlusion } => {
                let mut seeds: Vec<Answers> = Vec::new();
                for seed in 0..n_seeds {
                    on_seed(seed);
                    let config = Config { seed, ..cell.config.clone() };
                    let answers = splits.iter().map(|split| self.answer(&config, split, *occlusion));
                    seeds.push(answers.collect::<Result<_, _>>()?);
                }
                Ok(Measured::Rates(Box::new(Rates::new(self.drives, &seeds))))
            }
            Work::Match { drives } => {
                on_seed(0);
                self.compare(drives.map(get), &cell.config).map(Measured::Matches)
            }
            Work::Cost { train, test } => {
                on_seed(0);
                cost::measure([get(*train), get(*test)], &cell.config).map(Measured::Cost)
            }
        }
    }

    fn compare(&self, drives: [&Drive; 2], config: &Config) -> Result<Matches, ExperimentError> {
        let key = key(&(SOURCES, config, drives.map(|drive| &drive.digest)));
        if let Some(matches) = self.cache.get(&key) {
            return Ok(matches);
        }
        let matches = stability::measure(drives, config)?;
        self.cache.put(&key, &matches)?;
        Ok(matches)
    }

    /// The answers to each drive that the split tests.
    fn answer(
        &mut self,
        config: &Config,
        split: &Split,
        occlusion: Occlusion,
    ) -> Result<Vec<(usize, Vec<FrameAnswer>)>, ExperimentError> {
        let model_key = self.model_key(config, &split.train);
        let mut answers = Vec::with_capacity(split.test.len());
        for &test in &split.test {
            let key = self.answer_key(&model_key, test, occlusion);
            let answer = match self.cache.get(&key) {
                Some(answer) => answer,
                None => {
                    self.train(config, &model_key, &split.train)?;
                    let answer = self.answer_drive(config, &model_key, test, occlusion)?;
                    self.cache.put(&key, &answer)?;
                    answer
                }
            };
            answers.push((test, answer));
        }
        Ok(answers)
    }

    fn train(&mut self, config: &Config, key: &str, drive_idxs: &[usize]) -> Result<(), ExperimentError> {
        if self.model(key).is_some() {
            return Ok(());
        }
        for &drive_idx in drive_idxs {
            self.describe(config, drive_idx, Occlusion::default(), drive_idxs.len())?;
        }
        let samples: Vec<&Sample> = drive_idxs
            .iter()
            .filter_map(|&idx| self.find(&described_key(config, idx, Occlusion::default())))
            .flat_map(|described| &described.samples)
            .collect();
        // No split trains on nothing; the drives of one lab share a camera.
        let camera = self.drives.get(drive_idxs[0]).camera.clone();
        let model = Model::train(&samples, config, camera, |_| ())
            .map_err(|error| ExperimentError::Impossible(error.to_string()))?
            .model;
        self.trained.push((key.to_owned(), model));
        let has_words =
            |(_, model): &(String, Model)| model.sizes().values().any(|size| size.n_words.is_some());
        for (words, max_kept) in [(true, MAX_TRAINED), (false, MAX_TRAINED_WITHOUT_WORDS)] {
            if self.trained.iter().filter(|trained| has_words(trained) == words).count() > max_kept {
                let oldest = self.trained.iter().position(|trained| has_words(trained) == words);
                oldest.map(|idx| self.trained.remove(idx));
            }
        }
        Ok(())
    }

    fn model(&self, key: &str) -> Option<&Model> {
        self.trained.iter().find(|(trained, _)| trained == key).map(|(_, model)| model)
    }

    /// Frames of rooms that were not trained cannot be answered and are left out, as in the papers.
    fn answer_drive(
        &mut self,
        config: &Config,
        model_key: &str,
        drive_idx: usize,
        occlusion: Occlusion,
    ) -> Result<Vec<FrameAnswer>, ExperimentError> {
        self.describe(config, drive_idx, occlusion, 1)?;
        let described = self.find(&described_key(config, drive_idx, occlusion));
        let (Some(described), Some(model)) = (described, self.model(model_key)) else {
            return Ok(Vec::new());
        };
        let answer = |sample_idx: usize| {
            let answered = validate::answer(model, &described.samples, sample_idx);
            FrameAnswer {
                frame_idx: described.frame_idxs[sample_idx],
                room: answered.room,
                n_keypoints: answered.recognition.n_keypoints,
            }
        };
        let is_trained = |&idx: &usize| model.rooms().binary_search(&described.samples[idx].room).is_ok();
        Ok((0..described.samples.len()).into_par_iter().filter(is_trained).map(answer).collect())
    }

    fn find(&self, key: &DescribedKey) -> Option<&Described> {
        self.described.iter().find(|(other, _)| other == key).map(|(_, described)| described)
    }

    /// Sees to it that a drive is described, and stays so while `n_needed` others are.
    fn describe(
        &mut self,
        config: &Config,
        drive_idx: usize,
        occlusion: Occlusion,
        n_needed: usize,
    ) -> Result<(), ExperimentError> {
        let key = described_key(config, drive_idx, occlusion);
        if let Some(found) = self.described.iter().position(|(other, _)| *other == key) {
            let found = self.described.remove(found);
            self.described.push(found);
            return Ok(());
        }
        let n_kept = MAX_DESCRIBED.max(n_needed) - 1;
        let n_dropped = self.described.len().saturating_sub(n_kept);
        self.described.drain(..n_dropped);
        let described = self.drives.get(drive_idx).describe(config, occlusion)?;
        self.described.push((key, described));
        Ok(())
    }

    fn model_key(&self, config: &Config, drive_idxs: &[usize]) -> String {
        let trained_on: Vec<&str> =
            drive_idxs.iter().map(|&idx| self.drives.get(idx).digest.as_str()).collect();
        key(&(SOURCES, config, trained_on))
    }

    fn answer_key(&self, model_key: &str, drive_idx: usize, occlusion: Occlusion) -> String {
        key(&(model_key, &self.drives.get(drive_idx).digest, occlusion))
    }
}

fn described_key(config: &Config, drive_idx: usize, occlusion: Occlusion) -> DescribedKey {
    (drive_idx, key(&(config.extraction(), occlusion)))
}

/// The digest of what the value says of itself.
fn key(value: &impl Serialize) -> String {
    // Plain values of this crate always have a JSON form.
    let json = serde_json::to_vec(value).unwrap_or_default();
    blake3::hash(&json).to_hex().to_string()
}
