//! The objects of a bucket: a waiting face over `object_store`.
//!
//! The work is done by a small runtime of its own, so that it does not matter where the callers wait, and
//! every wait has an end.

use crate::repository::RepositoryError;
use futures_util::StreamExt;
use object_store::aws::{AmazonS3, AmazonS3Builder, AmazonS3ConfigKey};
use object_store::path::Path as Key;
use object_store::{
    ClientConfigKey, Error, GetResult, ObjectMeta, ObjectStore, ObjectStoreExt, PutMode, RetryConfig,
    UpdateVersion,
};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::{Arc, mpsc};
use std::time::Duration;
use tokio::runtime::{Builder, Runtime};
use tokio::time::timeout;

/// How often a call that failed is tried again.
const MAX_RETRIES: usize = 2;

/// The most objects of a repository.
const MAX_OBJECTS: usize = 100_000;

/// An upload that is slower than so many bytes a second has stalled.
const SLOWEST_UPLOAD: u64 = 64 << 10;

/// No single transfer takes longer, whatever its size.
const LONGEST_TRANSFER: &str = "3600s";

/// A bucket, or the part of it whose keys begin with a prefix. Paths are relative to that.
#[derive(Debug)]
pub(super) struct Remote {
    /// As it was given, for messages.
    location: String,
    store: Arc<AmazonS3>,
    /// Empty, or such as `robots/`.
    prefix: String,
    /// How long nothing may come before a call has failed.
    patience: Duration,
    /// There until this is dropped.
    runtime: Option<Runtime>,
}

/// What is known of an object.
#[derive(Clone, Debug)]
pub(super) struct Object {
    pub path: String,
    pub n_bytes: u64,
    /// Changes with the object's bytes.
    pub tag: String,
}

impl Remote {
    /// The bucket at `s3://bucket/prefix`; nothing is sent yet.
    pub fn new(
        builder: AmazonS3Builder,
        location: &str,
        patience: Duration,
    ) -> Result<Self, RepositoryError> {
        let wrong = |reason: String| RepositoryError::Bucket { location: location.to_owned(), reason };
        let rest = location.strip_prefix(super::SCHEME).unwrap_or(location).trim_end_matches('/');
        let (bucket, prefix) = rest.split_once('/').unwrap_or((rest, ""));
        let is_plain = Key::parse(prefix).is_ok_and(|key| key.as_ref() == prefix);
        if bucket.is_empty() || !is_plain {
            return Err(wrong("give it as s3://bucket or s3://bucket/prefix".to_owned()));
        }
        let retry =
            RetryConfig { max_retries: MAX_RETRIES, retry_timeout: patience, ..RetryConfig::default() };
        let store = builder
            .with_bucket_name(bucket)
            .with_allow_http(true)
            .with_config(AmazonS3ConfigKey::Client(ClientConfigKey::Timeout), LONGEST_TRANSFER)
            .with_retry(retry)
            .build()
            .map_err(|error| wrong(error.to_string()))?;
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build();
        Ok(Self {
            location: location.to_owned(),
            store: Arc::new(store),
            prefix: if prefix.is_empty() { String::new() } else { format!("{prefix}/") },
            patience,
            runtime: Some(runtime.map_err(|error| wrong(error.to_string()))?),
        })
    }

    /// All objects whose paths begin with this folder; all there are when it is empty.
    pub fn list(&self, folder: &str) -> Result<Vec<Object>, RepositoryError> {
        let (store, key, patience) = (self.store.clone(), self.key(folder)?, self.patience);
        let found = self.wait(async move {
            let mut stream = store.list(Some(&key));
            let mut found = Vec::new();
            while let Some(meta) = timeout(patience, stream.next()).await.map_err(late)? {
                if found.len() == MAX_OBJECTS {
                    return Err(format!(
                        "it has more than {MAX_OBJECTS} objects: use a prefix for the models"
                    ));
                }
                found.push(meta.map_err(failed)?);
            }
            Ok(found)
        })?;
        Ok(found.into_iter().filter_map(|meta| self.object(meta)).collect())
    }

    /// The bytes of a small object, and what names them where others are to take their place; none where there is
    /// no such thing.
    pub fn read(
        &self,
        path: &str,
        max_bytes: u64,
    ) -> Result<Option<(Vec<u8>, UpdateVersion)>, RepositoryError> {
        let (store, key, patience) = (self.store.clone(), self.key(path)?, self.patience);
        self.wait(async move {
            let Some(found) = get(&store, &key, patience).await? else { return Ok(None) };
            let GetResult { meta: ObjectMeta { e_tag, version, .. }, .. } = &found;
            let version = UpdateVersion { e_tag: e_tag.clone(), version: version.clone() };
            let mut bytes = Vec::new();
            receive(found, max_bytes, patience, |piece| {
                bytes.extend_from_slice(piece);
                Ok(())
            })
            .await?;
            Ok(Some((bytes, version)))
        })
    }

    /// Copies an object into a new file, no more bytes than were listed.
    pub fn download(&self, object: &Object, to: &Path) -> Result<(), RepositoryError> {
        let (store, key, patience) = (self.store.clone(), self.key(&object.path)?, self.patience);
        let (n_bytes, path, to) = (object.n_bytes, object.path.clone(), to.to_owned());
        self.wait(async move {
            let cannot = |error: std::io::Error| format!("cannot write {}: {error}", to.display());
            let mut file = File::create_new(&to).map_err(cannot)?;
            let found = get(&store, &key, patience).await?.ok_or_else(|| format!("{path} is gone"))?;
            receive(found, n_bytes, patience, |piece| file.write_all(piece).map_err(cannot)).await
        })
    }

    /// Writes an object; where it must be new or take the place of certain bytes, whether it did.
    pub fn write(&self, path: &str, bytes: Vec<u8>, mode: PutMode) -> Result<bool, RepositoryError> {
        let (store, key) = (self.store.clone(), self.key(path)?);
        let patience = self.patience + Duration::from_secs(bytes.len() as u64 / SLOWEST_UPLOAD);
        self.wait(async move {
            match timeout(patience, store.put_opts(&key, bytes.into(), mode.into())).await.map_err(late)? {
                Ok(_) => Ok(true),
                Err(Error::AlreadyExists { .. } | Error::Precondition { .. }) => Ok(false),
                Err(error) => Err(failed(error)),
            }
        })
    }

    /// Removes an object; that it is gone already is no error.
    pub fn remove(&self, path: &str) -> Result<(), RepositoryError> {
        let (store, key, patience) = (self.store.clone(), self.key(path)?, self.patience);
        self.wait(async move {
            match timeout(patience, store.delete(&key)).await.map_err(late)? {
                Ok(()) | Err(Error::NotFound { .. }) => Ok(()),
                Err(error) => Err(failed(error)),
            }
        })
    }

    /// What the bucket calls a path. Paths go as they are, not encoded.
    fn key(&self, path: &str) -> Result<Key, RepositoryError> {
        let key = format!("{}{path}", self.prefix);
        Key::parse(key.trim_end_matches('/')).map_err(|error| self.error(error.to_string()))
    }

    fn object(&self, meta: ObjectMeta) -> Option<Object> {
        let path = meta.location.as_ref().strip_prefix(&self.prefix)?.to_owned();
        let tag = meta.e_tag.unwrap_or_else(|| meta.last_modified.to_string());
        Some(Object { path, n_bytes: meta.size, tag })
    }

    /// Waits for a call, which says itself for how long at most.
    fn wait<T: Send + 'static>(
        &self,
        call: impl Future<Output = Result<T, String>> + Send + 'static,
    ) -> Result<T, RepositoryError> {
        let (tell, told) = mpsc::sync_channel(1);
        if let Some(runtime) = &self.runtime {
            runtime.spawn(async move { tell.send(call.await) });
        }
        let result = told.recv().unwrap_or_else(|_| Err("the call broke off".to_owned()));
        result.map_err(|reason| self.error(reason))
    }

    fn error(&self, reason: String) -> RepositoryError {
        RepositoryError::Bucket { location: self.location.clone(), reason }
    }
}

/// A runtime that is dropped waits for its threads, which asynchronous callers may not.
impl Drop for Remote {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

async fn get(store: &AmazonS3, key: &Key, patience: Duration) -> Result<Option<GetResult>, String> {
    match timeout(patience, store.get(key)).await.map_err(late)? {
        Ok(found) => Ok(Some(found)),
        Err(Error::NotFound { .. }) => Ok(None),
        Err(error) => Err(failed(error)),
    }
}

/// Hands the bytes of an object on, piece by piece, and no more than are allowed.
async fn receive(
    found: GetResult,
    max_bytes: u64,
    patience: Duration,
    mut take: impl FnMut(&[u8]) -> Result<(), String>,
) -> Result<(), String> {
    let path = found.meta.location.clone();
    let mut stream = found.into_stream();
    let mut n_bytes = 0;
    while let Some(piece) = timeout(patience, stream.next()).await.map_err(late)? {
        let piece = piece.map_err(failed)?;
        n_bytes += piece.len() as u64;
        if n_bytes > max_bytes {
            return Err(format!("{path} has more than {max_bytes} bytes"));
        }
        take(&piece)?;
    }
    Ok(())
}

fn late<E>(_: E) -> String {
    "cannot be reached: it does not answer in time".to_owned()
}

fn failed(error: Error) -> String {
    match error {
        Error::Generic { source, .. } => format!("cannot be reached: {source}"),
        error => error.to_string(),
    }
}
