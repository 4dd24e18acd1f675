//! A folder of frames, models and a memory, written once by `roomsight-bench prepare` and read by those that measure:
//! neither rendering nor training is measured, and under valgrind both would take minutes.
//!
//! Of each camera: `00.jpeg` and so on, `00.pgm` with their luma for others to read, and `model`, a model file. Of the memory
//! its parts, as numbers.

use crate::drive::{Drive, decode};
use crate::raw;
use crate::world::{N_PLACES, World};
use roomsight_lab::simulate::CameraKind;
use roomsight_recognition::classify::memory::{self, Memory, Origin, Parts};
use roomsight_recognition::classify::svm::{Calibration, LinearSvm, Scheme};
use roomsight_recognition::model::{Config, Extractor, Features, Model, Representation, Sample, Scratch};
use roomsight_recognition::vocabulary::Vocabulary;
use roomsight_vision::image::Image;
use roomsight_vision::matrix::Matrix;
use safetensors::SafeTensors;
use std::fs;
use std::path::Path;

/// Of the frames that answer; along the drive that makes some thirty.
pub const FRAMES_PER_SECOND: f32 = 0.2;

/// Frames whose answers the memory is asked for.
const N_QUERIES: usize = 50;

/// Frames of one camera, and the default model that was trained on them.
pub struct Prepared {
    /// As JPEGs.
    pub jpegs: Vec<Vec<u8>>,
    /// Their luma.
    pub images: Vec<Image>,
    /// What the model sees in them.
    pub features: Vec<Features>,
    /// The model of the papers.
    pub model: Model,
    /// The parts of that model.
    pub parts: MachineParts,
}

/// What a model does after describing, in its parts.
pub struct MachineParts {
    /// Descriptors to bags.
    pub vocabulary: Vocabulary,
    /// Bags to decision values.
    pub svm: LinearSvm,
    /// Decision values to probabilities.
    pub calibration: Calibration,
}

impl Prepared {
    /// Trains the default model on a drive and writes both to `folder`, which need not be there.
    pub fn write(folder: &Path, drive: &Drive) {
        fs::create_dir_all(folder).unwrap();
        for (idx, (jpeg, image)) in drive.jpegs.iter().zip(&drive.images).enumerate() {
            fs::write(folder.join(format!("{idx:02}.jpeg")), jpeg).unwrap();
            let mut pgm = format!("P5\n{} {}\n255\n", image.width(), image.height()).into_bytes();
            pgm.extend(image.pixels());
            fs::write(folder.join(format!("{idx:02}.pgm")), pgm).unwrap();
        }
        fs::write(folder.join("model"), train(drive).to_bytes().unwrap()).unwrap();
    }

    /// Reads `n_frames` of those in `folder`, evenly spread, or all where there are fewer.
    pub fn read(folder: &Path, n_frames: usize) -> Self {
        let mut paths: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        paths.retain(|path| path.extension().is_some_and(|extension| extension == "jpeg"));
        paths.sort();
        let n_frames = n_frames.min(paths.len());
        let spread = (0..n_frames).map(|idx| &paths[idx * paths.len() / n_frames]);
        let jpegs: Vec<Vec<u8>> = spread.map(|path| fs::read(path).unwrap()).collect();
        let images: Vec<Image> = jpegs.iter().map(|jpeg| decode(jpeg)).collect();
        let bytes = fs::read(folder.join("model")).unwrap();
        let model = Model::from_bytes(&bytes).unwrap();
        let mut scratch = Scratch::default();
        let features = images.iter().map(|image| model.features(image, &mut scratch)).collect();
        let parts = MachineParts::read(&bytes, &model);
        Self { jpegs, images, features, model, parts }
    }
}

/// The default model, trained on a drive.
fn train(drive: &Drive) -> Model {
    let config = Config::default();
    let extractor = Extractor::new(&config, drive.camera.clone());
    let mut scratch = Scratch::default();
    let mut sample = |(image, room): (&Image, &String)| Sample {
        room: room.clone(),
        sequence: String::new(),
        name: String::new(),
        pose: None,
        picture: None,
        features: extractor.extract(image, &mut scratch),
    };
    let samples: Vec<Sample> = drive.images.iter().zip(&drive.rooms).map(&mut sample).collect();
    let samples: Vec<&Sample> = samples.iter().collect();
    Model::train(&samples, &config, drive.camera.clone(), |_| ()).unwrap().model
}

impl MachineParts {
    fn read(file: &[u8], model: &Model) -> Self {
        let file = SafeTensors::deserialize(file).unwrap();
        let floats = |name: &str| raw::numbers::<f32>(file.tensor(&format!("bag/{name}")).unwrap().data());
        let matrix = |name: &str| {
            let n_cols = file.tensor(&format!("bag/{name}")).unwrap().shape()[1];
            Matrix::from_vec(floats(name), n_cols).unwrap()
        };
        let Some(Representation::Bag(bag)) =
            model.config().machines().map(|machines| &machines.representation)
        else {
            panic!("no bag by default")
        };
        let n_rooms = model.rooms().len();
        let rho = floats("svm.rho");
        // How many vectors support the machines says nothing of what they cost.
        let n_support_vectors = vec![0; rho.len()];
        let svm =
            LinearSvm::from_parts(Scheme::OneVsAll, n_rooms, matrix("svm.weights"), rho, n_support_vectors);
        let (slopes, offsets) = (floats("calibration.slopes"), floats("calibration.offsets"));
        Self {
            vocabulary: Vocabulary::new(
                matrix("vocabulary.centers"),
                bag,
                model.camera().projection.kind().sees_all_around(),
            ),
            svm: svm.unwrap(),
            calibration: Calibration::from_parts(Scheme::OneVsAll, n_rooms, slopes, offsets).unwrap(),
        }
    }
}

/// The name of a camera, as of its folder.
pub fn camera_name(camera: CameraKind) -> String {
    format!("{camera:?}").to_lowercase()
}

/// Writes a memory of 320,000 descriptors, and frames to ask it about, to `folder`, which need not be there.
pub fn write_memory(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let mut world = World::default();
    let parts = world.remembered().to_parts();
    let floats = |name: &str, values: &[f32]| raw::write(&folder.join(name), values);
    floats("components", parts.components.as_slice());
    floats("offsets", &parts.offsets);
    floats("scale", &[parts.scale]);
    raw::write(&folder.join("words"), &parts.words);
    raw::write(&folder.join("codes"), &parts.codes);
    let lengths: Vec<u32> = parts.list_lengths.iter().map(|&length| length as u32).collect();
    raw::write(&folder.join("list_lengths"), &lengths);
    raw::write(&folder.join("frame_idxs"), &parts.frame_idxs);
    let rooms: Vec<u32> = parts.origins.iter().map(|origin| origin.room_idx as u32).collect();
    raw::write(&folder.join("rooms"), &rooms);
    for idx in 0..N_QUERIES {
        floats(&format!("query_{idx:02}"), world.frame().as_slice());
    }
}

/// Reads it again, with so many of the frames.
pub fn read_memory(folder: &Path, n_frames: usize) -> (Memory, Vec<Matrix>) {
    let floats = |name: &str| raw::read::<f32>(&folder.join(name));
    let offsets = floats("offsets");
    let components = floats("components");
    let n_inputs = components.len() / offsets.len();
    let rooms = raw::read::<u32>(&folder.join("rooms"));
    let origin = |(frame_idx, &room_idx)| Origin { room_idx: room_idx as usize, frame_idx };
    let parts = Parts {
        components: Matrix::from_vec(components, n_inputs).unwrap(),
        offsets,
        scale: floats("scale")[0],
        words: raw::read(&folder.join("words")),
        codes: raw::read(&folder.join("codes")),
        list_lengths: raw::read::<u32>(&folder.join("list_lengths")).iter().map(|&n| n as usize).collect(),
        frame_idxs: raw::read(&folder.join("frame_idxs")),
        origins: rooms.iter().enumerate().map(origin).collect(),
    };
    let memory = Memory::from_parts(parts, &memory::Config::default(), N_PLACES).unwrap();
    let query = |idx| Matrix::from_vec(floats(&format!("query_{idx:02}")), n_inputs).unwrap();
    (memory, (0..n_frames.min(N_QUERIES)).map(query).collect())
}
