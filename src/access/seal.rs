//! What callers keep for the service: sealed, so that they can neither read nor change it, by keys that all replicas share.

use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use ring::aead::{AES_256_GCM, Aad, LessSafeKey, Nonce, UnboundKey};
use std::sync::atomic::{AtomicU64, Ordering};

/// What the keys of seals are derived for, and nothing else (BLAKE3, `derive_key`).
const CONTEXT: &str = "roomsight 2026 resume tokens of streams";
/// The first byte of what is sealed so.
const VERSION: u8 = 1;
const SALT_BYTES: usize = 16;
const COUNT_BYTES: usize = 8;
const HEAD_BYTES: usize = 1 + SALT_BYTES + COUNT_BYTES;

/// Seals what callers keep, and opens it again.
pub struct Seals {
    own: Option<OwnKey>,
    secrets: Vec<String>,
}

/// What this process seals with: a key that no other process has, so that a counter makes all nonces differ.
struct OwnKey {
    salt: [u8; SALT_BYTES],
    key: LessSafeKey,
    n_sealed: AtomicU64,
}

impl Seals {
    /// The first of these secrets seals, all open; without any nothing is sealed.
    ///
    /// # Errors
    /// There are no random bytes.
    pub fn new(secrets: &[&str]) -> Result<Self, getrandom::Error> {
        let own = |secret: &&str| {
            let mut salt = [0; SALT_BYTES];
            getrandom::fill(&mut salt)?;
            Ok(derived(secret, &salt).map(|key| OwnKey { salt, key, n_sealed: AtomicU64::new(0) }))
        };
        let own = secrets.first().map(own).transpose()?.flatten();
        Ok(Self { own, secrets: secrets.iter().map(|&secret| secret.to_owned()).collect() })
    }

    /// Whether there is what seals.
    pub fn has_key(&self) -> bool {
        self.own.is_some()
    }

    /// Seals bytes, as text that may stand in an address. They are opened only with the same `bound`.
    pub fn seal(&self, mut bytes: Vec<u8>, bound: &[u8]) -> Option<String> {
        let own = self.own.as_ref()?;
        let count = own.n_sealed.fetch_add(1, Ordering::Relaxed).to_be_bytes();
        own.key.seal_in_place_append_tag(nonce(count), Aad::from(bound), &mut bytes).ok()?;
        let head = [&[VERSION], &own.salt[..], &count[..]].concat();
        Some(BASE64_URL_SAFE_NO_PAD.encode([head, bytes].concat()))
    }

    /// What was sealed, with one of the secrets and the same `bound`.
    pub fn open(&self, text: &str, bound: &[u8]) -> Option<Vec<u8>> {
        let bytes = BASE64_URL_SAFE_NO_PAD.decode(text).ok()?;
        let (head, sealed) = bytes.split_at_checked(HEAD_BYTES)?;
        let (salt, count) = head.strip_prefix(&[VERSION])?.split_at_checked(SALT_BYTES)?;
        let count: [u8; COUNT_BYTES] = count.try_into().ok()?;
        self.secrets.iter().find_map(|secret| {
            let mut sealed = sealed.to_vec();
            let key = derived(secret, salt)?;
            Some(key.open_in_place(nonce(count), Aad::from(bound), &mut sealed).ok()?.to_vec())
        })
    }
}

fn derived(secret: &str, salt: &[u8]) -> Option<LessSafeKey> {
    let key = blake3::derive_key(CONTEXT, &[salt, secret.as_bytes()].concat());
    UnboundKey::new(&AES_256_GCM, &key).ok().map(LessSafeKey::new)
}

fn nonce(count: [u8; COUNT_BYTES]) -> Nonce {
    let mut nonce = [0; ring::aead::NONCE_LEN];
    nonce[ring::aead::NONCE_LEN - COUNT_BYTES..].copy_from_slice(&count);
    Nonce::assume_unique_for_key(nonce)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn seals(secrets: &[&str]) -> Seals {
        Seals::new(secrets).unwrap()
    }

    #[test]
    fn what_one_replica_seals_another_opens_and_keys_rotate() {
        let [old, both, new] = [&["a"][..], &["b", "a"], &["b"]].map(seals);
        let by_old = old.seal(b"state".into(), b"wall-e").unwrap();
        assert_ne!(old.seal(b"state".into(), b"wall-e").unwrap(), by_old);
        assert_eq!(both.open(&by_old, b"wall-e").unwrap(), b"state");
        assert_eq!(new.open(&by_old, b"wall-e"), None);
        let by_both = both.seal(b"state".into(), b"").unwrap();
        assert_eq!(new.open(&by_both, b"").unwrap(), b"state");
        assert_eq!(old.open(&by_both, b""), None);
        assert_eq!(both.open(&by_old, b"eve"), None, "bound to another");
        let none = seals(&[]);
        assert!(none.seal(b"state".into(), b"").is_none() && none.open(&by_old, b"wall-e").is_none());
    }

    proptest! {
        #[test]
        fn what_was_changed_does_not_open(bytes: Vec<u8>, at: prop::sample::Index, flip in 1..=255_u8) {
            let seals = seals(&["a"]);
            let text = seals.seal(bytes.clone(), b"").unwrap();
            prop_assert_eq!(seals.open(&text, b""), Some(bytes));
            let mut raw = BASE64_URL_SAFE_NO_PAD.decode(&text).unwrap();
            let at = at.index(raw.len());
            raw[at] ^= flip;
            prop_assert_eq!(seals.open(&BASE64_URL_SAFE_NO_PAD.encode(&raw), b""), None);
            prop_assert_eq!(seals.open(&BASE64_URL_SAFE_NO_PAD.encode(&raw[..at]), b""), None);
        }

        #[test]
        fn nonsense_does_not_open(text: String) {
            prop_assert_eq!(seals(&["a"]).open(&text, b""), None);
        }
    }
}
