//! What training does, beside faiss and LIBSVM: the same numbers in files for both.

use crate::drive::Drive;
use crate::raw;
use roomsight_lab::simulate::CameraKind;
use roomsight_recognition::classify::svm::{self, KernelConfig, KernelFunction, KernelSvm, Scheme};
use roomsight_recognition::model::{Config, Extractor, Features, Scratch, Seen};
use roomsight_recognition::vocabulary::{self, Described, Vocabulary};
use roomsight_vision::camera::Spot;
use roomsight_vision::image::Image;
use roomsight_vision::matrix::Matrix;
use std::fs;
use std::path::Path;

/// Gives more than [`N_DESCRIPTORS`].
const FRAMES_PER_SECOND: f32 = 3.0;
const N_DESCRIPTORS: usize = 100_000;
const N_CLUSTERS: usize = 300;
const N_ROUNDS: usize = 20;

/// Of the radial basis functions; bags are of unit length.
const GAMMA: f64 = 1.0;
const COST: f64 = 10.0;

/// Descriptors to cluster, and bags to tell apart.
pub struct Training {
    descriptors: Matrix,
    bags: Matrix,
    labels: Vec<usize>,
}

impl Training {
    /// Describes a longer drive as the default model does and writes its descriptors and bags to `folder`, which need not be
    /// there.
    pub fn write(folder: &Path) {
        fs::create_dir_all(folder).unwrap();
        let drive = Drive::render(CameraKind::Perspective, FRAMES_PER_SECOND);
        let extractor = Extractor::new(&Config::default(), drive.camera.clone());
        let mut scratch = Scratch::default();
        let extract = |image: &Image| extractor.extract(image, &mut scratch);
        let features: Vec<Features> = drive.images.iter().map(extract).collect();
        let local = features.iter().flat_map(|features| &features.seen).filter_map(Seen::local);
        let frames: Vec<Described> = local.map(|local| local.described()).collect();

        let rows: Vec<&[f32]> = frames.iter().flat_map(|frame| frame.descriptors.rows()).collect();
        let drawn = (0..N_DESCRIPTORS).map(|idx| rows[idx * rows.len() / N_DESCRIPTORS]);
        assert!(rows.len() >= N_DESCRIPTORS, "{} descriptors are too few", rows.len());
        raw::write(&folder.join("descriptors"), &drawn.collect::<Vec<_>>().concat());

        let words = vocabulary::Config { max_descriptors: 20_000, ..vocabulary::Config::default() };
        let vocabulary = Vocabulary::train(&frames, &words, 0).unwrap();
        let bags: Vec<f32> = frames.iter().flat_map(|&frame| vocabulary.row(frame)).collect();
        raw::write(&folder.join("bags"), &bags);
        let mut names = drive.rooms.clone();
        names.sort();
        names.dedup();
        let label = |room| names.binary_search(room).unwrap() as u32;
        raw::write(&folder.join("labels"), &drive.rooms.iter().map(label).collect::<Vec<_>>());
    }

    /// Reads them again.
    pub fn read(folder: &Path) -> Self {
        let descriptors = raw::read::<f32>(&folder.join("descriptors"));
        let width = descriptors.len() / N_DESCRIPTORS;
        let labels: Vec<usize> =
            raw::read::<u32>(&folder.join("labels")).iter().map(|&label| label as usize).collect();
        let bags = raw::read::<f32>(&folder.join("bags"));
        let n_columns = bags.len() / labels.len();
        Self {
            descriptors: Matrix::from_vec(descriptors, width).unwrap(),
            bags: Matrix::from_vec(bags, n_columns).unwrap(),
            labels,
        }
    }

    /// Clusters 100,000 descriptors into 300, in at most 20 rounds.
    pub fn cluster(&self) -> Vocabulary {
        let spots = vec![Spot { across: Some(0.5), down: 0.5 }; self.descriptors.n_rows()];
        let all = Described { descriptors: &self.descriptors, spots: &spots };
        let words = vocabulary::Config {
            n_words: N_CLUSTERS,
            max_rounds: N_ROUNDS,
            max_descriptors: N_DESCRIPTORS,
            ..vocabulary::Config::default()
        };
        Vocabulary::train(&[all], &words, 0).unwrap()
    }

    /// The sum of the descriptors' squared distances to the nearest of these centers.
    pub fn inertia(&self, centers: &Matrix) -> f64 {
        let distance =
            |row: &[f32], center: &[f32]| row.iter().zip(center).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
        let nearest = |row| centers.rows().map(|center| distance(row, center)).fold(f32::INFINITY, f32::min);
        self.descriptors.rows().map(|row| f64::from(nearest(row))).sum()
    }

    /// Tells the rooms apart by machines with radial basis functions, one for each pair, as LIBSVM does.
    pub fn train_svm(&self) -> KernelSvm {
        let machines = svm::Config { scheme: Scheme::OneVsOne, c: COST, ..svm::Config::default() };
        let config = KernelConfig { kernel: KernelFunction::Rbf { gamma: Some(GAMMA) }, machines };
        let n_rooms = self.labels.iter().max().map_or(0, |most| most + 1);
        KernelSvm::train(&self.bags, &self.labels, n_rooms, &config).unwrap()
    }
}
