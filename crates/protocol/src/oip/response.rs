//! The tensors that answer frames.

use super::request::AskedOutput;
use super::tensor::Values;
use super::{Datatype, OutputName};
use crate::rest::ModelName;
use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// Which rooms frames show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({
    "model_name": "lab", "model_version": "1", "id": "42",
    "outputs": [{"name": "room", "datatype": "BYTES", "shape": [1], "data": ["kitchen"]}]
})))]
pub struct InferResponse {
    /// The model that answered.
    pub model_name: String,
    /// Its version.
    pub model_version: String,
    /// As sent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// The tensors, in the order asked for.
    pub outputs: Vec<OutputTensor>,
    /// The binary ones, one behind the other.
    #[serde(skip)]
    binary: Vec<u8>,
}

/// A tensor of an answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct OutputTensor {
    /// Which.
    pub name: OutputName,
    /// What its elements are.
    pub datatype: Datatype,
    /// How many elements it has in each direction.
    pub shape: Vec<i64>,
    /// Where the values follow behind the JSON.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameters: Option<BinarySize>,
    /// The values, row by row, where they do not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<Values>,
}

/// How many bytes behind the JSON are a tensor's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct BinarySize {
    /// So many.
    pub binary_data_size: usize,
}

impl InferResponse {
    /// Of a model, to a request that may have an id; without a tensor yet.
    pub fn new(model: &ModelName, id: Option<String>) -> Self {
        Self {
            model_name: model.name.clone(),
            model_version: model.version.to_string(),
            id,
            outputs: Vec::new(),
            binary: Vec::new(),
        }
    }

    /// Adds a tensor in the form that was asked for.
    pub fn push(&mut self, asked: AskedOutput, shape: Vec<i64>, values: Values) {
        let datatype = values.datatype();
        let (parameters, data) = if asked.binary {
            let bytes = values.to_bytes();
            self.binary.extend_from_slice(&bytes);
            (Some(BinarySize { binary_data_size: bytes.len() }), None)
        } else {
            (None, Some(values))
        };
        self.outputs.push(OutputTensor { name: asked.name, datatype, shape, parameters, data });
    }

    /// The body, and where tensors follow its JSON: how many bytes are JSON.
    pub fn into_body(self) -> Result<(Vec<u8>, Option<usize>), serde_json::Error> {
        let mut body = serde_json::to_vec(&self)?;
        let json_length = (!self.binary.is_empty()).then_some(body.len());
        body.extend(self.binary);
        Ok((body, json_length))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn response(outputs: [(OutputName, bool); 2]) -> (Value, Vec<u8>) {
        let model = ModelName { name: "lab".into(), version: 3, epoch: 1, digest: String::new() };
        let mut response = InferResponse::new(&model, None);
        for (name, binary) in outputs {
            response.push(AskedOutput { name, binary }, vec![1], Values::Bool(vec![true]));
        }
        let (body, json_length) = response.into_body().unwrap();
        let (json, binary) = body.split_at(json_length.unwrap_or(body.len()));
        (serde_json::from_slice(json).unwrap(), binary.to_vec())
    }

    #[test]
    fn a_tensor_stands_in_the_json_or_behind_it() {
        let (json, binary) = response([(OutputName::Known, true), (OutputName::Room, false)]);
        assert_eq!(
            json,
            json!({"model_name": "lab", "model_version": "3", "outputs": [
                {"name": "known", "datatype": "BOOL", "shape": [1], "parameters": {"binary_data_size": 1}},
                {"name": "room", "datatype": "BOOL", "shape": [1], "data": [true]}
            ]})
        );
        assert_eq!(binary, [1]);
        let (_, none) = response([(OutputName::Known, false), (OutputName::Room, false)]);
        assert!(none.is_empty());
    }
}
