//! Keys: what each allows, as a line of the settings.
//!
//! A key is 256 random bits, so that nobody can guess one from its hash however fast the hash is:
//! a slow password hash would only cost every request its time.

use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use subtle::ConstantTimeEq;
use utoipa::ToSchema;

/// What begins every key, so that a key found in a file is known for what it is.
const KEY_PREFIX: &str = "rs_";
/// What stands between the robots of a line. No comma: that parts the keys of the environment.
const ROBOT_SEPARATOR: char = '+';
const MAX_NAME_BYTES: usize = 64;

/// What a key allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Posts frames.
    Robot,
    /// Reads models and what happens.
    Viewer,
    /// Does everything.
    Admin,
}

/// A key as the service knows it: whose it is, what it allows, and its hash.
///
/// As text `role:name:hash`, the hash in 64 hexadecimal digits, or `role:name:hash:robot+robot` where it is
/// bound to robots. Debugged or serialized, the hash is left out.
#[derive(Clone, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Key {
    role: Role,
    name: String,
    hash: blake3::Hash,
    /// The robots that it alone may speak for; empty: any that is nobody's.
    robots: Vec<String>,
}

/// Why a key's line was refused.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum KeyError {
    /// Neither three parts nor four.
    #[error(
        "an entry of `keys` is not `role:name:hash` or `role:name:hash:robot+robot`; \
         `roomsight key new` prints one that is"
    )]
    Shape,
    /// A role that does not exist.
    #[error("{0:?} is no role; roles are robot, viewer, admin")]
    Role(String),
    /// A name that would not read well in a log.
    #[error("a key cannot be named {0:?}: use 1 to 64 letters, digits, `-`, `_` or `.`")]
    Name(String),
    /// A robot's name that would not read well in a log.
    #[error("a key cannot be bound to a robot {0:?}: use 1 to 64 letters, digits, `-`, `_` or `.`")]
    Robot(String),
    /// Robots of a key that posts no frames as a robot.
    #[error("{0:?} cannot be bound to robots: only a key with the role robot can")]
    Bound(String),
    /// Not a hash.
    #[error("the hash of {0:?} in `keys` is not 64 hexadecimal digits")]
    Hash(String),
    /// Two of one name, which no log could tell apart.
    #[error("two keys are named {0:?}: give each a name of its own")]
    Twice(String),
    /// A key with the name of another's robot.
    #[error("the key {0:?} has the name of a robot that another key is bound to: give it another name")]
    Confusing(String),
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Robot => "robot",
            Self::Viewer => "viewer",
            Self::Admin => "admin",
        })
    }
}

impl FromStr for Role {
    type Err = KeyError;

    fn from_str(text: &str) -> Result<Self, KeyError> {
        [Self::Robot, Self::Viewer, Self::Admin]
            .into_iter()
            .find(|role| role.to_string() == text)
            .ok_or_else(|| KeyError::Role(text.to_owned()))
    }
}

impl Key {
    /// Makes a key of 32 random bytes: what the caller keeps, and what the service keeps.
    pub fn new(role: Role, name: &str, random: &[u8; 32]) -> Result<(String, Self), KeyError> {
        let secret = format!("{KEY_PREFIX}{}", BASE64_URL_SAFE_NO_PAD.encode(random));
        let hash = blake3::hash(secret.as_bytes());
        Ok((secret, Self { role, name: checked_name(name)?, hash, robots: Vec::new() }))
    }

    /// The same key, bound to these robots: it speaks for no other, and no other key for them.
    ///
    /// # Errors
    /// A key of another role than robot, or a robot's name that is no plain one.
    pub fn bound_to<'a>(self, robots: impl IntoIterator<Item = &'a str>) -> Result<Self, KeyError> {
        let robots: Vec<String> = robots
            .into_iter()
            .map(|robot| checked_name(robot).map_err(|_| KeyError::Robot(robot.to_owned())))
            .collect::<Result<_, _>>()?;
        if self.role != Role::Robot && !robots.is_empty() {
            return Err(KeyError::Bound(self.name));
        }
        Ok(Self { robots, ..self })
    }

    /// Whose it is.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it allows.
    pub fn role(&self) -> Role {
        self.role
    }

    /// The robot that speaks where a caller names none.
    pub fn robot(&self) -> &str {
        match &self.robots[..] {
            [robot] => robot,
            _ => &self.name,
        }
    }

    /// The robots that it alone may speak for.
    pub fn robots(&self) -> &[String] {
        &self.robots
    }

    /// Whether it is bound to robots.
    pub fn is_bound(&self) -> bool {
        !self.robots.is_empty()
    }

    /// Whether it is bound to this robot.
    pub fn is_bound_to(&self, robot: &str) -> bool {
        self.robots.iter().any(|own| own == robot)
    }

    /// Whether its secret has this hash. The time this takes tells nothing.
    pub(super) fn opens(&self, hash: &blake3::Hash) -> bool {
        self.hash.as_bytes().ct_eq(hash.as_bytes()).into()
    }

    /// The line of the configuration, hash and all.
    pub fn to_line(&self) -> String {
        let line = format!("{}:{}:{}", self.role, self.name, self.hash);
        if self.is_bound() { format!("{line}:{}", self.robots.join("+")) } else { line }
    }
}

impl TryFrom<String> for Key {
    type Error = KeyError;

    fn try_from(line: String) -> Result<Self, KeyError> {
        let parts: Vec<&str> = line.split(':').collect();
        let (role, name, hash, robots) = match parts[..] {
            [role, name, hash] => (role, name, hash, None),
            [role, name, hash, robots] => (role, name, hash, Some(robots)),
            _ => return Err(KeyError::Shape),
        };
        let name = checked_name(name)?;
        let hash = blake3::Hash::from_hex(hash).map_err(|_| KeyError::Hash(name.clone()))?;
        let key = Self { role: role.parse()?, name, hash, robots: Vec::new() };
        key.bound_to(robots.into_iter().flat_map(|robots| robots.split(ROBOT_SEPARATOR)))
    }
}

/// Holds that keys can be told apart.
///
/// # Errors
/// Two of one name, or one with the name of a robot that only another speaks for.
pub fn check_together(keys: &[Key]) -> Result<(), KeyError> {
    for (key_idx, key) in keys.iter().enumerate() {
        if keys[..key_idx].iter().any(|other| other.name == key.name) {
            return Err(KeyError::Twice(key.name.clone()));
        }
        if !key.is_bound_to(&key.name) && keys.iter().any(|other| other.is_bound_to(&key.name)) {
            return Err(KeyError::Confusing(key.name.clone()));
        }
    }
    Ok(())
}

fn checked_name(name: &str) -> Result<String, KeyError> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if name.is_empty() || name.len() > MAX_NAME_BYTES || !name.chars().all(is_plain) {
        return Err(KeyError::Name(name.to_owned()));
    }
    Ok(name.to_owned())
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}:{}:(hidden)", self.role, self.name)?;
        if self.is_bound() { write!(f, ":{}", self.robots.join("+")) } else { Ok(()) }
    }
}

impl Serialize for Key {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{self:?}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(name: &str, robots: &[&str]) -> Key {
        let (_, key) = Key::new(Role::Robot, name, &[7; 32]).unwrap();
        key.bound_to(robots.iter().copied()).unwrap()
    }

    #[test]
    fn a_line_is_read_back_and_a_bad_one_says_why() {
        for made in [key("someone", &[]), key("someone", &["wall-e"]), key("someone", &["wall-e", "eve"])] {
            assert_eq!(Key::try_from(made.to_line()).unwrap(), made);
        }
        let hash = "0".repeat(64);
        for (line, error) in [
            ("robot".to_owned(), KeyError::Shape),
            (format!("robot:a:b:{hash}:c"), KeyError::Shape),
            (format!("king:a:{hash}"), KeyError::Role("king".into())),
            (format!("robot:a b:{hash}"), KeyError::Name("a b".into())),
            (format!("robot::{hash}"), KeyError::Name(String::new())),
            ("robot:a:12".to_owned(), KeyError::Hash("a".into())),
            (format!("robot:a:{hash}:"), KeyError::Robot(String::new())),
            (format!("robot:a:{hash}:b+c d"), KeyError::Robot("c d".into())),
            (format!("viewer:a:{hash}:b"), KeyError::Bound("a".into())),
        ] {
            assert_eq!(Key::try_from(line).unwrap_err(), error);
        }
        assert_eq!(Key::new(Role::Robot, "a:b", &[0; 32]).unwrap_err(), KeyError::Name("a:b".into()));
    }

    #[test]
    fn a_caller_that_names_no_robot_is_the_one_of_its_key() {
        assert_eq!(key("fleet", &[]).robot(), "fleet");
        assert_eq!(key("fleet", &["wall-e"]).robot(), "wall-e");
        assert_eq!(key("fleet", &["wall-e", "eve"]).robot(), "fleet");
    }

    #[test]
    fn keys_that_could_be_confused_are_refused() {
        assert_eq!(check_together(&[key("a", &["x"]), key("b", &["x"]), key("x", &["x"])]), Ok(()));
        assert_eq!(check_together(&[key("a", &[]), key("a", &["x"])]), Err(KeyError::Twice("a".into())));
        assert_eq!(check_together(&[key("a", &["x"]), key("x", &[])]), Err(KeyError::Confusing("x".into())));
    }
}
