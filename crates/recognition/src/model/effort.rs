//! What `train` chooses among where nothing is asked for.

use crate::classify::svm;
use crate::file::names::{BAG, PATTERNS};
use crate::look::laser::LaserShape;
use crate::look::lens::Lens;
use crate::model::choose::Candidate;
use crate::model::config::{ALWAYS_ALL, Config};
use crate::opinions::{
    Classifier, LaserConfig, MachinesConfig, MemoryConfig, OpinionConfig, PatternsConfig, Remembered,
    Representation, VectorConfig,
};
use crate::vocabulary;
use crate::vocabulary::Pooling;
use roomsight_vision::camera::CameraKind;
use roomsight_vision::describe::{CsLbp, Descriptor, Region, SiftDescriptor};
use roomsight_vision::detect::{Dense, Detector, Sift};
use roomsight_vision::network::Around;

/// Smaller pictures show few blobs, unless they are doubled.
const SMALL_SIDE: usize = 480;

/// How often cheap opinions are to be right where costly ones need not be asked.
const SURE: f64 = 0.95;

/// How much may be spent on a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// A few milliseconds, without a network.
    Fast,
    /// Some tens of milliseconds.
    #[default]
    Balanced,
    /// What answers best.
    Best,
}

/// What there is to choose from.
#[derive(Clone, Copy, Debug)]
pub struct Means {
    /// How much may be spent.
    pub effort: Effort,
    /// The camera whose frames are answered.
    pub camera: CameraKind,
    /// Whether the default network is there.
    pub has_network: bool,
    /// The longest side of the frames, in pixels, or about that.
    pub longest_side: usize,
    /// How the scans of a laser beside the frames can be looked at, where there are any.
    pub laser: Option<LaserShape>,
}

impl Means {
    /// The candidates, in the order of preference. A laser is looked at beside whatever else, since it costs next to nothing.
    pub fn candidates(&self) -> Vec<Candidate> {
        let mut candidates = self.of_pictures();
        let Some(shape) = self.laser else { return candidates };
        let laser = Named("laser", OpinionConfig::Laser(LaserConfig { shape, ..LaserConfig::default() }));
        for candidate in &mut candidates {
            candidate.name.push_str(", and a laser");
            candidate.config.opinions.insert(laser.0.to_owned(), laser.1.clone());
        }
        candidates.push(self.candidate("a laser alone", vec![laser]));
        candidates
    }

    fn of_pictures(&self) -> Vec<Candidate> {
        let with_network = self.has_network && self.effort != Effort::Fast;
        let is_around = self.camera != CameraKind::Perspective;
        let (mut rooms, looks) = match self.effort {
            Effort::Fast => (vec![memory()], vec![patterns()]),
            // Corners of all around are enough.
            Effort::Balanced if is_around => (vec![memory()], vec![patterns(), bag(of_patterns())]),
            // The blobs of a doubled picture are four times the work.
            Effort::Balanced => {
                let blobs = sift(300, self.longest_side < SMALL_SIDE);
                (vec![memory(), blobs], vec![patterns(), bag(of_gradients())])
            }
            Effort::Best if is_around => {
                (vec![memory(), sift(600, true)], vec![patterns(), bag(of_patterns())])
            }
            Effort::Best => (vec![sift(600, true)], vec![patterns(), bag(of_gradients())]),
        };
        if !with_network {
            return vec![
                self.candidate("places and patterns", [&rooms[..], &looks].concat()),
                self.candidate("patterns alone", looks),
            ];
        }
        rooms.push(self.vector());
        // Of a frame of an ordinary lens, keypoints tell more places than the cells of a grid, and both no more than they.
        if is_around {
            rooms.push(self.grid());
        }
        vec![
            self.candidate("places and a network", rooms.clone()),
            self.candidate("a network alone", vec![self.vector()]),
            self.candidate("everything", [rooms, looks].concat()),
        ]
    }

    fn candidate(self, name: &str, opinions: Vec<Named>) -> Candidate {
        let opinions = opinions.into_iter().map(|Named(name, opinion)| (name.to_owned(), opinion)).collect();
        let early_precision = match self.effort {
            Effort::Fast | Effort::Balanced => SURE,
            Effort::Best => ALWAYS_ALL,
        };
        Candidate { name: name.to_owned(), config: Config { opinions, early_precision, ..Config::default() } }
    }

    /// How the default network looks at frames.
    fn lens(&self) -> Lens {
        match self.camera {
            CameraKind::Perspective => Lens::of_size(384, 224, Around::Views { n: 8 }),
            CameraKind::Equirectangular => Lens::default(),
            // A mirror shows less than views are made for: one strip does for the vector and the grid.
            CameraKind::Omnidirectional => Lens::of_size(704, 256, Around::Strip { border: 32 }),
        }
    }

    fn vector(&self) -> Named {
        // Of all around there are few frames, of which none may be passed over.
        let c = if self.camera == CameraKind::Perspective { 1.0 } else { 10.0 };
        Named("vector", OpinionConfig::Vector(VectorConfig { lens: self.lens(), c }))
    }

    /// Cells of panoramas are looked for on one strip, since views would show most of them twice, and are coarser.
    fn grid(&self) -> Named {
        let lens = match self.camera {
            CameraKind::Equirectangular => Lens::of_size(640, 256, Around::Strip { border: 32 }),
            _ => self.lens(),
        };
        let features = Remembered::Grid { lens, grid: "block14".to_owned() };
        Named("grid", OpinionConfig::Memory(MemoryConfig { features, ..MemoryConfig::default() }))
    }
}

/// An opinion by its name.
#[derive(Clone)]
struct Named(&'static str, OpinionConfig);

/// Corners, as the fast loops find them.
fn memory() -> Named {
    Named("memory", OpinionConfig::Memory(MemoryConfig::default()))
}

/// Blobs, also those that only the doubled picture shows, if wanted.
fn sift(target: usize, doubled: bool) -> Named {
    let features = Remembered::Keypoints {
        detector: Detector::Sift(Sift { target, doubled, ..Sift::default() }),
        descriptor: Descriptor::Sift(SiftDescriptor::default()),
    };
    Named("sift", OpinionConfig::Memory(MemoryConfig { features, ..MemoryConfig::default() }))
}

fn patterns() -> Named {
    Named(PATTERNS, OpinionConfig::Patterns(PatternsConfig::default()))
}

/// What the bag describes the points of its grid by, in a few milliseconds.
fn of_patterns() -> Descriptor {
    let region = Region { side: 16, scaled: true, ..Region::default() };
    Descriptor::CsLbp(CsLbp { radius: 1.0, region, ..CsLbp::default() })
}

/// The same in some tens of milliseconds, which tells more rooms apart.
fn of_gradients() -> Descriptor {
    Descriptor::Sift(SiftDescriptor::default())
}

/// Words of a grid of points at several sizes, counted where they lie.
fn bag(descriptor: Descriptor) -> Named {
    let bag = vocabulary::Config {
        n_words: 400,
        max_descriptors: 50_000,
        max_rounds: 15,
        pooling: Pooling::Pyramid { levels: 3 },
        ..vocabulary::Config::default()
    };
    let machines = MachinesConfig {
        detector: Detector::Dense(Dense::default()),
        descriptor,
        representation: Representation::Bag(bag),
        classifier: Classifier::LinearSvm(svm::Config { c: 5.0, ..svm::Config::default() }),
    };
    Named(BAG, OpinionConfig::Machines(machines))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::choose::all_opinions;

    #[test]
    fn candidates_are_parts_of_one_configuration_that_makes_sense() {
        for camera in [CameraKind::Perspective, CameraKind::Equirectangular, CameraKind::Omnidirectional] {
            for effort in [Effort::Fast, Effort::Balanced, Effort::Best] {
                let laser = Some(LaserShape::default());
                let means = Means { effort, camera, has_network: false, longest_side: 640, laser };
                let candidates = means.candidates();
                assert!(candidates.iter().all(|candidate| candidate.config.opinions.contains_key("laser")));
                let all = all_opinions(&candidates).unwrap();
                assert_eq!(all.check(), Ok(()));
                for candidate in candidates {
                    assert_eq!(
                        candidate.config,
                        all.with_opinions(|name| candidate.config.opinions.contains_key(name))
                    );
                }
            }
        }
    }

    #[test]
    fn a_network_is_looked_through_where_there_is_one_and_time_for_it() {
        let looks_through = |effort, has_network| {
            let camera = CameraKind::Equirectangular;
            let means = Means { effort, camera, has_network, longest_side: 640, laser: None };
            all_opinions(&means.candidates()).unwrap().opinions.contains_key("vector")
        };
        assert!(looks_through(Effort::Balanced, true) && looks_through(Effort::Best, true));
        assert!(!looks_through(Effort::Fast, true) && !looks_through(Effort::Best, false));
    }
    #[test]
    fn all_are_always_asked_where_it_may_cost_most() {
        let always = |effort| {
            let camera = CameraKind::Perspective;
            let means = Means { effort, camera, has_network: true, longest_side: 640, laser: None };
            means.candidates().iter().all(|candidate| candidate.config.early_precision >= ALWAYS_ALL)
        };
        assert_eq!([Effort::Fast, Effort::Balanced, Effort::Best].map(always), [false, false, true]);
    }
}
