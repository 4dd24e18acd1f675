//! A frame to keypoints and descriptors: what training and recognition have in common.

use super::{Config, Cue, FrameLbpCue};
use crate::camera::{Camera, Spot, View};
use crate::describe::{Descriptor, Sections};
use crate::detect::{Detector, Keypoint};
use crate::image::{Image, Region};
use crate::matrix::Matrix;
use crate::plane::ScaleSpace;
use crate::vocabulary::Described;
use std::sync::Arc;

/// Finds and describes keypoints as a model was configured to. A clone is the same extractor.
#[derive(Clone, Debug)]
pub struct Extractor(Arc<Parameters>);

#[derive(Debug)]
struct Parameters {
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
    /// Where the keypoints lie in what the camera sees.
    pub spots: Vec<Spot>,
    /// What the cue sees of the whole frame; empty without one.
    pub frame: Vec<f32>,
    /// Pixels of the frame as it came for one pixel at working size, at least 1.
    pub scale: f32,
}

impl Features {
    /// What a vocabulary sees.
    pub fn described(&self) -> Described<'_> {
        Described { descriptors: &self.descriptors, spots: &self.spots }
    }
}

/// Working memory of one thread, reused from frame to frame. It remembers what depends on an [`Extractor`];
/// for another one it begins anew.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Whose the rest is.
    owner: Option<Arc<Parameters>>,
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
        Self(Arc::new(Parameters {
            longest_side: config.longest_side,
            detector: config.detector.clone(),
            descriptor: config.descriptor.clone(),
            cue: config.cue.clone(),
            camera,
        }))
    }

    /// The longest side in pixels that it looks at.
    pub fn longest_side(&self) -> usize {
        self.0.longest_side
    }

    /// The camera whose frames it takes.
    pub fn camera(&self) -> &Camera {
        &self.0.camera
    }

    /// The keypoints of a frame and their descriptors. A `scratch` that served another extractor is emptied
    /// before, which costs time, not truth.
    pub fn extract(&self, image: &Image, scratch: &mut Scratch) -> Features {
        if !scratch.owner.as_ref().is_some_and(|owner| Arc::ptr_eq(owner, &self.0)) {
            *scratch = Scratch { owner: Some(Arc::clone(&self.0)), ..Scratch::default() };
        }
        self.0.extract(image, scratch)
    }
}

impl Parameters {
    /// `scratch` is ours.
    fn extract(&self, image: &Image, scratch: &mut Scratch) -> Features {
        let shrunk = image.shrink_to(self.longest_side);
        let scaled = shrunk.as_ref().unwrap_or(image);
        let size = (scaled.width(), scaled.height());
        // Of a frame that did not arrive whole; no other has the same.
        let visible = image.visible().map(|visible| visible.shrunk(image, [size.0, size.1]));
        let partial = visible.map(|visible| self.camera.view(size.0, size.1).within(visible));
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
        let spots = keypoints.iter().map(|keypoint| view.spot(keypoint.x, keypoint.y)).collect();
        let frame = self.describe_frame(scaled, visible, &mut scratch.sections);
        Features {
            keypoints,
            descriptors,
            spots,
            frame,
            scale: (image.width() * image.reduction()) as f32 / scaled.width() as f32,
        }
    }

    /// What the cue sees of the visible part of a frame, or of all of it; `sections` is kept for the next frame
    /// of the same size.
    fn describe_frame(
        &self,
        frame: &Image,
        visible: Option<Region>,
        sections: &mut Option<((usize, usize), Sections)>,
    ) -> Vec<f32> {
        let Some(Cue::FrameLbp(FrameLbpCue { histograms, .. })) = &self.cue else { return Vec::new() };
        let shrunk = frame.shrink_to(histograms.longest_side);
        let image = shrunk.as_ref().unwrap_or(frame);
        let size = (image.width(), image.height());
        if let Some(visible) = visible {
            let view = self.camera.view(size.0, size.1).within(visible.shrunk(frame, [size.0, size.1]));
            return histograms.describe(image, &histograms.sections(&view));
        }
        let of_same_size = sections.take().filter(|(of_size, _)| *of_size == size);
        let make = || (size, histograms.sections(&self.camera.view(size.0, size.1)));
        let (_, sections) = sections.insert(of_same_size.unwrap_or_else(make));
        histograms.describe(image, sections)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Projection;
    use crate::image::Limits;
    use image::codecs::jpeg::JpegEncoder;
    use image::{ExtendedColorType, GrayImage, ImageEncoder, Luma};

    /// A frame full of corners, as a JPEG.
    fn frame() -> Vec<u8> {
        let picture = GrayImage::from_fn(128, 96, |x, y| {
            let is_bright = x / 9 % 2 == y / 7 % 2;
            Luma([if is_bright { 190 } else { 60 } + ((x * 7 + y * 5) % 11) as u8])
        });
        let mut bytes = Vec::new();
        let encoder = JpegEncoder::new_with_quality(&mut bytes, 90);
        encoder.write_image(&picture, 128, 96, ExtendedColorType::L8).unwrap();
        bytes
    }

    #[test]
    fn nothing_is_found_where_rows_are_missing() {
        let bytes = frame();
        let decode = |bytes: &[u8]| Image::decode(bytes, &Limits::default()).unwrap();
        let (whole, cut) = (decode(&bytes), decode(&bytes[..bytes.len() * 3 / 4]));
        let visible = cut.visible().unwrap();
        assert!((48..80).contains(&visible.bottom), "{visible:?}");
        let cue = Some(Cue::FrameLbp(FrameLbpCue::default()));
        let config = Config { cue, ..Config::default() };
        let extractor = Extractor::new(&config, Camera::new(Projection::Perspective));
        let mut scratch = Scratch::default();
        let of_whole = extractor.extract(&whole, &mut scratch);
        let of_cut = extractor.extract(&cut, &mut scratch);
        assert!(of_whole.keypoints.iter().any(|keypoint| keypoint.y > visible.bottom as f32));
        assert!(!of_cut.keypoints.is_empty());
        assert!(of_cut.keypoints.iter().all(|keypoint| keypoint.y + 3.0 < visible.bottom as f32));
        assert_ne!(of_cut.frame, of_whole.frame);
        // The next frame is seen whole again.
        assert_eq!(extractor.extract(&whole, &mut scratch).keypoints, of_whole.keypoints);
    }
}
