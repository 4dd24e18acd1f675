//! What each opinion of a configuration brings: each alone, each pair, and all together.

use roomsight_recognition::model::{
    Candidate, Choice, Config, Model, Sample, TrainError, Trials, Unit, train_preferred,
};
use roomsight_vision::camera::Camera;

/// Opinions that answer together.
#[derive(Clone, Debug, PartialEq)]
pub struct Team {
    /// Its opinions, joined by `+`.
    pub name: String,
    /// The configuration that has these alone.
    pub config: Config,
}

/// Each opinion alone, each pair where there are three or more, and all.
pub fn teams(config: &Config) -> Vec<Team> {
    let names: Vec<&String> = config.opinions.keys().collect();
    let of = |members: &[&String]| Team {
        name: members.iter().map(|name| name.as_str()).collect::<Vec<_>>().join(" + "),
        config: config.with_opinions(|name| members.iter().any(|member| *member == name)),
    };
    let mut teams: Vec<Team> = names.iter().map(|&name| of(&[name])).collect();
    if names.len() > 2 {
        for (idx, &first) in names.iter().enumerate() {
            teams.extend(names[idx + 1..].iter().map(|&second| of(&[first, second])));
        }
    }
    if names.len() > 1 {
        teams.push(of(&names));
    }
    teams
}

/// What is trained in a round.
#[derive(Clone, Debug)]
pub enum Method {
    /// A model of each of these. All have a part of one configuration's opinions.
    Every(Vec<Team>),
    /// A model of the one that held-out training frames prefer.
    Preferred(Vec<Candidate>),
}

/// A model, and which of its method's it is.
pub struct Trained {
    /// The index of the team; 0 of what was preferred.
    pub team_idx: usize,
    /// What answers.
    pub model: Model,
    /// Why, where it was preferred to others.
    pub choice: Option<Choice>,
}

impl Method {
    /// A model of a configuration as it is.
    pub fn of(config: &Config) -> Self {
        Self::Every(teams(config).into_iter().next_back().into_iter().collect())
    }

    /// The names of what is measured.
    pub fn names(&self) -> Vec<String> {
        match self {
            Self::Every(teams) => teams.iter().map(|team| team.name.clone()).collect(),
            Self::Preferred(_) => vec!["preferred".to_owned()],
        }
    }

    /// Trains on samples that were described for `config`, which has all opinions of the method.
    ///
    /// # Errors
    /// What cannot be trained.
    pub fn train(
        &self,
        samples: &[&Sample],
        config: &Config,
        camera: &Camera,
    ) -> Result<Vec<Trained>, TrainError> {
        // With the seed of the round.
        let seeded = |part: &Config| Config { seed: config.seed, ..part.clone() };
        match self {
            Self::Every(teams) => {
                let mut trials = Trials::run(samples, config, Unit::Drives, |_| ())?;
                let mut finish = |part: &Config| {
                    trials.finish(&seeded(part), camera.clone(), |_| ()).map(|training| training.model)
                };
                let trained = teams.iter().enumerate().map(|(team_idx, team)| {
                    Ok(Trained { team_idx, model: finish(&team.config)?, choice: None })
                });
                trained.collect()
            }
            Self::Preferred(candidates) => {
                let seeded = |candidate: &Candidate| Candidate {
                    config: seeded(&candidate.config),
                    ..candidate.clone()
                };
                let candidates: Vec<Candidate> = candidates.iter().map(seeded).collect();
                let preferred = train_preferred(samples, &candidates, camera, |_| ())?;
                let (model, choice) = (preferred.training.model, Some(preferred.choice));
                Ok(vec![Trained { team_idx: 0, model, choice }])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use roomsight_recognition::model::PatternsConfig;

    #[test]
    fn opinions_are_measured_alone_in_pairs_and_together() {
        let names = |config: &Config| teams(config).into_iter().map(|team| team.name).collect::<Vec<_>>();
        assert_eq!(names(&Config::default()), ["bag"]);
        let mut config = Config::default().with_patterns(0.5, PatternsConfig::default());
        assert_eq!(names(&config), ["bag", "patterns", "bag + patterns"]);
        config.weights.clear();
        let again = config.opinions["patterns"].clone();
        config.opinions.insert("again".to_owned(), again);
        let three = ["again", "bag", "patterns", "again + bag", "again + patterns", "bag + patterns"];
        let expected: Vec<&str> = three.into_iter().chain(["again + bag + patterns"]).collect();
        assert_eq!(names(&config), expected);
        assert!(teams(&config).iter().all(|team| team.config.check().is_ok()));
    }
}
