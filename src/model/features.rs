//! A frame to keypoints and descriptors: what training and recognition have in common.

use super::{Config, Cue, FrameLbpCue};
use crate::camera::{Camera, View};
use crate::describe::{Descriptor, Sections};
use crate::detect::{Detector, Keypoint};
use crate::image::Image;
use crate::matrix::Matrix;
use crate::plane::ScaleSpace;

/// Finds and describes keypoints as a model was configured to.
#[derive(Clone, Debug)]
pub struct Extractor {
    longest_side: usize,
    detector: Detector,
    descriptor: Descriptor,
    cue: Option<Cue>,
    camera: Camera,
}

/// What a frame shows, before it is classified.
#[derive(Clone, Debug)]
pub struct Features {
    /// Keypoints in pixels of the frame at working size.
    pub keypoints: Vec<Keypoint>,
    /// One row a keypoint.
    pub descriptors: Matrix,
    /// What the cue sees of the whole frame; empty without one.
    pub frame: Vec<f32>,
    /// Pixels of the frame as it came for one pixel at working size, at least 1.
    pub scale: f32,
}

/// Working memory of one thread, reused from frame to frame.
#[derive(Debug, Default)]
pub struct Scratch {
    /// The valid region for the last frame's size.
    view: Option<View>,
    /// Of the last frame, if keypoints were looked for in one.
    space: ScaleSpace,
    /// Of the cue, with the size of the frames that they are for.
    sections: Option<((usize, usize), Sections)>,
}

impl Extractor {
    /// What `config` says, for frames of `camera`.
    pub fn new(config: &Config, camera: Camera) -> Self {
        Self {
            longest_side: config.longest_side,
            detector: config.detector.clone(),
            descriptor: config.descriptor.clone(),
            cue: config.cue.clone(),
            camera,
        }
    }

    /// The longest side in pixels that it looks at.
    pub fn longest_side(&self) -> usize {
        self.longest_side
    }

    /// The camera whose frames it takes.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The keypoints of a frame and their descriptors. `scratch` is for frames of this extractor only.
    pub fn extract(&self, image: &Image, scratch: &mut Scratch) -> Features {
        let shrunk = image.shrink_to(self.longest_side);
        let scaled = shrunk.as_ref().unwrap_or(image);
        let size = (scaled.width(), scaled.height());
        let partial = image
            .visible()
            .map(|visible| self.camera.view(size.0, size.1).within(visible.shrunk(image, [size.0, size.1])));
        let view = match &partial {
            Some(view) => view,
            None => {
                let same_size = scratch.view.take().filter(|view| (view.width(), view.height()) == size);
                scratch.view.insert(same_size.unwrap_or_else(|| self.camera.view(size.0, size.1)))
            }
        };
        let keypoints = self.detector.detect_with(scaled, view, &mut scratch.space);
        let descriptors = match &self.descriptor {
            // The costly part of both, built once.
            Descriptor::Sift(sift) if self.detector.levels().is_some() => {
                sift.describe_in(&scratch.space, &keypoints, view)
            }
            descriptor => descriptor.describe(scaled, &keypoints, view),
        };
        let frame = self.describe_frame(scaled, &mut scratch.sections);
        Features {
            keypoints,
            descriptors,
            frame,
            scale: (image.width() * image.reduction()) as f32 / scaled.width() as f32,
        }
    }

    /// What the cue sees; `sections` is kept for the next frame of the same size.
    fn describe_frame(&self, image: &Image, sections: &mut Option<((usize, usize), Sections)>) -> Vec<f32> {
        let Some(Cue::FrameLbp(FrameLbpCue { histograms, .. })) = &self.cue else { return Vec::new() };
        let shrunk = image.shrink_to(histograms.longest_side);
        let image = shrunk.as_ref().unwrap_or(image);
        let size = (image.width(), image.height());
        let of_same_size = sections.take().filter(|(of_size, _)| *of_size == size);
        let make = || (size, histograms.sections(&self.camera.view(size.0, size.1)));
        let (_, sections) = sections.insert(of_same_size.unwrap_or_else(make));
        histograms.describe(image, sections)
    }
}
