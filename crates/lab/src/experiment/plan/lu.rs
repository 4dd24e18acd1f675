//! The experiments of Lu et al.

use super::super::{Drives, Experiment, ExperimentError, Occlusion};
use super::{Cell, Chart, Plan, Split, Work, cell};
use crate::dataset::cold::Illumination;
use crate::validate::teams;
use Illumination::{Cloudy, Night, Sunny};
use roomsight_recognition::classify::boost;
use roomsight_recognition::classify::svm::{self, KernelConfig, KernelFunction};
use roomsight_recognition::model::{Classifier, Config, Representation};
use roomsight_recognition::vocabulary;
use roomsight_vision::camera::Projection;
use roomsight_vision::describe::{CsLbp, Descriptor, Lbp, SiftDescriptor, SurfDescriptor};
use roomsight_vision::detect::{Detector, Fast, FastThreshold, Sift, Surf};
use std::collections::BTreeSet;

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
        let rows_are = match self {
            Self::Stability | Self::Cost => "features",
            Self::Keypoints => "detector",
            Self::Words => "number of words k",
            Self::Kernels => "kernel",
            Self::Best => "model",
            Self::Illumination => "training drives",
            Self::Occlusion => "hidden part of the frame (%)",
            Self::Opinions => "opinions and training drive",
            _ => "features and training drive",
        };
        Plan {
            experiment: self,
            title: title.to_owned(),
            source,
            chart,
            rows_are,
            printed: None,
            differences: BAG_DIFFERENCES.to_vec(),
            cells: Vec::new(),
        }
    }
}

/// The features of table 1.
fn features_of_paper() -> [(&'static str, Detector, Descriptor); 4] {
    let fast = || Detector::Fast(Fast::default());
    [
        ("FAST+LBP", fast(), Descriptor::Lbp(Lbp::default())),
        ("FAST+CS-LBP", fast(), Descriptor::CsLbp(CsLbp::default())),
        ("SIFT", Detector::Sift(Sift::default()), Descriptor::Sift(SiftDescriptor::default())),
        ("SURF", Detector::Surf(Surf::default()), Descriptor::Surf(SurfDescriptor::default())),
    ]
}

/// The parameters of bags; the defaults where the configuration has none.
fn bag_of(config: &Config) -> vocabulary::Config {
    match config.machines().map(|machines| &machines.representation) {
        Some(Representation::Bag(bag)) => bag.clone(),
        _ => vocabulary::Config::default(),
    }
}

fn with_words(base: &Config, n_words: usize) -> Config {
    let bag = vocabulary::Config { n_words, ..bag_of(base) };
    base.with_bag(|machines| machines.representation = Representation::Bag(bag))
}

fn with_features(base: &Config, detector: &Detector, descriptor: &Descriptor) -> Config {
    base.with_bag(|machines| {
        machines.detector = detector.clone();
        machines.descriptor = descriptor.clone();
    })
}

pub(super) fn features(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Features;
    let tests = experiment.lu(drives, &LU_TESTS)?;
    let trainings = experiment.lu(drives, &LU_TRAININGS)?;
    let printed = [
        [[0.9375, 0.9245, 0.8216], [0.9472, 0.9621, 0.9149], [0.8867, 0.7238, 0.7493]],
        [[0.9611, 0.9364, 0.9468], [0.9254, 0.8659, 0.9470], [0.8666, 0.6802, 0.6863]],
        [[0.8168, 0.7282, 0.8361], [0.8495, 0.8342, 0.8892], [0.8083, 0.7362, 0.6335]],
        [[0.8313, 0.7255, 0.7954], [0.7225, 0.7849, 0.8150], [0.7760, 0.7711, 0.7813]],
    ];
    let mut plan = experiment.lu_plan("Local features, k = 200", "Lu et al., table 1", Chart::Bars);
    for ((name, detector, descriptor), printed) in features_of_paper().into_iter().zip(printed) {
        let config = with_features(&with_words(base, 200), &detector, &descriptor);
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

pub(super) fn kernels(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Kernels;
    let train = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let tests = experiment.lu(drives, &LU_TESTS)?;
    let over_bags = |kernel| Classifier::KernelSvm(KernelConfig { kernel, ..KernelConfig::default() });
    let classifiers: [(&str, Classifier, [Option<f64>; 3]); 6] = [
        ("linear", Classifier::LinearSvm(svm::Config::default()), [Some(0.9521), Some(0.9594), Some(0.9336)]),
        ("RBF", over_bags(KernelFunction::Rbf { gamma: None }), [Some(0.9632), Some(0.9477), Some(0.9475)]),
        (
            "sigmoid",
            over_bags(KernelFunction::Sigmoid { gamma: None, coef0: 0.0 }),
            [Some(0.9313), Some(0.9516), Some(0.9476)],
        ),
        ("chi-squared", over_bags(KernelFunction::ChiSquared { gamma: None }), [None; 3]),
        ("histogram intersection", over_bags(KernelFunction::HistogramIntersection), [None; 3]),
        ("AdaBoost instead", Classifier::Boost(boost::Config::default()), [None; 3]),
    ];
    let mut plan = experiment.lu_plan("Kernels over bags, k = 300", "Lu et al., table 3", Chart::Bars);
    for (name, classifier, printed) in classifiers {
        let config = with_words(base, 300).with_bag(|machines| machines.classifier = classifier);
        for (&(test, tested), printed) in tests.iter().zip(printed) {
            plan.cells.push(Cell { printed, ..cell(name, tested, &[train], test, config.clone()) });
        }
    }
    Ok(plan)
}

pub(super) fn stability(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Stability;
    let first = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let tests = experiment.lu(drives, &LU_TESTS)?;
    let lacks_poses =
        |drive_idx: usize| drives.get(drive_idx).dataset.frames.iter().all(|frame| frame.pose.is_none());
    if drives.get(first).camera.projection == Projection::Perspective {
        return Err(experiment.missing("frames that show all round", drives));
    }
    if lacks_poses(first) || tests.iter().any(|&(test, _)| lacks_poses(test)) {
        return Err(experiment.missing("the positions of all drives", drives));
    }
    let mut plan = experiment.lu_plan(
        "Keypoints of cloudy1 found again in other light",
        "Lu et al., table 2",
        Chart::Table,
    );
    plan.printed = Some(
        "the paper's pairs are single frames, of 180, 179, 81, 90, 189 and 163 corners, their correct matches counted \
         by eye",
    );
    plan.differences = vec![
        "means over up to 40 pairs of frames, taken within 0.5 m and 20 degrees of each other",
        "keypoints match when each is the other's nearest, by 0.8 of the distance of the second",
        "a match is correct when it agrees within 5 degrees with the turn between the frames that most matches agree \
         on, and within a tenth of the mirror's radius with its own height; by chance one wrong match in 200 does",
    ];
    for (name, detector, descriptor) in features_of_paper() {
        for &(test, tested) in &tests {
            let config = with_features(base, &detector, &descriptor);
            let work = Work::Match { drives: [first, test] };
            plan.cells.push(Cell { work, ..cell(name, tested, &[first], test, config) });
        }
    }
    Ok(plan)
}

pub(super) fn cost(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Cost;
    let train = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let test = experiment.lu(drives, &LU_TESTS[..1])?[0].0;
    let mut plan = experiment.lu_plan("Time and memory, k = 300", "Lu et al., section 6.8", Chart::Table);
    plan.printed = Some(
        "FAST+CS-LBP on a Core 2 Duo of 2.26 GHz: 5 to 20 ms features, under 10 ms bag and machines, 30 ms in all; \
         300 words of 72 numbers; 618, 279, 206 and 407 support vectors",
    );
    for (name, detector, descriptor) in features_of_paper() {
        let config = with_features(&with_words(base, 300), &detector, &descriptor);
        plan.cells
            .push(Cell { work: Work::Cost { train, test }, ..cell(name, "cloudy2", &[train], test, config) });
    }
    Ok(plan)
}

pub(super) fn keypoints(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Keypoints;
    let train = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let mut plan = experiment.lu_plan("Keypoints a frame", "Lu et al., table 2 and figure 5", Chart::Table);
    let thresholds =
        [("fixed threshold 20", FastThreshold::Fixed(20)), ("adapting threshold", Fast::default().threshold)];
    for (name, threshold) in thresholds {
        let detector = Detector::Fast(Fast { threshold });
        for (test, tested) in experiment.lu(drives, &LU_TESTS)? {
            plan.cells.push(cell(
                name,
                tested,
                &[train],
                test,
                base.with_bag(|machines| machines.detector = detector.clone()),
            ));
        }
    }
    Ok(plan)
}

pub(super) fn words(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Words;
    let train = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let tests = experiment.lu(drives, &LU_TESTS)?;
    let mut plan = experiment.lu_plan("The number of words", "Lu et al., figure 7", Chart::Lines);
    // And the number that is configured.
    let counts: BTreeSet<usize> = (50..=400).step_by(50).chain([bag_of(base).n_words]).collect();
    for n_words in counts {
        for &(test, tested) in &tests {
            let config = with_words(base, n_words);
            let cell = cell(&format!("k = {n_words}"), tested, &[train], test, config);
            plan.cells.push(Cell { parameter: Some(n_words as f64), ..cell });
        }
    }
    Ok(plan)
}

pub(super) fn illumination(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
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

pub(super) fn best(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Best;
    let train = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let matching = base.with_bag(|machines| {
        machines.representation = Representation::Descriptors {};
        machines.classifier = Classifier::MatchSvm(svm::MatchConfig::default());
    });
    let models = [
        ("FAST+CS-LBP, bag", with_words(base, 300), [0.9806, 0.9594, 0.9429]),
        ("FAST+CS-LBP, match kernel", matching, [0.9500, 0.9215, 0.9323]),
    ];
    let mut plan =
        experiment.lu_plan("The best model, trained on cloudy1", "Lu et al., tables 5 to 7", Chart::Bars);
    for (name, config, printed) in models {
        for ((test, tested), printed) in experiment.lu(drives, &LU_TESTS)?.into_iter().zip(printed) {
            let cell = cell(name, tested, &[train], test, config.clone());
            plan.cells.push(Cell { printed: Some(printed), ..cell });
        }
    }
    Ok(plan)
}

pub(super) fn occlusion(drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Occlusion;
    let train = experiment.lu(drives, &LU_TRAININGS[..1])?[0].0;
    let tests = experiment.lu(drives, &LU_TESTS)?;
    let mut plan =
        experiment.lu_plan("Parts of the frames hidden, k = 300", "Lu et al., figure 13", Chart::Lines);
    plan.differences =
        [BAG_DIFFERENCES, &["the stripes are eight upright ones; the paper does not say which"]].concat();
    for sixteenths in 0..=8 {
        for &(test, tested) in &tests {
            let percent = f64::from(sixteenths) * 6.25;
            let hidden = format!("{percent}%");
            let splits = vec![Split { train: vec![train], test: vec![test] }];
            let work = Work::Rate { splits, occlusion: Occlusion { sixteenths } };
            let cell = cell(&hidden, tested, &[train], test, with_words(base, 300));
            plan.cells.push(Cell { work, parameter: Some(percent), ..cell });
        }
    }
    Ok(plan)
}

/// Beside the experiments of the papers: each opinion of `all` alone, each pair, and all together.
pub(super) fn opinions(drives: &Drives, all: &Config) -> Result<Plan, ExperimentError> {
    let experiment = Experiment::Opinions;
    let tests = experiment.lu(drives, &LU_TESTS)?;
    let (cloudy, trained) = experiment.lu(drives, &LU_TRAININGS[..1])?[0];
    let mut plan = experiment.lu_plan("Opinions, each alone and together", "beside the papers", Chart::Bars);
    plan.differences = Vec::new();
    for team in teams(all) {
        let row = format!("{}, trained on {trained}", team.name);
        plan.cells.extend(
            tests.iter().map(|&(test, tested)| cell(&row, tested, &[cloudy], test, team.config.clone())),
        );
    }
    Ok(plan)
}
