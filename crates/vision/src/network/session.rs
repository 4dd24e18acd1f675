//! A network, ready to run on one thread for inputs of one size.

use super::budget::Sizes;
use super::description::{Description, Size};
use super::onnx::Graph;
use super::outputs::{Forms, Outputs};
use super::runtime::{Runtime, first_line};
use ort::session::builder::GraphOptimizationLevel;
use ort::value::TensorRef;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A network, ready to run on one thread for inputs of one size. It holds the weights once more, in the order
/// that suits the processor.
#[derive(Debug)]
pub struct Session {
    session: ort::session::Session,
    size: Size,
    forms: Arc<Forms>,
}

impl Session {
    /// The error ends a sentence that begins with the network's name.
    pub(super) fn new(
        onnx: &[u8],
        description: &Description,
        runtime: &Runtime,
        size: Size,
    ) -> Result<Self, String> {
        description.check_size(size)?;
        let graph = Graph::read(onnx)?;
        check_input(&graph, description, size)?;
        let dims = [1, 3, size.height as usize, size.width as usize];
        let sizes = Sizes::check(&graph, runtime, &dims)?;
        let forms = Arc::new(Forms::new(description, &sizes, size)?);
        let outputs: BTreeSet<&str> = description.outputs().collect();
        let file = graph.rewritten(&dims, &outputs);
        let session = runtime
            .session(GraphOptimizationLevel::All)
            .and_then(|mut builder| builder.commit_from_memory(&file))
            .map_err(|error| format!("is refused by ONNX Runtime: {}", first_line(&error.to_string())))?;
        Ok(Self { session, size, forms })
    }

    /// The size of the pictures that it takes.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The numbers of a vector; `None` where the network has none.
    pub fn vector_len(&self) -> Option<usize> {
        self.forms.vector_len()
    }

    /// The numbers of a row of the grid `name`; `None` where the network has none of that name.
    pub fn grid_len(&self, name: &str) -> Option<usize> {
        self.forms.grid_len(name)
    }

    /// Runs the network on a picture, `3 x height x width` floats as [`super::Input`] says. `None` where it failed, or
    /// what came out is no number somewhere: it saw nothing then. Panics when the input has another length.
    pub fn run(&mut self, input: &[f32]) -> Option<Outputs> {
        self.try_run(input).ok()
    }

    /// The same, with the reason.
    pub(super) fn try_run(&mut self, input: &[f32]) -> Result<Outputs, String> {
        let Size { width, height } = self.size;
        assert_eq!(input.len(), 3 * width as usize * height as usize, "an input of another size");
        let failed = |error: ort::Error| format!("failed: {}", first_line(&error.to_string()));
        let shape = [1, 3, height as usize, width as usize];
        let input = TensorRef::from_array_view((shape, input)).map_err(failed)?;
        let outputs = self.session.run(ort::inputs![input]).map_err(failed)?;
        let mut tensors = BTreeMap::new();
        for (name, value) in &outputs {
            let (_, values) = value.try_extract_tensor::<f32>().map_err(failed)?;
            if !values.iter().all(|value| value.is_finite()) {
                return Err(format!("has numbers in its output {name:?} that are not finite"));
            }
            tensors.insert(name.to_owned(), values.to_vec());
        }
        Ok(Outputs { forms: Arc::clone(&self.forms), tensors })
    }
}

/// Whether the network takes a picture of `size`, as its description says.
fn check_input(graph: &Graph<'_>, description: &Description, size: Size) -> Result<(), String> {
    let name = &description.input.name;
    let [input] = &graph.inputs[..] else {
        let names: Vec<_> = graph.inputs.iter().map(|input| input.name).collect();
        return Err(format!("has {} inputs, {names:?}: one picture is all that it is given", names.len()));
    };
    if input.name != name {
        return Err(format!("has the input {:?}, and not {name:?}, as its description says", input.name));
    }
    let wanted = [1, 3, u64::from(size.height), u64::from(size.width)];
    if !input.is_float || !input.takes(&wanted) {
        let dims: Vec<String> = input.dims.iter().map(ToString::to_string).collect();
        let kind = if input.is_float { "32-bit floats" } else { "something else than 32-bit floats" };
        return Err(format!(
            "takes {} of {kind}, and not 1 x 3 x {} x {} of 32-bit floats, as its description says",
            dims.join(" x "),
            size.height,
            size.width
        ));
    }
    Ok(())
}
