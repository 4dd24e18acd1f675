//! The simulated drive that all benchmarks take their frames from.

use image::codecs::jpeg::JpegEncoder;
use rayon::prelude::*;
use roomsight_lab::simulate::{CameraKind, Illumination, Lab, Part, Route, SequenceSpec, Simulation};
use roomsight_vision::camera::{Camera, Mirror, Projection};
use roomsight_vision::image::{Image, Limits};

/// As the simulated sequences are written.
const JPEG_QUALITY: u8 = 88;

/// Saarbruecken, part B, standard path, cloudy.
pub fn simulation(frames_per_second: f32) -> Simulation {
    let spec = SequenceSpec {
        lab: Lab::Saarbruecken,
        part: Part::B,
        route: Route::Standard,
        illumination: Illumination::Cloudy,
        run: 1,
        seed: 0,
        frames_per_second,
        has_stops: false,
    };
    Simulation::new(&spec).unwrap()
}

/// Frames of 640 x 480 pixels of one camera along the drive.
pub struct Drive {
    /// As JPEGs.
    pub jpegs: Vec<Vec<u8>>,
    /// Their luma.
    pub images: Vec<Image>,
    /// The room that each shows.
    pub rooms: Vec<String>,
    /// What they were taken with; where its mirror lies is estimated.
    pub camera: Camera,
}

impl Drive {
    /// On all threads.
    pub fn render(kind: CameraKind, frames_per_second: f32) -> Self {
        let simulation = simulation(frames_per_second);
        let encode = |frame_idx| {
            let mut bytes = Vec::new();
            let mut encoder = JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY);
            encoder.encode_image(&simulation.render(frame_idx, kind)).unwrap();
            bytes
        };
        let jpegs: Vec<Vec<u8>> = (0..simulation.n_frames()).into_par_iter().map(encode).collect();
        let images: Vec<Image> = jpegs.iter().map(|jpeg| decode(jpeg)).collect();
        let rooms = (0..images.len()).map(|frame_idx| simulation.place(frame_idx).to_owned()).collect();
        let projection = match kind {
            CameraKind::Perspective => Projection::Perspective,
            CameraKind::Omnidirectional => Projection::Omnidirectional(Mirror::estimate(&images).unwrap()),
        };
        Self { jpegs, images, rooms, camera: Camera::new(projection) }
    }
}

/// The luma of a JPEG.
pub fn decode(jpeg: &[u8]) -> Image {
    Image::decode(jpeg, &Limits::default()).unwrap()
}
