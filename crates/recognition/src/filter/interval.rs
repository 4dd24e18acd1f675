//! What lies between two frames of a robot: time, and where its odometry is given, the way that it went.

/// Farther than this in no time, and this much farther a second, no robot goes indoors: it was carried, or its odometry began
/// anew. In meters, and meters a second.
const JUMP: f64 = 1.0;
const TOP_SPEED: f64 = 3.0;

/// The way after which a frame shows something new: by then it counts in full, as frames do that the trust was chosen on.
/// In meters and radians.
const NEW_VIEW_METERS: f64 = 0.05;
const NEW_VIEW_RADIANS: f64 = 0.1;

/// How much a frame counts that shows what the one before showed, and how fast time passes for a robot that stands: not at
/// all would trust odometry that stands still because it broke, or because the robot was lifted.
const STILL: f64 = 0.05;
const STILL_TIME: f64 = 0.02;

/// How a robot moved, by its odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// The way, in meters; not negative.
    pub meters: f64,
    /// By how much it turned, in radians from 0 to pi.
    pub radians: f64,
}

/// What lies between a frame and the one before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The time, in seconds, 0 for the first frame. What is negative or no number counts as 0.
    pub seconds: f64,
    /// How the robot moved meanwhile, where that is known.
    pub motion: Option<Motion>,
}

impl From<f64> for Interval {
    /// So many seconds of which nothing else is known.
    fn from(seconds: f64) -> Self {
        Self { seconds, motion: None }
    }
}

impl Interval {
    /// Whether the robot cannot have gone there by itself.
    pub(super) fn is_jump(&self) -> bool {
        self.motion.is_some_and(|motion| motion.meters > JUMP + TOP_SPEED * self.seconds.max(0.0))
    }

    /// The time in which a robot of this speed, in meters a second, goes as far; of a robot whose way is not known the time
    /// that passed.
    pub(super) fn driven_seconds(&self, speed: f64) -> f64 {
        let seconds = self.seconds.max(0.0);
        self.motion.map_or(seconds, |motion| (motion.meters / speed).max(STILL_TIME * seconds))
    }

    /// How much the frame counts, up to 1: little where it shows what the one before it showed.
    pub(super) fn new_view(&self) -> f64 {
        let Some(Motion { meters, radians }) = self.motion else { return 1.0 };
        let new = meters / NEW_VIEW_METERS + radians / NEW_VIEW_RADIANS;
        // Also where it is no number.
        if new > STILL { new.min(1.0) } else { STILL }
    }
}
