//! What a model expects of frames like those that it was trained on, so that others can be told when frames change.

use crate::model::Model;

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
            let (probabilities, novelty) = self.classification.answer(&self.config, &decided.said);
            let probability = probabilities.into_iter().fold(0.0, f32::max);
            n_frames += 1;
            n_known +=
                usize::from(self.classification.known.is_some_and(|known| known.holds(probability, novelty)));
            sum += f64::from(novelty.unwrap_or_default());
        }
        let mean = |sum: f64| sum / n_frames as f64;
        (n_frames > 0).then(|| Expected {
            n_frames,
            known: mean(n_known as f64),
            novelty: self.tells_new_places().then(|| mean(sum)),
        })
    }
}
