//! The frames of one request and their answers, whatever protocol brought them.

use super::caller::CallerId;
use super::doubts::OtherRooms;
use super::frame::Frame;
use super::recognize::{Shown, Task};
use super::robots::{LastAnswer, RobotRecord};
use super::timings::ms;
use super::{Engine, answer, recognize};
use crate::access::{Key, Role};
use crate::problem::Problem;
use roomsight_protocol::event::AnswerEvent;
use roomsight_protocol::rest::{Answer, RecognizeQuery};
use std::sync::Arc;
use std::time::Instant;

/// What is asked about frames, and what follows from it.
pub struct Asked {
    /// As it was asked.
    pub query: RecognizeQuery,
    /// The request's id.
    pub request_id: Arc<str>,
    /// When the request arrived.
    pub arrived: Instant,
    /// What to do with each frame.
    pub task: Task,
    /// Whose share of the threads and of the queue it takes.
    pub caller: CallerId,
    /// The key that it came with.
    pub key: Option<Arc<Key>>,
}

impl Asked {
    /// The robot that it says it is, or whose key it brings.
    fn robot(&self, engine: &Engine) -> Option<Arc<RobotRecord>> {
        let of_key = self.key.as_deref().filter(|key| key.role() == Role::Robot).map(Key::robot);
        let name = self.query.robot.as_deref().or(of_key)?;
        Some(engine.robots.named(name, self.key.as_ref()))
    }
}

/// Recognizes the frames of one request, all of them or, where the queue has no room, none.
pub async fn answers(
    engine: Engine,
    asked: Asked,
    frames: Vec<Frame>,
) -> Result<Vec<Result<Answer, Problem>>, Problem> {
    let slots = engine.pool.admit(&asked.caller, frames.len())?;
    let robot = asked.robot(&engine);
    let n_frames = frames.len();
    let begin = |(idx, (slot, frame))| {
        let mut task = asked.task.clone();
        if let Some(robot) = &robot {
            robot.accepted();
            // Of several the last one is kept.
            let number = (idx + 1 == n_frames).then(|| engine.robots.frame_number());
            task.shown_for = Some(Shown { robot: robot.clone(), number });
        }
        recognize::recognize(&engine, slot, frame, task)
    };
    let waiting: Vec<_> = slots.into_iter().zip(frames).enumerate().map(begin).collect();
    let mut answers = Vec::with_capacity(waiting.len());
    for seen in waiting {
        let answer = seen.await.map(|seen| {
            if let Some(doubtable) = &seen.doubtable {
                engine.doubts.consider(doubtable, seen.doubted_answer(), OtherRooms::default());
            }
            answer::answer(seen, &asked.query, &asked.request_id)
        });
        let latency_ms = ms(asked.arrived.elapsed());
        match (&answer, &robot) {
            (Ok(answer), Some(robot)) => {
                engine.robots.answered(robot, LastAnswer::of_frame(answer, latency_ms));
                engine.recordings.answer(robot, answer, None);
            }
            (Err(_), Some(robot)) => robot.failed(),
            (_, None) => {}
        }
        if let Ok(answer) = &answer {
            engine.events.answered(|| AnswerEvent::of_frame(answer, latency_ms));
        }
        answers.push(answer.map_err(Problem::from));
    }
    Ok(answers)
}
