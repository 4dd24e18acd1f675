//! LBP and CS-LBP histograms against scikit-image's, made by `tests/golden/skimage_lbp.py`.
//!
//! Interpolation in fixed point may decide a comparison otherwise than floating point only where it is
//! closer than the weights' rounding. Such a pixel may be counted in another bin of its cell: a cell's
//! histograms differ by at most two counts for each pixel that is undecided in this sense.

use roomsight_vision::camera::{Camera, Projection};
use roomsight_vision::describe::{CsLbp, Descriptor, Lbp, Region};
use roomsight_vision::detect::Keypoint;
use roomsight_vision::image::{Image, Limits};
use serde::Deserialize;
use std::fs;
use std::path::Path;

#[derive(Deserialize)]
struct Golden {
    made_by: String,
    region_side: usize,
    /// scikit-image's label of each uniform pattern, by ascending code: the order of our bins.
    uniform_labels_by_code: Vec<usize>,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    kind: String,
    frame: String,
    parameters: Parameters,
    regions: Vec<GoldenRegion>,
}

#[derive(Debug, Deserialize)]
struct Parameters {
    radius: f32,
    n_cells: usize,
    n_neighbors: Option<usize>,
    threshold: Option<f32>,
}

#[derive(Deserialize)]
struct GoldenRegion {
    x: f32,
    y: f32,
    /// Counts of pixels: cells, bins.
    cells: Vec<Vec<u32>>,
    n_undecided: Vec<u32>,
}

fn golden_file(name: &str) -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)).unwrap()
}

impl Parameters {
    fn descriptor(&self, region_side: usize) -> Descriptor {
        let region = Region { side: region_side, ..Region::default() };
        let (radius, n_cells) = (self.radius, self.n_cells);
        match (self.n_neighbors, self.threshold) {
            (Some(n_neighbors), Some(threshold)) => {
                Descriptor::CsLbp(CsLbp { n_neighbors, radius, threshold, n_cells, region })
            }
            _ => Descriptor::Lbp(Lbp { radius, n_cells, region }),
        }
    }
}

/// Asserts that all cells of the cases of `kind` agree. `bins` are the golden bins in our order.
fn assert_same_as_skimage(kind: &str, bins: impl Fn(&Golden, usize) -> Vec<usize>) {
    let golden: Golden = serde_json::from_slice(&golden_file("skimage_lbp.json")).unwrap();
    assert!(golden.made_by.contains("scikit-image"));
    let cases: Vec<&Case> = golden.cases.iter().filter(|case| case.kind == kind).collect();
    assert_eq!(cases.len(), 6, "three frames, two sets of parameters each");
    for case in cases {
        let image = Image::decode(&golden_file(&format!("{}.png", case.frame)), &Limits::default()).unwrap();
        let view = Camera::new(Projection::Perspective).view(image.width(), image.height());
        let keypoints: Vec<Keypoint> =
            case.regions.iter().map(|region| Keypoint::new(region.x, region.y, 0.0)).collect();
        let descriptor = case.parameters.descriptor(golden.region_side);
        let rows = descriptor.describe(&image, &keypoints, &view);
        let n_cells = case.parameters.n_cells * case.parameters.n_cells;
        let n_bins = descriptor.n_dimensions() / n_cells;
        let order = bins(&golden, n_bins);
        for (region, row) in case.regions.iter().zip(rows.rows()) {
            // Rows have unit length: a region's pixels say how long they were.
            let n_pixels = (golden.region_side * golden.region_side) as f32;
            let length = n_pixels / row.iter().sum::<f32>();
            for (cell_idx, values) in row.chunks(n_bins).enumerate() {
                let counts = values.iter().map(|value| (value * length).round() as u32);
                let expected = order.iter().map(|&bin| region.cells[cell_idx][bin]);
                let distance: u32 = counts.zip(expected).map(|(a, b)| a.abs_diff(b)).sum();
                let allowed = 2 * region.n_undecided[cell_idx];
                assert!(
                    distance <= allowed,
                    "{} {:?} ({}, {}) cell {cell_idx}: {distance} > {allowed}",
                    case.frame,
                    case.parameters,
                    region.x,
                    region.y
                );
            }
        }
    }
}

#[test]
fn lbp_histograms_are_those_of_scikit_image() {
    assert_same_as_skimage("lbp", |golden, n_bins| {
        let mut labels = golden.uniform_labels_by_code.clone();
        labels.push(n_bins - 1);
        labels
    });
}

#[test]
fn cs_lbp_histograms_are_those_of_neighbors_that_scikit_image_interpolates() {
    assert_same_as_skimage("cs_lbp", |_, n_bins| (0..n_bins).collect());
}
