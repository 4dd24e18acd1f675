//! Who may call: keys, their roles, and the check that comes before anything else.
//!
//! A key is 256 random bits, so that nobody can guess one from its hash however fast the hash is:
//! a slow password hash would only cost every request its time.

use super::App;
use super::problem::Problem;
use crate::protocol::stream::KEY_SUBPROTOCOL_PREFIX;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use subtle::ConstantTimeEq;

/// What begins every key, so that a key found in a file is known for what it is.
const KEY_PREFIX: &str = "rs_";
/// The header that is read where `Authorization: Bearer` is not given.
const KEY_HEADER: &str = "x-api-key";
const MAX_NAME_BYTES: usize = 64;

/// What a key allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
/// As text `role:name:hash`, the hash in 64 hexadecimal digits. Debugged or serialized, the hash
/// is left out.
#[derive(Clone, Deserialize)]
#[serde(try_from = "String")]
pub struct Key {
    role: Role,
    name: String,
    hash: blake3::Hash,
}

/// Why a key's line was refused.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum KeyError {
    /// Not three parts.
    #[error("an entry of `keys` is not `role:name:hash`; `roomsight key new` prints one that is")]
    Shape,
    /// A role that does not exist.
    #[error("{0:?} is no role; roles are robot, viewer, admin")]
    Role(String),
    /// A name that would not read well in a log.
    #[error("a key cannot be named {0:?}: use 1 to 64 letters, digits, `-`, `_` or `.`")]
    Name(String),
    /// Not a hash.
    #[error("the hash of {0:?} in `keys` is not 64 hexadecimal digits")]
    Hash(String),
}

/// Why a caller was turned away.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
pub enum AuthError {
    /// No key was sent.
    #[error("send a key in the header `Authorization: Bearer KEY`")]
    Missing,
    /// A key that nobody has.
    #[error("the key is not known here; check it, or ask the operator for one")]
    Unknown,
    /// A page of another site, in a browser that can reach a service without keys.
    #[error("a page of another site may not open a stream here; give the service keys, and the page one")]
    Origin,
    /// A key whose role does not allow this.
    #[error("a key with the role {has} may not do this; it takes the role {needs}, or admin")]
    Forbidden {
        /// The role of the key that was sent.
        has: Role,
        /// The role that would do.
        needs: Role,
    },
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
        Ok((secret, Self { role, name: checked_name(name)?, hash }))
    }

    /// The line of the configuration, hash and all.
    pub fn to_line(&self) -> String {
        format!("{}:{}:{}", self.role, self.name, self.hash)
    }
}

impl TryFrom<String> for Key {
    type Error = KeyError;

    fn try_from(line: String) -> Result<Self, KeyError> {
        let mut parts = line.split(':');
        let (Some(role), Some(name), Some(hash), None) =
            (parts.next(), parts.next(), parts.next(), parts.next())
        else {
            return Err(KeyError::Shape);
        };
        let name = checked_name(name)?;
        let hash = blake3::Hash::from_hex(hash).map_err(|_| KeyError::Hash(name.clone()))?;
        Ok(Self { role: role.parse()?, name, hash })
    }
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
        write!(f, "{}:{}:(hidden)", self.role, self.name)
    }
}

impl Serialize for Key {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{self:?}"))
    }
}

/// Whether a caller with these headers may do what takes the role `needs`; without `keys` anyone
/// may. Returns the name of the key.
pub fn authorize<'a>(
    keys: &'a [Key],
    headers: &HeaderMap,
    needs: Role,
) -> Result<Option<&'a str>, AuthError> {
    if keys.is_empty() {
        return Ok(None);
    }
    let hash = blake3::hash(secret(headers).ok_or(AuthError::Missing)?);
    // All keys are compared, so that time does not tell which one is near.
    let mut found = None;
    for key in keys {
        if key.hash.as_bytes().ct_eq(hash.as_bytes()).into() {
            found = Some(key);
        }
    }
    let key = found.ok_or(AuthError::Unknown)?;
    if key.role == needs || key.role == Role::Admin {
        Ok(Some(&key.name))
    } else {
        Err(AuthError::Forbidden { has: key.role, needs })
    }
}

/// Lets robots pass.
pub async fn robots(State(app): State<App>, request: Request, next: Next) -> Response {
    pass(&app, Role::Robot, request, next).await
}

/// Lets viewers pass.
pub async fn viewers(State(app): State<App>, request: Request, next: Next) -> Response {
    pass(&app, Role::Viewer, request, next).await
}

/// Lets admins pass.
pub async fn admins(State(app): State<App>, request: Request, next: Next) -> Response {
    pass(&app, Role::Admin, request, next).await
}

/// The name of the key of a request that has one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyName(pub String);

async fn pass(app: &App, needs: Role, mut request: Request, next: Next) -> Response {
    match authorize(&app.settings.keys, request.headers(), needs) {
        Ok(name) => {
            if let Some(name) = name {
                tracing::Span::current().record("key", name);
                let name = KeyName(name.to_owned());
                request.extensions_mut().insert(name);
            }
            next.run(request).await
        }
        Err(error) => Problem::from(error).into_response(),
    }
}

/// The hash of the key that a request carries, known or not.
pub fn fingerprint(headers: &HeaderMap) -> Option<blake3::Hash> {
    secret(headers).map(blake3::hash)
}

fn secret(headers: &HeaderMap) -> Option<&[u8]> {
    let bearer = headers.get(header::AUTHORIZATION).and_then(|value| {
        let (scheme, key) = value.as_bytes().split_at_checked("Bearer ".len())?;
        scheme.eq_ignore_ascii_case(b"Bearer ").then_some(key.trim_ascii())
    });
    bearer.or_else(|| Some(headers.get(KEY_HEADER)?.as_bytes())).or_else(|| {
        subprotocols(headers).find_map(|name| name.strip_prefix(KEY_SUBPROTOCOL_PREFIX.as_bytes()))
    })
}

/// The subprotocols that a WebSocket's request offers.
pub fn subprotocols(headers: &HeaderMap) -> impl Iterator<Item = &[u8]> {
    let lists = headers.get_all(header::SEC_WEBSOCKET_PROTOCOL).into_iter();
    lists.flat_map(|list| list.as_bytes().split(|&byte| byte == b',')).map(<[u8]>::trim_ascii)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(name: &'static str, value: &str) -> HeaderMap {
        HeaderMap::from_iter([(name.parse().unwrap(), value.parse().unwrap())])
    }

    fn key(role: Role, seed: u8) -> (String, Key) {
        Key::new(role, "someone", &[seed; 32]).unwrap()
    }

    #[test]
    fn a_role_may_do_its_own_and_admin_everything() {
        let made: Vec<_> = [Role::Robot, Role::Viewer, Role::Admin]
            .into_iter()
            .zip(1..)
            .map(|(r, s)| (r, key(r, s)))
            .collect();
        let keys: Vec<Key> = made.iter().map(|(_, (_, key))| key.clone()).collect();
        for (has, (secret, _)) in &made {
            for needs in [Role::Robot, Role::Viewer, Role::Admin] {
                let result = authorize(&keys, &headers("authorization", &format!("Bearer {secret}")), needs);
                if *has == needs || *has == Role::Admin {
                    assert_eq!(result, Ok(Some("someone")));
                } else {
                    assert_eq!(result, Err(AuthError::Forbidden { has: *has, needs }));
                }
            }
        }
    }

    #[test]
    fn the_key_is_read_from_either_header() {
        let (secret, key) = key(Role::Robot, 1);
        let keys = [key];
        for headers in [
            headers("authorization", &format!("Bearer {secret}")),
            headers("authorization", &format!("bearer  {secret}")),
            headers("x-api-key", &secret),
        ] {
            assert!(authorize(&keys, &headers, Role::Robot).is_ok());
        }
    }

    #[test]
    fn no_key_and_a_wrong_key_are_told_apart() {
        let (secret, known) = key(Role::Robot, 1);
        let keys = [known];
        assert_eq!(authorize(&keys, &HeaderMap::new(), Role::Robot), Err(AuthError::Missing));
        for wrong in ["Basic abc", &secret] {
            assert_eq!(
                authorize(&keys, &headers("authorization", wrong), Role::Robot),
                Err(AuthError::Missing)
            );
        }
        for wrong in [key(Role::Robot, 2).0, secret[1..].to_owned(), format!("{secret}x"), String::new()] {
            let headers = headers("authorization", &format!("Bearer {wrong}"));
            assert_eq!(authorize(&keys, &headers, Role::Robot), Err(AuthError::Unknown));
        }
    }

    #[test]
    fn without_keys_anyone_passes() {
        assert_eq!(authorize(&[], &HeaderMap::new(), Role::Admin), Ok(None));
    }

    #[test]
    fn a_line_is_read_back_and_a_bad_one_says_why() {
        let (_, made) = key(Role::Viewer, 3);
        assert_eq!(Key::try_from(made.to_line()).unwrap().to_line(), made.to_line());
        let hash = "0".repeat(64);
        for (line, error) in [
            ("robot".to_owned(), KeyError::Shape),
            (format!("robot:a:b:{hash}"), KeyError::Shape),
            (format!("king:a:{hash}"), KeyError::Role("king".into())),
            (format!("robot:a b:{hash}"), KeyError::Name("a b".into())),
            (format!("robot::{hash}"), KeyError::Name(String::new())),
            ("robot:a:12".to_owned(), KeyError::Hash("a".into())),
        ] {
            assert_eq!(Key::try_from(line).unwrap_err(), error);
        }
        assert_eq!(Key::new(Role::Robot, "a:b", &[0; 32]).unwrap_err(), KeyError::Name("a:b".into()));
    }
}
