//! What a model file says of opinions that answer early.

use super::{NEVER_KNOWN, read_known, read_weights};
use crate::file::arrays::{Array, Arrays, require};
use crate::file::error::FormatError;
use crate::model::Classification;
use crate::model::cascade::Early;
use crate::model::config::Config;
use crate::model::novelty::Novelty;
use crate::opinions::Opinion;
use crate::opinions::calibration::Calibration;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// All that is not an array.
#[derive(Serialize, Deserialize)]
pub(super) struct EarlyEntry {
    /// From which probability on answers are sure.
    least_probability: f32,
    /// Up to which novelty.
    most_novelty: f32,
    known_probability: f32,
    known_novelty: f32,
    /// How much each opinion counts, by name.
    weights: BTreeMap<String, f64>,
    doubt: f64,
}

impl EarlyEntry {
    pub(super) fn of(early: &Early) -> Self {
        let Early { config, classification, sure, .. } = early;
        let names = config.opinions.keys().cloned();
        Self {
            least_probability: sure.least_probability,
            most_novelty: sure.most_novelty,
            known_probability: classification.known.map_or(NEVER_KNOWN, |known| known.least_probability),
            known_novelty: classification.known.map_or(1.0, |known| known.most_novelty),
            weights: names.zip(classification.opinions.iter().map(|opinion| opinion.weight)).collect(),
            doubt: classification.doubt,
        }
    }

    /// Of unknown origin, those that are asked as number `idx` of the opinions of a model.
    pub(super) fn read(
        self,
        idx: usize,
        config: &Config,
        all: &Classification,
        file: &Arrays,
    ) -> Result<Early, FormatError> {
        let part = config.with_opinions(|name| self.weights.contains_key(name));
        let are_some = !part.opinions.is_empty() && part.opinions.len() == self.weights.len();
        require(are_some, "the opinions that answer early are not its own")?;
        require((0.0..=1.0).contains(&self.doubt), "a doubt of those that answer early is no share")?;
        let sure = read_known(self.least_probability, self.most_novelty)?;
        let sure =
            sure.ok_or_else(|| FormatError::Damaged("none of its early answers is sure".to_owned()))?;
        let weights = read_weights(&part, &self.weights)?;
        let of_all = config.opinions.iter().zip(&all.opinions);
        let of_part = of_all.filter(|((name, _), _)| part.opinions.contains_key(*name));
        let mut opinions = Vec::new();
        for (((name, config), opinion), weight) in of_part.zip(weights) {
            let prefix = format!("{}/{name}", prefix(idx));
            let calibration = Calibration::from_arrays(config.way(), all.n_rooms, &file.of_opinion(&prefix))?;
            opinions.push(Opinion { calibration, weight, ..opinion.clone() });
        }
        let prefix = prefix(idx);
        let classification = Classification {
            n_rooms: all.n_rooms,
            opinions,
            doubt: self.doubt,
            novelty: Novelty::from_arrays(&part, &file.of_opinion(&prefix))?,
            known: read_known(self.known_probability, self.known_novelty)?,
        };
        Ok(Early::new(part, config, classification, sure))
    }
}

pub(super) fn early_arrays(early: &[Early]) -> Vec<Array> {
    let mut arrays = Vec::new();
    for (idx, Early { config, classification, .. }) in early.iter().enumerate() {
        let mut of_part: Vec<Array> = classification.novelty.iter().flat_map(Novelty::to_arrays).collect();
        for (name, opinion) in config.opinions.keys().zip(&classification.opinions) {
            of_part.extend(opinion.calibration.to_arrays().into_iter().map(|array| array.of_opinion(name)));
        }
        arrays.extend(of_part.into_iter().map(|array| array.of_opinion(&prefix(idx))));
    }
    arrays
}

/// No opinion is called so.
fn prefix(idx: usize) -> String {
    format!("early.{idx}")
}
