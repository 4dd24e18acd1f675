//! The experiments of Ullah et al.

use super::super::{Drives, Experiment, ExperimentError};
use super::{Cell, Chart, Occlusion, Plan, Split};
use crate::dataset::cold::Illumination::{Cloudy, Night, Sunny};
use crate::dataset::cold::{DrivenPath, SequenceName};
use crate::model::Config;

/// Every drive trains once; all other drives of its lab, part and path that `is_wanted` are answered.
fn pairs(drives: &Drives, is_wanted: impl Fn(&SequenceName, &SequenceName) -> bool) -> Vec<Split> {
    let same_rooms =
        |a: &SequenceName, b: &SequenceName| (&a.lab, a.part, a.path) == (&b.lab, b.part, b.path);
    let names: Vec<&SequenceName> = drives.iter().map(|drive| &drive.name).collect();
    let split = |(train, name): (usize, &&SequenceName)| {
        let tests =
            |&test: &usize| test != train && same_rooms(name, names[test]) && is_wanted(name, names[test]);
        Split { train: vec![train], test: (0..names.len()).filter(tests).collect() }
    };
    names.iter().enumerate().map(split).filter(|split| !split.test.is_empty()).collect()
}

const PATHS: [(DrivenPath, &str); 2] =
    [(DrivenPath::Standard, "standard path"), (DrivenPath::Extended, "extended path")];

const BAG_INSTEAD: &[&str] = &["FAST, CS-LBP and a bag instead of Harris-Laplace, SIFT and the match kernel"];

pub(super) fn dynamic(drives: &Drives, base: &Config) -> Plan {
    let printed = |lab: &str, path: DrivenPath, same_light: bool| {
        let of_lab = match lab {
            "saarbruecken" => [0.905, 0.838],
            "freiburg" => [0.856, 0.818],
            "ljubljana" => [0.904, 0.855],
            _ => return None,
        };
        same_light.then_some(of_lab[usize::from(path == DrivenPath::Extended)])
    };
    let mut cells = Vec::new();
    for lab in drives.labs() {
        for (path, path_name) in PATHS {
            for (same_light, light) in [(true, "same light"), (false, "other light")] {
                let splits = pairs(drives, |a, b| {
                    (&a.lab, a.path) == (&lab, path) && (a.illumination == b.illumination) == same_light
                });
                cells.push(Cell {
                    row: format!("{lab}, {path_name}"),
                    column: light.to_owned(),
                    splits,
                    config: base.clone(),
                    occlusion: Occlusion::default(),
                    printed: printed(&lab, path, same_light),
                });
            }
        }
    }
    cells.retain(|cell| !cell.splits.is_empty());
    Plan {
        experiment: Experiment::Dynamic,
        title: "Every pair of drives of a lab".to_owned(),
        source: "Ullah et al., figure 4",
        chart: Chart::Bars,
        differences: BAG_INSTEAD.to_vec(),
        cells,
    }
}

pub(super) fn geographic(drives: &Drives, base: &Config) -> Plan {
    let printed = |lab: &str, same_light: bool| match (lab, same_light) {
        ("saarbruecken", true) => Some(0.875),
        ("freiburg", true) => Some(0.8370),
        ("ljubljana", true) => Some(0.8795),
        ("saarbruecken", false) => Some(0.7582),
        ("freiburg", false) => Some(0.7103),
        ("ljubljana", false) => Some(0.7998),
        _ => None,
    };
    let mut cells = Vec::new();
    for lab in drives.labs() {
        for (same_light, light) in [(true, "same light"), (false, "other light")] {
            let splits =
                pairs(drives, |a, b| a.lab == lab && (a.illumination == b.illumination) == same_light);
            cells.push(Cell {
                row: lab.clone(),
                column: light.to_owned(),
                splits,
                config: base.clone(),
                occlusion: Occlusion::default(),
                printed: printed(&lab, same_light),
            });
        }
    }
    cells.retain(|cell| !cell.splits.is_empty());
    Plan {
        experiment: Experiment::Geographic,
        title: "The same parameters in every lab".to_owned(),
        source: "Ullah et al., section V",
        chart: Chart::Bars,
        differences: BAG_INSTEAD.to_vec(),
        cells,
    }
}

pub(super) fn categorical(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let labs = drives.labs();
    if labs.len() < 2 {
        return Err(Experiment::Categorical.missing("drives of two labs or more", drives));
    }
    let mut cells = Vec::new();
    for lab in &labs {
        for (light, name) in [(Cloudy, "cloudy"), (Night, "night"), (Sunny, "sunny")] {
            let train = drives.indices(|drive| drive.lab != *lab && drive.illumination == light);
            let test = drives.indices(|drive| drive.lab == *lab && drive.illumination == light);
            let n_labs =
                labs.iter().filter(|lab| train.iter().any(|&idx| drives.get(idx).name.lab == **lab)).count();
            if n_labs + 1 == labs.len() && !test.is_empty() {
                cells.push(Cell {
                    row: format!("answered in {lab}"),
                    column: name.to_owned(),
                    splits: vec![Split { train, test }],
                    config: base.clone(),
                    occlusion: Occlusion::default(),
                    printed: None,
                });
            }
        }
    }
    Ok(Plan {
        experiment: Experiment::Categorical,
        title: "Rooms of a lab that was never seen".to_owned(),
        source: "Ullah et al., figure 6",
        chart: Chart::Bars,
        differences: BAG_INSTEAD.to_vec(),
        cells,
    })
}
