//! What belongs to a network beside its ONNX file: how pictures become its input, what comes out of it, where it
//! is from.

use super::onnx::{Dim, Graph};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

/// The longest side of an input, where a network takes many sizes and says nothing.
const DEFAULT_LONGEST: u32 = 1024;
/// The longest side that any network may be given.
const MAX_SIDE: u32 = 4096;

/// Columns and rows of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(from = "[u32; 2]", into = "[u32; 2]")]
pub struct Size {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl From<[u32; 2]> for Size {
    fn from([width, height]: [u32; 2]) -> Self {
        Self { width, height }
    }
}

impl From<Size> for [u32; 2] {
    fn from(size: Size) -> Self {
        [size.width, size.height]
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} x {}", self.width, self.height)
    }
}

/// The TOML file `NAME.toml` beside `NAME.onnx`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// BLAKE3 of the ONNX file, in hexadecimal digits.
    pub digest: String,
    /// Under which license the weights may be used.
    pub license: String,
    /// Where the weights come from.
    pub origin: String,
    /// How a picture becomes the network's input.
    pub input: Input,
    /// The output that describes the picture as a whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vector: Option<VectorOutput>,
    /// The outputs that describe the picture cell by cell, by names of their own.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub grids: BTreeMap<String, GridOutput>,
    /// The outputs of a network that finds keypoints as XFeat does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub xfeat: Option<XFeatOutputs>,
}

/// How a picture becomes the network's input: `1 x 3 x height x width` floats, `(value - mean) * scale`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// The tensor's name in the ONNX file.
    pub name: String,
    /// Width and height that it takes, and is given where nothing else is asked for.
    pub size: Size,
    /// Other sizes are taken as well if both sides are multiples of this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub multiple_of: Option<u32>,
    /// The longest side of such sizes; 1024 if it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub longest_side: Option<u32>,
    /// Taken from each value of a pixel, which is 0 to 255: red, green, blue, whatever the order.
    pub mean: [f32; 3],
    /// What is left is multiplied by this: red, green, blue, whatever the order.
    pub scale: [f32; 3],
    /// Which color comes first.
    #[serde(default)]
    pub order: ColorOrder,
}

/// The order of the three planes of an input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ColorOrder {
    /// Red, green, blue.
    #[default]
    Rgb,
    /// Blue, green, red.
    Bgr,
}

/// The output that describes the picture as a whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VectorOutput {
    /// The tensor's name: `1 x C`, a map `1 x C x H x W`, or tokens `1 x N x C` of a transformer.
    pub output: String,
    /// What makes one vector of a map or of tokens.
    #[serde(default)]
    pub pooling: Pooling,
    /// Of tokens: how many come before those of the patches.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class_tokens: Option<usize>,
}

/// How one vector is made of many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pooling {
    /// Their mean.
    #[default]
    Mean,
    /// The third root of the mean of third powers, of what is above 0 (Radenović et al., "Fine-tuning CNN image
    /// retrieval with no human annotation", 2018, equation 3 with p = 3).
    GeneralizedMean,
    /// The first token of a transformer.
    ClassToken,
}

/// An output that describes the picture cell by cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridOutput {
    /// The tensor's name: a map `1 x C x H x W`, or tokens `1 x N x C` of a transformer, row by row.
    pub output: String,
    /// Of tokens: how many come before those of the patches, 1 if it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class_tokens: Option<usize>,
}

/// The outputs of XFeat (Potje et al., "XFeat: Accelerated Features for Lightweight Image Matching", 2024), each at
/// an eighth of the input's size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct XFeatOutputs {
    /// Descriptors, `1 x 64 x H/8 x W/8`.
    pub features: String,
    /// Scores of the 64 pixels of a cell, and of none, `1 x 65 x H/8 x W/8`.
    pub keypoints: String,
    /// How far each descriptor can be relied on, `1 x 1 x H/8 x W/8`.
    pub reliability: String,
}

impl Description {
    /// Reads and checks the text of a TOML file. The error is a sentence about the file.
    pub fn read(toml: &str) -> Result<Self, String> {
        let description: Self = toml::from_str(toml).map_err(|error| error.to_string().trim().to_owned())?;
        description.check()?;
        Ok(description)
    }

    fn check(&self) -> Result<(), String> {
        let Input { size, multiple_of, longest_side, mean, scale, .. } = &self.input;
        let longest = longest_side.unwrap_or(DEFAULT_LONGEST);
        if !(1..=MAX_SIDE).contains(&longest) {
            return Err(format!("input.longest_side must be from 1 to {MAX_SIDE}, not {longest}"));
        }
        if ![size.width, size.height].iter().all(|side| (1..=MAX_SIDE).contains(side)) {
            return Err(format!("the sides of input.size must be from 1 to {MAX_SIDE}, not {size}"));
        }
        if multiple_of.is_some_and(|step| !(1..=MAX_SIDE).contains(&step)) {
            return Err(format!("input.multiple_of must be from 1 to {MAX_SIDE}"));
        }
        if !mean.iter().chain(scale).all(|number| number.is_finite()) || scale.contains(&0.0) {
            return Err("input.mean and input.scale must be numbers, and no scale 0".to_owned());
        }
        if self.outputs().next().is_none() {
            return Err("at least one of [vector], [grids.NAME] and [xfeat] must name outputs".to_owned());
        }
        Ok(())
    }

    /// Whether pictures of `size` are taken; if not, the error says which are.
    pub fn check_size(&self, size: Size) -> Result<(), String> {
        let Input { size: fixed, multiple_of, longest_side, .. } = &self.input;
        let longest = longest_side.unwrap_or(DEFAULT_LONGEST);
        let fits = |side: u32, step: u32| side > 0 && side <= longest && side.is_multiple_of(step);
        match *multiple_of {
            _ if size == *fixed => Ok(()),
            Some(step) if fits(size.width, step) && fits(size.height, step) => Ok(()),
            Some(step) => Err(format!(
                "takes sides that are multiples of {step} up to {longest}, or {fixed}, and not {size}"
            )),
            None => Err(format!("takes pictures of {fixed} alone, and not {size}")),
        }
    }

    /// The names of all tensors that are wanted; one may be there twice.
    pub(super) fn outputs(&self) -> impl Iterator<Item = &str> {
        let vector = self.vector.iter().map(|vector| &vector.output);
        let grids = self.grids.values().map(|grid| &grid.output);
        let xfeat = self.xfeat.iter();
        let xfeat = xfeat.flat_map(|xfeat| [&xfeat.features, &xfeat.keypoints, &xfeat.reliability]);
        vector.chain(grids).chain(xfeat).map(String::as_str)
    }

    /// The TOML to start from, where there is none: what the ONNX file says itself, and for the rest what most
    /// networks take. It has one vector, and others as comments.
    pub(super) fn to_start_from(graph: &Graph<'_>, digest: &str) -> String {
        let (name, dims) = graph.inputs.first().map_or(("image", &[][..]), |input| (input.name, &input.dims));
        let side = |idx: usize| match dims.get(idx) {
            Some(Dim::Size(size)) => *size,
            _ => 224,
        };
        let (width, height) = (side(3), side(2));
        let many = match dims.get(2) {
            Some(Dim::Any(_)) => "multiple_of = 32\n",
            _ => "",
        };
        let mut text = format!(
            "digest = \"{digest}\"\nlicense = \"?\"\norigin = \"?\"\n\n\
             [input]\nname = {}\nsize = [{width}, {height}]\n{many}\
             # ImageNet's, of values from 0 to 255.\n\
             mean = [123.675, 116.28, 103.53]\nscale = [0.01712475, 0.017507, 0.01742919]\norder = \"rgb\"\n",
            quoted(name)
        );
        let (mut has_vector, mut seen) = (false, BTreeSet::new());
        for output in graph.outputs.iter().filter(|output| seen.insert(output.name)) {
            let dims: Vec<String> = output.dims.iter().map(ToString::to_string).collect();
            let name = quoted(output.name);
            let table = match output.dims.len() {
                2 if has_vector => format!("# [vector]\n# output = {name}"),
                2 => format!("[vector]\noutput = {name}"),
                3 => format!("[grids.{name}]\noutput = {name}\nclass_tokens = 1"),
                4 => format!("[grids.{name}]\noutput = {name}"),
                _ => continue,
            };
            has_vector |= output.dims.len() == 2;
            // Names of dimensions are texts of the file too, and a comment ends with its line.
            let dims = dims.join(" x ").replace(char::is_control, "?");
            // Writing into a text cannot fail.
            let _ = write!(text, "\n# {dims}\n{table}\n");
        }
        text
    }
}

/// A text as TOML has it on one line.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted.push_str(&format!("\\u{:04x}", u32::from(c))),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}
