//! How long a robot stays in each room and where it goes from there, in continuous time: a Markov chain
//! whose rate out of room i is 1 / dwell(i), so that the robot stays for t seconds with probability
//! exp(-t / dwell(i)). Frames of training and of streaming may come at different rates.

use roomsight_vision::matrix::Matrix;

/// What the mean dwell is taken for where no drive says it, in seconds.
const DEFAULT_DWELL: f64 = 20.0;

/// The shortest and the longest mean dwell, in seconds.
const DWELL_RANGE: (f64, f64) = (0.1, 1e6);

/// How fast robots drive where nothing says it, in meters a second: those of the COLD database.
const DEFAULT_SPEED: f32 = 0.3;

/// The slowest and the fastest mean speed, in meters a second.
const SPEED_RANGE: (f32, f32) = (0.01, 10.0);

/// The longest time that is told from forever, in seconds; after it no robot is where it was.
const MAX_ELAPSED: f64 = 1e8;

/// The most jumps that are summed one by one.
const MAX_JUMPS: f64 = 16.0;

/// The weight of the jumps that are left out of the sum.
const MAX_REMAINDER: f64 = 1e-12;

/// How far from 1 the sum of probabilities in a file may be.
const SUM_TOLERANCE: f32 = 1e-3;

/// How robots move between the rooms of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Transitions {
    /// One mean a room, in seconds.
    dwells: Vec<f32>,
    /// From each room (row) to the next one (column); each row sums to 1, no room follows itself.
    next: Matrix,
    /// The mean of the drives that said where they went, in meters a second.
    speed: Option<f32>,
}

/// From one frame of a drive to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The room of the first frame.
    pub from: usize,
    /// The room of the second.
    pub to: usize,
    /// The time between them. What is negative or no number counts as 0, what exceeds 1e8 as that.
    pub seconds: f64,
    /// The way between them, in meters, where that is known.
    pub meters: Option<f64>,
}

/// Why arrays are no transitions.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransitionsError {
    /// Not one dwell and one row a room.
    #[error("its transitions are between {found} rooms instead of {expected}")]
    Shape {
        /// Rooms of the arrays.
        found: usize,
        /// Rooms of the model.
        expected: usize,
    },
    /// A dwell out of range.
    #[error("its mean dwell in room {0} is out of range")]
    Dwell(usize),
    /// A row that is no distribution over the other rooms.
    #[error("its transitions from room {0} do not sum to 1 over the other rooms")]
    Next(usize),
    /// A speed out of range.
    #[error("its mean speed is out of range")]
    Speed,
}

impl Transitions {
    /// Where nothing was learned: all rooms alike, 20 seconds in each.
    pub fn unlearned(n_rooms: usize) -> Self {
        Self::learn(n_rooms, [])
    }

    /// Learns from all steps of drives between `n_rooms` rooms.
    ///
    /// The mean dwell of a room is the time spent there over the number of departures, the maximum
    /// likelihood also where drives begin and end within visits; where a robot goes is counted. No room is
    /// taken at its word alone: each gets one more visit, which lasts as long as the mean of all rooms and
    /// goes on to every other room alike. So no transition is impossible.
    ///
    /// Where steps say how far they went, the mean speed is learned too, that of robots that stand for a while included: by it
    /// the way of a robot says how long it would have stayed.
    ///
    /// Panics when a room is not below `n_rooms`.
    pub fn learn(n_rooms: usize, steps: impl IntoIterator<Item = Step>) -> Self {
        let mut seconds = vec![0.0; n_rooms];
        let mut n_departures = vec![0.0; n_rooms];
        let mut counts = vec![vec![0.0; n_rooms]; n_rooms];
        let (mut all_meters, mut all_seconds) = (0.0, 0.0);
        for step in steps {
            if let Some(meters) = step.meters.filter(|meters| meters.is_finite()) {
                all_meters += meters;
                all_seconds += sensible(step.seconds);
            }
            seconds[step.from] += sensible(step.seconds);
            if step.from != step.to {
                n_departures[step.from] += 1.0;
                counts[step.from][step.to] += 1.0;
            }
        }
        let n_all: f64 = n_departures.iter().sum();
        let mean = if n_all > 0.0 { seconds.iter().sum::<f64>() / n_all } else { DEFAULT_DWELL };
        let dwell = |(seconds, n_departures): (&f64, &f64)| {
            ((seconds + mean) / (n_departures + 1.0)).clamp(DWELL_RANGE.0, DWELL_RANGE.1) as f32
        };
        let dwells = seconds.iter().zip(&n_departures).map(dwell).collect();
        let share = 1.0 / (n_rooms.max(2) - 1) as f64;
        let mut next = Matrix::zeros(n_rooms, n_rooms);
        for (from, (counts, n_departures)) in counts.iter().zip(&n_departures).enumerate() {
            let row = next.row_mut(from);
            for (to, count) in counts.iter().enumerate().filter(|&(to, _)| to != from) {
                row[to] = ((count + share) / (n_departures + 1.0)) as f32;
            }
        }
        let speed = (all_meters > 0.0 && all_seconds > 0.0)
            .then(|| ((all_meters / all_seconds) as f32).clamp(SPEED_RANGE.0, SPEED_RANGE.1));
        Self { dwells, next, speed }
    }

    /// Puts transitions between `n_rooms` rooms together from their arrays, as [`Transitions::dwells`],
    /// [`Transitions::next`] and [`Transitions::learned_speed`] gave them.
    ///
    /// # Errors
    /// Other shapes, a dwell that is not from 0.1 to 1,000,000 seconds, a row that is no distribution over
    /// the other rooms, a speed that is not from 0.01 to 10 meters a second.
    pub fn from_parts(
        n_rooms: usize,
        dwells: Vec<f32>,
        next: Matrix,
        speed: Option<f32>,
    ) -> Result<Self, TransitionsError> {
        for found in [dwells.len(), next.n_rows(), next.n_cols()] {
            if found != n_rooms {
                return Err(TransitionsError::Shape { found, expected: n_rooms });
            }
        }
        let range = DWELL_RANGE.0 as f32..=DWELL_RANGE.1 as f32;
        if let Some(room_idx) = dwells.iter().position(|dwell| !range.contains(dwell)) {
            return Err(TransitionsError::Dwell(room_idx));
        }
        if speed.is_some_and(|speed| !(SPEED_RANGE.0..=SPEED_RANGE.1).contains(&speed)) {
            return Err(TransitionsError::Speed);
        }
        let is_distribution = |(from, row): (usize, &[f32])| {
            let sum: f32 = row.iter().sum();
            row[from] == 0.0 && row.iter().all(|&to| to >= 0.0) && (sum - 1.0).abs() <= SUM_TOLERANCE
        };
        let wrong = next.rows().enumerate().position(|row| !is_distribution(row));
        wrong.map_or(Ok(Self { dwells, next, speed }), |room_idx| Err(TransitionsError::Next(room_idx)))
    }

    /// The mean time that a robot stays, one a room, in seconds.
    pub fn dwells(&self) -> &[f32] {
        &self.dwells
    }

    /// The probability of each room (column) as the one after a room (row), rooms x rooms.
    pub fn next(&self) -> &Matrix {
        &self.next
    }

    /// How fast the robots of training drove, in meters a second; `None` where their drives did not say where they went.
    pub fn learned_speed(&self) -> Option<f32> {
        self.speed
    }

    /// How fast robots drive, in meters a second: 0.3 where it was not learned.
    pub(super) fn speed(&self) -> f64 {
        f64::from(self.speed.unwrap_or(DEFAULT_SPEED))
    }

    /// Where a robot is `elapsed` seconds after it was somewhere with these probabilities. The answer sums
    /// to what `belief` sums to, but for rounding.
    ///
    /// By uniformization (Jensen, "Markoff chains as an aid in the study of Markoff processes", 1953): all
    /// rooms are left at the rate of the most restless one, some jumps lead back where they began, and the
    /// number of jumps is a Poisson variable. Every term is positive, so nothing cancels. What takes many
    /// jumps is a power of what takes few.
    pub(super) fn predict(&self, belief: &[f32], elapsed: f64) -> Vec<f64> {
        assert_eq!(belief.len(), self.dwells.len(), "transitions between other rooms");
        let belief: Vec<f64> = belief.iter().copied().map(f64::from).collect();
        let n_jumps = sensible(elapsed) / self.shortest_dwell();
        if n_jumps <= MAX_JUMPS {
            return self.after_jumps(belief, n_jumps);
        }
        let n_doublings = (n_jumps / MAX_JUMPS).log2().ceil() as i32;
        let n_jumps = n_jumps / f64::from(n_doublings).exp2();
        let surely = |room_idx: usize| (0..belief.len()).map(|idx| f64::from(idx == room_idx)).collect();
        let mut over_time: Vec<Vec<f64>> =
            (0..belief.len()).map(|room_idx| self.after_jumps(surely(room_idx), n_jumps)).collect();
        for _ in 0..n_doublings {
            over_time = over_time.iter().map(|row| weighted_sum(row, &over_time)).collect();
        }
        weighted_sum(&belief, &over_time)
    }

    /// Where a robot is after a Poisson number of jumps with this mean.
    fn after_jumps(&self, belief: Vec<f64>, mean: f64) -> Vec<f64> {
        let mut weight = (-mean).exp();
        let mut remainder = 1.0 - weight;
        let mut sum: Vec<f64> = belief.iter().map(|belief| weight * belief).collect();
        let mut after = belief;
        let mut n_jumps = 0.0;
        while remainder > MAX_REMAINDER {
            n_jumps += 1.0;
            weight *= mean / n_jumps;
            remainder -= weight;
            after = self.after_jump(&after);
            sum.iter_mut().zip(&after).for_each(|(sum, after)| *sum += weight * after);
        }
        sum
    }

    fn after_jump(&self, belief: &[f64]) -> Vec<f64> {
        let shortest = self.shortest_dwell();
        let mut after = vec![0.0; belief.len()];
        for (from, (&belief, &dwell)) in belief.iter().zip(&self.dwells).enumerate() {
            let leaving = belief * shortest / f64::from(dwell);
            after[from] += belief - leaving;
            after
                .iter_mut()
                .zip(self.next.row(from))
                .for_each(|(to, &next)| *to += leaving * f64::from(next));
        }
        after
    }

    fn shortest_dwell(&self) -> f64 {
        f64::from(self.dwells.iter().copied().fold(DWELL_RANGE.1 as f32, f32::min))
    }
}

/// A time of unknown origin, in seconds, from 0 to [`MAX_ELAPSED`].
fn sensible(seconds: f64) -> f64 {
    // The maximum with what is no number is the other number.
    seconds.clamp(0.0, MAX_ELAPSED).max(0.0)
}

/// The sum of `rows`, each times its weight.
fn weighted_sum(weights: &[f64], rows: &[Vec<f64>]) -> Vec<f64> {
    let mut sum = vec![0.0; weights.len()];
    for (weight, row) in weights.iter().zip(rows) {
        sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += weight * value);
    }
    sum
}
