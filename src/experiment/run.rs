//! Plans to figures: models are trained, drives are answered, what was answered before is read.

use super::{Cache, Cell, Drives, ExperimentError, Occlusion, Plan};
use crate::dataset::Described;
use crate::evaluate::{Answer, Evaluation, Summary};
use crate::model::{Config, Model, Sample};
use crate::validate;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, VecDeque};

/// The answer to one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameAnswer {
    /// Which frame of the drive.
    pub frame_idx: usize,
    /// The room that was answered.
    pub place: String,
    /// How many keypoints the answer rests on.
    pub n_keypoints: usize,
}

/// A cell, measured.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Over the seeds: the mean, over the splits, of the rates of the answered frames.
    pub rate: Option<Summary>,
    /// Over the seeds: the same away from room borders.
    pub without_border: Option<Summary>,
    /// Of the best seed, all splits together.
    pub best: Evaluation,
    /// The best seed.
    pub best_seed: u64,
    /// Of the best seed: the answers to each answered drive.
    #[serde(skip)]
    pub best_answers: Vec<(usize, Vec<FrameAnswer>)>,
    /// Of the best seed.
    pub keypoints: KeypointCounts,
}

/// How many keypoints the answered frames have.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct KeypointCounts {
    /// Of the frame that has fewest.
    pub least: usize,
    /// Over the frames.
    pub mean: f64,
    /// Of the frame that has most.
    pub most: usize,
}

/// What is being done.
#[derive(Clone, Debug)]
pub struct Step<'a> {
    /// The cell, as `row, column`.
    pub cell: String,
    /// Steps done, of the plan's cells times seeds.
    pub n_done: usize,
    /// All steps.
    pub n_steps: usize,
    /// The plan.
    pub plan: &'a Plan,
}

/// Measures the cells of a plan in their order. `on_step` is called before each.
pub fn run(
    plan: &Plan,
    drives: &Drives,
    n_seeds: u64,
    cache: &Cache,
    mut on_step: impl FnMut(Step),
) -> Result<Vec<Measured>, ExperimentError> {
    let n_steps = plan.cells.len() * n_seeds as usize;
    let mut runner = Runner { drives, cache, described: Vec::new(), trained: VecDeque::new() };
    let mut measured = Vec::with_capacity(plan.cells.len());
    for (cell_idx, cell) in plan.cells.iter().enumerate() {
        let mut seeds = Vec::new();
        for seed in 0..n_seeds {
            let n_done = cell_idx * n_seeds as usize + seed as usize;
            on_step(Step { cell: cell.name(), n_done, n_steps, plan });
            seeds.push(runner.answer(cell, seed)?);
        }
        measured.push(Measured::new(drives, &seeds));
    }
    Ok(measured)
}

impl Cell {
    /// What messages call it.
    pub fn name(&self) -> String {
        format!("{}, {}", self.row, self.column)
    }
}

/// For each split, for each drive that it tests: the drive and the answers to it.
type Answers = Vec<Vec<(usize, Vec<FrameAnswer>)>>;

impl Measured {
    fn new(drives: &Drives, seeds: &[Answers]) -> Self {
        let rates = |value: fn(&Evaluation) -> Option<f64>| -> Vec<f64> {
            seeds.iter().filter_map(|splits| mean_over_splits(drives, splits, value)).collect()
        };
        let overall = rates(|evaluation| evaluation.overall.rate);
        let best_seed = (0..overall.len()).max_by(|&a, &b| overall[a].total_cmp(&overall[b]).then(b.cmp(&a)));
        let best_seed = best_seed.unwrap_or_default();
        let best_answers: Vec<_> = seeds.get(best_seed).into_iter().flatten().flatten().cloned().collect();
        Self {
            rate: Summary::of(&overall),
            without_border: Summary::of(&rates(|evaluation| evaluation.without_border.rate)),
            best: evaluate(drives, &best_answers),
            best_seed: best_seed as u64,
            keypoints: KeypointCounts::of(best_answers.iter().flat_map(|(_, answers)| answers)),
            best_answers,
        }
    }
}

impl KeypointCounts {
    fn of<'a>(answers: impl Iterator<Item = &'a FrameAnswer>) -> Self {
        let counts: Vec<usize> = answers.map(|answer| answer.n_keypoints).collect();
        Self {
            least: counts.iter().min().copied().unwrap_or_default(),
            mean: counts.iter().sum::<usize>() as f64 / counts.len().max(1) as f64,
            most: counts.iter().max().copied().unwrap_or_default(),
        }
    }
}

fn mean_over_splits(drives: &Drives, splits: &Answers, value: fn(&Evaluation) -> Option<f64>) -> Option<f64> {
    let rates: Vec<f64> = splits.iter().filter_map(|answers| value(&evaluate(drives, answers))).collect();
    Summary::of(&rates).map(|summary| summary.mean)
}

fn evaluate(drives: &Drives, answers: &[(usize, Vec<FrameAnswer>)]) -> Evaluation {
    let answers = answers.iter().flat_map(|(drive_idx, answers)| {
        let drive = drives.get(*drive_idx);
        answers.iter().map(move |answer| Answer {
            place: &drive.dataset.frames[answer.frame_idx].place,
            answered: &answer.place,
            near_border: drive.near_border[answer.frame_idx],
        })
    });
    Evaluation::new(&answers.collect::<Vec<_>>())
}

/// What the frames of a drive look like depends on these.
type DescribedKey = (usize, String);

struct Runner<'a> {
    drives: &'a Drives,
    cache: &'a Cache,
    /// The drives described last, the oldest first.
    described: Vec<(DescribedKey, Described)>,
    /// The models trained last, the oldest first, and what they depend on.
    trained: VecDeque<(String, Model)>,
}

/// Models that are kept: those of all seeds, since the next cell often tests the same ones.
const MAX_TRAINED: usize = 32;

/// Drives that are kept described: the six of one lab and one more.
const MAX_DESCRIBED: usize = 7;

impl Runner<'_> {
    fn answer(&mut self, cell: &Cell, seed: u64) -> Result<Answers, ExperimentError> {
        let config = Config { seed, ..cell.config.clone() };
        let mut splits = Vec::with_capacity(cell.splits.len());
        for split in &cell.splits {
            let model_key = self.model_key(&config, &split.train);
            let mut answers = Vec::new();
            for &test in &split.test {
                let key = self.answer_key(&model_key, test, cell.occlusion);
                let answer = match self.cache.get(&key) {
                    Some(answer) => answer,
                    None => {
                        self.train(cell, &config, (&model_key, &split.train))?;
                        let answer = self.answer_drive(&config, &model_key, (test, cell.occlusion))?;
                        self.cache.put(&key, &answer)?;
                        answer
                    }
                };
                answers.push((test, answer));
            }
            splits.push(answers);
        }
        Ok(splits)
    }

    fn train(
        &mut self,
        cell: &Cell,
        config: &Config,
        (key, drive_idxs): (&str, &[usize]),
    ) -> Result<(), ExperimentError> {
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
            .map_err(|source| ExperimentError::Train { cell: cell.name(), source })?
            .model;
        if self.trained.len() == MAX_TRAINED {
            self.trained.pop_front();
        }
        self.trained.push_back((key.to_owned(), model));
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
        (drive_idx, occlusion): (usize, Occlusion),
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
                place: answered.place,
                n_keypoints: answered.recognition.n_keypoints,
            }
        };
        let is_trained = |&idx: &usize| model.places().binary_search(&described.samples[idx].place).is_ok();
        Ok((0..described.samples.len()).filter(is_trained).map(answer).collect())
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
        key(&(env!("CARGO_PKG_VERSION"), config, trained_on))
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

/// Cells by row and column, in the order in which they first occur.
pub(super) fn axes(plan: &Plan) -> (Vec<&str>, Vec<&str>) {
    let in_order = |name: fn(&Cell) -> &str| {
        let mut seen = BTreeSet::new();
        plan.cells.iter().map(name).filter(|name| seen.insert(*name)).collect()
    };
    (in_order(|cell| &cell.row), in_order(|cell| &cell.column))
}
