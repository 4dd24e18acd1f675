//! Values that are made once for each key and then found again without allocating.

use std::borrow::Borrow;
use std::collections::BTreeMap;
use std::sync::{PoisonError, RwLock};

/// Values by key, made when they are first asked for and never given up: for keys that callers cannot choose.
pub struct Kept<K, V>(RwLock<BTreeMap<K, V>>);

impl<K: Ord, V: Clone> Kept<K, V> {
    /// The value of a key.
    pub fn get<Q>(&self, key: &Q, make: impl FnOnce() -> V) -> V
    where
        K: Borrow<Q>,
        Q: Ord + ToOwned<Owned = K> + ?Sized,
    {
        let kept = self.0.read().unwrap_or_else(PoisonError::into_inner).get(key).cloned();
        kept.unwrap_or_else(|| {
            let mut kept = self.0.write().unwrap_or_else(PoisonError::into_inner);
            kept.entry(key.to_owned()).or_insert_with(make).clone()
        })
    }
}

impl<K, V> Default for Kept<K, V> {
    fn default() -> Self {
        Self(RwLock::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_made_once_for_each_key() {
        let kept = Kept::<String, usize>::default();
        assert_eq!(kept.get("a", || 1), 1);
        assert_eq!(kept.get("a", || panic!("it is there")), 1);
        assert_eq!(kept.get("b", || 2), 2);
    }
}
