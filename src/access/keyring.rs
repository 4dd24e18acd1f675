//! The keys that are valid now, and the sessions that were made from them.

use crate::access::{AuthError, Key};
use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use subtle::ConstantTimeEq;
use tokio::sync::watch;

/// The valid keys. They can be replaced while the service runs.
pub struct Keyring {
    keys: watch::Sender<Arc<[Arc<Key>]>>,
    /// Signs sessions. It is made when the process starts, so that they end with it.
    secret: [u8; 32],
    /// Codes that stand for a key once.
    codes: Mutex<Vec<Code>>,
    /// What the ends of sessions are counted from, so that a clock that is set does not move them.
    began: Instant,
}

/// A code that stands for a key once, by its hash.
struct Code {
    hash: blake3::Hash,
    key: Arc<Key>,
    /// When it is of no use any more, counted as sessions are.
    end: Duration,
}

impl Keyring {
    /// With these keys; with none anyone may do everything.
    ///
    /// # Errors
    /// A system that gives no random numbers.
    pub fn new(keys: &[Key]) -> Result<Self, getrandom::Error> {
        let mut secret = [0; 32];
        getrandom::fill(&mut secret)?;
        Ok(Self {
            keys: watch::Sender::new(shared(keys)),
            secret,
            codes: Mutex::default(),
            began: Instant::now(),
        })
    }

    /// Whether there are no keys.
    pub fn is_open(&self) -> bool {
        self.keys.borrow().is_empty()
    }

    /// Takes other keys in place of all.
    pub fn replace(&self, keys: &[Key]) {
        self.keys.send_replace(shared(keys));
    }

    /// The key with this secret.
    pub fn find(&self, secret: &[u8]) -> Option<Arc<Key>> {
        let hash = blake3::hash(secret);
        self.select(|key| key.opens(&hash))
    }

    /// Ready when a caller that was let in with this key, or with none, would be let in no longer, or no longer as
    /// the robot that it then is.
    pub async fn revoked(&self, key: Option<&Key>, robot: impl Fn() -> Option<String>) {
        let mut changes = self.keys.subscribe();
        let is_let_in = || {
            let keys = self.keys.borrow().clone();
            match key {
                Some(key) => keys.iter().any(|other| **other == *key),
                None => keys.is_empty(),
            }
        };
        while is_let_in() && robot().is_none_or(|robot| self.check_robot(key, &robot).is_ok()) {
            // The sender lives as long as we do.
            let _ = changes.changed().await;
        }
    }

    /// Holds that a caller may speak for a robot.
    ///
    /// # Errors
    /// A robot that is not one of the key's, or that another key is bound to.
    pub fn check_robot(&self, key: Option<&Key>, robot: &str) -> Result<(), AuthError> {
        let is_own = key.is_some_and(|key| key.is_bound_to(robot) || key.name() == robot);
        // A key of several robots that names none speaks by its own name.
        let is_of =
            |other: &Arc<Key>| other.is_bound_to(robot) || (other.is_bound() && other.name() == robot);
        let is_others = || self.keys.borrow().iter().any(is_of);
        if is_own || !key.is_some_and(Key::is_bound) && !is_others() {
            Ok(())
        } else {
            Err(AuthError::Robot(robot.to_owned()))
        }
    }

    /// Makes a session of a key: a text that stands for the key for so long, in this process.
    pub fn begin_session(&self, key: &Key, life: Duration) -> String {
        let end_s = (self.began.elapsed() + life).as_secs();
        format!("{end_s}.{}", self.seal(key, end_s))
    }

    /// Makes a code that stands for a key once, for so long: for a phone, which cannot type a key.
    ///
    /// # Errors
    /// A system that gives no random numbers.
    pub fn begin_code(&self, key: &Arc<Key>, life: Duration) -> Result<String, getrandom::Error> {
        let mut random = [0; 16];
        getrandom::fill(&mut random)?;
        let code = BASE64_URL_SAFE_NO_PAD.encode(random);
        let end = self.began.elapsed() + life;
        self.codes().push(Code { hash: blake3::hash(code.as_bytes()), key: key.clone(), end });
        Ok(code)
    }

    /// The key that a code stands for, while that key is valid; the code is used up.
    pub fn take_code(&self, code: &str) -> Option<Arc<Key>> {
        let (hash, now) = (blake3::hash(code.as_bytes()), self.began.elapsed());
        let mut codes = self.codes();
        codes.retain(|code| code.end > now);
        let idx = codes.iter().position(|code| code.hash == hash)?;
        let key = codes.swap_remove(idx).key;
        self.select(|valid| *valid == *key)
    }

    /// The keys that are valid now.
    pub fn keys(&self) -> Vec<Key> {
        self.keys.borrow().iter().map(|key| Key::clone(key)).collect()
    }

    fn codes(&self) -> MutexGuard<'_, Vec<Code>> {
        self.codes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The key that a session stands for, while that key is valid and the session's time is not up.
    pub fn find_session(&self, session: &str) -> Option<Arc<Key>> {
        let (end_s, seal) = session.split_once('.')?;
        let (end_s, seal) = (end_s.parse().ok()?, blake3::Hash::from_hex(seal).ok()?);
        if self.began.elapsed().as_secs() >= end_s {
            return None;
        }
        self.select(|key| self.seal(key, end_s).as_bytes().ct_eq(seal.as_bytes()).into())
    }

    /// What only this process can know of a key and a time.
    fn seal(&self, key: &Key, end_s: u64) -> blake3::Hash {
        blake3::keyed_hash(&self.secret, format!("{end_s} {}", key.to_line()).as_bytes())
    }

    /// The one that fits. All are compared, so that time does not tell which one is near.
    fn select(&self, fits: impl Fn(&Key) -> bool) -> Option<Arc<Key>> {
        let keys = self.keys.borrow().clone();
        keys.iter().fold(None, |found, key| if fits(key) { Some(key.clone()) } else { found })
    }
}

fn shared(keys: &[Key]) -> Arc<[Arc<Key>]> {
    keys.iter().cloned().map(Arc::new).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::Role;

    const LONG: Duration = Duration::from_secs(60);

    fn key(name: &str, robots: &[&str]) -> (String, Key) {
        let (secret, key) = Key::new(Role::Robot, name, blake3::hash(name.as_bytes()).as_bytes()).unwrap();
        (secret, key.bound_to(robots.iter().copied()).unwrap())
    }

    #[test]
    fn a_key_is_found_by_its_secret_alone() {
        let ((secret, key), (foreign, _)) = (key("a", &[]), key("b", &[]));
        let keyring = Keyring::new(std::slice::from_ref(&key)).unwrap();
        assert_eq!(keyring.find(secret.as_bytes()).as_deref(), Some(&key));
        for wrong in [&foreign, &secret[1..], &format!("{secret}x"), ""] {
            assert_eq!(keyring.find(wrong.as_bytes()), None, "{wrong}");
        }
    }

    #[test]
    fn a_robot_of_one_key_is_no_robot_of_another() {
        let ((_, bound), (_, free)) = (key("a", &["wall-e"]), key("b", &[]));
        let keyring = Keyring::new(&[bound.clone(), free.clone()]).unwrap();
        let may = |key, robot| keyring.check_robot(key, robot).is_ok();
        assert!(may(Some(&bound), "wall-e") && may(Some(&bound), "a") && !may(Some(&bound), "eve"));
        assert!(!may(Some(&free), "wall-e") && may(Some(&free), "eve"));
        assert!(!may(None, "wall-e") && may(None, "eve"));
        assert!(!may(Some(&free), "a"), "the bound key speaks by its own name where it names no robot");
    }

    #[test]
    fn a_session_stands_for_its_key_until_its_time_is_up_or_the_key_is_gone() {
        let ((_, key), (_, other)) = (key("a", &[]), key("b", &[]));
        let keyring = Keyring::new(&[key.clone(), other.clone()]).unwrap();
        let session = keyring.begin_session(&key, LONG);
        assert_eq!(keyring.find_session(&session).as_deref(), Some(&key));
        let late = keyring.begin_session(&key, Duration::ZERO);
        let longer = format!("9{session}");
        let elsewhere = Keyring::new(std::slice::from_ref(&key)).unwrap().begin_session(&key, LONG);
        for wrong in [&late, &longer, &elsewhere, &session[1..], "", ".", "9.9"] {
            assert_eq!(keyring.find_session(wrong), None, "{wrong}");
        }
        keyring.replace(&[other]);
        assert_eq!(keyring.find_session(&session), None);
    }

    #[test]
    fn a_code_stands_for_its_key_once() {
        let ((_, key), (_, other)) = (key("a", &[]), key("b", &[]));
        let keyring = Keyring::new(&[key.clone(), other.clone()]).unwrap();
        let shared = Arc::new(key.clone());
        let code = keyring.begin_code(&shared, LONG).unwrap();
        assert_eq!(keyring.take_code("other"), None);
        assert_eq!(keyring.take_code(&code).as_deref(), Some(&key));
        assert_eq!(keyring.take_code(&code), None);
        let late = keyring.begin_code(&shared, Duration::ZERO).unwrap();
        assert_eq!(keyring.take_code(&late), None);
        let code = keyring.begin_code(&shared, LONG).unwrap();
        keyring.replace(&[other]);
        assert_eq!(keyring.take_code(&code), None, "the key is gone");
    }

    #[tokio::test]
    async fn callers_hear_when_their_key_is_gone() {
        let ((_, key), (_, other)) = (key("a", &[]), key("b", &[]));
        let keyring = Keyring::new(&[key.clone(), other.clone()]).unwrap();
        let is_revoked = async |of: Option<&Key>| {
            tokio::select! {
                biased;
                () = keyring.revoked(of, || Some("wall-e".into())) => true,
                () = tokio::task::yield_now() => false,
            }
        };
        assert!(!is_revoked(Some(&key)).await && is_revoked(None).await);
        keyring.replace(std::slice::from_ref(&other));
        assert!(is_revoked(Some(&key)).await && !is_revoked(Some(&other)).await);
        let (_, binding) = self::key("c", &["wall-e"]);
        keyring.replace(&[other.clone(), binding]);
        assert!(is_revoked(Some(&other)).await, "the robot is now another's");
        keyring.replace(&[other.clone().bound_to(["eve"]).unwrap()]);
        assert!(is_revoked(Some(&other)).await, "it no longer allows what it did");
        keyring.replace(&[]);
        assert!(!is_revoked(None).await);
    }
}
