//! How answers follow a robot from room to room: how late they notice that it is in another one.

use serde::Serialize;

/// How many frames in a row must be answered with the new room, or all up to the end of the visit if it is
/// shorter, for a change to count as noticed.
pub const N_HELD: usize = 3;

/// A frame of a drive, answered. Drives follow each other, each in the order it was driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StreamAnswer<'a> {
    /// The room that the frame shows.
    pub room: &'a str,
    /// The room that was answered.
    pub answered: &'a str,
    /// Since the frame before, in seconds; none where a drive begins.
    pub elapsed: Option<f64>,
}

/// What happened at the changes of room in some drives.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Changes {
    /// How often the labels change from frame to frame.
    pub n_changes: usize,
    /// Changes after which no [`N_HELD`] frames in a row were answered with the new room while it lasted.
    pub n_missed: usize,
    /// How often the answers change from frame to frame, for a reason or without.
    pub n_answered: usize,
    /// From the first frame that shows the new room to the first such answer, in frames; 0 is at once.
    pub late_frames: Option<Lateness>,
    /// The same in seconds.
    pub late_seconds: Option<Lateness>,
}

/// How late the changes were noticed, without those that were missed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lateness {
    /// No later than this for half of them.
    pub median: f64,
    /// No later than this for nine of ten.
    pub p90: f64,
}

impl Changes {
    /// Looks at all changes of room.
    pub fn new(answers: &[StreamAnswer]) -> Self {
        let (mut late_frames, mut late_seconds) = (Vec::new(), Vec::new());
        let mut changes = Self::default();
        for drive in answers.chunk_by(|_, next| next.elapsed.is_some()) {
            changes.n_answered += drive.chunk_by(|this, next| this.answered == next.answered).count() - 1;
            for visit in drive.chunk_by(|this, next| this.room == next.room).skip(1) {
                changes.n_changes += 1;
                let Some(n_late) = first_held(visit) else {
                    changes.n_missed += 1;
                    continue;
                };
                late_frames.push(n_late as f64);
                let elapsed = visit[1..=n_late].iter().filter_map(|answer| answer.elapsed);
                // The sum of nothing is -0.
                late_seconds.push(elapsed.fold(0.0, |sum, elapsed| sum + elapsed));
            }
        }
        Self { late_frames: Lateness::of(late_frames), late_seconds: Lateness::of(late_seconds), ..changes }
    }
}

impl Lateness {
    fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let rank = |percent: usize| (values.len() * percent).div_ceil(100).checked_sub(1);
        Some(Self { median: values[rank(50)?], p90: values[rank(90)?] })
    }
}

/// The first frame of a visit from which on the answer holds.
fn first_held(visit: &[StreamAnswer]) -> Option<usize> {
    (0..visit.len())
        .find(|&first| visit[first..].iter().take(N_HELD).all(|answer| answer.answered == answer.room))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One frame a letter, half a second apart.
    fn drive<'a>(rooms: &'a str, answered: &'a str) -> Vec<StreamAnswer<'a>> {
        assert_eq!(rooms.len(), answered.len());
        let answer = |idx: usize| StreamAnswer {
            room: &rooms[idx..=idx],
            answered: &answered[idx..=idx],
            elapsed: (idx > 0).then_some(0.5),
        };
        (0..rooms.len()).map(answer).collect()
    }

    #[test]
    fn a_change_is_noticed_where_the_new_answer_holds() {
        // A single right answer does not hold; a change at once is not late.
        let changes = Changes::new(&drive("hhhhkkkkkkkkbbbb", "hhhhhkhhkkkkbbbb"));
        assert_eq!((changes.n_changes, changes.n_missed, changes.n_answered), (2, 0, 4));
        assert_eq!(changes.late_frames, Some(Lateness { median: 0.0, p90: 4.0 }));
        assert_eq!(changes.late_seconds, Some(Lateness { median: 0.0, p90: 2.0 }));
    }

    #[test]
    fn a_short_visit_is_noticed_by_all_of_its_frames_and_else_missed() {
        let changes = Changes::new(&drive("hhhkkhhhhhbbb", "hhhkkhhhhhhhh"));
        assert_eq!((changes.n_changes, changes.n_missed), (3, 1));
        assert_eq!(Changes::new(&drive("hhhkkkkhhh", "hhhhkhhhhh")).n_missed, 1);
    }

    #[test]
    fn drives_do_not_run_into_each_other() {
        let answers = [drive("hhh", "hhh"), drive("kkk", "kkk")].concat();
        assert_eq!(Changes::new(&answers), Changes::default());
        assert_eq!(Changes::new(&[]), Changes::default());
    }

    #[test]
    fn ranks_are_nearest() {
        let lateness = Lateness::of((1..=10).rev().map(f64::from).collect());
        assert_eq!(lateness, Some(Lateness { median: 5.0, p90: 9.0 }));
    }
}
