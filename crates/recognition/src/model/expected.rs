//! What a model expects of frames like those that it was trained on, so that others can be told when frames change.

use crate::model::Model;
use crate::model::known::Known;
use crate::opinions::Said;

/// How frames were answered that were held out in training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// The number of these frames that the model still knows of.
    pub n_frames: usize,
    /// The share of them whose answers were known.
    pub known: f64,
    /// Their mean novelty; `None` where the model cannot tell.
    pub novelty: Option<f64>,
}

impl Model {
    /// What is expected of frames of the trained rooms; `None` where the file does not say. Takes milliseconds.
    pub fn expected(&self) -> Option<Expected> {
        let (mut n_frames, mut n_known, mut sum) = (0, 0, 0.0);
        for decided in self.held_out.iter() {
            let (is_known, novelty) = self.expects(&decided.said);
            n_frames += 1;
            n_known += usize::from(is_known);
            sum += f64::from(novelty.unwrap_or_default());
        }
        let mean = |sum: f64| sum / n_frames as f64;
        (n_frames > 0).then(|| Expected {
            n_frames,
            known: mean(n_known as f64),
            novelty: self.tells_new_places().then(|| mean(sum)),
        })
    }

    /// Whether the answer to a frame of which opinions say this is known, and how new the frame is.
    fn expects(&self, said: &[Option<Said>]) -> (bool, Option<f32>) {
        let early = self.early.iter().find_map(|early| {
            let said: Vec<Option<Said>> = early.opinion_idxs.iter().map(|&idx| said[idx].clone()).collect();
            let (probabilities, novelty) = early.classification.answer(&early.config, &said);
            let sees = said.iter().any(Option::is_some);
            (sees && early.is_sure(largest(&probabilities), novelty)).then_some((true, novelty))
        });
        early.unwrap_or_else(|| {
            let (probabilities, novelty) = self.classification.answer(&self.config, said);
            let holds = |known: Known| known.holds(largest(&probabilities), novelty);
            (self.classification.known.is_some_and(holds), novelty)
        })
    }
}

fn largest(probabilities: &[f32]) -> f32 {
    probabilities.iter().copied().fold(0.0, f32::max)
}
