//! Which model answers whom: the part of the registry that every frame reads.

use super::LookupError;
use super::served::ServedModel;
use super::shadow::Shadow;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The label of the version that answers requests that ask for none.
pub const STABLE: &str = "stable";
/// The label of the version that answers a share of the robots in the place of the stable one.
pub const CANARY: &str = "canary";
/// The label of the version that sees what the stable one sees, and answers nobody.
pub const SHADOW: &str = "shadow";
/// The label of the version that was stable before.
pub const PREVIOUS: &str = "previous";

/// What serves under one name.
#[derive(Clone, Debug, Default)]
pub struct Serving {
    /// Answers where nothing else is asked for.
    pub stable: Option<Arc<ServedModel>>,
    /// Was stable before; kept, so that going back takes no time.
    pub previous: Option<Arc<ServedModel>>,
    /// Answers a share of the robots, above 0 and below 1.
    pub canary: Option<(Arc<ServedModel>, f64)>,
    /// Sees what the stable one sees, and answers nobody.
    pub shadow: Option<Arc<Shadow>>,
}

/// Which version of a model a caller asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The one that serves.
    Serving,
    Version(u64),
    /// The one that carries a label.
    Label(String),
}

/// What serves. Never changed: another one takes its place.
#[derive(Clone, Default)]
pub struct Table {
    /// The model of requests that name none; none before one was named or served. It need not serve now.
    pub default: Option<String>,
    pub models: BTreeMap<String, Serving>,
}

impl Table {
    /// The models of which a stable version serves, in the order of their names.
    pub fn stable(&self) -> impl Iterator<Item = &str> {
        let stable = self.models.iter().filter(|(_, serving)| serving.stable.is_some());
        stable.map(|(name, _)| name.as_str())
    }
}

impl Serving {
    /// The version that answers a caller who calls itself so. Robots without a name get the stable one.
    pub fn choose(
        &self,
        name: &str,
        choice: &Choice,
        robot: Option<&str>,
    ) -> Result<&Arc<ServedModel>, LookupError> {
        let nothing = || LookupError::NothingServes(name.to_owned());
        match choice {
            Choice::Serving => match &self.canary {
                Some((canary, share)) if robot.is_some_and(|robot| takes_part(name, robot, *share)) => {
                    Ok(canary)
                }
                _ => self.stable.as_ref().ok_or_else(nothing),
            },
            Choice::Label(label) if label == STABLE => self.stable.as_ref().ok_or_else(nothing),
            Choice::Label(label) => {
                let labeled = match label.as_str() {
                    CANARY => self.canary.as_ref().map(|(served, _)| served),
                    SHADOW => self.shadow.as_ref().map(|shadow| &shadow.served),
                    PREVIOUS => self.previous.as_ref(),
                    _ => None,
                };
                labeled.ok_or_else(|| LookupError::NoLabel(name.to_owned(), label.clone()))
            }
            Choice::Version(version) => self
                .answering()
                .find(|served| served.version == *version)
                .ok_or_else(|| LookupError::NotReady(name.to_owned(), *version)),
        }
    }

    /// All that can answer, the stable one first.
    pub fn answering(&self) -> impl Iterator<Item = &Arc<ServedModel>> {
        let canary = self.canary.as_ref().map(|(served, _)| served);
        let shadow = self.shadow.as_ref().map(|shadow| &shadow.served);
        self.stable.iter().chain(canary).chain(shadow).chain(&self.previous)
    }

    /// The shadow of the frames that this model answers.
    pub fn shadow_of(&self, served: &Arc<ServedModel>) -> Option<&Arc<Shadow>> {
        let is_stable = self.stable.as_ref().is_some_and(|stable| Arc::ptr_eq(stable, served));
        self.shadow.as_ref().filter(|_| is_stable)
    }
}

/// Whether a robot is among the share that the canary answers. It is so for as long as the share does not
/// shrink, whatever else happens: a robot does not flap between two versions.
fn takes_part(name: &str, robot: &str, share: f64) -> bool {
    let mut hasher = blake3::Hasher::new();
    hasher.update(name.as_bytes()).update(&[0]).update(robot.as_bytes());
    let digest = hasher.finalize();
    let position =
        digest.as_bytes().iter().take(8).fold(0_u64, |position, &byte| position << 8 | u64::from(byte));
    (position as f64) < share * 2_f64.powi(64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_the_robots_takes_part_and_stays_when_the_share_grows() {
        let robots: Vec<String> = (0..2000).map(|idx| format!("robot {idx}")).collect();
        let part = |share| robots.iter().filter(|robot| takes_part("lab", robot, share)).collect::<Vec<_>>();
        let (tenth, half) = (part(0.1), part(0.5));
        assert!((150..=250).contains(&tenth.len()), "{}", tenth.len());
        assert!((900..=1100).contains(&half.len()), "{}", half.len());
        assert!(tenth.iter().all(|robot| half.contains(robot)));
        assert_ne!(
            part(0.1),
            robots.iter().filter(|robot| takes_part("attic", robot, 0.1)).collect::<Vec<_>>()
        );
    }
}
