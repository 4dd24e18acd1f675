//! What an ONNX file holds, looked into before ONNX Runtime does.
//!
//! Field numbers are those of onnx.proto3 (github.com/onnx/onnx).

use super::operators::{is_control_flow, work};
use super::refusal::{MAX_RANK, Problem, refused};
use super::weights::Weights;
use super::wire::{Field, Malformed, fields, put_bytes, put_varint};
use std::collections::{BTreeMap, BTreeSet};

/// The most bytes of an ONNX file.
pub const MAX_FILE_BYTES: u64 = 512 << 20;
/// The most operations of a network.
pub const MAX_NODES: usize = 10_000;
/// The most tensors that a network may have, weights included.
const MAX_TENSORS: usize = 100_000;
/// The oldest operators that say which sizes come out of them.
const MIN_OPSET: u64 = 11;

/// ONNX's number for 32-bit floats.
const FLOAT: u64 = 1;

/// What an ONNX file holds; names and weights stay in the file's bytes.
#[derive(Debug)]
pub(super) struct Graph<'a> {
    file: &'a [u8],
    /// The operations in the order in which they stand there.
    pub nodes: Vec<Node<'a>>,
    /// The sizes of the weights, by name.
    pub weights: BTreeMap<&'a str, Vec<usize>>,
    /// What goes in: neither the weights, nor what the network computes.
    pub inputs: Vec<Tensor<'a>>,
    /// What comes out.
    pub outputs: Vec<Tensor<'a>>,
}

/// One operation.
#[derive(Debug, Default)]
pub(super) struct Node<'a> {
    pub operator: &'a str,
    /// Names; empty where an input is left out.
    pub inputs: Vec<&'a str>,
    /// Names; empty where nobody wants an output.
    pub outputs: Vec<&'a str>,
    /// The numbers of the window that is moved over the input; 1 where there is none.
    pub window: u64,
}

/// A tensor that goes in or comes out.
#[derive(Debug, PartialEq)]
pub(super) struct Tensor<'a> {
    pub name: &'a str,
    pub is_float: bool,
    pub dims: Vec<Dim<'a>>,
}

/// The size of one dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dim<'a> {
    Size(u64),
    /// Any; the file calls it so, or not at all.
    Any(&'a str),
}

impl std::fmt::Display for Dim<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Size(size) => write!(f, "{size}"),
            Self::Any("") => write!(f, "?"),
            Self::Any(name) => write!(f, "{name}"),
        }
    }
}

/// Why a file is refused, as the end of a sentence that begins with its name.
type Refusal = String;

impl<'a> Graph<'a> {
    /// Looks into `file`, the bytes of an ONNX file. The error ends a sentence that begins with the file's name.
    pub fn read(file: &'a [u8]) -> Result<Self, Refusal> {
        if file.len() as u64 > MAX_FILE_BYTES {
            return Err(format!(
                "is larger than {} MiB, the most that a network may take",
                MAX_FILE_BYTES >> 20
            ));
        }
        let mut graph = Self {
            file,
            nodes: Vec::new(),
            weights: BTreeMap::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
        };
        graph.read_model().map_err(|problem| match problem {
            Problem::Malformed => {
                "is no ONNX file, or only a part of one: fetch or export the network again".to_owned()
            }
            Problem::Refused(why) => why,
        })?;
        graph.check_names()?;
        Ok(graph)
    }

    fn read_model(&mut self) -> Result<(), Problem> {
        let (mut has_graph, mut opset) = (false, None);
        for field in fields(self.file) {
            let field = field?;
            match field.number {
                MODEL_GRAPH => {
                    has_graph = true;
                    self.read_graph(field.bytes()?)?;
                }
                MODEL_OPSET => opset = opset_version(field.bytes()?)?.or(opset),
                MODEL_TRAINING => return refused("carries steps of training: export it for inference"),
                MODEL_FUNCTIONS => {
                    return refused("defines functions of its own: export it with functions inlined");
                }
                _ => {}
            }
        }
        match opset {
            _ if !has_graph => Err(Problem::Malformed),
            None => Err(Problem::Malformed),
            Some(version) if version < MIN_OPSET => refused(format!(
                "is written for operators of version {version}: export it with opset {MIN_OPSET} or newer"
            )),
            Some(_) => Ok(()),
        }
    }

    fn read_graph(&mut self, graph: &'a [u8]) -> Result<(), Problem> {
        for field in fields(graph) {
            let field = field?;
            if self.nodes.len() > MAX_NODES {
                return refused(format!("has more than {MAX_NODES} operations"));
            }
            if self.weights.len() + self.inputs.len() + self.outputs.len() > MAX_TENSORS {
                return refused(format!("has more than {MAX_TENSORS} tensors"));
            }
            match field.number {
                GRAPH_NODE => self.nodes.push(Node::read(field.bytes()?)?),
                GRAPH_WEIGHTS => {
                    let weights = Weights::read(field.bytes()?)?;
                    weights.check_finite()?;
                    if self.weights.insert(weights.name, weights.dims).is_some() {
                        return refused(format!("has two weights of the name {:?}", weights.name));
                    }
                }
                GRAPH_SPARSE_WEIGHTS => return refused("has sparse weights: export it with dense ones"),
                GRAPH_INPUT => self.inputs.push(Tensor::read(field.bytes()?)?),
                GRAPH_OUTPUT => self.outputs.push(Tensor::read(field.bytes()?)?),
                _ => {}
            }
        }
        Ok(())
    }

    /// Each tensor must have one maker, so that none can stand in for another.
    fn check_names(&mut self) -> Result<(), Refusal> {
        // Up to version 3 of the format weights are named among the inputs as well.
        self.inputs.retain(|input| !self.weights.contains_key(input.name));
        let mut made: BTreeSet<&str> = self.weights.keys().copied().collect();
        let outputs = self.nodes.iter().flat_map(|node| node.outputs.iter().copied());
        for name in self.inputs.iter().map(|input| input.name).chain(outputs.filter(|name| !name.is_empty()))
        {
            if !made.insert(name) {
                return Err(format!("makes the tensor {name:?} twice"));
            }
        }
        match made.len() > MAX_TENSORS {
            true => Err(format!("has more than {MAX_TENSORS} tensors")),
            false => Ok(()),
        }
    }

    /// The file once more, for an input of `dims`, with `outputs` alone and the operations that they take.
    /// Sizes that the file claims for other tensors are left out, so that they are told by the operations.
    pub fn rewritten(&self, dims: &[usize], outputs: &BTreeSet<&str>) -> Vec<u8> {
        let needed = self.needed_for(outputs);
        let mut graph = Vec::with_capacity(self.file.len());
        let mut node_idx = 0;
        for field in self.graph_fields() {
            let is_kept = match field.number {
                GRAPH_NODE => {
                    node_idx += 1;
                    needed[node_idx - 1]
                }
                GRAPH_INPUT => tensor_name(&field).is_some_and(|name| self.weights.contains_key(name)),
                GRAPH_OUTPUT | GRAPH_VALUE_INFO => false,
                _ => true,
            };
            if is_kept {
                graph.extend_from_slice(field.raw);
            }
        }
        for input in &self.inputs {
            put_bytes(&mut graph, GRAPH_INPUT, &float_tensor(input.name, dims));
        }
        for &name in outputs {
            let mut tensor = Vec::new();
            put_bytes(&mut tensor, 1, name.as_bytes());
            put_bytes(&mut graph, GRAPH_OUTPUT, &tensor);
        }
        let mut model = Vec::with_capacity(graph.len() + 1024);
        for field in fields(self.file).flatten().filter(|field| field.number != MODEL_GRAPH) {
            model.extend_from_slice(field.raw);
        }
        put_bytes(&mut model, MODEL_GRAPH, &graph);
        model
    }

    /// Of each operation whether one of `outputs` takes it, directly or through others. Operations stand behind
    /// those that they take.
    fn needed_for(&self, outputs: &BTreeSet<&str>) -> Vec<bool> {
        let mut wanted = outputs.clone();
        let mut needed = vec![false; self.nodes.len()];
        for (node, is_needed) in self.nodes.iter().zip(&mut needed).rev() {
            *is_needed = node.outputs.iter().any(|name| wanted.contains(name));
            if *is_needed {
                wanted.extend(&node.inputs);
            }
        }
        needed
    }

    fn graph_fields(&self) -> impl Iterator<Item = Field<'a>> {
        let graphs = fields(self.file).flatten().filter(|field| field.number == MODEL_GRAPH);
        graphs.filter_map(|field| field.bytes().ok()).flat_map(|graph| fields(graph).flatten())
    }
}

const MODEL_GRAPH: u64 = 7;
const MODEL_OPSET: u64 = 8;
const MODEL_TRAINING: u64 = 20;
const MODEL_FUNCTIONS: u64 = 25;
const GRAPH_NODE: u64 = 1;
const GRAPH_WEIGHTS: u64 = 5;
const GRAPH_INPUT: u64 = 11;
const GRAPH_OUTPUT: u64 = 12;
const GRAPH_VALUE_INFO: u64 = 13;
const GRAPH_SPARSE_WEIGHTS: u64 = 15;

/// The version of ONNX's own operators, if that is what the entry is about.
fn opset_version(opset: &[u8]) -> Result<Option<u64>, Malformed> {
    let (mut domain, mut version) = ("", 0);
    for field in fields(opset) {
        let field = field?;
        match field.number {
            1 => domain = field.text()?,
            2 => version = field.varint()?,
            _ => {}
        }
    }
    Ok(matches!(domain, "" | "ai.onnx").then_some(version))
}

impl<'a> Node<'a> {
    fn read(node: &'a [u8]) -> Result<Self, Problem> {
        let mut read = Self { window: 1, ..Self::default() };
        let mut domain = "";
        for field in fields(node) {
            let field = field?;
            match field.number {
                1 => read.inputs.push(field.text()?),
                2 => read.outputs.push(field.text()?),
                4 => read.operator = field.text()?,
                5 => read.read_attribute(field.bytes()?)?,
                7 => domain = field.text()?,
                _ => {}
            }
            if read.inputs.len() + read.outputs.len() > MAX_NODES {
                return refused(format!("has an operation with more than {MAX_NODES} tensors"));
            }
        }
        let operator = read.operator;
        if is_control_flow(operator) {
            return refused(format!(
                "loops or branches (operator {operator}), so that its time cannot be bounded: export it without"
            ));
        }
        if !matches!(domain, "" | "ai.onnx") {
            return refused(format!(
                "uses the operator {operator} of {domain:?}: export it with ONNX's own operators alone"
            ));
        }
        if work(operator).is_none() {
            return refused(format!(
                "uses the operator {operator:?}, which is unknown, or whose time and memory cannot be bounded"
            ));
        }
        Ok(read)
    }

    fn read_attribute(&mut self, attribute: &'a [u8]) -> Result<(), Problem> {
        let mut name = "";
        for field in fields(attribute) {
            let field = field?;
            match field.number {
                1 => name = field.text()?,
                // The tensor of a constant: its size is checked. What is not finite has uses there, in masks.
                5 | 10 => _ = Weights::read(field.bytes()?)?,
                8 if name == "kernel_shape" => {
                    field.varints(&mut |side| self.window = self.window.saturating_mul(side))?;
                }
                6 | 11 => {
                    return refused(
                        "loops or branches (an operation has a graph of its own): export it without",
                    );
                }
                22 | 23 => return refused("has sparse constants: export it with dense ones"),
                _ => {}
            }
        }
        // LRN calls its window `size`, and looks at channels, of which no network has more.
        if self.operator == "LRN" {
            self.window = self.window.max(64);
        }
        Ok(())
    }
}

fn tensor_name<'a>(field: &Field<'a>) -> Option<&'a str> {
    let name = fields(field.bytes().ok()?).flatten().find(|field| field.number == 1)?;
    name.text().ok()
}

impl<'a> Tensor<'a> {
    fn read(tensor: &'a [u8]) -> Result<Self, Problem> {
        let mut read = Self { name: "", is_float: false, dims: Vec::new() };
        for field in fields(tensor) {
            let field = field?;
            match field.number {
                1 => read.name = field.text()?,
                2 => read.read_type(field.bytes()?)?,
                _ => {}
            }
        }
        match read.name {
            "" => Err(Problem::Malformed),
            _ => Ok(read),
        }
    }

    /// TypeProto, in it TypeProto.Tensor, in it TensorShapeProto.
    fn read_type(&mut self, kind: &'a [u8]) -> Result<(), Problem> {
        for tensor in fields(kind) {
            let tensor = tensor?;
            // Other kinds than tensors are no pictures; they are refused by what they are not.
            if tensor.number != 1 {
                continue;
            }
            for field in fields(tensor.bytes()?) {
                let field = field?;
                match field.number {
                    1 => self.is_float = field.varint()? == FLOAT,
                    2 => {
                        for dim in fields(field.bytes()?) {
                            let dim = dim?;
                            if dim.number == 1 {
                                self.dims.push(Dim::read(dim.bytes()?)?);
                            }
                            if self.dims.len() > MAX_RANK {
                                return refused(format!("has tensors of more than {MAX_RANK} dimensions"));
                            }
                        }
                    }
                    _ => {}
                }
            }
        }
        Ok(())
    }
}

impl Tensor<'_> {
    /// Whether a tensor of `sizes` fits.
    pub fn takes(&self, sizes: &[u64]) -> bool {
        let fits = |(dim, size): (&Dim<'_>, &u64)| matches!(dim, Dim::Any(_)) || *dim == Dim::Size(*size);
        self.dims.len() == sizes.len() && self.dims.iter().zip(sizes).all(fits)
    }
}

impl<'a> Dim<'a> {
    fn read(dim: &'a [u8]) -> Result<Self, Problem> {
        let mut read = Self::Any("");
        for field in fields(dim) {
            let field = field?;
            match field.number {
                1 => read = Self::Size(field.varint()?),
                2 => read = Self::Any(field.text()?),
                _ => {}
            }
        }
        Ok(read)
    }
}

/// ValueInfoProto of 32-bit floats.
fn float_tensor(name: &str, dims: &[usize]) -> Vec<u8> {
    let mut shape = Vec::new();
    for &size in dims {
        let mut dim = Vec::new();
        put_varint(&mut dim, 1, size as u64);
        put_bytes(&mut shape, 1, &dim);
    }
    let mut tensor = Vec::new();
    put_varint(&mut tensor, 1, FLOAT);
    put_bytes(&mut tensor, 2, &shape);
    let mut kind = Vec::new();
    put_bytes(&mut kind, 1, &tensor);
    let mut info = Vec::new();
    put_bytes(&mut info, 1, name.as_bytes());
    put_bytes(&mut info, 2, &kind);
    info
}
