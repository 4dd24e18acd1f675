//! What each experiment trains and answers, and what its paper prints.

use super::{Drives, Experiment, ExperimentError};
use crate::dataset::cold::{DrivenPath, Illumination, SequenceName};
use crate::describe::{CsLbp, Descriptor, Lbp};
use crate::model::{Config, Representation};
use crate::vocabulary;
use serde::Serialize;
use std::collections::BTreeSet;

/// An experiment, laid out on the drives that there are.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// Which experiment.
    pub experiment: Experiment,
    /// What it is about.
    pub title: String,
    /// Where the paper reports it.
    pub source: &'static str,
    /// How its chart looks.
    pub chart: Chart,
    /// What is done otherwise than in the paper.
    pub differences: Vec<&'static str>,
    /// What is measured, in the order in which it is.
    pub cells: Vec<Cell>,
}

/// How the rates of a plan are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Chart {
    /// A group of bars a row, a bar a column.
    Bars,
    /// A line a column over the rows.
    Lines,
}

/// One figure of a table.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// Its row.
    pub row: String,
    /// Its column.
    pub column: String,
    /// What is trained and answered; the figure is the mean over all.
    #[serde(skip)]
    pub splits: Vec<Split>,
    /// What is trained.
    #[serde(skip)]
    pub config: Config,
    /// What is hidden of the answered frames.
    #[serde(skip)]
    pub occlusion: Occlusion,
    /// The rate that the paper prints, of COLD.
    pub printed: Option<f64>,
}

/// Drives that train, and others that are answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Indices of drives.
    pub train: Vec<usize>,
    /// Indices of drives.
    pub test: Vec<usize>,
}

/// Stripes of a frame whose pixels are not looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Occlusion {
    /// How much is hidden, in sixteenths of the frame, from 0 to 8.
    pub sixteenths: u8,
}

use Illumination::{Cloudy, Night, Sunny};

/// The drives that Lu answers, in the order of the tables.
const LU_TESTS: [(Illumination, u32, &str); 3] =
    [(Cloudy, 2, "cloudy2"), (Night, 1, "night1"), (Sunny, 1, "sunny1")];

/// The drives that Lu trains on.
const LU_TRAININGS: [(Illumination, u32, &str); 3] =
    [(Cloudy, 1, "cloudy1"), (Night, 2, "night2"), (Sunny, 2, "sunny2")];

/// What every experiment here does otherwise.
const BAG_DIFFERENCES: &[&str] = &[
    "bags are normalized by the square root instead of counted raw",
    "the threshold of FAST adapts to 300 corners a frame",
    "one sigmoid is shared by all machines and fitted on held-out frames",
];

impl Experiment {
    /// What it trains and answers of these drives, with `base` for all parameters that it does not set.
    ///
    /// # Errors
    /// Drives that it needs are missing.
    pub fn plan(self, drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
        match self {
            Self::Features => features(drives, base),
            Self::Keypoints => keypoints(drives, base),
            Self::Words => words(drives, base),
            Self::Illumination => illumination(drives, base),
            Self::Best => best(drives, base),
            Self::Occlusion => occlusion(drives, base),
            Self::Dynamic => Ok(dynamic(self, drives, base)),
            Self::Geographic => Ok(geographic(self, drives, base)),
            Self::Categorical => categorical(drives, base),
        }
        .and_then(|plan| {
            if plan.cells.is_empty() {
                Err(self.missing("drives that fit together", drives))
            } else {
                Ok(plan)
            }
        })
    }

    fn missing(self, needed: &str, drives: &Drives) -> ExperimentError {
        let experiment = format!("{self:?}").to_lowercase();
        ExperimentError::MissingDrives { experiment, needed: needed.to_owned(), present: drives.names() }
    }

    /// The drives of Lu in these lights.
    fn lu(
        self,
        drives: &Drives,
        wanted: &[(Illumination, u32, &'static str)],
    ) -> Result<Vec<(usize, &'static str)>, ExperimentError> {
        wanted
            .iter()
            .map(|&(light, run, name)| match drives.of_lu(light, run) {
                Some(drive_idx) => Ok((drive_idx, name)),
                None => Err(self.missing(&format!("part B, standard path, {name}"), drives)),
            })
            .collect()
    }

    fn lu_plan(self, title: &str, source: &'static str, chart: Chart) -> Plan {
        Plan {
            experiment: self,
            title: title.to_owned(),
            source,
            chart,
            differences: BAG_DIFFERENCES.to_vec(),
            cells: Vec::new(),
        }
    }
}

fn cell(row: &str, column: &str, train: &[usize], test: usize, config: Config) -> Cell {
    Cell {
        row: row.to_owned(),
        column: column.to_owned(),
        splits: vec![Split { train: train.to_vec(), test: vec![test] }],
        config,
        occlusion: Occlusion::default(),
        printed: None,
    }
}

/// The parameters of bags; the defaults where the configuration has none.
fn bag_of(config: &Config) -> vocabulary::Config {
    match &config.representation {
        Representation::Bag(bag) => bag.clone(),
        Representation::Descriptors => vocabulary::Config::default(),
    }
}

fn with_words(base: &Config, n_words: usize) -> Config {
    let bag = vocabulary::Config { n_words, ..bag_of(base) };
    Config { representation: Representation::Bag(bag), ..base.clone() }
}

fn features(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Features;
    let tests = experiment.lu(drives, &LU_TESTS)?;
    let trainings = experiment.lu(drives, &LU_TRAININGS)?;
    let descriptors: [(&str, Descriptor, [[f64; 3]; 3]); 2] = [
        (
            "FAST+LBP",
            Descriptor::Lbp(Lbp::default()),
            [[0.9375, 0.9245, 0.8216], [0.9472, 0.9621, 0.9149], [0.8867, 0.7238, 0.7493]],
        ),
        (
            "FAST+CS-LBP",
            Descriptor::CsLbp(CsLbp::default()),
            [[0.9611, 0.9364, 0.9468], [0.9254, 0.8659, 0.9470], [0.8666, 0.6802, 0.6863]],
        ),
    ];
    let mut plan = experiment.lu_plan("Local features, k = 200", "Lu et al., table 1", Chart::Bars);
    for (name, descriptor, printed) in descriptors {
        let config = Config { descriptor, ..with_words(base, 200) };
        for (train_idx, &(train, trained)) in trainings.iter().enumerate() {
            for (test_idx, &(test, tested)) in tests.iter().enumerate() {
                let row = format!("{name}, trained on {trained}");
                let cell = cell(&row, tested, &[train], test, config.clone());
                plan.cells.push(Cell { printed: Some(printed[test_idx][train_idx]), ..cell });
            }
        }
    }
    Ok(plan)
}

fn keypoints(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Keypoints;
    let train = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let mut plan = experiment.lu_plan("Keypoints a frame", "Lu et al., table 2 and figure 5", Chart::Bars);
    let thresholds = [
        ("fixed threshold 20", crate::detect::FastThreshold::Fixed(20)),
        ("adapting threshold", crate::detect::Fast::default().threshold),
    ];
    for (name, threshold) in thresholds {
        let detector = crate::detect::Detector::Fast(crate::detect::Fast { threshold });
        for (test, tested) in experiment.lu(drives, &LU_TESTS)? {
            plan.cells.push(cell(
                name,
                tested,
                &[train],
                test,
                Config { detector: detector.clone(), ..base.clone() },
            ));
        }
    }
    Ok(plan)
}

fn words(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Words;
    let train = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let tests = experiment.lu(drives, &LU_TESTS)?;
    let mut plan = experiment.lu_plan("The number of words", "Lu et al., figure 7", Chart::Lines);
    // And the number that is configured.
    let counts: BTreeSet<usize> = (50..=400).step_by(50).chain([bag_of(base).n_words]).collect();
    for n_words in counts {
        for &(test, tested) in &tests {
            let config = with_words(base, n_words);
            plan.cells.push(cell(&format!("k = {n_words}"), tested, &[train], test, config));
        }
    }
    Ok(plan)
}

fn illumination(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Illumination;
    let tests = experiment.lu(drives, &LU_TESTS)?;
    let trainings = experiment.lu(drives, &LU_TRAININGS)?;
    let printed = [
        [0.9296, 0.9366, 0.9523, 0.9634],
        [0.9550, 0.7190, 0.9516, 0.9707],
        [0.9380, 0.5919, 0.6379, 0.8362],
    ];
    let mut plan =
        experiment.lu_plan("The light that is trained in, k = 300", "Lu et al., table 4", Chart::Bars);
    let mut trained: Vec<(Vec<usize>, &str)> =
        trainings.iter().map(|&(idx, name)| (vec![idx], name)).collect();
    trained.push((trainings.iter().map(|&(idx, _)| idx).collect(), "all three"));
    for (train_idx, (train, name)) in trained.iter().enumerate() {
        for (test_idx, &(test, tested)) in tests.iter().enumerate() {
            let cell = cell(&format!("trained on {name}"), tested, train, test, with_words(base, 300));
            plan.cells.push(Cell { printed: Some(printed[test_idx][train_idx]), ..cell });
        }
    }
    Ok(plan)
}

fn best(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Best;
    let train = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let printed = [0.9806, 0.9594, 0.9429];
    let mut plan = experiment.lu_plan(
        "The best model, k = 300, trained on cloudy1",
        "Lu et al., tables 5 to 7",
        Chart::Bars,
    );
    for ((test, tested), printed) in experiment.lu(drives, &LU_TESTS)?.into_iter().zip(printed) {
        let cell = cell("FAST+CS-LBP", tested, &[train], test, with_words(base, 300));
        plan.cells.push(Cell { printed: Some(printed), ..cell });
    }
    Ok(plan)
}

fn occlusion(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Occlusion;
    let train = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let tests = experiment.lu(drives, &LU_TESTS)?;
    let mut plan =
        experiment.lu_plan("Parts of the frames hidden, k = 300", "Lu et al., figure 13", Chart::Lines);
    plan.differences =
        [BAG_DIFFERENCES, &["the stripes are eight upright ones; the paper does not say which"]].concat();
    for sixteenths in 0..=8 {
        for &(test, tested) in &tests {
            let hidden = format!("{}%", f64::from(sixteenths) * 6.25);
            let cell = cell(&hidden, tested, &[train], test, with_words(base, 300));
            plan.cells.push(Cell { occlusion: Occlusion { sixteenths }, ..cell });
        }
    }
    Ok(plan)
}

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

fn dynamic(experiment: Experiment, drives: &Drives, base: &Config) -> Plan {
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
        experiment,
        title: "Every pair of drives of a lab".to_owned(),
        source: "Ullah et al., figure 4",
        chart: Chart::Bars,
        differences: BAG_INSTEAD.to_vec(),
        cells,
    }
}

fn geographic(experiment: Experiment, drives: &Drives, base: &Config) -> Plan {
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
        experiment,
        title: "The same parameters in every lab".to_owned(),
        source: "Ullah et al., section V",
        chart: Chart::Bars,
        differences: BAG_INSTEAD.to_vec(),
        cells,
    }
}

fn categorical(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
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
