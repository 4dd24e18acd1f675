//! How a stream stands, sealed for its robot to keep: any replica goes on from it, without a store that they share.

use super::belief::SealedBelief;
use super::moment::since;
use crate::access::{Key, Seals};
use crate::settings::{Secret, Settings};
use roomsight_protocol::header::MAX_SEQ;
use roomsight_protocol::rest::ModelName;
use roomsight_protocol::stream::StreamSettings;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// The most frames that are told as lost: many more than can have been accepted, fewer than a stranger may name.
const MAX_LOST: u64 = 4096;

/// Seals streams, and opens them again.
pub struct Tokens {
    seals: Seals,
    max_age: Duration,
}

/// How a stream stands. What later versions add must have a default: replicas are upgraded one by one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Standing {
    /// When it stood so, in milliseconds since 1970.
    pub at_ms: u64,
    /// Its public name, for logs.
    pub stream: String,
    pub settings: StreamSettings,
    /// The number of the next frame that brings none.
    pub next_seq: u64,
    /// The frames that were accepted and not told of.
    pub untold: Vec<Run>,
    pub told: Told,
}

/// What a stream has told, for another process that goes on with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Told {
    pub model: ModelName,
    /// Tells the model's rooms from others.
    pub rooms_digest: String,
    pub belief: Option<SealedBelief>,
    pub is_sure: bool,
    pub doubts_stamps: bool,
}

/// Numbers that follow one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    pub first: u64,
    pub last: u64,
}

/// Why a stream cannot go on from what its robot brings.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum TokenError {
    /// Of another service, of a key that is no longer known here, or opened with another key.
    #[error("it was not sealed with one of `resume_keys`, or not for this caller")]
    Sealed,
    /// Of another version.
    #[error("what was sealed cannot be read: {0}")]
    Unreadable(String),
    /// `resume_token_ms` have passed.
    #[error("it is {} s old", .0.as_secs())]
    Old(Duration),
}

impl Tokens {
    /// As the settings say.
    ///
    /// # Errors
    /// There are no random bytes.
    pub fn new(settings: &Settings) -> Result<Self, getrandom::Error> {
        let secrets: Vec<&str> = settings.resume_keys.iter().map(Secret::reveal).collect();
        Ok(Self { seals: Seals::new(&secrets)?, max_age: settings.resume_token() })
    }

    /// Whether there are any.
    pub fn are_told(&self) -> bool {
        self.seals.has_key()
    }

    /// A token of a stream that was opened with this key.
    pub fn seal(&self, standing: &Standing, key: Option<&Key>) -> Option<String> {
        // Plain values always have a JSON form.
        self.seals.seal(serde_json::to_vec(standing).unwrap_or_default(), &bound(key))
    }

    /// What a token says.
    ///
    /// # Errors
    /// It is not one of ours for this key, or too old.
    pub fn open(&self, token: &str, key: Option<&Key>) -> Result<Standing, TokenError> {
        let bytes = self.seals.open(token, &bound(key)).ok_or(TokenError::Sealed)?;
        let standing: Standing =
            serde_json::from_slice(&bytes).map_err(|error| TokenError::Unreadable(error.to_string()))?;
        let age = since(standing.at_ms);
        if age > self.max_age { Err(TokenError::Old(age)) } else { Ok(standing) }
    }
}

impl Told {
    /// Whether there is a filter that has taken in a frame.
    pub fn believes(&self) -> bool {
        self.belief.is_some()
    }
}

impl Standing {
    /// The frames that have no answer and will get none, ascending: those that were accepted and not told of, and those up to the
    /// last that was sent.
    pub fn lost(&self, last_seq: Option<u64>, sent_seq: Option<u64>) -> Vec<u64> {
        let sent = sent_seq.map(|last| Run { first: self.next_seq, last: last.min(MAX_SEQ) });
        let runs = self.untold.iter().copied().chain(sent);
        let missed = runs.filter_map(|Run { first, last }| {
            let first = last_seq.map_or(first, |last_seq| first.max(last_seq.saturating_add(1)));
            (first <= last).then(|| first..=last.min(first.saturating_add(MAX_LOST)))
        });
        missed.flatten().take(MAX_LOST as usize).collect()
    }
}

/// Numbers as runs; they ascend.
pub fn runs(numbers: impl Iterator<Item = u64>) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for number in numbers {
        match runs.last_mut() {
            Some(run) if run.last + 1 == number => run.last = number,
            _ => runs.push(Run { first: number, last: number }),
        }
    }
    runs
}

/// Tells these rooms from others.
pub fn digest_of(rooms: &[String]) -> String {
    let mut hasher = blake3::Hasher::new();
    for room in rooms {
        hasher.update(&(room.len() as u64).to_le_bytes()).update(room.as_bytes());
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

/// What a token is bound to: the key that opened its stream.
fn bound(key: Option<&Key>) -> Vec<u8> {
    key.map(Key::to_line).unwrap_or_default().into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::Role;
    use crate::engine::streams::moment::now_ms;

    const SECRET: &str = "0123456789abcdef0123456789abcdef";

    /// Of a stream that has told a little.
    fn told() -> Told {
        let model = ModelName { name: "home".into(), version: 3, epoch: 7, digest: "ab".into() };
        let rooms_digest = digest_of(&["hall".into(), "lab".into()]);
        Told { model, rooms_digest, belief: None, is_sure: true, doubts_stamps: false }
    }

    fn tokens(resume_token_ms: u64) -> Tokens {
        let resume_keys = vec![SECRET.into()];
        Tokens::new(&Settings { resume_keys, resume_token_ms, ..Settings::default() }).unwrap()
    }

    fn standing(untold: &[u64]) -> Standing {
        let settings = r#"{"robot": "wall-e", "model": "home", "mode": "lossless"}"#;
        let settings = serde_json::from_str(settings).unwrap();
        let untold = runs(untold.iter().copied());
        Standing { at_ms: now_ms(), stream: "public".into(), settings, next_seq: 12, untold, told: told() }
    }

    #[test]
    fn a_token_says_how_the_stream_stood_to_the_key_that_opened_it_for_a_while() {
        let standing = standing(&[8, 9, 11]);
        let key = Key::new(Role::Robot, "wall-e", &[1; 32]).unwrap().1;
        let other = Key::new(Role::Robot, "wall-e", &[2; 32]).unwrap().1;
        let token = tokens(1000).seal(&standing, Some(&key)).unwrap();
        assert_eq!(tokens(60_000).open(&token, Some(&key)), Ok(standing.clone()));
        for stranger in [Some(&other), None] {
            assert_eq!(tokens(60_000).open(&token, stranger), Err(TokenError::Sealed));
        }
        let old = Standing { at_ms: now_ms() - 2000, ..standing };
        let token = tokens(1000).seal(&old, None).unwrap();
        assert!(matches!(tokens(1000).open(&token, None), Err(TokenError::Old(age)) if age.as_secs() == 2));
        let without = Tokens::new(&Settings::default()).unwrap();
        assert!(!without.are_told() && without.seal(&old, None).is_none());
    }

    #[test]
    fn frames_without_an_answer_are_lost() {
        let standing = standing(&[8, 9, 11]);
        assert_eq!(standing.lost(Some(7), None), [8, 9, 11]);
        assert_eq!(standing.lost(Some(9), Some(14)), [11, 12, 13, 14]);
        assert_eq!(standing.lost(None, Some(3)), [8, 9, 11], "what was sent is not before what was accepted");
        for (last_seq, sent_seq) in [(20, 14), (u64::MAX, u64::MAX)] {
            assert!(standing.lost(Some(last_seq), Some(sent_seq)).is_empty());
        }
        assert_eq!(standing.lost(None, Some(u64::MAX)).len() as u64, MAX_LOST);
    }

    #[test]
    fn rooms_are_told_apart() {
        let digest =
            |rooms: &[&str]| digest_of(&rooms.iter().map(|&room| room.to_owned()).collect::<Vec<_>>());
        assert_eq!(digest(&["a", "b"]), digest(&["a", "b"]));
        assert_ne!(digest(&["a", "b"]), digest(&["ab"]));
        assert_ne!(digest(&["a", "b"]), digest(&["b", "a"]));
    }
}
