//! A network that a model looks through.

use crate::file::networks::{CarriedNetwork, Networks};
use crate::look::local::LocalFeatures;
use roomsight_vision::camera::{CameraKind, View};
use roomsight_vision::detect::Keypoint;
use roomsight_vision::image::Image;
use roomsight_vision::matrix::Matrix;
use roomsight_vision::network::{
    Around, FrameInput, Input, Network, NetworkError, Outputs, Runtime, Size, XFeat,
};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The network that is taken where none is named.
pub const DEFAULT_NETWORK: &str = "efficientnet-lite0";

/// A network, and how frames are laid before it. What is read from a file is only a name; [`Lens::link`] gives it
/// the network.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Lens {
    /// The network's name: that of its files, without endings.
    pub network: String,
    /// Width and height of its input; those of its description if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<Size>,
    /// How frames of cameras that see all around are laid before it.
    pub around: Around,
    #[serde(skip)]
    linked: Option<Arc<Linked>>,
}

/// The same network in the same way, whether linked or not.
impl PartialEq for Lens {
    fn eq(&self, other: &Self) -> bool {
        (&self.network, self.size, self.around) == (&other.network, other.size, other.around)
    }
}

impl Default for Lens {
    fn default() -> Self {
        Self { network: DEFAULT_NETWORK.to_owned(), size: None, around: Around::Views { n: 8 }, linked: None }
    }
}

/// A network that can run.
#[derive(Debug)]
struct Linked {
    carried: Arc<CarriedNetwork>,
    network: Network,
    runtime: Runtime,
    size: Size,
    vector_len: Option<usize>,
    /// By name.
    grid_lens: Vec<(String, usize)>,
}

/// What a network said of a frame.
pub(crate) struct Look<'a> {
    input: FrameInput<'a>,
    /// Of each view; `None` where it saw nothing.
    views: Vec<Option<Outputs>>,
}

impl Lens {
    /// Through the default network, at this size.
    pub(crate) fn of_size(width: u32, height: u32, around: Around) -> Self {
        Self { size: Some(Size { width, height }), around, ..Self::default() }
    }

    /// Gives it the network of its name, which is tried once. The error says what to do.
    pub(crate) fn link(&mut self, networks: &Networks) -> Result<(), NetworkError> {
        let name = &self.network;
        let carried = networks.get(name).ok_or_else(|| NetworkError::NotThere(name.clone()))?;
        let linked = Linked::new(carried, name, self.size)?;
        self.linked = Some(Arc::new(linked));
        Ok(())
    }

    /// What it is linked to.
    pub(crate) fn carried(&self) -> Option<&Arc<CarriedNetwork>> {
        self.linked.as_ref().map(|linked| &linked.carried)
    }

    /// What is wrong with it, if anything.
    pub(crate) fn check(&self) -> Result<(), String> {
        match &self.linked {
            Some(linked) => self.around.check(linked.size),
            None => Err(format!("the network {} is not there", self.network)),
        }
    }

    /// The numbers of its vector; 0 where it has none.
    pub(crate) fn vector_len(&self) -> usize {
        self.linked.as_ref().and_then(|linked| linked.vector_len).unwrap_or_default()
    }

    /// The numbers of a cell of a grid; 0 where it has none of this name.
    pub(crate) fn grid_len(&self, grid: &str) -> usize {
        let grids = self.linked.iter().flat_map(|linked| &linked.grid_lens);
        grids.filter(|(name, _)| name == grid).map(|(_, len)| *len).next().unwrap_or_default()
    }

    /// Whether it finds keypoints as XFeat does.
    pub(crate) fn has_xfeat(&self) -> bool {
        self.linked.as_ref().is_some_and(|linked| linked.network.description().xfeat.is_some())
    }

    /// Whether frames of a camera are laid before the network in the same way.
    pub(crate) fn looks_as(&self, other: &Self, camera: CameraKind) -> bool {
        let is_around = camera != CameraKind::Perspective;
        (&self.network, self.size) == (&other.network, other.size)
            && (!is_around || self.around == other.around)
    }

    /// Makes it ready for so many threads at once, so that none has to wait on its first frame.
    pub(crate) fn prepare(&self, n_threads: usize) -> Result<(), NetworkError> {
        let Some(Linked { network, runtime, size, .. }) = self.linked.as_deref() else { return Ok(()) };
        network.prepare(runtime, *size, n_threads)
    }

    /// Runs the network on a frame; `None` where it is not linked or cannot run.
    pub(crate) fn look<'v>(&self, frame: &Image, view: &'v View) -> Option<Look<'v>> {
        let Linked { network, runtime, size, .. } = &**self.linked.as_ref()?;
        let mut session = network.lend(runtime, *size).ok()?;
        let description: &Input = &network.description().input;
        let input = FrameInput::of(frame, view, &self.around, *size, description);
        let views = input.views().map(|view| session.run(view)).collect();
        Some(Look { input, views })
    }
}

impl Linked {
    fn new(carried: &Arc<CarriedNetwork>, name: &str, size: Option<Size>) -> Result<Self, NetworkError> {
        let network = carried.open(name)?.clone();
        let runtime = Runtime::get()?;
        let size = size.unwrap_or(network.description().input.size);
        let session = network.lend(&runtime, size)?;
        let grids = network.description().grids.keys();
        let grid_lens = grids.filter_map(|name| Some((name.clone(), session.grid_len(name)?))).collect();
        let (carried, vector_len) = (Arc::clone(carried), session.vector_len());
        drop(session);
        Ok(Self { carried, network, runtime, size, vector_len, grid_lens })
    }
}

impl Look<'_> {
    /// The mean of the vectors of all views, of length 1; empty where nothing was seen.
    pub(crate) fn vector(&self) -> Vec<f32> {
        let mut sum: Vec<f32> = Vec::new();
        for vector in self.views.iter().flatten().filter_map(Outputs::vector) {
            sum.resize(vector.len(), 0.0);
            sum.iter_mut().zip(&vector).for_each(|(sum, value)| *sum += value);
        }
        let length = sum.iter().map(|value| value * value).sum::<f32>().sqrt();
        if length <= 0.0 {
            return Vec::new();
        }
        sum.iter_mut().for_each(|value| *value /= length);
        sum
    }

    /// The cells of a grid, where they lie in the frame. `n_dimensions` is that of a cell.
    pub(crate) fn grid(&self, name: &str, n_dimensions: usize) -> LocalFeatures {
        self.placed(n_dimensions, |outputs| outputs.grid(name).map(|grid| (grid.keypoints, grid.rows)))
    }

    /// The keypoints of XFeat, at most so many.
    pub(crate) fn xfeat(&self, target: usize) -> LocalFeatures {
        let xfeat = XFeat { target: target.div_ceil(self.views.len().max(1)) };
        self.placed(XFeat::N_DIMENSIONS, |outputs| outputs.xfeat().map(|maps| xfeat.keypoints(&maps)))
    }

    fn placed(
        &self,
        n_dimensions: usize,
        found: impl Fn(&Outputs) -> Option<(Vec<Keypoint>, Matrix)>,
    ) -> LocalFeatures {
        let mut local = LocalFeatures::nothing(n_dimensions);
        for (view_idx, outputs) in self.views.iter().enumerate() {
            let Some((keypoints, descriptors)) = outputs.as_ref().and_then(&found) else { continue };
            let (keypoints, descriptors) = self.input.to_frame(view_idx, &keypoints, &descriptors);
            local.keypoints.extend(keypoints);
            descriptors.rows().for_each(|row| local.descriptors.push_row(row));
        }
        local
    }
}
