//! How a frame is answered: looked at step by step, until enough is seen.

use crate::look::features::Features;
use crate::look::scan::Frame;
use crate::model::extractor::Scratch;
use crate::model::{Model, Recognition};
use crate::opinions::Said;
use std::collections::BTreeMap;

/// A frame on its way to an answer. [`Model::look`] and [`Model::answer`] take turns until there is one.
#[derive(Debug, Default)]
pub struct Looking {
    /// What was seen so far.
    features: Option<Features>,
    /// How many of [`Model::early`] were not sure.
    n_asked: usize,
    /// What opinions have said so far, by their index.
    said: BTreeMap<usize, Option<Said>>,
}

impl Model {
    /// Whether it answers some frames without asking all opinions.
    pub fn answers_early(&self) -> bool {
        !self.early.is_empty()
    }

    /// The same model, which always asks all opinions.
    #[must_use]
    pub fn asking_all(&self) -> Self {
        Self { early: Vec::new(), ..self.clone() }
    }

    /// Which room a frame shows.
    pub fn recognize<'a>(&self, frame: impl Into<Frame<'a>>, scratch: &mut Scratch) -> Recognition {
        let (frame, mut looking) = (frame.into(), Looking::default());
        loop {
            self.look(&mut looking, frame, scratch);
            if let Some(recognition) = self.answer(&mut looking) {
                return recognition;
            }
        }
    }

    /// Looks at a frame as the opinions want that are asked next.
    pub fn look<'a>(&self, looking: &mut Looking, frame: impl Into<Frame<'a>>, scratch: &mut Scratch) {
        let before = looking.features.take();
        let sights = self.early.get(looking.n_asked).map(|early| &early.sights);
        looking.features = Some(self.extractor.extract_also(sights, before, frame.into(), scratch));
    }

    /// Detects and describes all that opinions look at, as far as it was not seen yet.
    pub fn look_at_all<'a>(
        &self,
        looking: Looking,
        frame: impl Into<Frame<'a>>,
        scratch: &mut Scratch,
    ) -> Features {
        self.extractor.extract_also(None, looking.features, frame.into(), scratch)
    }

    /// What these opinions answer, with those that were asked before; `None` where they are not sure, and there are others.
    pub fn answer(&self, looking: &mut Looking) -> Option<Recognition> {
        let features = looking.features.take()?;
        let answer = self.answer_next(looking, &features);
        looking.features = Some(features);
        answer
    }

    /// Counts words and weighs them: the second half of [`Model::recognize`], where the first has seen all.
    pub fn classify(&self, features: &Features) -> Recognition {
        let mut looking = Looking::default();
        loop {
            if let Some(recognition) = self.answer_next(&mut looking, features) {
                return recognition;
            }
        }
    }

    fn answer_next(&self, looking: &mut Looking, features: &Features) -> Option<Recognition> {
        let opinions = &self.classification.opinions;
        let mut say =
            |idx: usize| looking.said.entry(idx).or_insert_with(|| opinions[idx].answer(features)).clone();
        let Some(early) = self.early.get(looking.n_asked) else {
            let said: Vec<Option<Said>> = (0..opinions.len()).map(say).collect();
            let seen: Vec<_> = features.seen.iter().collect();
            return Some(self.classification.recognition(&self.config, &said, &seen, features.hidden()));
        };
        looking.n_asked += 1;
        let said: Vec<Option<Said>> = early.opinion_idxs.iter().map(|&idx| say(idx)).collect();
        let seen = features.through(&early.sights);
        early.sure_answer(early.classification.recognition(&early.config, &said, &seen, features.hidden()))
    }
}
