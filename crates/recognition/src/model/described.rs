//! What an extractor saw of many frames, as bytes: a safetensors file, from which the same features come back bit for bit.
//!
//! Of each way to look (`i` counts them) there are, over all frames one after the other: of places `i/counts` (how many a frame),
//! `i/keypoints` (column, row, response, scale, angle), `i/spots` (across, down) and `i/descriptors`; of whole frames `i/counts`
//! (1 where anything was seen) and `i/whole`. An angle or an across that there is none of is no number.

use crate::file::arrays::{Array, Arrays, require, serialize};
use crate::file::error::FormatError;
use crate::look::flaw::Flaw;
use crate::look::laser::LaserShape;
use crate::look::local::LocalFeatures;
use crate::look::sight::{Seen, Sight};
use crate::model::{Extractor, Features};
use roomsight_vision::camera::{Camera, Spot};
use roomsight_vision::detect::Keypoint;
use roomsight_vision::matrix::Matrix;
use safetensors::SafeTensors;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The last version of the layout.
const VERSION: u32 = 1;

/// What the text of the file is called.
const ABOUT: &str = "roomsight-features";

/// Numbers of a keypoint, and of where it lies.
const KEYPOINT_LEN: usize = 5;
const SPOT_LEN: usize = 2;

/// How frames were looked at: features of two extractors are the same only where this is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Looked {
    version: u32,
    /// In pixels, at working size.
    longest_side: usize,
    /// A digest of the projection and the mask.
    camera: String,
    /// The ways, each as JSON; of networks with the digest of the file.
    sights: Vec<String>,
}

/// Why bytes are no features that an extractor would see.
#[derive(Debug, thiserror::Error)]
pub enum FeaturesError {
    /// No such file, or damaged.
    #[error("they are no described frames, or damaged: {0}")]
    Damaged(String),
    /// Of another program.
    #[error("they have format version {0}; this program reads version {VERSION}: describe the frames again")]
    OtherVersion(u32),
    /// Described for another configuration or camera.
    #[error(
        "they were described in another way ({0}): describe the frames again with what they are used for"
    )]
    Otherwise(&'static str),
}

impl From<FormatError> for FeaturesError {
    fn from(error: FormatError) -> Self {
        match error {
            FormatError::Damaged(reason) => Self::Damaged(reason),
            error => Self::Damaged(error.to_string()),
        }
    }
}

impl Looked {
    /// How this extractor looks.
    pub fn of(extractor: &Extractor) -> Self {
        Self {
            version: VERSION,
            longest_side: extractor.longest_side(),
            camera: camera_key(extractor.camera()),
            sights: extractor.sights().iter().map(key).collect(),
        }
    }

    /// How it looked at the scans of lasers, if it did.
    pub fn laser(&self) -> Option<LaserShape> {
        let of_laser = |key: &String| match serde_json::from_str(key).ok()? {
            SightKey::Laser(shape) => Some(shape),
            SightKey::Other => None,
        };
        self.sights.iter().find_map(of_laser)
    }

    /// What hinders an extractor from using what was seen so, if anything.
    ///
    /// # Errors
    /// What is not the same.
    pub fn check(&self, extractor: &Extractor) -> Result<(), FeaturesError> {
        let wanted = Self::of(extractor);
        let is_seen = |sight: &String| self.sights.contains(sight);
        if self.version != wanted.version {
            return Err(FeaturesError::OtherVersion(self.version));
        }
        for (is_same, what) in [
            (self.camera == wanted.camera, "with another camera, mirror or mask"),
            (self.longest_side == wanted.longest_side, "at another working size"),
            (wanted.sights.iter().all(is_seen), "for other opinions, parameters or networks"),
        ] {
            if !is_same {
                return Err(FeaturesError::Otherwise(what));
            }
        }
        Ok(())
    }
}

/// What a [`key`] says of a laser.
#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum SightKey {
    Laser(LaserShape),
    #[serde(other)]
    Other,
}

/// What tells a way to look from others.
fn key(sight: &Sight) -> String {
    // Plain values always have a JSON form.
    let mut key = serde_json::to_string(sight).unwrap_or_default();
    if let Some(carried) = sight.lens().and_then(|lens| lens.carried()) {
        key.push(' ');
        key.push_str(&carried.key());
    }
    key
}

fn camera_key(camera: &Camera) -> String {
    let mut digest = blake3::Hasher::new();
    digest.update(serde_json::to_string(&camera.projection).unwrap_or_default().as_bytes());
    if let Some(mask) = &camera.mask {
        digest.update(&(mask.picture().width() as u64).to_le_bytes());
        digest.update(mask.picture().pixels());
    }
    digest.finalize().to_hex().to_string()
}

/// The bytes of what `extractor` saw of frames.
///
/// # Errors
/// Features of another extractor.
pub fn features_to_bytes(features: &[&Features], extractor: &Extractor) -> Result<Vec<u8>, FeaturesError> {
    let scales: Vec<f32> = features.iter().map(|features| features.scale).collect();
    let flaws = features.iter().map(|features| flaw_to_number(features.flaw));
    let mut arrays = vec![Array::vector("scales", &scales), Array::counts("flaws", flaws)];
    for (idx, sight) in extractor.sights().iter().enumerate() {
        let missing = FeaturesError::Otherwise("for other opinions");
        let seen = features.iter().map(|features| features.of(sight)).collect::<Option<Vec<&Seen>>>();
        let name = |part: &str| format!("{idx}/{part}");
        let seen = seen.ok_or(missing)?;
        let mut rows = Rows::new(sight.n_dimensions(extractor.camera().projection.kind()));
        seen.iter().for_each(|seen| rows.push(seen));
        arrays.push(Array::counts(&name("counts"), rows.counts.iter().copied()));
        if sight.sees_places() {
            arrays.push(Array::matrix(&name("keypoints"), &rows.keypoints));
            arrays.push(Array::matrix(&name("spots"), &rows.spots));
            arrays.push(Array::matrix(&name("descriptors"), &rows.numbers));
        } else {
            arrays.push(Array::matrix(&name("whole"), &rows.numbers));
        }
    }
    let about = serde_json::to_string(&Looked::of(extractor)).unwrap_or_default();
    Ok(serialize(&arrays, (ABOUT, about))?)
}

/// What one way to look saw of all frames.
struct Rows {
    counts: Vec<usize>,
    keypoints: Matrix,
    spots: Matrix,
    numbers: Matrix,
}

impl Rows {
    fn new(n_dimensions: usize) -> Self {
        let (keypoints, spots) = (Matrix::new(KEYPOINT_LEN), Matrix::new(SPOT_LEN));
        let numbers = Matrix::new(n_dimensions);
        Self { counts: Vec::new(), keypoints, spots, numbers }
    }

    fn push(&mut self, seen: &Seen) {
        match seen {
            Seen::Local(LocalFeatures { keypoints, descriptors, spots }) => {
                self.counts.push(keypoints.len());
                for Keypoint { x, y, response, scale, angle } in keypoints {
                    self.keypoints.push_row(&[*x, *y, *response, *scale, angle.unwrap_or(f32::NAN)]);
                }
                for Spot { across, down } in spots {
                    self.spots.push_row(&[across.unwrap_or(f32::NAN), *down]);
                }
                descriptors.rows().for_each(|row| self.numbers.push_row(row));
            }
            Seen::Whole(whole) => {
                self.counts.push(usize::from(!whole.is_empty()));
                if !whole.is_empty() {
                    self.numbers.push_row(whole);
                }
            }
        }
    }
}

/// The features of frames as `extractor` would see them.
///
/// # Errors
/// Other bytes, damaged ones, and what was seen in another way.
pub fn features_from_bytes(bytes: &[u8], extractor: &Extractor) -> Result<Vec<Features>, FeaturesError> {
    let damaged = |error: &dyn std::fmt::Display| FeaturesError::Damaged(error.to_string());
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|error| damaged(&error))?;
    let about = metadata.metadata().as_ref().and_then(|texts| texts.get(ABOUT));
    let about =
        about.ok_or_else(|| FeaturesError::Damaged("it says nothing of how frames were looked at".into()))?;
    let looked: Looked = serde_json::from_str(about).map_err(|error| damaged(&error))?;
    looked.check(extractor)?;
    let file = SafeTensors::deserialize(bytes).map_err(|error| damaged(&error))?;
    let arrays = Arrays::new(&file);
    let scales = arrays.vector("scales")?;
    let flaws = arrays.counts("flaws")?;
    require(flaws.len() == scales.len(), "it has not as many flaws as frames")?;
    require(scales.iter().all(|scale| *scale >= 1.0 && scale.is_finite()), "a scale is none")?;
    let mut features = Vec::with_capacity(scales.len());
    for (scale, flaw) in scales.into_iter().zip(flaws) {
        let sights = Arc::clone(extractor.sights());
        features.push(Features { sights, seen: Vec::new(), scale, flaw: flaw_from_number(flaw)? });
    }
    let camera = extractor.camera().projection.kind();
    for sight in extractor.sights().iter() {
        let idx = looked.sights.iter().position(|other| *other == key(sight));
        let idx = idx.ok_or(FeaturesError::Otherwise("for other opinions"))?;
        let seen = read_sight(&arrays, idx, sight, sight.n_dimensions(camera), features.len())?;
        features.iter_mut().zip(seen).for_each(|(features, seen)| features.seen.push(seen));
    }
    Ok(features)
}

/// What one way to look saw of so many frames.
fn read_sight(
    arrays: &Arrays,
    idx: usize,
    sight: &Sight,
    n_dimensions: usize,
    n_frames: usize,
) -> Result<Vec<Seen>, FormatError> {
    let name = |part: &str| format!("{idx}/{part}");
    let counts = arrays.counts(&name("counts"))?;
    require(counts.len() == n_frames, "it has not as many counts as frames")?;
    let n_rows = counts.iter().try_fold(0_usize, |sum, count| sum.checked_add(*count));
    let read = |part: &str, n_columns: usize| {
        let matrix = arrays.matrix(&name(part))?;
        let fits = matrix.n_cols() == n_columns && Some(matrix.n_rows()) == n_rows;
        require(fits, "an array has other rows than are counted")?;
        Ok::<Matrix, FormatError>(matrix)
    };
    let finite = |matrix: &Matrix| {
        require(matrix.as_slice().iter().all(|value| value.is_finite()), "a value is no number")
    };
    if !sight.sees_places() {
        let whole = read("whole", n_dimensions)?;
        finite(&whole)?;
        require(counts.iter().all(|count| *count <= 1), "a frame was seen twice")?;
        let mut rows = whole.rows();
        let next = |count: usize| Seen::Whole(rows.by_ref().take(count).flatten().copied().collect());
        return Ok(counts.into_iter().map(next).collect());
    }
    let (keypoints, spots) = (read("keypoints", KEYPOINT_LEN)?, read("spots", SPOT_LEN)?);
    let descriptors = read("descriptors", n_dimensions)?;
    finite(&descriptors)?;
    let is_short = |row: &[f32]| row.iter().map(|value| value * value).sum::<f32>() <= LONGEST * LONGEST;
    require(descriptors.rows().all(is_short), "a descriptor is longer than 1")?;
    require(
        keypoints.rows().all(|row| row[..4].iter().all(|value| value.is_finite())),
        "a keypoint is nowhere",
    )?;
    require(spots.rows().all(|row| row[1].is_finite()), "a keypoint lies nowhere")?;
    let given = |value: f32| (!value.is_nan()).then_some(value);
    let mut keypoints = keypoints.rows().map(|row| Keypoint {
        x: row[0],
        y: row[1],
        response: row[2],
        scale: row[3],
        angle: given(row[4]),
    });
    let mut spots = spots.rows().map(|row| Spot { across: given(row[0]), down: row[1] });
    let mut rows = descriptors.rows();
    let next = |count: usize| {
        let mut descriptors = Matrix::new(n_dimensions);
        rows.by_ref().take(count).for_each(|row| descriptors.push_row(row));
        Seen::Local(LocalFeatures {
            keypoints: keypoints.by_ref().take(count).collect(),
            spots: spots.by_ref().take(count).collect(),
            descriptors,
        })
    };
    Ok(counts.into_iter().map(next).collect())
}

/// A descriptor is no longer than 1, rounding left out.
const LONGEST: f32 = 1.0001;

fn flaw_to_number(flaw: Option<Flaw>) -> usize {
    match flaw {
        None => 0,
        Some(Flaw::Dark) => 1,
        Some(Flaw::Covered) => 2,
        Some(Flaw::Flat) => 3,
    }
}

fn flaw_from_number(number: usize) -> Result<Option<Flaw>, FormatError> {
    match number {
        0 => Ok(None),
        1 => Ok(Some(Flaw::Dark)),
        2 => Ok(Some(Flaw::Covered)),
        3 => Ok(Some(Flaw::Flat)),
        _ => Err(FormatError::Damaged("a flaw is none".to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Config, OpinionConfig, PatternsConfig, Scratch};
    use proptest::prelude::*;
    use roomsight_vision::camera::Projection;
    use roomsight_vision::image::Image;

    /// Looks at corners and, beside them, at patterns.
    fn extractor(longest_side: usize) -> Extractor {
        let patterns = OpinionConfig::Patterns(PatternsConfig::default());
        let mut config = Config { longest_side, ..Config::default() };
        config.opinions.insert("patterns".to_owned(), patterns);
        Extractor::new(&config, Camera::new(Projection::Perspective))
    }

    fn image(width: usize, height: usize, seed: usize) -> Image {
        let pixel = |idx: usize| (idx * idx * (seed + 7) % 251) as u8;
        Image::from_pixels(width, height, (0..width * height).map(pixel).collect()).unwrap()
    }

    fn seen(extractor: &Extractor, images: &[Image]) -> Vec<Features> {
        let mut scratch = Scratch::default();
        images.iter().map(|image| extractor.extract(image, &mut scratch)).collect()
    }

    fn bytes(extractor: &Extractor, features: &[Features]) -> Vec<u8> {
        features_to_bytes(&features.iter().collect::<Vec<_>>(), extractor).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn the_same_features_come_back(sizes in prop::collection::vec((16_usize..200, 16_usize..150, 0_usize..9), 0..5)) {
            let extractor = extractor(120);
            let images: Vec<Image> = sizes.into_iter().map(|(width, height, seed)| image(width, height, seed)).collect();
            let features = seen(&extractor, &images);
            let read = features_from_bytes(&bytes(&extractor, &features), &extractor).unwrap();
            prop_assert_eq!(read, features);
        }
    }

    #[test]
    fn frames_without_anything_to_see_come_back() {
        let extractor = extractor(120);
        let black = Image::from_pixels(64, 48, vec![0; 64 * 48]).unwrap();
        let features = seen(&extractor, &[black.clone(), image(64, 48, 1), black]);
        assert!(
            features[0].flaw.is_some() && features[0].n_keypoints() == 0 && features[1].n_keypoints() > 0
        );
        assert_eq!(features_from_bytes(&bytes(&extractor, &features), &extractor).unwrap(), features);
    }

    #[test]
    fn one_who_looks_in_fewer_ways_can_use_them() {
        let (both, corners) = (extractor(120), {
            let config = Config { longest_side: 120, ..Config::default() };
            Extractor::new(&config, Camera::new(Projection::Perspective))
        });
        let images = [image(90, 60, 3), image(60, 90, 4)];
        let written = bytes(&both, &seen(&both, &images));
        assert_eq!(features_from_bytes(&written, &corners).unwrap(), seen(&corners, &images));
        let written = bytes(&corners, &seen(&corners, &images));
        assert!(matches!(features_from_bytes(&written, &both), Err(FeaturesError::Otherwise(_))));
    }

    #[test]
    fn what_was_seen_in_another_way_is_refused() {
        let ours = extractor(120);
        let written = bytes(&ours, &seen(&ours, &[image(90, 60, 3)]));
        let refused =
            |extractor: &Extractor| features_from_bytes(&written, extractor).unwrap_err().to_string();
        assert!(refused(&extractor(100)).contains("working size"));
        let panoramas = Extractor::new(
            &Config { longest_side: 120, ..Config::default() },
            Camera::new(Projection::Equirectangular),
        );
        assert!(refused(&panoramas).contains("camera"));
    }

    #[test]
    fn damaged_bytes_are_refused() {
        let ours = extractor(120);
        let written = bytes(&ours, &seen(&ours, &[image(90, 60, 3), image(64, 48, 5)]));
        for length in (0..written.len()).step_by(97) {
            assert!(features_from_bytes(&written[..length], &ours).is_err());
        }
        // A count that is not true to its rows.
        let file = SafeTensors::deserialize(&written).unwrap();
        let counts = file.tensor("0/counts").unwrap().data();
        let at = counts.as_ptr() as usize - written.as_ptr() as usize;
        let mut wrong = written.clone();
        wrong[at] ^= 1;
        assert!(matches!(features_from_bytes(&wrong, &ours), Err(FeaturesError::Damaged(_))));
    }
}
