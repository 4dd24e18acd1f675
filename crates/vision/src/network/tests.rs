//! Networks that tests make, read, refused and run.

use super::description::Description;
use super::testing::*;
use super::{MAX_NODES, Network, NetworkError, Runtime, Size, lock};
use proptest::prelude::*;
use std::path::Path;

const EMBEDDING: &str = "[vector]\noutput = \"embedding\"\n";
const SMALL: Size = Size { width: 16, height: 8 };

fn network(model: &Model, tables: &str) -> Result<Network, NetworkError> {
    Network::new("made", model.bytes().into(), &described(model, tables))
}

/// The sentence with which `model` is refused before ONNX Runtime sees it.
fn refusal(model: &Model) -> String {
    network(model, EMBEDDING).expect_err("it is refused").to_string()
}

/// The sentence with which a session of `model` is refused.
fn session_refusal(runtime: &Runtime, model: &Model, tables: &str) -> String {
    network(model, tables).unwrap().tried(runtime, SMALL).expect_err("it is refused").to_string()
}

/// A picture whose red, green and blue is `color(x, y)`.
fn picture(size: Size, color: impl Fn(u32, u32) -> [f32; 3]) -> Vec<f32> {
    let pixels = |plane: usize| {
        let color = &color;
        (0..size.height).flat_map(move |y| (0..size.width).map(move |x| color(x, y)[plane]))
    };
    (0..3).flat_map(pixels).collect()
}

fn close(left: &[f32], right: &[f32]) -> bool {
    left.len() == right.len() && left.iter().zip(right).all(|(left, right)| (left - right).abs() < 1e-5)
}

fn unit<const N: usize>(row: [f32; N]) -> [f32; N] {
    let length = row.iter().map(|number| number * number).sum::<f32>().sqrt();
    row.map(|number| number / length)
}

#[test]
fn a_convolution_gives_a_vector_and_a_grid_in_one_pass() {
    let Some(runtime) = runtime("running a convolution") else { return };
    let grid = "[grids.all]\noutput = \"map\"\n";
    let network = network(&convolution(), &format!("{EMBEDDING}{grid}")).unwrap();
    for size in [SMALL, Size { width: 8, height: 24 }] {
        let mut session = network.tried(&runtime, size).unwrap();
        assert_eq!(
            (session.vector_len(), session.grid_len("all"), session.grid_len("other")),
            (Some(4), Some(4), None)
        );
        // Red grows to the right, green is everywhere, the first pixel has no color at all.
        let input = picture(size, |x, y| if x + y == 0 { [0.0; 3] } else { [x as f32, 2.0, -1.0] });
        let outputs = session.run(&input).unwrap();
        let grid = outputs.grid("all").unwrap();
        let n_cells = (size.width * size.height / 4) as usize;
        assert_eq!((grid.keypoints.len(), grid.rows.n_rows()), (n_cells - 1, n_cells - 1), "one saw nothing");
        let first = grid.keypoints[0];
        assert_eq!((first.x, first.y), (2.5, 0.5));
        assert!(close(grid.rows.row(0), &unit([2.0, 2.0, 0.0, 3.0])), "{:?}", grid.rows.row(0));
        assert!((first.response - 17_f32.sqrt()).abs() < 1e-5);
        let reds = (0..size.width).step_by(2).sum::<u32>() as f32 * (size.height / 2) as f32;
        let cells = n_cells as f32 - 1.0;
        let mean = unit([reds, 2.0 * cells, 0.0, reds + cells]);
        assert!(close(&outputs.vector().unwrap(), &mean), "{:?} is not {mean:?}", outputs.vector());
    }
}

#[test]
fn maps_are_pooled_as_the_description_says() {
    let Some(runtime) = runtime("pooling maps") else { return };
    let tables = "[vector]\noutput = \"map\"\npooling = \"generalized_mean\"\n";
    let mut session = network(&convolution(), tables).unwrap().session(&runtime, SMALL).unwrap();
    // One cell of red 2, the others of green 1.
    let input = picture(SMALL, |x, y| if x + y == 0 { [2.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] });
    let expected = unit([8_f32.cbrt(), 31_f32.cbrt(), 0.0, 39_f32.cbrt()]);
    let vector = session.run(&input).unwrap().vector().unwrap();
    assert!(close(&vector, &expected), "{vector:?} is not {expected:?}");
    let black = vec![0.0; input.len()];
    assert_eq!(session.run(&black).unwrap().vector(), None, "black has no direction");
}

#[test]
fn a_transformer_gives_its_class_token_and_its_patches() {
    let Some(runtime) = runtime("running a transformer") else { return };
    let tables = "[vector]\noutput = \"last_hidden_state\"\npooling = \"class_token\"\n\
                  [grids.patches]\noutput = \"last_hidden_state\"\nclass_tokens = 1\n";
    let network = network(&transformer(), tables).unwrap();
    let size = Size { width: 24, height: 16 };
    let mut session = network.tried(&runtime, size).unwrap();
    let outputs = session.run(&picture(size, |x, y| [1.0, (x / 8) as f32, (y / 8) as f32])).unwrap();
    assert!(close(&outputs.vector().unwrap(), &unit([5.0, 6.0, 7.0])));
    let grid = outputs.grid("patches").unwrap();
    let places: Vec<_> = grid.keypoints.iter().map(|keypoint| (keypoint.x, keypoint.y)).collect();
    assert_eq!(places, [(3.5, 3.5), (11.5, 3.5), (19.5, 3.5), (3.5, 11.5), (11.5, 11.5), (19.5, 11.5)]);
    for (cell_idx, row) in grid.rows.rows().enumerate() {
        let expected = unit([1.0, (cell_idx % 3) as f32, (cell_idx / 3) as f32]);
        assert!(close(row, &expected), "cell {cell_idx}: {row:?} is not {expected:?}");
    }
    assert!((grid.keypoints[0].response - 2.0).abs() < 1e-5, "doubled");
    let odd = tables.replace("class_tokens = 1", "class_tokens = 2");
    let said = session_refusal(&runtime, &transformer(), &odd);
    assert!(said.contains("do not make a grid"), "{said}");
}

#[test]
fn files_that_are_no_networks_are_refused() {
    let whole = convolution().bytes();
    let texts: [&[u8]; 4] = [b"", b"This is not a network.", &whole[..whole.len() / 2], &whole[1..]];
    for bytes in texts {
        let description = described(&convolution(), EMBEDDING)
            .replace(&*blake3::hash(&whole).to_hex(), &blake3::hash(bytes).to_hex());
        let said = Network::new("made", bytes.into(), &description).unwrap_err().to_string();
        assert!(said.starts_with("the network made is no ONNX file"), "{said}");
    }
}

#[test]
fn another_file_than_the_described_one_is_refused() {
    let said = Network::new("made", transformer().bytes().into(), &described(&convolution(), EMBEDDING));
    let said = said.unwrap_err().to_string();
    assert!(said.contains("is another than its description is about"), "{said}");
}

#[test]
fn what_cannot_be_bounded_or_is_broken_is_refused_before_the_runtime() {
    type Change = fn(&mut Graph);
    let changes: [(&str, Change); 13] = [
        ("loops or branches (operator Loop)", |graph| graph.nodes[1].operator = "Loop".to_owned()),
        ("loops or branches (operator If)", |graph| graph.nodes[1].operator = "If".to_owned()),
        ("a graph of its own", |graph| {
            let inner = Attribute { graph: Some(Graph::default()), kind: 5, ..Attribute::default() };
            graph.nodes[1].attributes.push(inner);
        }),
        ("uses the operator \"Frobnicate\"", |graph| graph.nodes[1].operator = "Frobnicate".to_owned()),
        ("uses the operator \"LSTM\"", |graph| graph.nodes[1].operator = "LSTM".to_owned()),
        ("of \"com.microsoft\"", |graph| graph.nodes[1].domain = "com.microsoft".to_owned()),
        ("not numbers or infinite, \"filters\"", |graph| {
            graph.weights[0].raw[..4].copy_from_slice(&f32::NAN.to_le_bytes());
        }),
        ("not numbers or infinite, \"filters\"", |graph| {
            graph.weights[0].raw[44..].copy_from_slice(&f32::NEG_INFINITY.to_le_bytes());
        }),
        ("weights of other sizes than it says, \"filters\"", |graph| graph.weights[0].dims[0] = 1 << 34),
        ("weights of other sizes than it says, \"filters\"", |graph| {
            graph.weights[0].raw.clear();
            graph.weights[0].dims = vec![1 << 34];
        }),
        ("weights of other sizes than it says, \"filters\"", |graph| graph.weights[0].dims[0] = -1),
        ("keeps weights in other files", |graph| graph.weights[0].location = 1),
        ("makes the tensor \"map\" twice", |graph| graph.nodes[0].outputs = vec!["map".to_owned()]),
    ];
    for (expected, change) in changes {
        let mut model = convolution();
        change(model.graph());
        let said = refusal(&model);
        assert!(
            said.starts_with("the network made ") && said.contains(expected),
            "{said} lacks {expected:?}"
        );
    }
    let mut many = convolution();
    many.graph().nodes = vec![node("Relu", "image", "", vec![]); MAX_NODES + 1];
    assert!(refusal(&many).contains("more than 10000 operations"));
    let mut old = convolution();
    old.opsets[0].version = 9;
    assert!(refusal(&old).contains("opset 11 or newer"));
}

/// A network that computes `asks_for` from nothing or from the picture, then a vector of 4 from both.
fn greedy(nodes: Vec<Node>, weights: Vec<Tensor>) -> Model {
    let mut model = convolution();
    let graph = model.graph();
    graph.nodes.extend(nodes);
    graph.nodes.push(node("ReduceMax", "asks_for", "most", vec![int("keepdims", 0)]));
    graph.nodes.push(node("Add", "embedding most", "greedy", vec![]));
    graph.weights.extend(weights);
    model
}

#[test]
fn what_asks_for_too_much_memory_or_work_is_refused_before_it_runs() {
    let Some(runtime) = runtime("bounding memory") else { return };
    let huge = 1_i64 << 34;
    let doubling = |times: usize| {
        let name = |idx: usize| if idx == times { "asks_for".to_owned() } else { format!("double{idx}") };
        let mut nodes = vec![node("Identity", "image", &name(0), vec![])];
        nodes.extend((0..times).map(|idx| {
            let inputs = format!("{} {}", name(idx), name(idx));
            node("Concat", &inputs, &name(idx + 1), vec![int("axis", 1)])
        }));
        nodes
    };
    let of_values = vec![
        node("ReduceMax", "image", "value", vec![int("keepdims", 0)]),
        node("Cast", "value", "whole", vec![int("to", 7)]),
        node("Reshape", "whole one", "sizes", vec![]),
        node("ConstantOfShape", "sizes", "asks_for", vec![]),
    ];
    let of_unknown_rank = vec![
        node("ReduceMax", "image", "value", vec![int("keepdims", 0)]),
        node("Cast", "value", "whole", vec![int("to", 7)]),
        node("Reshape", "whole one", "sizes", vec![]),
        node("Expand", "sizes sizes", "more_sizes", vec![]),
        node("Expand", "value more_sizes", "asks_for", vec![]),
    ];
    let cases = [
        (
            "for one tensor",
            vec![node("ConstantOfShape", "sizes", "asks_for", vec![])],
            vec![numbers("sizes", &[huge])],
        ),
        (
            "for one tensor",
            vec![node("Expand", "filters sizes", "asks_for", vec![])],
            vec![numbers("sizes", &[huge, 4, 3, 1, 1])],
        ),
        (
            "for one tensor",
            vec![node("Tile", "image times", "asks_for", vec![])],
            vec![numbers("times", &[1, 1, 1 << 20, 1 << 14])],
        ),
        ("for one tensor", doubling(40), vec![]),
        ("follows from what it computes", of_values, vec![numbers("one", &[1])]),
        ("follows from what it computes", of_unknown_rank, vec![numbers("one", &[1])]),
    ];
    for (expected, nodes, weights) in cases {
        let said = session_refusal(&runtime, &greedy(nodes, weights), "[vector]\noutput = \"greedy\"\n");
        assert!(said.contains(expected), "{said} lacks {expected:?}");
    }
    // Each fits, all together do not.
    let many = (0..6).map(|idx| node("Expand", "most_of_all sizes", &format!("part{idx}"), vec![]));
    let mut nodes = vec![node("ReduceMax", "image", "most_of_all", vec![int("keepdims", 0)])];
    nodes.extend(many);
    nodes.push(node("Sum", "part0 part1 part2 part3 part4 part5", "asks_for", vec![]));
    let said = session_refusal(
        &runtime,
        &greedy(nodes, vec![numbers("sizes", &[60 << 20])]),
        "[vector]\noutput = \"greedy\"\n",
    );
    assert!(said.contains("MiB at a time"), "{said}");
    // Products without end.
    let mut nodes = vec![node("Expand", "most_of_all sizes", "square0", vec![])];
    nodes.insert(0, node("ReduceMax", "image", "most_of_all", vec![int("keepdims", 0)]));
    nodes.extend((0..20).map(|idx| {
        let out = if idx == 19 { "asks_for".to_owned() } else { format!("square{}", idx + 1) };
        node("MatMul", &format!("square{idx} square{idx}"), &out, vec![])
    }));
    let said = session_refusal(
        &runtime,
        &greedy(nodes, vec![numbers("sizes", &[3000, 3000])]),
        "[vector]\noutput = \"greedy\"\n",
    );
    assert!(said.contains("billion multiplications"), "{said}");
}

#[test]
fn what_the_description_says_is_held_against_the_network() {
    let Some(runtime) = runtime("holding descriptions against networks") else { return };
    let mut one_size = convolution();
    one_size.graph().inputs = vec![value("image", &[1, 3, 32, 32])];
    let said = session_refusal(&runtime, &one_size, EMBEDDING);
    assert!(said.contains("takes 1 x 3 x 32 x 32 of 32-bit floats, and not 1 x 3 x 8 x 16"), "{said}");
    let mut other_name = convolution();
    other_name.graph().inputs[0].name = "pixels".to_owned();
    other_name.graph().nodes[0].inputs[0] = "pixels".to_owned();
    assert!(
        session_refusal(&runtime, &other_name, EMBEDDING)
            .contains("has the input \"pixels\", and not \"image\"")
    );
    let mut two = convolution();
    two.graph().inputs.push(value("mask", &[1]));
    assert!(session_refusal(&runtime, &two, EMBEDDING).contains("has 2 inputs"));
    for (tables, expected) in [
        ("[vector]\noutput = \"nothing\"\n", "has no tensor \"nothing\""),
        (
            "[vector]\noutput = \"map\"\npooling = \"class_token\"\n",
            "has no class token in its output \"map\"",
        ),
        ("[grids.all]\noutput = \"embedding\"\n", "has one vector for all cells"),
        (
            "[xfeat]\nfeatures = \"map\"\nkeypoints = \"map\"\nreliability = \"map\"\n",
            "has no output of XFeat",
        ),
    ] {
        let said = session_refusal(&runtime, &convolution(), tables);
        assert!(said.contains(expected), "{said} lacks {expected:?}");
    }
    let network = network(&convolution(), EMBEDDING).unwrap();
    let said = network.session(&runtime, Size { width: 12, height: 8 }).unwrap_err().to_string();
    assert!(said.contains("multiples of 8 up to 64"), "{said}");
    // Sizes that do not fit each other are ONNX Runtime's to find, some of them only when it runs.
    let mut broken = convolution();
    broken.graph().weights[0] = floats("filters", &[2, 6, 1, 1], &[1.0; 12]);
    let said = session_refusal(&runtime, &broken, EMBEDDING);
    assert!(said.contains("failed: ") && said.contains("kernel channels") && !said.contains('\n'), "{said}");
}

#[test]
fn numbers_that_are_not_finite_are_an_error_at_load_and_nothing_seen_later() {
    let Some(runtime) = runtime("numbers that are not finite") else { return };
    let mut model = convolution();
    let graph = model.graph();
    graph.nodes.push(node("Log", "embedding", "logarithms", vec![]));
    let network = network(&model, "[vector]\noutput = \"logarithms\"\n").unwrap();
    let mut session = network.session(&runtime, SMALL).unwrap();
    assert!(session.run(&picture(SMALL, |_, _| [2.0; 3])).is_some());
    assert!(session.run(&picture(SMALL, |_, _| [0.0; 3])).is_none(), "the logarithm of 0");
    let mut always = convolution();
    always.graph().nodes.push(node("Sub", "embedding embedding", "zero", vec![]));
    always.graph().nodes.push(node("Log", "zero", "logarithms", vec![]));
    let said = session_refusal(&runtime, &always, "[vector]\noutput = \"logarithms\"\n");
    assert!(said.contains("was tried on a gray picture, and has numbers"), "{said}");
}

#[test]
fn a_network_without_a_description_says_what_to_start_from() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.onnx");
    std::fs::write(&path, convolution().bytes()).unwrap();
    let NetworkError::NoDescription { path: beside, text } = Network::open(&path).unwrap_err() else {
        panic!("another error")
    };
    assert_eq!(beside, folder.path().join("mine.toml"));
    std::fs::write(&beside, &text).unwrap();
    let network = Network::open(&path).unwrap();
    assert_eq!(network.name(), "mine");
    assert_eq!(network.description().vector.as_ref().unwrap().output, "embedding");
    assert_eq!(network.description().grids["map"].output, "map");
    let Some(runtime) = runtime("running from the description to start from") else { return };
    network.tried(&runtime, network.description().input.size).unwrap();
    std::fs::write(&path, transformer().bytes()).unwrap();
    std::fs::remove_file(&beside).unwrap();
    let NetworkError::NoDescription { text, .. } = Network::open(&path).unwrap_err() else {
        panic!("another error")
    };
    std::fs::write(&beside, text).unwrap();
    Network::open(&path).unwrap().tried(&runtime, Size { width: 224, height: 224 }).unwrap();
}

#[test]
fn the_description_to_start_from_can_be_read_whatever_names_the_outputs_have() {
    let start = |names: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.onnx");
        let mut model = convolution();
        model.graph().outputs = names.iter().map(|name| value(name, &[1, 4])).collect();
        std::fs::write(&path, model.bytes()).unwrap();
        match Network::open(&path) {
            Err(NetworkError::NoDescription { text, .. }) => text,
            other => panic!("{other:?}"),
        }
    };
    let two = start(&["embedding", "logits", "embedding"]);
    assert_eq!(Description::read(&two).unwrap().vector.unwrap().output, "embedding");
    assert_eq!(two.matches("embedding").count(), 1, "{two}");
    assert!(two.contains("# output = \"logits\""), "{two}");
    let strange = "of \"all\" \\ kinds\u{1}\n\u{7f}\u{301}";
    assert_eq!(Description::read(&start(&[strange])).unwrap().vector.unwrap().output, strange);
}

#[test]
fn descriptions_with_mistakes_say_what_is_wrong() {
    let right = described(&convolution(), EMBEDDING);
    for (from, to, expected) in [
        ("license", "licence", "unknown field `licence`"),
        ("size = [16, 8]", "size = [0, 8]", "must be from 1 to 4096"),
        ("scale = [1.0, ", "scale = [0.0, ", "no scale 0"),
        ("mean = [0.0, ", "mean = [nan, ", "must be numbers"),
        ("longest_side = 64", "longest_side = 100000", "longest_side must be"),
        ("multiple_of = 8", "multiple_of = 0", "multiple_of must be"),
        ("multiple_of = 8", "order = \"gray\"", "unknown variant `gray`"),
        (EMBEDDING, "", "must name outputs"),
        ("digest = ", "digits = ", "unknown field `digits`"),
    ] {
        let text = right.replacen(from, to, 1);
        let said = Network::new("made", convolution().bytes().into(), &text).unwrap_err().to_string();
        assert!(
            said.starts_with("the description of the network made: ") && said.contains(expected),
            "{said}"
        );
    }
    let description = Description::read(&right).unwrap();
    assert_eq!(Description::read(&toml::to_string(&description).unwrap()), Ok(description));
}

#[test]
fn missing_files_are_named() {
    let said = Network::open(Path::new("nowhere/none.onnx")).unwrap_err().to_string();
    assert!(said.starts_with("nowhere/none.onnx: "), "{said}");
}

#[test]
fn what_outputs_take_that_are_not_described_is_not_computed() {
    let Some(runtime) = runtime("limiting a network to some outputs") else { return };
    // The logarithm is infinite, so that computing it would be seen.
    let mut model = convolution();
    model.graph().nodes.push(node("Log", "embedding", "logarithms", vec![]));
    let grid = "[grids.all]\noutput = \"map\"\n";
    let black = vec![0.0; 3 * 16 * 8];
    let answer = |tables: &str| {
        let network = network(&model, tables).unwrap();
        network.session(&runtime, SMALL).unwrap().run(&black)
    };
    assert!(answer(&format!("[vector]\noutput = \"logarithms\"\n{grid}")).is_none());
    let outputs = answer(grid).unwrap();
    assert_eq!((outputs.vector(), outputs.grid("all").unwrap().rows.n_rows()), (None, 0));
}

#[test]
fn prepared_sessions_are_as_many_as_threads_use_them() {
    let Some(runtime) = runtime("preparing sessions of a network") else { return };
    let network = network(&convolution(), "[grids.all]\noutput = \"map\"\n").unwrap();
    let n_sessions = || lock(&network.sessions).n_of(SMALL);
    let used = network.lend(&runtime, SMALL).unwrap();
    network.prepare(&runtime, SMALL, 3).unwrap();
    assert_eq!(n_sessions(), 3, "one of them is in use");
    let all = [0, 1].map(|_| network.lend(&runtime, SMALL).unwrap());
    assert_eq!((n_sessions(), lock(&network.sessions).idle.len()), (3, 0));
    drop((used, all));
    network.prepare(&runtime, SMALL, 2).unwrap();
    assert_eq!((n_sessions(), lock(&network.sessions).idle.len()), (3, 3));
}

proptest! {
    #[test]
    fn damaged_files_are_refused_or_run(
        is_transformer: bool,
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        let (model, output) =
            if is_transformer { (transformer(), "last_hidden_state") } else { (convolution(), "map") };
        let mut bytes = model.bytes();
        for (place, byte) in damage {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        let digest = blake3::hash(&bytes).to_hex();
        let text = described(&model, &format!("[grids.all]\noutput = \"{output}\"\n"));
        let text = text.replace(&*blake3::hash(&model.bytes()).to_hex(), &digest);
        if let Ok(network) = Network::new("damaged", bytes.into(), &text)
            && let Some(runtime) = runtime("running damaged networks")
            && let Ok(mut session) = network.tried(&runtime, SMALL)
        {
            let _ = session.run(&picture(SMALL, |x, y| [x as f32, y as f32, 1.0]));
        }
    }
}
