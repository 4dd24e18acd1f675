//! What is to serve: the desired state, which survives restarts, and which all servers of one repository follow.

use serde::{Deserialize, Serialize};

/// The file of a model's record, in its folder.
pub(super) const RECORD_FILE: &str = "serving.json";

/// The longest record that is read.
pub(super) const MAX_RECORD_BYTES: u64 = 64 << 10;

/// The highest epoch that is believed: so many changes were never made, and there is always a next one.
pub(super) const MAX_EPOCH: u64 = u64::MAX / 2;

/// Which versions of one model are to serve, and as what.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ServingRecord {
    /// Counts the changes of this record.
    pub epoch: u64,
    /// The highest version that was ever given a label, or published to be decided about: only a higher one comes to serve by itself.
    pub settled: u64,
    /// The version that answers.
    pub stable: Option<u64>,
    /// The one that was stable before, to which a rollback leads.
    pub previous: Option<u64>,
    /// The version that is tried on some robots.
    pub canary: Option<Canary>,
    /// The version that sees frames and answers nobody.
    pub shadow: Option<u64>,
}

/// A version that answers some of the robots.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Canary {
    pub version: u64,
    /// The share of the robots that it answers, above 0 and below 1.
    pub share: f64,
}

/// Why a record is not changed so.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordError {
    /// Nothing was stable before.
    #[error("there is no previous version to go back to")]
    NoPrevious,
    /// The version has a label.
    #[error("version {version} is {label}: give the label to another version, or remove it, first")]
    Labeled { version: u64, label: &'static str },
    /// A stable version needs no second label.
    #[error("version {0} is stable: it answers all robots already")]
    Stable(u64),
    /// A share that leaves nothing to one of both.
    #[error("a canary's share must be above 0 and below 1, not {0}")]
    Share(f64),
    /// A count that nobody can have counted to.
    #[error("the epoch {0} is no count of changes: give one of at most {MAX_EPOCH}")]
    Epoch(u64),
}

impl ServingRecord {
    /// The record in which `version` is stable and what was stable is previous. A canary or shadow that
    /// becomes stable loses that label. Nothing changes where it is stable already.
    pub fn activated(&self, version: u64) -> Self {
        if self.stable == Some(version) {
            return self.clone();
        }
        self.changed(Self {
            settled: self.settled.max(version),
            stable: Some(version),
            previous: self.stable.or(self.previous).filter(|previous| *previous != version),
            canary: self.canary.filter(|canary| canary.version != version),
            shadow: self.shadow.filter(|shadow| *shadow != version),
            epoch: self.epoch,
        })
    }

    /// The record in which `version` does not come to serve by itself.
    pub fn decided_about(&self, version: u64) -> Self {
        self.changed(Self { settled: self.settled.max(version), ..self.clone() })
    }

    /// The record in which the previous version is stable again.
    pub fn rolled_back(&self) -> Result<Self, RecordError> {
        Ok(self.activated(self.previous.ok_or(RecordError::NoPrevious)?))
    }

    /// The record with this canary.
    pub fn with_canary(&self, canary: Canary) -> Result<Self, RecordError> {
        let settled = self.settled.max(canary.version);
        let record = Self { canary: Some(canary), settled, ..self.clone() };
        record.check()?;
        Ok(self.changed(record))
    }

    /// The record without a canary.
    pub fn without_canary(&self) -> Self {
        self.changed(Self { canary: None, ..self.clone() })
    }

    /// The record with this shadow.
    pub fn with_shadow(&self, version: u64) -> Result<Self, RecordError> {
        let settled = self.settled.max(version);
        let record = Self { shadow: Some(version), settled, ..self.clone() };
        record.check()?;
        Ok(self.changed(record))
    }

    /// The record without a shadow.
    pub fn without_shadow(&self) -> Self {
        self.changed(Self { shadow: None, ..self.clone() })
    }

    /// The record in which a version may be deleted: refused where it is stable, canary or shadow.
    pub fn without(&self, version: u64) -> Result<Self, RecordError> {
        match self.labels(version).first() {
            Some(&"previous") | None => {}
            Some(label) => return Err(RecordError::Labeled { version, label }),
        }
        let previous = self.previous.filter(|previous| *previous != version);
        Ok(self.changed(Self { previous, ..self.clone() }))
    }

    /// The record in which nothing serves; a rollback leads to what was stable.
    pub fn unloaded(&self) -> Self {
        let previous = self.stable.or(self.previous);
        self.changed(Self { stable: None, previous, canary: None, shadow: None, ..self.clone() })
    }

    /// What a version is: `stable`, `canary`, `shadow`, `previous`.
    pub fn labels(&self, version: u64) -> Vec<&'static str> {
        let canary = self.canary.map(|canary| canary.version);
        let labels = [
            ("stable", self.stable),
            ("canary", canary),
            ("shadow", self.shadow),
            ("previous", self.previous),
        ];
        labels.into_iter().filter(|(_, of)| *of == Some(version)).map(|(label, _)| label).collect()
    }

    /// Reads a record that anybody may have written.
    pub(super) fn from_json(json: &[u8]) -> Result<Self, String> {
        let record: Self = serde_json::from_slice(json).map_err(|error| error.to_string())?;
        record.check().map_err(|error| error.to_string())?;
        Ok(record)
    }

    fn check(&self) -> Result<(), RecordError> {
        if self.epoch > MAX_EPOCH {
            return Err(RecordError::Epoch(self.epoch));
        }
        if let Some(Canary { share, .. }) = self.canary
            && !(share > 0.0 && share < 1.0)
        {
            return Err(RecordError::Share(share));
        }
        let tried = [self.canary.map(|canary| canary.version), self.shadow];
        match self.stable.filter(|stable| tried.contains(&Some(*stable))) {
            Some(stable) => Err(RecordError::Stable(stable)),
            None => Ok(()),
        }
    }

    /// `next`, one epoch later than this, where it says anything new.
    fn changed(&self, next: Self) -> Self {
        if next == *self { next } else { Self { epoch: self.epoch + 1, ..next } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CANARY: Canary = Canary { version: 3, share: 0.1 };

    #[test]
    fn what_was_stable_is_previous_and_comes_back() {
        let second = ServingRecord::default().activated(1).activated(2);
        assert_eq!((second.stable, second.previous, second.settled, second.epoch), (Some(2), Some(1), 2, 2));
        let back = second.rolled_back().unwrap();
        assert_eq!((back.stable, back.previous, back.settled, back.epoch), (Some(1), Some(2), 2, 3));
        assert_eq!(back.rolled_back().unwrap(), ServingRecord { epoch: 4, ..second });
        assert_eq!(ServingRecord::default().activated(1).rolled_back(), Err(RecordError::NoPrevious));
    }

    #[test]
    fn what_says_nothing_new_is_no_change() {
        let record = ServingRecord::default().activated(1).with_canary(CANARY).unwrap();
        assert_eq!(record.activated(1), record);
        assert_eq!(record.with_canary(CANARY).unwrap(), record);
        assert_eq!(record.without_shadow(), record);
        assert_eq!(record.without(9).unwrap(), record);
        assert_eq!(record.epoch, 2);
    }

    #[test]
    fn a_canary_that_becomes_stable_is_canary_no_more() {
        let tried =
            ServingRecord::default().activated(1).with_canary(CANARY).unwrap().with_shadow(4).unwrap();
        let won = tried.activated(3);
        assert_eq!((won.canary, won.shadow, won.previous), (None, Some(4), Some(1)));
        assert_eq!(won.activated(4).shadow, None);
    }

    #[test]
    fn labels_that_make_no_sense_are_refused() {
        let record = ServingRecord::default().activated(3);
        assert_eq!(record.with_canary(CANARY), Err(RecordError::Stable(3)));
        assert_eq!(record.with_shadow(3), Err(RecordError::Stable(3)));
        for share in [0.0, 1.0, -0.1, 2.0, f64::NAN] {
            let refused = record.with_canary(Canary { version: 4, share });
            assert!(matches!(refused, Err(RecordError::Share(_))), "{share}");
        }
    }

    #[test]
    fn a_version_in_use_is_not_let_go_and_the_label_is_named() {
        let record = ServingRecord::default().activated(1).activated(2).with_canary(CANARY).unwrap();
        let record = record.with_shadow(4).unwrap();
        for (version, label) in [(2, "stable"), (3, "canary"), (4, "shadow")] {
            assert_eq!(record.without(version), Err(RecordError::Labeled { version, label }));
            assert_eq!(record.labels(version), [label]);
        }
        assert_eq!(record.labels(1), ["previous"]);
        assert_eq!(record.without(1).unwrap().previous, None);
    }

    #[test]
    fn after_unloading_a_rollback_leads_to_what_was_stable() {
        let unloaded = ServingRecord::default().activated(1).with_canary(CANARY).unwrap().unloaded();
        assert_eq!((unloaded.stable, unloaded.canary, unloaded.settled), (None, None, 3));
        let back = unloaded.rolled_back().unwrap();
        assert_eq!((back.stable, back.previous), (Some(1), None));
    }

    #[test]
    fn a_record_comes_back_from_its_text_and_a_wrong_one_does_not() {
        let record = ServingRecord::default().activated(2).with_canary(CANARY).unwrap();
        assert_eq!(ServingRecord::from_json(&serde_json::to_vec(&record).unwrap()), Ok(record));
        assert_eq!(ServingRecord::from_json(b"{}"), Ok(ServingRecord::default()));
        for text in
            ["", r#"{"stable":-1}"#, r#"{"canary":{"version":3,"share":7}}"#, r#"{"stable":3,"shadow":3}"#]
        {
            assert!(ServingRecord::from_json(text.as_bytes()).is_err(), "{text}");
        }
        let worn = ServingRecord::from_json(format!(r#"{{"epoch":{}}}"#, u64::MAX).as_bytes()).unwrap_err();
        assert!(worn.contains("epoch"), "{worn}");
    }
}
