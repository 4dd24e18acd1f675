//! Small networks that tests make, by messages of their own.

#![allow(missing_docs, reason = "messages and fields are those of ONNX's onnx.proto")]

use super::{Runtime, RuntimeError};
use prost::Message;
use std::path::Path;

/// 32-bit floats, as TensorProto.DataType says.
pub const FLOAT: i32 = 1;
/// 64-bit whole numbers.
pub const INT64: i32 = 7;

#[derive(Clone, PartialEq, Message)]
pub struct Model {
    #[prost(int64, tag = "1")]
    pub ir_version: i64,
    #[prost(message, optional, tag = "7")]
    pub graph: Option<Graph>,
    #[prost(message, repeated, tag = "8")]
    pub opsets: Vec<Opset>,
}

#[derive(Clone, PartialEq, Message)]
pub struct Opset {
    #[prost(string, tag = "1")]
    pub domain: String,
    #[prost(int64, tag = "2")]
    pub version: i64,
}

#[derive(Clone, PartialEq, Message)]
pub struct Graph {
    #[prost(message, repeated, tag = "1")]
    pub nodes: Vec<Node>,
    #[prost(string, tag = "2")]
    pub name: String,
    #[prost(message, repeated, tag = "5")]
    pub weights: Vec<Tensor>,
    #[prost(message, repeated, tag = "11")]
    pub inputs: Vec<ValueInfo>,
    #[prost(message, repeated, tag = "12")]
    pub outputs: Vec<ValueInfo>,
}

#[derive(Clone, PartialEq, Message)]
pub struct Node {
    #[prost(string, repeated, tag = "1")]
    pub inputs: Vec<String>,
    #[prost(string, repeated, tag = "2")]
    pub outputs: Vec<String>,
    #[prost(string, tag = "4")]
    pub operator: String,
    #[prost(message, repeated, tag = "5")]
    pub attributes: Vec<Attribute>,
    #[prost(string, tag = "7")]
    pub domain: String,
}

#[derive(Clone, PartialEq, Message)]
pub struct Attribute {
    #[prost(string, tag = "1")]
    pub name: String,
    #[prost(int64, optional, tag = "3")]
    pub int: Option<i64>,
    #[prost(message, optional, tag = "5")]
    pub tensor: Option<Tensor>,
    #[prost(message, optional, tag = "6")]
    pub graph: Option<Graph>,
    #[prost(int64, repeated, tag = "8")]
    pub ints: Vec<i64>,
    /// AttributeProto.AttributeType: 2 a number, 4 a tensor, 5 a graph, 7 numbers.
    #[prost(int32, tag = "20")]
    pub kind: i32,
}

#[derive(Clone, PartialEq, Message)]
pub struct Tensor {
    #[prost(int64, repeated, tag = "1")]
    pub dims: Vec<i64>,
    #[prost(int32, tag = "2")]
    pub kind: i32,
    #[prost(string, tag = "8")]
    pub name: String,
    #[prost(bytes = "vec", tag = "9")]
    pub raw: Vec<u8>,
    #[prost(int32, tag = "14")]
    pub location: i32,
}

#[derive(Clone, PartialEq, Message)]
pub struct ValueInfo {
    #[prost(string, tag = "1")]
    pub name: String,
    #[prost(message, optional, tag = "2")]
    pub kind: Option<Type>,
}

#[derive(Clone, PartialEq, Message)]
pub struct Type {
    #[prost(message, optional, tag = "1")]
    pub tensor: Option<TensorType>,
}

#[derive(Clone, PartialEq, Message)]
pub struct TensorType {
    #[prost(int32, tag = "1")]
    pub element: i32,
    #[prost(message, optional, tag = "2")]
    pub shape: Option<Shape>,
}

#[derive(Clone, PartialEq, Message)]
pub struct Shape {
    #[prost(message, repeated, tag = "1")]
    pub dims: Vec<Dim>,
}

#[derive(Clone, PartialEq, Message)]
pub struct Dim {
    #[prost(int64, optional, tag = "1")]
    pub size: Option<i64>,
    #[prost(string, optional, tag = "2")]
    pub name: Option<String>,
}

/// A tensor that goes in or comes out; -1 stands for any size.
pub fn value(name: &str, dims: &[i64]) -> ValueInfo {
    let dim = |(idx, &size): (usize, &i64)| match size {
        -1 => Dim { size: None, name: Some(format!("d{idx}")) },
        _ => Dim { size: Some(size), name: None },
    };
    let shape = Shape { dims: dims.iter().enumerate().map(dim).collect() };
    let tensor = TensorType { element: FLOAT, shape: Some(shape) };
    ValueInfo { name: name.to_owned(), kind: Some(Type { tensor: Some(tensor) }) }
}

/// Weights of 32-bit floats.
pub fn floats(name: &str, dims: &[i64], values: &[f32]) -> Tensor {
    let raw = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    Tensor { dims: dims.to_vec(), kind: FLOAT, name: name.to_owned(), raw, location: 0 }
}

/// Weights of whole numbers, one dimension.
pub fn numbers(name: &str, values: &[i64]) -> Tensor {
    let raw = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    Tensor { dims: vec![values.len() as i64], kind: INT64, name: name.to_owned(), raw, location: 0 }
}

/// An operation; names are given with spaces between.
pub fn node(operator: &str, inputs: &str, outputs: &str, attributes: Vec<Attribute>) -> Node {
    let names = |text: &str| text.split(' ').filter(|name| !name.is_empty()).map(str::to_owned).collect();
    Node {
        inputs: names(inputs),
        outputs: names(outputs),
        operator: operator.to_owned(),
        attributes,
        domain: String::new(),
    }
}

/// An attribute of numbers.
pub fn ints(name: &str, values: &[i64]) -> Attribute {
    Attribute { name: name.to_owned(), ints: values.to_vec(), kind: 7, ..Attribute::default() }
}

/// An attribute of one number.
pub fn int(name: &str, value: i64) -> Attribute {
    Attribute { name: name.to_owned(), int: Some(value), kind: 2, ..Attribute::default() }
}

impl Model {
    pub fn new(graph: Graph) -> Self {
        let opset = Opset { domain: String::new(), version: 17 };
        Self { ir_version: 8, graph: Some(Graph { name: "g".to_owned(), ..graph }), opsets: vec![opset] }
    }

    pub fn graph(&mut self) -> &mut Graph {
        self.graph.get_or_insert_default()
    }

    pub fn bytes(&self) -> Vec<u8> {
        self.encode_to_vec()
    }
}

/// A convolution of stride 2 whose four channels are red, green, blue and their sum at every second pixel, of
/// what is above 0; the mean of that; and a number.
pub fn convolution() -> Model {
    let mut filters = vec![0.0; 4 * 3];
    for color in 0..3 {
        filters[color * 3 + color] = 1.0;
        filters[3 * 3 + color] = 1.0;
    }
    Model::new(Graph {
        nodes: vec![
            node(
                "Conv",
                "image filters",
                "sums",
                vec![ints("strides", &[2, 2]), ints("kernel_shape", &[1, 1])],
            ),
            node("Relu", "sums", "map", vec![]),
            node("GlobalAveragePool", "map", "mean", vec![]),
            node("Flatten", "mean", "embedding", vec![]),
        ],
        weights: vec![floats("filters", &[4, 3, 1, 1], &filters)],
        inputs: vec![value("image", &[-1, 3, -1, -1])],
        outputs: vec![value("embedding", &[-1, 4]), value("map", &[-1, 4, -1, -1])],
        ..Graph::default()
    })
}

/// Patches of 8 x 8 pixels, their mean red, green and blue as tokens, behind a class token of `[5, 6, 7]`; all
/// doubled by a product of matrices.
pub fn transformer() -> Model {
    let mut patch = vec![0.0; 3 * 3 * 64];
    for color in 0..3 {
        patch[(color * 3 + color) * 64..][..64].fill(1.0 / 64.0);
    }
    let doubling = [2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0];
    Model::new(Graph {
        nodes: vec![
            node(
                "Conv",
                "image patch",
                "patches",
                vec![ints("strides", &[8, 8]), ints("kernel_shape", &[8, 8])],
            ),
            node("Reshape", "patches flat", "rows", vec![]),
            node("Transpose", "rows", "tokens_behind", vec![ints("perm", &[0, 2, 1])]),
            node("Concat", "class tokens_behind", "tokens", vec![int("axis", 1)]),
            node("MatMul", "tokens doubling", "last_hidden_state", vec![]),
        ],
        weights: vec![
            floats("patch", &[3, 3, 8, 8], &patch),
            numbers("flat", &[1, 3, -1]),
            floats("class", &[1, 1, 3], &[5.0, 6.0, 7.0]),
            floats("doubling", &[3, 3], &doubling),
        ],
        inputs: vec![value("image", &[-1, 3, -1, -1])],
        outputs: vec![value("last_hidden_state", &[-1, -1, 3])],
        ..Graph::default()
    })
}

/// A description of `model` for 16 x 8 pixels and multiples of 8, with tables behind it.
pub fn described(model: &Model, tables: &str) -> String {
    let digest = blake3::hash(&model.bytes()).to_hex();
    format!(
        "digest = \"{digest}\"\nlicense = \"none\"\norigin = \"a test\"\n\n[input]\nname = \"image\"\n\
         size = [16, 8]\nmultiple_of = 8\nlongest_side = 64\nmean = [0.0, 0.0, 0.0]\nscale = [1.0, 1.0, 1.0]\n\n\
         {tables}"
    )
}

/// ONNX Runtime as `make networks` leaves it; without it says that `what` is left out.
pub fn runtime(what: &str) -> Option<Runtime> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../networks");
    match Runtime::find(&folder) {
        Ok(library) => {
            Runtime::look_into(folder);
            Some(Runtime::load(&library).expect("`make networks` leaves an ONNX Runtime that loads"))
        }
        Err(error @ RuntimeError::NoneInFolder(_)) => {
            eprintln!("LEFT OUT: {what}. {error}.");
            None
        }
        Err(error) => panic!("{error}"),
    }
}
