//! Which model answers requests that name none: the one that the setting names, or else the one that the repository
//! names. Where neither does, the first by name of those that serve is written into the repository at once: from then
//! on no other model takes its place by coming before it in the alphabet.

use super::{Book, ChangeError, Registry, lock};
use crate::engine::registry::table::Table;
use crate::repository::{DefaultModel, RepositoryError};
use std::sync::Arc;

/// How often it is tried to name a model where others do so meanwhile.
const MAX_TRIES: usize = 3;

impl Registry {
    /// The model of requests that name none, where one was named or served. It need not serve now.
    pub fn default_name(&self) -> Option<String> {
        self.table().default.clone()
    }

    /// Lets a model answer requests that name none, for all services of the repository, and for good.
    ///
    /// # Errors
    /// A model of which nothing serves, a setting that names another, a repository that cannot be written.
    pub fn set_default(&self, name: &str) -> Result<(), ChangeError> {
        self.entry(name)?;
        if self.default_setting == name {
            return Ok(());
        }
        if !self.default_setting.is_empty() {
            return Err(ChangeError::DefaultIsSet(self.default_setting.clone()));
        }
        if self.serving(name).stable.is_none() {
            return Err(ChangeError::NotServing(name.to_owned()));
        }
        let _looking = lock(&self.looking);
        let mut result = self.write_default(name);
        for _ in 1..MAX_TRIES {
            if !matches!(result, Err(RepositoryError::DefaultOvertaken(_))) {
                break;
            }
            result = self.write_default(name);
        }
        Ok(result?)
    }

    fn write_default(&self, name: &str) -> Result<(), RepositoryError> {
        let current = self.repository.default_model()?;
        if let Some(current) = current.as_ref().filter(|current| current.model == name) {
            self.note_default(&mut self.book(), current);
            return Ok(());
        }
        let next = DefaultModel::after(current.as_ref(), name);
        self.repository.write_default(&next)?;
        self.note_default(&mut self.book(), &next);
        Ok(())
    }

    /// Writes down which model is the default, where nobody has said it and one serves.
    pub(super) fn settle_default(&self) {
        if self.default_name().is_some() {
            return;
        }
        let table = self.table();
        let Some(first) = table.stable().next() else { return };
        let _looking = lock(&self.looking);
        let first = DefaultModel::after(None, first);
        let default = match self.repository.write_default(&first) {
            Ok(()) => first,
            Err(error) => match self.repository.default_model() {
                // Somebody else was faster.
                Ok(Some(theirs)) => theirs,
                _ => {
                    let is_alone = matches!(error, RepositoryError::ReadOnly(_));
                    if !is_alone {
                        let advice = "the setting `model` names it for good";
                        tracing::warn!(model = first.model, %error, advice, "the default model is not kept");
                    }
                    DefaultModel { epoch: 0, ..first }
                }
            },
        };
        self.note_default(&mut self.book(), &default);
    }

    /// Takes over which model is the default. Whoever calls this holds `looking`, so that nothing older follows.
    pub(super) fn note_default(&self, book: &mut Book, default: &DefaultModel) {
        if !self.default_setting.is_empty() || book.default.as_ref() == Some(default) {
            return;
        }
        book.default = Some(default.clone());
        if self.table().default.as_deref() != Some(&default.model) {
            let mut table = Table::clone(&self.table());
            table.default = Some(default.model.clone());
            self.table.store(Arc::new(table));
            tracing::info!(model = default.model, "answers requests that name no model");
        }
    }

    /// Tells at the start what of the default model was not told when it was found out.
    pub(super) fn tell_default(&self) {
        let table = self.table();
        let Some(default) = &table.default else {
            return tracing::info!(
                "no model serves yet; the first that does answers requests that name none"
            );
        };
        if !table.stable().any(|name| name == default) {
            let advice = "name another by `roomsight models default NAME`, or activate a version of it";
            tracing::warn!(model = default, advice, "is the default and does not serve");
        } else if !self.default_setting.is_empty() {
            tracing::info!(model = default, "answers requests that name no model, by the setting `model`");
        }
    }
}
