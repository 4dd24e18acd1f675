//! A frame to what opinions see of it: what training and recognition have in common.

use crate::look::features::Features;
use crate::look::flaw::Flaw;
use crate::look::laser::LaserShape;
use crate::look::lens::{Lens, Look};
use crate::look::local::LocalFeatures;
use crate::look::scan::{Frame, Scan};
use crate::look::sight::{Seen, Sight};
use crate::model::config::Config;
use roomsight_vision::camera::{Camera, Spot, View};
use roomsight_vision::describe::{Descriptor, FrameLbp, Sections};
use roomsight_vision::detect::{Detector, Keypoint};
use roomsight_vision::image::{Image, ImageError, Limits, Region};
use roomsight_vision::network::{NetworkError, XFeat};
use roomsight_vision::plane::ScaleSpace;
use std::sync::Arc;

/// Sees in frames what a model was configured to see. A clone is the same extractor.
#[derive(Clone, Debug)]
pub struct Extractor(Arc<Parameters>);

#[derive(Debug)]
struct Parameters {
    longest_side: usize,
    sights: Arc<Vec<Sight>>,
    camera: Camera,
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
    /// Of the patterns of whole frames, with what they are for.
    sections: Vec<(SectionsOf, Sections)>,
}

/// What the sections of a frame depend on, beside the camera.
#[derive(Debug, PartialEq)]
struct SectionsOf {
    histograms: FrameLbp,
    size: [usize; 2],
}

/// The scan of a laser that sees less than the one that a model was trained with.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the scan covers {found:.0} degrees, and the model was trained on {expected:.0}, half of them to each side of ahead: \
     send scans of the laser that it was trained with"
)]
pub struct ScanFieldError {
    /// What the scan covers, in degrees.
    pub found: f32,
    /// What the model looks at.
    pub expected: f32,
}

/// A frame at working size, and where it is valid.
struct Scaled<'a> {
    frame: &'a Image,
    /// The part of the frame that arrived, where not all did.
    visible: Option<Region>,
    view: &'a View,
}

/// What networks say of a frame as it came, with its colors; each is asked once.
struct Looks<'a> {
    image: &'a Image,
    view: &'a View,
    /// Pixels of it for one at working size.
    reduction: f32,
    so_far: Vec<(&'a Lens, Option<Look<'a>>)>,
}

impl<'a> Looks<'a> {
    /// What the network says of the whole frame; nothing where it cannot run.
    fn vector(&mut self, lens: &'a Lens) -> Vec<f32> {
        self.through(lens).map_or_else(Vec::new, Look::vector)
    }

    fn grid(&mut self, lens: &'a Lens, grid: &str) -> LocalFeatures {
        let n_dimensions = lens.grid_len(grid);
        let cells = self.through(lens).map(|look| look.grid(grid, n_dimensions));
        self.at_working_size(cells.unwrap_or_else(|| LocalFeatures::nothing(n_dimensions)))
    }

    fn xfeat(&mut self, lens: &'a Lens, target: usize) -> LocalFeatures {
        let found = self.through(lens).map(|look| look.xfeat(target));
        self.at_working_size(found.unwrap_or_else(|| LocalFeatures::nothing(XFeat::N_DIMENSIONS)))
    }

    fn through(&mut self, lens: &'a Lens) -> Option<&Look<'a>> {
        let camera = self.view.projection().kind();
        let known = self.so_far.iter().position(|(other, _)| other.looks_as(lens, camera));
        let idx = known.unwrap_or_else(|| {
            self.so_far.push((lens, lens.look(self.image, self.view)));
            self.so_far.len() - 1
        });
        self.so_far[idx].1.as_ref()
    }

    fn at_working_size(&self, mut local: LocalFeatures) -> LocalFeatures {
        local.spots = spots(&local.keypoints, self.view);
        shrink(&mut local.keypoints, self.reduction);
        local
    }
}

impl Extractor {
    /// What `config` says, for frames of `camera`.
    pub fn new(config: &Config, camera: Camera) -> Self {
        let sights = Arc::new(config.sights());
        Self(Arc::new(Parameters { longest_side: config.longest_side, sights, camera }))
    }

    /// Makes all networks ready for so many threads at once.
    pub(crate) fn prepare(&self, n_threads: usize) -> Result<(), NetworkError> {
        let mut lenses = self.0.sights.iter().filter_map(Sight::lens);
        lenses.try_for_each(|lens| lens.prepare(n_threads))
    }

    /// The longest side in pixels that it looks at.
    pub fn longest_side(&self) -> usize {
        self.0.longest_side
    }

    /// The camera whose frames it takes.
    pub fn camera(&self) -> &Camera {
        &self.0.camera
    }

    /// The ways in which it looks.
    pub(crate) fn sights(&self) -> &Arc<Vec<Sight>> {
        &self.0.sights
    }

    /// Whether a sight looks at colors.
    pub fn wants_colors(&self) -> bool {
        self.0.sights.iter().any(Sight::wants_colors)
    }

    /// How it looks at the scans of lasers; not at all where there is none.
    pub fn laser(&self) -> Option<&LaserShape> {
        self.0.sights.iter().find_map(Sight::laser)
    }

    /// What hinders it from seeing the scan of a laser, if anything: it looks at more of the surroundings than was measured.
    pub fn check_scan(&self, scan: &Scan) -> Result<(), ScanFieldError> {
        match self.laser().filter(|shape| !shape.is_covered_by(scan)) {
            Some(shape) => Err(ScanFieldError { found: scan.field_degrees(), expected: shape.field_degrees }),
            None => Ok(()),
        }
    }

    /// Decodes a frame of unknown origin to what is looked at: in color only where a sight wants that, and no
    /// larger than it must be where it goes beyond `limits`, see [`Limits::enough_side`].
    pub fn decode(&self, bytes: &[u8], limits: &Limits) -> Result<Image, ImageError> {
        let limits = limits.enough_for(self.longest_side());
        let decode = if self.wants_colors() { Image::decode_with_colors } else { Image::decode };
        decode(bytes, &limits)
    }

    /// What all sights see of a frame. A `scratch` that served another extractor is emptied before, which costs
    /// time, not truth.
    pub fn extract<'a>(&self, frame: impl Into<Frame<'a>>, scratch: &mut Scratch) -> Features {
        self.extract_also(None, None, frame.into(), scratch)
    }

    /// What `sights` see of a frame, all if left out, some of which may have seen it `before`.
    pub(crate) fn extract_also(
        &self,
        sights: Option<&Arc<Vec<Sight>>>,
        before: Option<Features>,
        frame: Frame,
        scratch: &mut Scratch,
    ) -> Features {
        if !scratch.owner.as_ref().is_some_and(|owner| Arc::ptr_eq(owner, &self.0)) {
            *scratch = Scratch { owner: Some(Arc::clone(&self.0)), ..Scratch::default() };
        }
        self.0.extract(sights.unwrap_or(&self.0.sights), before, frame, scratch)
    }
}

impl Parameters {
    /// What `sights` see, but for what was seen before. `scratch` is ours.
    fn extract<'s>(
        &self,
        sights: &'s Arc<Vec<Sight>>,
        before: Option<Features>,
        Frame { image, scan }: Frame,
        scratch: &mut Scratch,
    ) -> Features {
        let shrunk = image.shrink_to(self.longest_side);
        let frame = shrunk.as_ref().unwrap_or(image);
        let size = (frame.width(), frame.height());
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
        let scaled = Scaled { frame, visible, view };
        // Whoever looks through a network sees the frame as it came.
        let has_lens = sights.iter().any(|sight| sight.lens().is_some());
        let unshrunk = (has_lens && shrunk.is_some()).then(|| {
            let whole = self.camera.view(image.width(), image.height());
            match image.visible() {
                Some(visible) => whole.within(visible),
                None => whole,
            }
        });
        let mut looks = Looks {
            image,
            view: unshrunk.as_ref().unwrap_or(view),
            reduction: image.width() as f32 / frame.width() as f32,
            so_far: Vec::new(),
        };
        let mut see = |sight: &'s Sight| match sight {
            Sight::Keypoints { detector, descriptor } => {
                Seen::Local(self.describe_keypoints(&scaled, detector, descriptor, &mut scratch.space))
            }
            Sight::Patterns(histograms) => {
                Seen::Whole(self.describe_frame(&scaled, histograms, &mut scratch.sections))
            }
            Sight::Vector(lens) => Seen::Whole(looks.vector(lens)),
            Sight::Grid { lens, grid } => Seen::Local(looks.grid(lens, grid)),
            Sight::XFeat { lens, target } => Seen::Local(looks.xfeat(lens, *target)),
            Sight::Laser(shape) => Seen::Whole(scan.map_or_else(Vec::new, |scan| shape.describe(scan))),
        };
        let flaw = before.as_ref().map_or_else(|| Flaw::of(frame, scaled.view), |before| before.flaw);
        let mut before: Vec<(Sight, Seen)> = before.map_or_else(Vec::new, Features::by_sight);
        let seen_or_see = |sight: &'s Sight| match before.iter().position(|(other, _)| other == sight) {
            Some(idx) => before.swap_remove(idx).1,
            None => see(sight),
        };
        let seen = sights.iter().map(seen_or_see).collect();
        let scale = (image.width() * image.reduction()) as f32 / frame.width() as f32;
        Features { sights: Arc::clone(sights), seen, scale, flaw }
    }

    /// The keypoints of a frame, shrunk first where the detector looks at smaller ones, and their descriptors.
    fn describe_keypoints(
        &self,
        scaled: &Scaled,
        detector: &Detector,
        descriptor: &Descriptor,
        space: &mut ScaleSpace,
    ) -> LocalFeatures {
        let Some(frame) = detector.longest_side().and_then(|longest| scaled.frame.shrink_to(longest)) else {
            return scaled.describe(detector, descriptor, space);
        };
        let size = [frame.width(), frame.height()];
        let view = self.camera.view(size[0], size[1]);
        let visible = scaled.visible.map(|visible| visible.shrunk(scaled.frame, size));
        let view = match visible {
            Some(visible) => view.within(visible),
            None => view,
        };
        let shrunk = Scaled { frame: &frame, visible, view: &view };
        let mut local = shrunk.describe(detector, descriptor, space);
        shrink(&mut local.keypoints, size[0] as f32 / scaled.frame.width() as f32);
        local
    }

    /// The patterns of the visible part of a frame, or of all of it; `kept` is kept for the next frame of the same
    /// size.
    fn describe_frame(
        &self,
        scaled: &Scaled,
        histograms: &FrameLbp,
        kept: &mut Vec<(SectionsOf, Sections)>,
    ) -> Vec<f32> {
        let shrunk = scaled.frame.shrink_to(histograms.longest_side);
        let image = shrunk.as_ref().unwrap_or(scaled.frame);
        let size = [image.width(), image.height()];
        if let Some(visible) = scaled.visible {
            let view = self.camera.view(size[0], size[1]).within(visible.shrunk(scaled.frame, size));
            return histograms.describe(image, &histograms.sections(&view));
        }
        let wanted = SectionsOf { histograms: histograms.clone(), size };
        kept.retain(|(of, _)| of.histograms != wanted.histograms || of.size == size);
        if let Some((_, sections)) = kept.iter().find(|(of, _)| *of == wanted) {
            return histograms.describe(image, sections);
        }
        let sections = histograms.sections(&self.camera.view(size[0], size[1]));
        let described = histograms.describe(image, &sections);
        kept.push((wanted, sections));
        described
    }
}

impl Scaled<'_> {
    /// Its keypoints and their descriptors; `space` is the memory for the scale space.
    fn describe(
        &self,
        detector: &Detector,
        descriptor: &Descriptor,
        space: &mut ScaleSpace,
    ) -> LocalFeatures {
        let mut keypoints = detector.detect_with(self.frame, self.view, space);
        // Training keeps them, and the room of the many that were weaker would be half of what it keeps.
        keypoints.shrink_to_fit();
        let descriptors = match descriptor {
            // The costly part of both, built once.
            Descriptor::Sift(sift) if detector.levels().is_some() => {
                sift.describe_in(space, &keypoints, self.view)
            }
            descriptor => descriptor.describe(self.frame, &keypoints, self.view),
        };
        let spots = spots(&keypoints, self.view);
        LocalFeatures { keypoints, descriptors, spots }
    }
}

/// Where keypoints lie in what the camera sees.
fn spots(keypoints: &[Keypoint], view: &View) -> Vec<Spot> {
    keypoints.iter().map(|keypoint| view.spot(keypoint.x, keypoint.y)).collect()
}

/// Moves keypoints to a frame with sides so many times as short. Middles of pixels are whole numbers in both.
fn shrink(keypoints: &mut [Keypoint], reduction: f32) {
    for keypoint in keypoints {
        keypoint.x = (keypoint.x + 0.5) / reduction - 0.5;
        keypoint.y = (keypoint.y + 0.5) / reduction - 0.5;
        keypoint.scale /= reduction;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::opinions::PatternsConfig;
    use image::codecs::jpeg::JpegEncoder;
    use image::{ExtendedColorType, GrayImage, ImageEncoder, Luma};
    use roomsight_vision::camera::Projection;

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
        let config = Config::default().with_patterns(0.5, PatternsConfig::default());
        let extractor = Extractor::new(&config, Camera::new(Projection::Perspective));
        let mut scratch = Scratch::default();
        let of_whole = extractor.extract(&whole, &mut scratch);
        let of_cut = extractor.extract(&cut, &mut scratch);
        assert!(of_whole.keypoints().any(|keypoint| keypoint.y > visible.bottom as f32));
        assert!(of_cut.n_keypoints() > 0);
        assert!(of_cut.keypoints().all(|keypoint| keypoint.y + 3.0 < visible.bottom as f32));
        assert_ne!(of_cut.seen[1], of_whole.seen[1]);
        // The next frame is seen whole again.
        assert_eq!(extractor.extract(&whole, &mut scratch), of_whole);
    }
}
