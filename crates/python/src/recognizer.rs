//! A model, and the working memories of the threads that use it.

use crate::filter::{Filter, Filtered, RoomProbability, by_probability};
use crate::frame::Frame;
use crate::{FrameError, ModelError};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use roomsight_recognition::model::{
    self, LoadedModel, Model, N_NEAREST, NearFrame, Pose, PoseEstimate, Recognition, Scan, Scratch, Unknown,
};
use roomsight_vision::network::Runtime;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// A model that recognizes frames; several threads may use it at the same time.
#[pyclass(frozen, module = "roomsight._core")]
pub struct Recognizer {
    model: Arc<Model>,
    digest: String,
    /// Those that no thread uses now.
    scratches: Mutex<Vec<Scratch>>,
}

/// What a frame shows, as `roomsight.Recognition` has it.
#[derive(IntoPyObject)]
struct Seen {
    room: String,
    known: bool,
    unknown: Option<String>,
    novelty: Option<f32>,
    probability: f32,
    probabilities: Vec<RoomProbability>,
    keypoints: usize,
    damaged_rows: usize,
    nearest: Option<Vec<NearestFrame>>,
    pose: Option<FramePose>,
    filtered: Option<Filtered>,
}

/// As `roomsight.NearestFrame` has it.
#[derive(IntoPyObject)]
struct NearestFrame {
    opinion: String,
    frame: String,
    drive: String,
    room: String,
    nearness: f32,
    points: Vec<[f32; 2]>,
}

/// As `roomsight.FramePose` has it: meters and radians.
#[derive(IntoPyObject)]
struct FramePose {
    x: f64,
    y: f64,
    angle: f64,
    radius: f64,
}

/// A scan: the angle of the first beam, from one to the next, the longest range, and the ranges.
#[derive(FromPyObject)]
struct Sweep(f32, f32, f32, Vec<f32>);

/// An answer, and the training frames and the pose that explain it, where they were asked for.
struct Explained {
    recognition: Recognition,
    damaged_rows: usize,
    nearest: Option<Vec<NearFrame>>,
    pose: Option<PoseEstimate>,
}

#[pymethods]
impl Recognizer {
    /// Loads the model in a folder. `onnx_runtime` is the library for models that look through networks.
    #[new]
    #[pyo3(signature = (folder, onnx_runtime=None))]
    fn open(py: Python<'_>, folder: PathBuf, onnx_runtime: Option<PathBuf>) -> PyResult<Self> {
        py.detach(move || {
            if let Some(library) = onnx_runtime {
                Runtime::name_library(library);
            }
            let refused = |error| {
                ModelError::new_err(format!(
                    "{} holds no model that can be loaded: {error}",
                    folder.display()
                ))
            };
            let LoadedModel { model, digest } = Model::load(&folder).map_err(refused)?;
            Ok(Self { model: Arc::new(model), digest, scratches: Mutex::default() })
        })
    }

    /// The rooms that it tells apart, by name.
    #[getter]
    fn rooms(&self) -> Vec<String> {
        self.model.rooms().to_vec()
    }

    /// The BLAKE3 digest of its file.
    #[getter]
    fn digest(&self) -> &str {
        &self.digest
    }

    /// A filter that has seen nothing.
    #[pyo3(signature = (trust=None))]
    fn filter(&self, trust: Option<f32>) -> PyResult<Filter> {
        Filter::new(Arc::clone(&self.model), trust)
    }

    /// What a frame shows; with a filter also what it and those before it say together.
    #[pyo3(signature = (frame, top=None, explain=false, filter=None, elapsed=0.0, odometry=None, scan=None))]
    #[allow(clippy::too_many_arguments, reason = "Python names them")]
    fn recognize(
        &self,
        py: Python<'_>,
        frame: &Bound<'_, PyAny>,
        top: Option<usize>,
        explain: bool,
        filter: Option<&Filter>,
        elapsed: f64,
        odometry: Option<[f64; 3]>,
        scan: Option<Sweep>,
    ) -> PyResult<Seen> {
        if filter.is_some_and(|filter| !filter.is_of(&self.model)) {
            return Err(PyValueError::new_err("the filter is of another model"));
        }
        let frame = Frame::of(frame, self.model.wants_colors())?;
        py.detach(|| {
            let scan = scan.map(|sweep| self.scan(sweep)).transpose()?;
            let image = frame.decoded(&self.model)?;
            let seen = model::Frame { image: &image, scan: scan.as_ref() };
            let explained = self.explained(seen, explain);
            let at = odometry.map(|[x, y, angle]| Pose { x, y, angle });
            let filtered = filter.map(|filter| filter.update(&explained.recognition, elapsed, at, top));
            Ok(self.seen(explained, filtered, top))
        })
    }
}

impl Recognizer {
    /// A scan that the model can look at, if it does.
    fn scan(&self, Sweep(start, step, max_range, ranges): Sweep) -> PyResult<Scan> {
        let refused = |reason: &dyn std::fmt::Display| FrameError::new_err(reason.to_string());
        let scan = Scan::new(start, step, max_range, ranges).map_err(|error| refused(&error))?;
        self.model.extractor().check_scan(&scan).map_err(|error| refused(&error))?;
        Ok(scan)
    }

    fn explained(&self, frame: model::Frame, explain: bool) -> Explained {
        let free = || self.scratches.lock().unwrap_or_else(PoisonError::into_inner);
        let mut scratch = free().pop().unwrap_or_default();
        let damaged_rows = frame.image.damaged_rows();
        let explained = if explain {
            let features = self.model.features(frame, &mut scratch);
            Explained {
                recognition: self.model.classify(&features),
                damaged_rows,
                nearest: Some(self.model.nearest(&features, N_NEAREST)),
                pose: self.model.pose(&features),
            }
        } else {
            let recognition = self.model.recognize(frame, &mut scratch);
            Explained { recognition, damaged_rows, nearest: None, pose: None }
        };
        free().push(scratch);
        explained
    }

    fn seen(&self, explained: Explained, filtered: Option<Filtered>, top: Option<usize>) -> Seen {
        let rooms = self.model.rooms();
        let Explained { recognition, damaged_rows, nearest, pose } = explained;
        let near = |NearFrame { opinion, name, drive, room_idx, nearness, points, .. }: NearFrame| {
            NearestFrame { opinion, frame: name, drive, room: rooms[room_idx].clone(), nearness, points }
        };
        Seen {
            room: rooms[recognition.room_idx].clone(),
            known: recognition.known,
            unknown: recognition.unknown.and_then(name),
            novelty: recognition.novelty,
            probability: recognition.probability(),
            probabilities: by_probability(rooms, &recognition.probabilities, top),
            keypoints: recognition.n_keypoints,
            damaged_rows,
            nearest: nearest.map(|nearest| nearest.into_iter().map(near).collect()),
            pose: pose.map(|PoseEstimate { pose, radius }| FramePose {
                x: pose.x,
                y: pose.y,
                angle: pose.angle,
                radius,
            }),
            filtered,
        }
    }
}

/// What it is called wherever it travels.
fn name(why: Unknown) -> Option<String> {
    serde_json::to_value(why).ok()?.as_str().map(str::to_owned)
}
