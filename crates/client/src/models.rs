//! What serves: calls that tell it and calls that change it.

use super::{Client, ClientError, failure_of, read};
use reqwest::header::{CONTENT_TYPE, IF_MATCH};
use reqwest::{Method, RequestBuilder};
use roomsight_protocol::rest::{LabelJson, ModelInfo, ModelList, VersionInfo};
use roomsight_protocol::version_id::VersionId;
use std::time::Duration;

/// How long a change may take, in which a model is sent, loaded and tried.
const CHANGE_PATIENCE: Duration = Duration::from_secs(600);

/// Calls that change what serves take the epoch at which the caller looked, where nothing is to be done if what
/// serves was changed since.
impl Client {
    /// The models there are.
    pub async fn models(&self) -> Result<ModelList, ClientError> {
        read(self.http.get(self.endpoint("v1/models")).send().await?).await
    }

    /// One model and its versions.
    pub async fn model(&self, name: &str) -> Result<ModelInfo, ClientError> {
        read(self.http.get(self.endpoint(&format!("v1/models/{name}"))).send().await?).await
    }

    /// One version with its card.
    pub async fn version(&self, id: &VersionId) -> Result<VersionInfo, ClientError> {
        read(self.http.get(self.endpoint(&version_path(id))).send().await?).await
    }

    /// Adds a version: a body as `roomsight models push` packs it, a tar.gz, a zip, or a model file.
    pub async fn upload(&self, id: &VersionId, body: Vec<u8>) -> Result<VersionInfo, ClientError> {
        let call = self.change(Method::PUT, &version_path(id), None);
        read(call.header(CONTENT_TYPE, "application/x-tar").body(body).send().await?).await
    }

    /// Lets a version serve.
    pub async fn activate(&self, id: &VersionId, epoch: Option<u64>) -> Result<VersionInfo, ClientError> {
        let path = format!("{}/activate", version_path(id));
        read(self.change(Method::POST, &path, epoch).send().await?).await
    }

    /// Lets the version serve that served before.
    pub async fn rollback(&self, name: &str, epoch: Option<u64>) -> Result<ModelInfo, ClientError> {
        let path = format!("v1/models/{name}/rollback");
        read(self.change(Method::POST, &path, epoch).send().await?).await
    }

    /// Removes a version that does not serve.
    pub async fn delete(&self, id: &VersionId, epoch: Option<u64>) -> Result<(), ClientError> {
        let response = self.change(Method::DELETE, &version_path(id), epoch).send().await?;
        if response.status().is_success() { Ok(()) } else { Err(failure_of(response).await?) }
    }

    /// Lets a model answer requests that name none, from now on.
    pub async fn set_default(&self, name: &str) -> Result<ModelInfo, ClientError> {
        let path = format!("v1/models/{name}/default");
        read(self.change(Method::PUT, &path, None).send().await?).await
    }

    /// Gives the label `canary` or `shadow` of a model to a version.
    pub async fn set_label(
        &self,
        name: &str,
        label: &str,
        given: &LabelJson,
        epoch: Option<u64>,
    ) -> Result<ModelInfo, ClientError> {
        let path = format!("v1/models/{name}/labels/{label}");
        read(self.change(Method::PUT, &path, epoch).json(given).send().await?).await
    }

    /// Takes the label `canary` or `shadow` of a model away.
    pub async fn remove_label(
        &self,
        name: &str,
        label: &str,
        epoch: Option<u64>,
    ) -> Result<ModelInfo, ClientError> {
        let path = format!("v1/models/{name}/labels/{label}");
        read(self.change(Method::DELETE, &path, epoch).send().await?).await
    }

    fn change(&self, method: Method, path: &str, epoch: Option<u64>) -> RequestBuilder {
        let call = self.http.request(method, self.endpoint(path)).timeout(CHANGE_PATIENCE);
        match epoch {
            Some(epoch) => call.header(IF_MATCH, format!("\"{epoch}\"")),
            None => call,
        }
    }
}

fn version_path(VersionId { name, version }: &VersionId) -> String {
    format!("v1/models/{name}/versions/{version}")
}
