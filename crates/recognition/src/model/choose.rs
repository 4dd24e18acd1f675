//! Which opinions a model has, chosen by held-out frames among a few candidates.

use crate::model::card::{Choice, Tally};
use crate::model::config::Config;
use crate::model::held_out::{TELLABLE, is_clear_gain};
use crate::model::sample::Sample;
use crate::model::training::{HeldOut, Training, TrainingStep};
use crate::model::trials::{Trials, Unit};
use crate::opinions::error::TrainError;
use roomsight_vision::camera::Camera;

/// A configuration that may be chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// What people call it.
    pub name: String,
    /// What it would train.
    pub config: Config,
}

/// All opinions of some candidates together: what is tried to choose among them. `None` without candidates.
pub fn all_opinions(candidates: &[Candidate]) -> Option<Config> {
    let (first, others) = candidates.split_first()?;
    let mut config = first.config.clone();
    for other in others {
        config.opinions.extend(other.config.opinions.clone());
    }
    Some(config)
}

/// An opinion that none can have on these frames.
#[derive(Debug)]
pub struct LeftOut {
    /// Its name.
    pub opinion: String,
    /// What it cannot learn.
    pub reason: TrainError,
}

/// A model of the candidate that was chosen.
#[derive(Debug)]
pub struct Preferred {
    /// The model, and its held-out answers.
    pub training: Training,
    /// Why it was chosen.
    pub choice: Choice,
    /// The opinions that none of the candidates could have.
    pub left_out: Vec<LeftOut>,
}

/// Trains a model of the candidate that held-out frames prefer; see [`choose`]. Where there are several, an opinion that
/// cannot learn from these frames is left out of all. `progress` is called before each step.
///
/// # Errors
/// Those of [`Trials::run`].
pub fn train_preferred(
    samples: &[&Sample],
    candidates: &[Candidate],
    camera: &Camera,
    mut progress: impl FnMut(TrainingStep),
) -> Result<Preferred, TrainError> {
    prefer(samples, candidates, Unit::Drives, &mut progress, |mut tried, progress| {
        let training = tried.trials.finish(tried.config, camera.clone(), progress)?;
        Ok(Preferred { training, choice: tried.choice, left_out: tried.left_out })
    })
}

/// What models of the preferred candidate, which were trained without a frame, say of it.
#[derive(Debug)]
pub struct HeldOutAnswers {
    /// The rooms, sorted.
    pub rooms: Vec<String>,
    /// The answers, none of which is known.
    pub held_out: Vec<HeldOut>,
}

/// Answers frames as [`train_preferred`] does on its way to a model, without making one, `unit` by unit.
///
/// # Errors
/// Those of [`Trials::run`].
pub fn answer_held_out(
    samples: &[&Sample],
    candidates: &[Candidate],
    unit: Unit,
    mut progress: impl FnMut(TrainingStep),
) -> Result<HeldOutAnswers, TrainError> {
    prefer(samples, candidates, unit, &mut progress, |tried, _| {
        let held_out = tried.trials.held_out(tried.config)?;
        Ok(HeldOutAnswers { rooms: tried.trials.rooms().to_vec(), held_out })
    })
}

/// All candidates, once they were tried.
struct TriedCandidates<'t, 's> {
    trials: Trials<'s>,
    /// Of the one that was chosen.
    config: &'t Config,
    choice: Choice,
    left_out: Vec<LeftOut>,
}

/// Tries candidates, chooses one, and goes on with it.
fn prefer<T>(
    samples: &[&Sample],
    candidates: &[Candidate],
    unit: Unit,
    mut progress: &mut dyn FnMut(TrainingStep),
    go_on: impl FnOnce(TriedCandidates, &mut dyn FnMut(TrainingStep)) -> Result<T, TrainError>,
) -> Result<T, TrainError> {
    let mut left_out: Vec<LeftOut> = Vec::new();
    loop {
        let candidates = without(candidates, &left_out);
        let Some(config) = all_opinions(&candidates) else {
            let none = || TrainError::Config("there is no opinion to train".to_owned());
            return Err(left_out.pop().map_or_else(none, |last| last.reason));
        };
        match Trials::run(samples, &config, unit, &mut progress) {
            Ok(trials) => {
                let choice = choose(&trials, &candidates)?;
                let config = &candidates[choice.chosen].config;
                return go_on(TriedCandidates { trials, config, choice, left_out }, progress);
            }
            Err(TrainError::Opinion { name, error }) if candidates.len() > 1 => {
                left_out.push(LeftOut { opinion: name, reason: *error });
            }
            Err(error) => return Err(error),
        }
    }
}

/// What is left of the candidates, none twice.
fn without(candidates: &[Candidate], left_out: &[LeftOut]) -> Vec<Candidate> {
    let mut left: Vec<Candidate> = Vec::new();
    for Candidate { name, config } in candidates {
        let config = config.with_opinions(|name| left_out.iter().all(|left_out| left_out.opinion != name));
        if !config.opinions.is_empty() && left.iter().all(|other| other.config != config) {
            left.push(Candidate { name: name.clone(), config });
        }
    }
    left
}

/// Chooses the candidate that answered the held-out frames best. Candidates come in the order of preference: a later one
/// is taken only where it is right on more frames than the best before it by over a standard error, that is, by
/// more than the square root of the number of frames on which exactly one of both is right (McNemar, "Note on the sampling
/// error of the difference between correlated proportions or percentages", Psychometrika 1947). It is the first where
/// there are no held-out frames, and where no candidate is right on at least half of them: then held-out drives show other
/// parts of the rooms than those that trained, and cannot tell.
///
/// # Errors
/// No calibration.
///
/// # Panics
/// Without candidates.
fn choose(trials: &Trials, candidates: &[Candidate]) -> Result<Choice, TrainError> {
    let mut tallies = Vec::with_capacity(candidates.len());
    let mut right_frames: Vec<Vec<bool>> = Vec::with_capacity(candidates.len());
    let mut chosen = 0;
    for candidate in candidates {
        let held_out = trials.held_out(&candidate.config)?;
        let is_right = trials.is_right(&held_out);
        tallies.push(Tally {
            name: candidate.name.clone(),
            opinions: candidate.config.opinions.keys().cloned().collect(),
            n_right: is_right.iter().filter(|&&is_right| is_right).count(),
            n_frames: held_out.len(),
        });
        right_frames.push(is_right);
    }
    let n_tellable = tallies.iter().map(|tally| tally.n_right).max().unwrap_or_default();
    if n_tellable as f64 >= TELLABLE * tallies[0].n_frames as f64 {
        for idx in 1..candidates.len() {
            if is_clearly_better(&right_frames[idx], &right_frames[chosen]) {
                chosen = idx;
            }
        }
    }
    Ok(Choice { chosen, tallies })
}

/// Frames count as they come, one flag a sample; see [`choose`].
fn is_clearly_better(candidate: &[bool], best: &[bool]) -> bool {
    let only =
        |one: &[bool], other: &[bool]| one.iter().zip(other).filter(|(one, other)| **one && !**other).count();
    is_clear_gain(only(candidate, best) as f64, only(best, candidate) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_later_candidate_is_taken_only_where_it_is_clearly_better() {
        let frames = |n_right: usize| (0..20).map(|idx| idx < n_right).collect::<Vec<_>>();
        assert!(is_clearly_better(&frames(12), &frames(10)));
        assert!(!is_clearly_better(&frames(11), &frames(10)), "one frame is no evidence");
        assert!(!is_clearly_better(&frames(10), &frames(12)));
        // Right on seven others, wrong on six that were right.
        let crossed: Vec<bool> = (0..20).map(|idx| (6..17).contains(&idx)).collect();
        assert!(!is_clearly_better(&crossed, &frames(10)));
        assert!(!is_clearly_better(&[], &[]));
    }
}
