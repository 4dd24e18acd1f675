//! How much memory and work a network takes, told before it runs.
//!
//! ONNX Runtime itself says which sizes all tensors have for an input of a given size; it computes nothing for
//! that. A tensor whose size it cannot tell follows from what the network computes, and is refused.

use super::onnx::{Graph, Node};
use super::operators::{Work, rank_follows_from_values, work};
use super::runtime::{Runtime, first_line};
use ort::session::builder::GraphOptimizationLevel;
use ort::value::ValueType;
use std::collections::BTreeMap;

/// The most bytes of a tensor that a network computes.
const MAX_TENSOR_BYTES: u64 = 512 << 20;
/// The most bytes of all tensors that are needed at the same time, without the weights.
const MAX_LIVE_BYTES: u64 = 1 << 30;
/// The most multiplications, some seconds on one thread.
const MAX_WORK: u64 = 200_000_000_000;

/// The sizes of the tensors that a network computes, for one size of its input.
#[derive(Debug)]
pub(super) struct Sizes<'a> {
    tensors: BTreeMap<&'a str, Tensor>,
}

#[derive(Clone, Debug)]
struct Tensor {
    dims: Vec<usize>,
    n_bytes: u64,
    is_float: bool,
}

impl<'a> Sizes<'a> {
    /// Computes the sizes for an input of `dims`, and refuses what takes too much.
    /// The error ends a sentence that begins with the file's name.
    pub fn check(graph: &'a Graph<'_>, runtime: &Runtime, dims: &[usize]) -> Result<Self, String> {
        let told = told_by_runtime(graph, runtime, dims)?;
        let mut sizes = Self { tensors: BTreeMap::new() };
        for (&name, dims) in &graph.weights {
            sizes.tensors.insert(name, Tensor { dims: dims.clone(), n_bytes: 0, is_float: false });
        }
        for input in &graph.inputs {
            let n_bytes = 4 * elements(dims);
            sizes.tensors.insert(input.name, Tensor { dims: dims.to_vec(), n_bytes, is_float: true });
        }
        let mut total_work = 0_u64;
        for node in &graph.nodes {
            for &name in node.outputs.iter().filter(|name| !name.is_empty()) {
                let unknown = || {
                    format!(
                        "has a tensor whose size follows from what it computes, {name:?} of {}: export it for \
                         inputs of one size",
                        node.operator
                    )
                };
                let tensor = told.get(name).cloned().ok_or_else(unknown)?;
                if tensor.dims.is_empty() && !sizes.makes_scalar(graph, node) {
                    return Err(unknown());
                }
                if tensor.n_bytes > MAX_TENSOR_BYTES {
                    return Err(format!(
                        "asks for {} MiB for one tensor, {name:?} of {}; {} are the most",
                        tensor.n_bytes >> 20,
                        node.operator,
                        MAX_TENSOR_BYTES >> 20
                    ));
                }
                sizes.tensors.insert(name, tensor);
            }
            total_work = total_work.saturating_add(sizes.work_of(node)?);
        }
        if total_work > MAX_WORK {
            return Err(format!(
                "takes {} billion multiplications a picture; {} are the most",
                total_work / 1_000_000_000,
                MAX_WORK / 1_000_000_000
            ));
        }
        sizes.check_live(graph)?;
        Ok(sizes)
    }

    /// The dimensions of the output `name`; the error ends a sentence that begins with the file's name.
    pub fn of_output(&self, name: &str) -> Result<&[usize], String> {
        let tensor = self.tensors.get(name).ok_or_else(|| format!("has no tensor {name:?}"))?;
        match tensor.is_float {
            true => Ok(&tensor.dims),
            false => Err(format!("has no 32-bit floats in its output {name:?}: export it so")),
        }
    }

    /// Whether an output of `node` without dimensions is a single number. ONNX Runtime says no dimensions as
    /// well of tensors of which it knows nothing.
    fn makes_scalar(&self, graph: &Graph<'_>, node: &Node<'_>) -> bool {
        let decisive = match node.operator {
            "ConstantOfShape" => &node.inputs[..],
            operator if rank_follows_from_values(operator) => node.inputs.get(1..).unwrap_or_default(),
            _ => &[],
        };
        let is_given = |name: &&str| name.is_empty() || graph.weights.contains_key(name);
        let is_known = |name: &&str| name.is_empty() || self.tensors.contains_key(name);
        decisive.iter().all(is_given) && node.inputs.iter().all(is_known)
    }

    fn work_of(&self, node: &Node<'_>) -> Result<u64, String> {
        let mut dims = Vec::new();
        for &name in &node.inputs {
            let known = match name {
                "" => &[][..],
                _ => &self.tensors.get(name).ok_or_else(|| out_of_order(node))?.dims,
            };
            dims.push(known);
        }
        let input = |idx: usize| dims.get(idx).copied().unwrap_or_default();
        let outputs = node.outputs.iter().filter_map(|name| self.tensors.get(name));
        let out: u64 = outputs.map(|tensor| elements(&tensor.dims)).sum();
        let into = dims.iter().map(|dims| elements(dims)).fold(0, u64::saturating_add);
        let one_filter = |idx: usize| elements(input(idx).get(1..).unwrap_or_default());
        let heavy = match work(node.operator) {
            Some(Work::Convolution { filters }) => out.saturating_mul(one_filter(filters)),
            Some(Work::Transposed { filters }) => elements(input(0)).saturating_mul(one_filter(filters)),
            Some(Work::Product) => {
                let longest = input(0).iter().copied().max().unwrap_or(1);
                out.saturating_mul(longest as u64)
            }
            Some(Work::Window) => out.saturating_mul(node.window),
            // Each index stands in two of the three at least, or is summed away before.
            Some(Work::Einsum) if dims.len() <= 2 => {
                let sides = [elements(input(0)), elements(input(1)), out];
                sides.iter().map(|&side| side.max(1) as f64).product::<f64>().sqrt() as u64
            }
            Some(Work::Einsum) | None => u64::MAX,
            // Interpolation looks at up to 16 neighbors.
            Some(Work::Elements) if node.operator == "Resize" => out.saturating_mul(16),
            Some(Work::Elements) => 0,
        };
        Ok(heavy.saturating_add(out).saturating_add(into))
    }

    /// Walks through the operations as ONNX Runtime does: a tensor is freed behind its last reader.
    fn check_live(&self, graph: &Graph<'_>) -> Result<(), String> {
        let mut last_reader = BTreeMap::new();
        for (node_idx, node) in graph.nodes.iter().enumerate() {
            for &name in node.inputs.iter().chain(&node.outputs) {
                last_reader.insert(name, node_idx);
            }
        }
        for output in &graph.outputs {
            last_reader.insert(output.name, graph.nodes.len());
        }
        let (mut live, mut most) = (0_u64, 0);
        let bytes = |name: &&str| self.tensors.get(name).map_or(0, |tensor| tensor.n_bytes);
        for (node_idx, node) in graph.nodes.iter().enumerate() {
            live += node.outputs.iter().map(&bytes).sum::<u64>();
            most = most.max(live);
            let mut freed: Vec<_> = node.inputs.iter().chain(&node.outputs).collect();
            freed.sort_unstable();
            freed.dedup();
            let is_last = |name: &&&str| {
                last_reader.get(**name) == Some(&node_idx)
                    && !graph.inputs.iter().any(|input| input.name == **name)
            };
            live -= freed.into_iter().filter(is_last).map(&bytes).sum::<u64>();
        }
        match most > MAX_LIVE_BYTES {
            true => Err(format!("needs {} MiB at a time; {} are the most", most >> 20, MAX_LIVE_BYTES >> 20)),
            false => Ok(()),
        }
    }
}

/// Asks ONNX Runtime for the sizes of all that `graph` computes. Those it does not know are left out.
fn told_by_runtime(
    graph: &Graph<'_>,
    runtime: &Runtime,
    dims: &[usize],
) -> Result<BTreeMap<String, Tensor>, String> {
    let names = graph.nodes.iter().flat_map(|node| node.outputs.iter().copied());
    let file = graph.rewritten(dims, &names.filter(|name| !name.is_empty()).collect());
    // Without optimization nothing is computed beforehand, however large it would be.
    let builder = runtime
        .session(GraphOptimizationLevel::Disable)
        .and_then(|builder| Ok(builder.with_prepacking(false)?));
    let session = builder
        .and_then(|mut builder| builder.commit_from_memory(&file))
        .map_err(|error| format!("is refused by ONNX Runtime: {}", first_line(&error.to_string())))?;
    let mut told = BTreeMap::new();
    for output in session.outputs() {
        let ValueType::Tensor { ty, shape, .. } = output.dtype() else { continue };
        let dims: Option<Vec<usize>> = shape.iter().map(|&size| usize::try_from(size).ok()).collect();
        let Some(dims) = dims else { continue };
        let n_bytes = elements(&dims).saturating_mul(ty.byte_size(1).unwrap_or(16) as u64);
        let is_float = *ty == ort::value::TensorElementType::Float32;
        told.insert(output.name().to_owned(), Tensor { dims, n_bytes, is_float });
    }
    Ok(told)
}

fn out_of_order(node: &Node<'_>) -> String {
    format!("has an operation {} before what it works on: save it again with the package onnx", node.operator)
}

fn elements(dims: &[usize]) -> u64 {
    dims.iter().fold(1, |n, &dim| n.saturating_mul(dim as u64))
}
