//! The simulated lab: a robot drives through a lab that does not exist and takes pictures of it, in the
//! layout of the COLD database on disk.
//!
//! A stand-in with the difficulties of real recordings: rooms of different labs share kinds of furniture,
//! light changes, things are moved, doors open and shut, people walk about, cameras blur and are noisy.
//! It proves nothing about real rooms. Figures from it are to be called simulated.
//!
//! A lab is drawn from a seed ([`Lab`] and [`Part`] choose among six); a sequence is one drive through
//! it. What a sequence shows depends on its [`SequenceSpec`] alone, not on the number of threads.
//!
//! | file | what |
//! |---|---|
//! | `plan` | which rooms, how large, where doors and windows are |
//! | `robot` | the drive |
//! | `builder`, `building`, `furniture`, `person` | what stands where |
//! | `solid`, `caster`, `texture`, `light`, `scene` | what light comes along a ray |
//! | `optics`, `sensor` | from rays to pixels |
//! | `laser`, `odometry` | what else the robot senses |
//! | `sequence`, `walls` | files |

mod builder;
mod building;
mod caster;
mod furniture;
mod laser;
mod light;
mod odometry;
mod optics;
mod person;
mod plan;
mod robot;
mod scene;
mod sensor;
mod sequence;
mod solid;
mod texture;
mod vector;
mod walls;

pub use robot::{Pose, SPEED};
pub use sequence::{MARKER_FILE, SequenceSummary, SimulateError};
pub use walls::Wall;

use crate::cold_layout::{
    LAB_PREFIX, OMNIDIRECTIONAL_FOLDER, PART_FOLDERS, PERSPECTIVE_FOLDER, sequence_number,
};
use image::RgbImage;
use optics::{Optics, Sight};
use person::Person;
use plan::{OpeningKind, Plan};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::{Trajectory, wrapped};
use scene::{Ray, Scene};
use sensor::Exposure;
use std::path::PathBuf;
use vector::{gray, vec3};

/// An enum whose variants have names, listed and read by them.
macro_rules! named {
    ($(#[$doc:meta])* $kind:ident { $($(#[$variant_doc:meta])* $variant:ident = $name:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $kind {
            $($(#[$variant_doc])* $variant,)+
        }

        impl $kind {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$variant,)+];

            /// Its name, as in paths and on the command line.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }

            /// The one of this name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|one| one.name() == name)
            }
        }
    };
}

named! {
    /// A lab, called by the one of COLD whose list of rooms it has.
    Lab {
        /// Two parts of seven and five rooms off the corridor.
        Freiburg = "freiburg",
        /// The lab of the papers' experiments.
        Saarbruecken = "saarbruecken",
        /// Its part B has no counterpart in COLD.
        Ljubljana = "ljubljana",
    }
}

named! {
    /// A floor of a lab.
    Part {
        /// Labels end in `-A`.
        A = "a",
        /// Labels end in `-B`.
        B = "b",
    }
}

impl Part {
    fn suffix(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
        }
    }
}

named! {
    /// Which rooms the robot visits; COLD calls it a path.
    Route {
        /// Those that most labs have.
        Standard = "standard",
        /// All.
        Extended = "extended",
    }
}

named! {
    /// The light.
    Illumination {
        /// Even light from windows and some lamps.
        Cloudy = "cloudy",
        /// Lamps only.
        Night = "night",
        /// Daylight, and hard patches of sun where windows let it in.
        Sunny = "sunny",
    }
}

named! {
    /// A camera of the robot.
    CameraKind {
        /// 84.9 x 68.9 degrees, looking ahead.
        Perspective = "std",
        /// A camera below a hyperbolic mirror.
        Omnidirectional = "omni",
    }
}

impl CameraKind {
    /// The folder of its frames in a sequence.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Perspective => PERSPECTIVE_FOLDER,
            Self::Omnidirectional => OMNIDIRECTIONAL_FOLDER,
        }
    }
}

/// One drive of the robot through one lab.
#[derive(Clone, Debug, PartialEq)]
pub struct SequenceSpec {
    /// The lab.
    pub lab: Lab,
    /// The part of it.
    pub part: Part,
    /// Which rooms are visited.
    pub route: Route,
    /// The light.
    pub illumination: Illumination,
    /// Tells apart drives that are equal otherwise.
    pub run: u32,
    /// The seed of all labs: another seed is other labs.
    pub seed: u64,
    /// Frames a second, 5 in COLD. Fewer means fewer frames on the same way, so that all rooms are seen.
    pub frames_per_second: f32,
    /// Whether the robot stops now and then, as where somebody is in its way. COLD's does not.
    pub has_stops: bool,
}

impl SequenceSpec {
    /// The path of the sequence below the root, as in COLD: `cold-LAB/part_P/seqN_LIGHTn`.
    pub fn folder(&self) -> PathBuf {
        let number = sequence_number(self.part as usize, self.route == Route::Extended);
        let sequence = format!("seq{number}_{}{}", self.illumination.name(), self.run);
        let lab = format!("{LAB_PREFIX}{}", self.lab.name());
        PathBuf::from(lab).join(PART_FOLDERS[self.part as usize]).join(sequence)
    }

    /// What makes the lab's layout.
    fn lab_key(&self) -> [u64; 3] {
        [self.seed, self.lab as u64, self.part as u64]
    }

    /// What makes this sequence different from others in the same lab.
    fn run_key(&self) -> [u64; 6] {
        let [seed, lab, part] = self.lab_key();
        [seed, lab, part, self.route as u64, 16 + self.illumination as u64, u64::from(self.run)]
    }

    /// When the drive began, in Unix seconds: some day of the summer in which COLD was recorded.
    fn start_time(&self) -> f64 {
        let day = 10 * (self.lab as u32) + 3 * (self.illumination as u32) + self.run;
        1_151_900_000.0
            + 86_400.0 * f64::from(day)
            + 7_200.0 * f64::from(2 * self.part as u32 + self.route as u32)
    }

    fn exposure(&self) -> Exposure {
        match self.illumination {
            Illumination::Cloudy => {
                Exposure { time: 0.02, noise: 1.8, max_gain: 4.0, balance: vec3(1.0, 1.0, 0.98) }
            }
            Illumination::Sunny => {
                Exposure { time: 0.012, noise: 1.6, max_gain: 4.0, balance: vec3(1.0, 0.99, 0.97) }
            }
            Illumination::Night => {
                Exposure { time: 0.04, noise: 3.4, max_gain: 5.0, balance: vec3(0.97, 1.0, 1.15) }
            }
        }
    }
}

/// A stretch of the drive on which somebody walks before the robot.
#[derive(Clone, Copy, Debug)]
struct Encounter {
    /// From and to which distance driven, in meters.
    stretch: [f32; 2],
    /// How far ahead, and how far to the left, in meters.
    ahead: [f32; 2],
}

/// A sequence, ready to be looked at frame by frame.
pub struct Simulation {
    spec: SequenceSpec,
    scene: Scene,
    trajectory: Trajectory,
    cameras: Vec<Optics>,
    encounters: Vec<Encounter>,
    stops: Vec<Stop>,
}

/// A time in which the robot stands.
#[derive(Clone, Copy, Debug)]
struct Stop {
    /// After how many meters.
    at: f32,
    /// For how long, in seconds.
    seconds: f32,
}

impl Simulation {
    /// Builds the lab of a sequence; frames will be of 640 x 480 pixels, as in COLD.
    ///
    /// # Errors
    ///
    /// [`SimulateError::FrameRate`] unless 0 < frames a second <= 30.
    pub fn new(spec: &SequenceSpec) -> Result<Self, SimulateError> {
        Self::with_size(spec, [640, 480])
    }

    /// The same with frames of this width and height, 4 : 3 for cameras like the robots'.
    ///
    /// # Errors
    ///
    /// [`SimulateError::FrameRate`] unless 0 < frames a second <= 30.
    pub fn with_size(spec: &SequenceSpec, size: [usize; 2]) -> Result<Self, SimulateError> {
        if !(spec.frames_per_second > 0.0 && spec.frames_per_second <= 30.0) {
            return Err(SimulateError::FrameRate(spec.frames_per_second));
        }
        let plan = Plan::draw(spec.lab, spec.part, &mut seeded(&spec.lab_key()));
        let mut rng = seeded(&spec.run_key());
        let trajectory = Trajectory::draw(&plan, spec.route, &mut rng);
        let encounters = encounters(trajectory.length(), &mut rng);
        let stops =
            if spec.has_stops { stops(&encounters, trajectory.length(), &mut rng) } else { Vec::new() };
        let optics = |kind: &CameraKind| Optics::new(*kind, size, &mut seeded(&[spec.seed, spec.lab as u64]));
        let cameras = CameraKind::ALL.iter().map(optics).collect();
        let scene = Scene::build(spec, plan, trajectory.points());
        Ok(Self { scene, spec: spec.clone(), trajectory, cameras, encounters, stops })
    }

    /// The number of frames on the whole way, at least one.
    pub fn n_frames(&self) -> usize {
        let standing: f32 = self.stops.iter().map(|stop| stop.seconds).sum();
        (self.trajectory.length() / self.step() + standing * self.spec.frames_per_second) as usize + 1
    }

    /// Where the robot is when it takes a frame.
    pub fn pose(&self, frame_idx: usize) -> Pose {
        self.trajectory.pose_at(self.distance(frame_idx))
    }

    /// The label of the room that the robot stands in, such as `1PO-B`.
    pub fn place(&self, frame_idx: usize) -> &str {
        let pose = self.pose(frame_idx);
        let plan = self.scene.plan();
        &plan.rooms[plan.room_at(pose.x, pose.y)].label
    }

    /// The walls of the lab.
    pub fn walls(&self) -> Vec<Wall> {
        self.scene.plan().walls()
    }

    /// How far the robot is from the nearest door or passage to another room, in meters.
    pub fn border_distance(&self, frame_idx: usize) -> f32 {
        let Pose { x, y, .. } = self.pose(frame_idx);
        let corridor = &self.scene.plan().rooms[0];
        let distances =
            corridor.openings.iter().filter(|opening| opening.kind != OpeningKind::Window).map(|opening| {
                let wall_y =
                    if opening.side == plan::Side::North { corridor.rect.y1 } else { corridor.rect.y0 };
                let aside = ((x - opening.center).abs() - opening.width / 2.0).max(0.0);
                aside.hypot(y - wall_y)
            });
        distances.fold(f32::INFINITY, f32::min)
    }

    /// When a frame is taken, in Unix seconds.
    pub fn time(&self, frame_idx: usize) -> f64 {
        self.spec.start_time() + frame_idx as f64 / f64::from(self.spec.frames_per_second)
    }

    /// The name of a frame's file: `t<unix time>_x<m>_y<m>_a<rad>.jpeg`.
    pub fn file_name(&self, frame_idx: usize) -> String {
        let time = self.time(frame_idx);
        let Pose { x, y, heading } = self.pose(frame_idx);
        format!("t{time:.6}_x{x:.6}_y{y:.6}_a{heading:.6}.jpeg")
    }

    /// What a camera sees.
    pub fn render(&self, frame_idx: usize, kind: CameraKind) -> RgbImage {
        let optics = &self.cameras[kind as usize];
        let distance = self.distance(frame_idx);
        let pose = self.trajectory.pose_at(distance);
        let person = self.person(distance);
        let (sin, cos) = pose.heading.sin_cos();
        let [ahead, height] = optics.mount;
        let origin = vec3(pose.x + cos * ahead, pose.y + sin * ahead, height);
        let on_robot = self.scene.light_from_above(vec3(pose.x, pose.y, 0.9));
        let sees = |sight: &Sight| match *sight {
            Sight::Dark => gray(0.0),
            Sight::Robot(albedo) => albedo * on_robot,
            Sight::World(direction) => {
                let ray = Ray { origin, direction: direction.turned(cos, sin), spread: optics.spread };
                self.scene.radiance(&ray, person.as_ref())
            }
        };
        let light = optics.sights.iter().map(sees).collect();
        let noise_key = [&self.spec.run_key()[..], &[1 + kind as u64, frame_idx as u64]].concat();
        let turn_rate = self.trajectory.turn_rate(distance);
        sensor::develop(optics, light, &self.spec.exposure(), turn_rate, &mut seeded(&noise_key))
    }

    /// Meters between frames.
    fn step(&self) -> f32 {
        SPEED / self.spec.frames_per_second
    }

    /// Meters from the start to a frame.
    fn distance(&self, frame_idx: usize) -> f32 {
        let mut way = frame_idx as f32 * self.step();
        for stop in &self.stops {
            if way > stop.at {
                way = (way - stop.seconds * SPEED).max(stop.at);
            }
        }
        way
    }

    /// Who is in the way, if anybody.
    fn person(&self, distance: f32) -> Option<Person> {
        let within = |encounter: &&Encounter| {
            let [from, to] = encounter.stretch;
            from <= distance && distance < to
        };
        let Encounter { ahead: [ahead, aside], .. } = self.encounters.iter().find(within)?;
        let at = self.trajectory.pose_at(distance + ahead);
        let (sin, cos) = at.heading.sin_cos();
        let pose = Pose { x: at.x - sin * aside, y: at.y + cos * aside, heading: wrapped(at.heading) };
        Some(Person::new(self.scene.outfit(), pose, 9.0 * distance))
    }
}

fn encounters(length: f32, rng: &mut ChaCha8Rng) -> Vec<Encounter> {
    let mut encounters = Vec::new();
    let mut from = rng.random_range(1.0..14.0);
    while from < length {
        let to = from + rng.random_range(1.5..4.0);
        let ahead = [rng.random_range(1.3..2.6), rng.random_range(-0.35..0.35)];
        encounters.push(Encounter { stretch: [from, to], ahead });
        from = to + rng.random_range(7.0..22.0);
    }
    encounters
}

/// Before half of the people in the way, and in places between.
fn stops(encounters: &[Encounter], length: f32, rng: &mut ChaCha8Rng) -> Vec<Stop> {
    let mut stops = Vec::new();
    for Encounter { stretch: [from, to], .. } in encounters {
        let at =
            if rng.random_bool(0.5) { from + 0.5 * (to - from) } else { to + rng.random_range(0.5..4.0) };
        if at < length && rng.random_bool(0.7) {
            stops.push(Stop { at, seconds: rng.random_range(5.0..25.0) });
        }
    }
    stops
}

/// A source of chance for this list of numbers: mixed by SplitMix64 (Steele, Lea and Flood 2014).
fn seeded(key: &[u64]) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(mixed(key))
}

fn mixed(key: &[u64]) -> u64 {
    key.iter().fold(0x9E37_79B9_7F4A_7C15, |state, &part| {
        let mut z = (state ^ part).wrapping_add(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    })
}

#[cfg(test)]
mod tests;
