//! The frames of one request and their answers, whatever protocol brought them.

use super::caller::CallerId;
use super::frame::Frame;
use super::recognize::Task;
use super::timings::ms;
use super::{Engine, answer, recognize};
use crate::problem::Problem;
use roomsight_protocol::event::{AnswerEvent, Event};
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
}

/// Recognizes the frames of one request, all of them or, where the queue has no room, none.
pub async fn answers(
    engine: Engine,
    asked: Asked,
    frames: Vec<Frame>,
) -> Result<Vec<Result<Answer, Problem>>, Problem> {
    let slots = engine.pool.admit(&asked.caller, frames.len())?;
    let jobs = slots.into_iter().zip(frames);
    let waiting: Vec<_> =
        jobs.map(|(slot, frame)| recognize::recognize(&engine, slot, frame, asked.task.clone())).collect();
    let mut answers = Vec::with_capacity(waiting.len());
    for seen in waiting {
        let answer = seen.await.map(|seen| answer::answer(seen, &asked.query, &asked.request_id));
        if let Ok(answer) = &answer {
            engine.events.tell(|| {
                let latency = asked.arrived.elapsed();
                Event::Answer(Box::new(AnswerEvent::of_frame(answer, ms(latency))))
            });
        }
        answers.push(answer.map_err(Problem::from));
    }
    Ok(answers)
}
