//! Frames that the model doubted, for whoever keeps them: by a rule, so many of a robot at most, and never in the way of a
//! frame.

use arc_swap::ArcSwapOption;
use bytes::Bytes;
use roomsight_protocol::inbox::{Doubt, InboxRule};
use roomsight_protocol::rest::{RoomProbability, Unknown};
use roomsight_protocol::training::PublishedVersion;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Rooms are torn where the second is so many times as probable as the first, or more.
const TORN: f32 = 0.6;
/// The rooms that are kept of an answer.
pub const N_ROOMS: usize = 3;
/// The most senders whose last frame is remembered; with more, the rule of time begins anew for all.
const MAX_SENDERS: usize = 10_000;

/// What of an uncertain answer counts: how near the second room is, how new the place is, and what else says another
/// room.
const MARGIN_WEIGHT: f64 = 0.5;
const NOVELTY_WEIGHT: f64 = 0.2;
const APART_WEIGHT: f64 = 0.3;

/// Who sends a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Sender {
    pub robot: Option<Arc<str>>,
    /// The name of its key.
    pub key: Option<Arc<str>>,
}

/// A frame that is kept if its answer is one to doubt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Doubtable {
    pub sender: Sender,
    pub bytes: Bytes,
}

/// What was answered.
#[derive(Clone, Debug, PartialEq)]
pub struct DoubtedAnswer {
    pub room: String,
    pub known: bool,
    pub unknown: Option<Unknown>,
    pub probability: f32,
    /// The most probable first.
    pub probabilities: Vec<RoomProbability>,
    pub novelty: Option<f32>,
    pub model: PublishedVersion,
}

/// A frame that is to be kept.
#[derive(Clone, Debug)]
pub struct DoubtedFrame {
    pub bytes: Bytes,
    pub robot: Option<String>,
    pub key: Option<String>,
    pub answer: DoubtedAnswer,
    pub filtered_room: Option<String>,
    pub shadow_room: Option<String>,
    pub reasons: Vec<Doubt>,
    /// How much it would teach, 0 to 1.
    pub value: f64,
    /// What a person says that it shows.
    pub said: Option<String>,
}

/// What else says of a frame which room it shows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OtherRooms {
    /// The frames so far.
    pub filtered: Option<String>,
    /// The shadow.
    pub shadow: Option<String>,
}

/// Whose time a frame takes. What a shadow doubts, which looks later, has a time of its own.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Turn {
    sender: Sender,
    is_shadows: bool,
}

/// The frames that are doubted, on their way.
#[derive(Default)]
pub struct Doubts {
    /// None: nothing is kept.
    rule: ArcSwapOption<InboxRule>,
    keeper: OnceLock<SyncSender<DoubtedFrame>>,
    /// When the last frame of each sender was kept.
    last: Mutex<HashMap<Turn, Instant>>,
    missed: AtomicU64,
}

impl Doubts {
    /// Sends what is doubted there from now on.
    pub fn connect(&self, keeper: SyncSender<DoubtedFrame>) {
        // Only the first counts: an engine has one keeper.
        let _ = self.keeper.set(keeper);
    }

    /// Keeps frames by this rule from now on.
    pub fn adopt(&self, rule: &InboxRule) {
        let keeps = rule.all || !rule.robots.is_empty() || !rule.keys.is_empty();
        self.rule.store(keeps.then(|| Arc::new(rule.clone())));
    }

    /// Frames that were not kept since too many came at once.
    pub fn n_missed(&self) -> u64 {
        self.missed.load(Ordering::Relaxed)
    }

    /// Whether a frame of this sender would be kept now, where it is doubted.
    pub fn wants(&self, sender: &Sender) -> bool {
        let Some(rule) = &*self.rule.load() else { return false };
        let turn = |is_shadows| Turn { sender: sender.clone(), is_shadows };
        covers(rule, sender) && [false, true].into_iter().any(|of| self.is_due(rule, &turn(of), false))
    }

    /// Keeps a frame of a sender, if its answer is one to doubt.
    pub fn consider(&self, doubtable: &Doubtable, answer: DoubtedAnswer, others: OtherRooms) {
        let Doubtable { sender, bytes } = doubtable;
        let Some(rule) = &*self.rule.load() else { return };
        let reasons = reasons(rule.probability, &answer, &others);
        let turn = Turn { sender: sender.clone(), is_shadows: others.shadow.is_some() };
        if reasons.is_empty() || !self.is_due(rule, &turn, true) {
            return;
        }
        let value = value(&answer, &reasons);
        let text = |name: &Option<Arc<str>>| name.as_deref().map(str::to_owned);
        let doubted = DoubtedFrame {
            bytes: bytes.clone(),
            robot: text(&sender.robot),
            key: text(&sender.key),
            answer: DoubtedAnswer { probabilities: first(answer.probabilities), ..answer },
            filtered_room: others.filtered,
            shadow_room: others.shadow,
            reasons,
            value,
            said: None,
        };
        if let Some(keeper) = self.keeper.get()
            && let Err(TrySendError::Full(_)) = keeper.try_send(doubted)
        {
            self.missed.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Whether so much time has passed since a frame of the sender was kept; `takes` it, if so.
    fn is_due(&self, rule: &InboxRule, turn: &Turn, takes: bool) -> bool {
        let now = Instant::now();
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let pause = Duration::try_from_secs_f64(rule.every_s).unwrap_or_default();
        let is_due = last.get(turn).is_none_or(|&kept| now.duration_since(kept) >= pause);
        if is_due && takes {
            if last.len() >= MAX_SENDERS {
                last.clear();
            }
            last.insert(turn.clone(), now);
        }
        is_due
    }
}

/// A frame whose answer a person calls wrong.
pub fn wrong(
    bytes: Bytes,
    robot: Option<String>,
    key: Option<String>,
    answer: DoubtedAnswer,
) -> DoubtedFrame {
    DoubtedFrame {
        bytes,
        robot,
        key,
        answer: DoubtedAnswer { probabilities: first(answer.probabilities), ..answer },
        filtered_room: None,
        shadow_room: None,
        reasons: vec![Doubt::Wrong],
        value: 1.0,
        said: None,
    }
}

fn first(mut rooms: Vec<RoomProbability>) -> Vec<RoomProbability> {
    rooms.truncate(N_ROOMS);
    rooms
}

fn covers(rule: &InboxRule, sender: &Sender) -> bool {
    let is_one_of = |name: &Option<Arc<str>>, names: &[String]| {
        name.as_deref().is_some_and(|name| names.iter().any(|one| one == name))
    };
    rule.all || is_one_of(&sender.robot, &rule.robots) || is_one_of(&sender.key, &rule.keys)
}

fn reasons(least_probable: f32, answer: &DoubtedAnswer, others: &OtherRooms) -> Vec<Doubt> {
    let second = answer.probabilities.get(1).map_or(0.0, |second| second.probability);
    let is_apart = |other: &Option<String>| other.as_ref().is_some_and(|other| *other != answer.room);
    [
        (!answer.known, Doubt::Unknown),
        (answer.known && answer.probability < least_probable, Doubt::Low),
        (second >= TORN * answer.probability && answer.probability > 0.0, Doubt::Torn),
        (is_apart(&others.filtered), Doubt::FilterApart),
        (is_apart(&others.shadow), Doubt::ShadowApart),
    ]
    .into_iter()
    .filter_map(|(is_so, doubt)| is_so.then_some(doubt))
    .collect()
}

/// How much a label of the frame would teach, 0 to 1: uncertainty by the margin between the two most probable rooms
/// (Scheffer et al., "Active hidden Markov models for information extraction", 2001), novelty, and disagreement.
fn value(answer: &DoubtedAnswer, reasons: &[Doubt]) -> f64 {
    // There is nothing to learn from a frame that shows nothing.
    if matches!(answer.unknown, Some(Unknown::Dark | Unknown::Covered | Unknown::NoDetail)) {
        return 0.0;
    }
    let second = answer.probabilities.get(1).map_or(0.0, |second| second.probability);
    let margin = f64::from((answer.probability - second).clamp(0.0, 1.0));
    let novelty = f64::from(answer.novelty.unwrap_or_default().clamp(0.0, 1.0));
    let is_apart = reasons.iter().any(|reason| matches!(reason, Doubt::FilterApart | Doubt::ShadowApart));
    MARGIN_WEIGHT * (1.0 - margin) + NOVELTY_WEIGHT * novelty + if is_apart { APART_WEIGHT } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::sync_channel;

    fn answer(known: bool, probabilities: &[f32]) -> DoubtedAnswer {
        let room =
            |(idx, &probability): (usize, &f32)| RoomProbability { room: idx.to_string(), probability };
        DoubtedAnswer {
            room: "0".into(),
            known,
            unknown: (!known).then_some(Unknown::Unsure),
            probability: probabilities[0],
            probabilities: probabilities.iter().enumerate().map(room).collect(),
            novelty: Some(0.1),
            model: PublishedVersion { name: "home".into(), version: 1 },
        }
    }

    fn sender(robot: &str) -> Sender {
        Sender { robot: Some(robot.into()), key: None }
    }

    fn doubtable(robot: &str) -> Doubtable {
        Doubtable { sender: sender(robot), bytes: Bytes::from_static(b"x") }
    }

    #[test]
    fn a_frame_is_kept_for_its_reasons_of_whom_the_rule_covers_and_so_often() {
        let doubts = Doubts::default();
        let (keeper, kept) = sync_channel(1);
        doubts.connect(keeper);
        let consider = |robot: &str, answer, others| {
            if doubts.wants(&sender(robot)) {
                doubts.consider(&doubtable(robot), answer, others);
            }
            kept.try_recv().ok().map(|frame| frame.reasons)
        };
        let unsure = || answer(false, &[0.4, 0.35, 0.25]);
        assert_eq!(consider("eve", unsure(), OtherRooms::default()), None, "it is off");
        let rule = InboxRule { robots: vec!["eve".into()], every_s: 3600.0, ..InboxRule::default() };
        doubts.adopt(&rule);
        assert_eq!(consider("wall-e", unsure(), OtherRooms::default()), None, "the rule does not cover it");
        assert_eq!(consider("eve", answer(true, &[0.9, 0.1]), OtherRooms::default()), None, "it is sure");
        let reasons = consider("eve", unsure(), OtherRooms::default());
        assert_eq!(reasons, Some(vec![Doubt::Unknown, Doubt::Torn]));
        assert_eq!(consider("eve", unsure(), OtherRooms::default()), None, "it comes too soon");
        doubts.adopt(&InboxRule { every_s: 0.0, ..rule });
        let others = OtherRooms { filtered: Some("1".into()), shadow: None };
        let reasons = consider("eve", answer(true, &[0.45, 0.2]), others);
        assert_eq!(reasons, Some(vec![Doubt::Low, Doubt::FilterApart]));
    }

    #[test]
    fn what_cannot_be_kept_in_time_is_counted() {
        let doubts = Doubts::default();
        let (keeper, _kept) = sync_channel(1);
        doubts.connect(keeper);
        doubts.adopt(&InboxRule { all: true, every_s: 0.0, ..InboxRule::default() });
        for _ in 0..3 {
            let unsure = answer(false, &[0.4, 0.3]);
            doubts.consider(&doubtable("eve"), unsure, OtherRooms::default());
        }
        assert_eq!(doubts.n_missed(), 2);
    }

    #[test]
    fn torn_and_new_frames_teach_more_and_empty_ones_nothing() {
        let of = |answer: &DoubtedAnswer| value(answer, &reasons(0.5, answer, &OtherRooms::default()));
        let (torn, sure) = (answer(false, &[0.4, 0.4]), answer(false, &[0.9, 0.05]));
        assert!(of(&torn) > of(&sure));
        let dark = DoubtedAnswer { unknown: Some(Unknown::Dark), ..torn };
        assert_eq!(of(&dark), 0.0);
    }
}
