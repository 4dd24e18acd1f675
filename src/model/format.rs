//! The model file: all arrays as safetensors, everything else as one JSON text in its metadata.
//!
//! | array | type and shape |
//! |---|---|
//! | `vocabulary.centers` | f32, words x dimensions |
//! | `svm.weights` | f32, machines x words |
//! | `svm.rho` | f32, machines |
//! | `svm.n_support_vectors` | u32, machines |
//! | `calibration.slopes`, `calibration.offsets` | f32, machines |
//! | `camera.mask` | u8, height x width; only with a mask |

use super::{Card, Classification, Classifier, Config, Extractor, Model, Representation};
use crate::camera::{Camera, Mask, Projection};
use crate::image::Image;
use crate::matrix::Matrix;
use crate::svm::{Calibration, LinearSvm};
use crate::vocabulary::Vocabulary;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, HashMap};

/// The version of the file's layout. A file of another version is refused.
pub const FORMAT_VERSION: u32 = 1;

/// The longest header that is read; it holds names and shapes, not arrays.
const MAX_HEADER_BYTES: u64 = 16 << 20;

const METADATA_KEY: &str = "roomsight";

/// Why bytes are no model; the text says what is wrong.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// Not a safetensors file, or damaged.
    #[error("not a roomsight model, or damaged: {0}")]
    NotAModel(String),
    /// A model of another layout.
    #[error(
        "the model has format version {found}; this program reads version {FORMAT_VERSION}: \
         train it again or use another version of roomsight"
    )]
    OtherVersion {
        /// The version it has.
        found: u32,
    },
    /// A model whose parts do not fit.
    #[error("the model is damaged: {0}")]
    Damaged(String),
}

/// All that is not an array.
#[derive(Serialize, Deserialize)]
struct Metadata {
    format_version: u32,
    places: Vec<String>,
    camera: Projection,
    known_probability: f32,
    config: Config,
    card: Card,
}

/// Read first, so that other versions are told apart from damage.
#[derive(Deserialize)]
struct Version {
    format_version: u32,
}

impl Model {
    /// The model file. The same model always gives the same bytes.
    pub fn to_bytes(&self) -> Result<Vec<u8>, FormatError> {
        let damaged = |error: &dyn std::fmt::Display| FormatError::Damaged(error.to_string());
        let metadata = Metadata {
            format_version: FORMAT_VERSION,
            places: self.places.clone(),
            camera: self.camera().projection,
            known_probability: self.known_probability(),
            config: self.config.clone(),
            card: self.card.clone(),
        };
        let metadata = serde_json::to_string(&metadata).map_err(|error| damaged(&error))?;
        let Classification { vocabulary, svm, calibration, .. } = &self.classification;
        let n_support_vectors: Vec<u8> =
            svm.n_support_vectors().iter().flat_map(|&count| (count as u32).to_le_bytes()).collect();
        let n_machines = svm.rho().len();
        let mut arrays = vec![
            (
                "vocabulary.centers",
                Dtype::F32,
                shape(vocabulary.centers()),
                bytes(vocabulary.centers().as_slice()),
            ),
            ("svm.weights", Dtype::F32, shape(svm.weights()), bytes(svm.weights().as_slice())),
            ("svm.rho", Dtype::F32, vec![n_machines], bytes(svm.rho())),
            ("svm.n_support_vectors", Dtype::U32, vec![n_machines], n_support_vectors),
            ("calibration.slopes", Dtype::F32, vec![n_machines], bytes(calibration.slopes())),
            ("calibration.offsets", Dtype::F32, vec![n_machines], bytes(calibration.offsets())),
        ];
        if let Some(mask) = &self.camera().mask {
            let picture = mask.picture();
            let shape = vec![picture.height(), picture.width()];
            arrays.push(("camera.mask", Dtype::U8, shape, picture.pixels().to_vec()));
        }
        let views: Result<Vec<_>, _> = arrays
            .iter()
            .map(|(name, dtype, shape, bytes)| {
                TensorView::new(*dtype, shape.clone(), bytes).map(|view| (*name, view))
            })
            .collect();
        let views = views.map_err(|error| damaged(&error))?;
        let metadata = HashMap::from([(METADATA_KEY.to_owned(), metadata)]);
        safetensors::serialize(views, Some(metadata)).map_err(|error| damaged(&error))
    }

    /// Reads a model file of unknown origin. A model that comes out cannot fail to recognize.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FormatError> {
        let not_a_model = |error: &dyn std::fmt::Display| FormatError::NotAModel(error.to_string());
        let header_length = bytes.first_chunk().map(|length| u64::from_le_bytes(*length));
        if header_length.is_none_or(|length| length > MAX_HEADER_BYTES) {
            return Err(FormatError::NotAModel("no safetensors header".to_owned()));
        }
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| not_a_model(&error))?;
        let json = header.metadata().as_ref().and_then(|metadata| metadata.get(METADATA_KEY));
        let json =
            json.ok_or_else(|| FormatError::NotAModel("a safetensors file of something else".into()))?;
        let version: Version = serde_json::from_str(json).map_err(|error| not_a_model(&error))?;
        if version.format_version != FORMAT_VERSION {
            return Err(FormatError::OtherVersion { found: version.format_version });
        }
        let metadata: Metadata =
            serde_json::from_str(json).map_err(|error| FormatError::Damaged(error.to_string()))?;
        let file = SafeTensors::deserialize(bytes).map_err(|error| not_a_model(&error))?;
        from_parts(metadata, &file)
    }
}

fn from_parts(metadata: Metadata, file: &SafeTensors) -> Result<Model, FormatError> {
    let Metadata { places, camera, known_probability, config, card, .. } = metadata;
    config.check().map_err(FormatError::Damaged)?;
    let distinct: BTreeSet<&str> = places.iter().map(String::as_str).collect();
    require(distinct.len() == places.len() && places.len() >= 2, "its rooms are not distinct")?;
    require(known_probability.is_finite(), "the probability from which answers are known is no number")?;
    if let Projection::Omnidirectional(mirror) = camera {
        require(mirror.is_valid(), "its mirror is no ring")?;
    }
    let Representation::Bag(bag) = &config.representation;
    let Classifier::LinearSvm(classifier) = &config.classifier;

    let centers = matrix(file, "vocabulary.centers")?;
    require(centers.n_cols() == config.descriptor.n_dimensions(), "its words fit no descriptor")?;
    require(centers.n_rows() == bag.n_words, "its vocabulary has another number of words than it says")?;
    let is_center = |word: &[f32]| word.iter().map(|value| value * value).sum::<f32>() < 1.001;
    require(centers.rows().all(is_center), "a word is no mean of descriptors")?;
    let weights = matrix(file, "svm.weights")?;
    require(weights.n_cols() == bag.n_words, "its machines fit no vocabulary")?;
    let n_support_vectors = array(file, "svm.n_support_vectors", Dtype::U32, 1)?.1;
    let n_support_vectors = n_support_vectors.as_chunks().0.iter();
    let n_support_vectors = n_support_vectors.map(|&count| u32::from_le_bytes(count) as usize).collect();
    let refused = |error: crate::svm::SvmError| FormatError::Damaged(error.to_string());
    let (scheme, n_places) = (classifier.scheme, places.len());
    let svm = LinearSvm::from_parts(scheme, n_places, weights, vector(file, "svm.rho")?, n_support_vectors)
        .map_err(refused)?;
    let slopes = vector(file, "calibration.slopes")?;
    let calibration = Calibration::from_parts(scheme, n_places, slopes, vector(file, "calibration.offsets")?)
        .map_err(refused)?;
    let camera = Camera { projection: camera, mask: mask(file)? };
    Ok(Model {
        places,
        extractor: Extractor::new(&config, camera),
        classification: Classification {
            vocabulary: Vocabulary::new(centers, bag.normalization),
            svm,
            calibration,
            known_probability,
        },
        config,
        card,
    })
}

fn mask(file: &SafeTensors) -> Result<Option<Mask>, FormatError> {
    if file.tensor("camera.mask").is_err() {
        return Ok(None);
    }
    let (shape, pixels) = array(file, "camera.mask", Dtype::U8, 2)?;
    let picture = Image::from_pixels(shape[1], shape[0], pixels.to_vec());
    picture
        .map(|picture| Some(Mask::new(picture)))
        .ok_or_else(|| FormatError::Damaged("its mask is empty".into()))
}

fn matrix(file: &SafeTensors, name: &str) -> Result<Matrix, FormatError> {
    let (shape, bytes) = array(file, name, Dtype::F32, 2)?;
    Matrix::from_vec(floats(bytes), shape[1])
        .ok_or_else(|| FormatError::Damaged(format!("{name} has no columns")))
}

fn vector(file: &SafeTensors, name: &str) -> Result<Vec<f32>, FormatError> {
    Ok(floats(array(file, name, Dtype::F32, 1)?.1))
}

/// Shape and little-endian bytes of an array of this type and number of dimensions.
fn array<'a>(
    file: &SafeTensors<'a>,
    name: &str,
    dtype: Dtype,
    n_dimensions: usize,
) -> Result<(Vec<usize>, &'a [u8]), FormatError> {
    let tensor =
        file.tensor(name).map_err(|_| FormatError::Damaged(format!("the array {name} is missing")))?;
    if tensor.dtype() != dtype || tensor.shape().len() != n_dimensions {
        return Err(FormatError::Damaged(format!("the array {name} has another type or shape")));
    }
    Ok((tensor.shape().to_vec(), tensor.data()))
}

fn require(condition: bool, otherwise: &str) -> Result<(), FormatError> {
    if condition { Ok(()) } else { Err(FormatError::Damaged(otherwise.to_owned())) }
}

fn shape(matrix: &Matrix) -> Vec<usize> {
    vec![matrix.n_rows(), matrix.n_cols()]
}

fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|&value| f32::from_le_bytes(value)).collect()
}
