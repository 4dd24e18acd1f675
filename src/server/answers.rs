//! The frames of one request and their answers, whatever protocol brought them.

use super::body::Frame;
use super::problem::Problem;
use super::query::Asked;
use super::{App, api, recognize};
use roomsight_protocol::event::{AnswerEvent, Event};
use roomsight_protocol::rest::Answer;

/// Recognizes the frames of one request, all of them or, where the queue has no room, none.
pub async fn answers(
    app: App,
    asked: Asked,
    frames: Vec<Frame>,
) -> Result<Vec<Result<Answer, Problem>>, Problem> {
    let slots = app.pool.admit(&asked.caller, frames.len())?;
    let jobs = slots.into_iter().zip(frames);
    let waiting: Vec<_> =
        jobs.map(|(slot, frame)| recognize::recognize(&app, slot, frame, asked.task.clone())).collect();
    let mut answers = Vec::with_capacity(waiting.len());
    for seen in waiting {
        let answer = seen.await.map(|seen| api::answer(seen, &asked.query, &asked.context.id));
        if let Ok(answer) = &answer {
            app.events.tell(|| {
                let latency = asked.context.arrived.elapsed();
                Event::Answer(Box::new(AnswerEvent::of_frame(answer, api::ms(latency))))
            });
        }
        answers.push(answer.map_err(Problem::from));
    }
    Ok(answers)
}
