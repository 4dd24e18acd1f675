//! The calls about the inbox: frames that the model doubted, and what people say of them.

use crate::engine::answers::{Asked, answers};
use crate::engine::doubts::{DoubtedAnswer, DoubtedFrame, wrong};
use crate::http::App;
use crate::http::blocking::blocking;
use crate::http::body::{BodyError, OneFrame, read_json, read_json_list};
use crate::http::by::By;
use crate::http::openapi::{AddProblems, FrameProblems, ImageBytes, TeachingProblems};
use crate::http::picture;
use crate::http::query::Caller;
use crate::problem::Problem;
use crate::teaching::{InboxSize, TeachingError, check_room};
use axum::Json;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use roomsight_protocol::audit::Deed;
use roomsight_protocol::event::Event;
use roomsight_protocol::inbox::{
    DiscardJson, Discarded, InboxFrame, InboxList, InboxQuery, InboxRule, InboxState, LabeledFrames,
    LabelsJson, WidthQuery, WrongQuery,
};
use roomsight_protocol::rest::{Answer, RecognizeQuery};
use roomsight_protocol::training::{LearningPolicy, PublishedVersion};

/// Which frames are kept
///
/// And how many there are.
#[utoipa::path(
    get, path = "/v1/inbox/rule", tag = "teaching", security(("key" = [])),
    responses((status = OK, description = "The rule", body = InboxState), TeachingProblems)
)]
pub async fn show_rule(State(app): State<App>) -> Result<Json<InboxState>, Problem> {
    Ok(Json(blocking(&app, state).await?))
}

/// Lets other frames be kept
///
/// None are until somebody says so: frames show homes, and people in them.
#[utoipa::path(
    put, path = "/v1/inbox/rule", tag = "teaching", security(("key" = [])),
    request_body(content = InboxRule),
    responses((status = OK, description = "The rule", body = InboxState), AddProblems)
)]
pub async fn set_rule(State(app): State<App>, by: By, request: Request) -> Result<Json<InboxState>, Problem> {
    let empty = || BodyError::Malformed("send the rule as JSON".to_owned());
    let rule = read_json::<InboxRule>(&app, request).await?.ok_or_else(empty)?;
    let state = blocking(&app, move |app| {
        app.teaching()?.inbox.set_rule(&rule)?;
        app.engine.doubts.adopt(&rule);
        app.teaching()?.tell_inbox(&app.engine)?;
        let whom = match (rule.all, rule.robots.len() + rule.keys.len()) {
            (true, _) => "all callers".to_owned(),
            (false, 0) => "nobody".to_owned(),
            (false, n) => format!("{n} robots or keys"),
        };
        by.did(app, Deed::InboxRule, "inbox", &format!("keeps frames of {whom}"));
        state(app)
    });
    Ok(Json(state.await?))
}

fn state(app: &App) -> Result<InboxState, TeachingError> {
    let inbox = &app.teaching()?.inbox;
    let InboxSize { frames, bytes, .. } = inbox.size()?;
    Ok(InboxState { rule: inbox.rule()?, frames, bytes, missed: app.engine.doubts.n_missed() })
}

/// The frames of the inbox
///
/// Those that would teach most come first.
#[utoipa::path(
    get, path = "/v1/inbox", tag = "teaching", security(("key" = [])), params(InboxQuery),
    responses((status = OK, description = "Some of them", body = InboxList), TeachingProblems)
)]
pub async fn list_inbox(
    State(app): State<App>,
    query: Result<Query<InboxQuery>, QueryRejection>,
) -> Result<Json<InboxList>, Problem> {
    let Query(query) = query.map_err(|error| Problem::query(error.body_text()))?;
    Ok(Json(blocking(&app, move |app| app.teaching()?.inbox.list(&query)).await?))
}

/// The picture of a frame in the inbox
///
/// As it came, or a JPEG that is at most so many pixels wide.
#[utoipa::path(
    get, path = "/v1/inbox/{id}/picture", tag = "teaching", security(("key" = [])),
    params(("id" = i64, Path, description = "The frame's number"), WidthQuery),
    responses(
        (status = OK, description = "The picture", body = ImageBytes, content_type = "image/jpeg",
            headers(("ETag" = String, description = "For `If-None-Match`"))),
        (status = NOT_MODIFIED, description = "It is as it was"),
        TeachingProblems
    )
)]
pub async fn show_inbox_picture(
    State(app): State<App>,
    path: Result<Path<i64>, PathRejection>,
    query: Result<Query<WidthQuery>, QueryRejection>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let Path(id) = path.map_err(|error| Problem::query(error.body_text()))?;
    let Query(WidthQuery { width }) = query.map_err(|error| Problem::query(error.body_text()))?;
    picture::answer(&app, &headers, width, move |app| Ok(app.teaching()?.inbox.picture(id)?)).await
}

/// Says that a frame was answered wrong
///
/// The frame is answered once more and comes into the inbox, whatever the rule, with what it shows where that is known.
#[utoipa::path(
    post, path = "/v1/inbox", tag = "teaching", security(("key" = [])), params(WrongQuery),
    request_body(content(
        (ImageBytes = "image/jpeg"), (ImageBytes = "image/png"), (ImageBytes = "image/webp"),
        (ImageBytes = "image/bmp"), (ImageBytes = "image/x-portable-graymap"),
        (ImageBytes = "application/octet-stream")
    )),
    responses(
        (status = CREATED, description = "The frame in the inbox", body = InboxFrame),
        FrameProblems
    )
)]
pub async fn add_wrong(
    State(app): State<App>,
    by: By,
    query: Result<Query<WrongQuery>, QueryRejection>,
    caller: Caller,
    OneFrame(frame): OneFrame,
) -> Result<(StatusCode, Json<InboxFrame>), Problem> {
    let Query(WrongQuery { robot, right, model }) =
        query.map_err(|error| Problem::query(error.body_text()))?;
    app.teaching()?;
    let said = right.as_deref().map(check_room).transpose()?;
    let bytes = frame.lasting();
    // Not in the name of the robot, which has not sent it again.
    let query = RecognizeQuery { model, ..RecognizeQuery::default() };
    let mut asked = Asked::new(&app, query, caller)?;
    // It is kept in any case.
    asked.task.sender = None;
    let answer = answers(app.engine.clone(), asked, vec![frame]).await?.remove(0)?;
    let doubted = wrong(bytes, robot, None, doubted_answer(answer));
    let doubted = DoubtedFrame { said, ..doubted };
    let kept = blocking(&app, move |app| {
        let kept = app.teaching()?.inbox.keep(doubted)?;
        app.teaching()?.tell_inbox(&app.engine)?;
        let target = kept.robot.clone().unwrap_or_default();
        by.did(app, Deed::Wrong, &target, &format!("{} as frame {} of the inbox", kept.room, kept.id));
        Ok::<_, Problem>(kept)
    })
    .await?;
    Ok((StatusCode::CREATED, Json(kept)))
}

/// Labels frames of the inbox
///
/// They come into a data set, by one change that can be undone. Frames that somebody else has labelled since they were seen stay
/// as they are, and are named.
#[utoipa::path(
    post, path = "/v1/inbox/labels", tag = "teaching", security(("key" = [])),
    request_body(content = LabelsJson),
    responses((status = OK, description = "What became of each", body = LabeledFrames), AddProblems)
)]
pub async fn label_frames(
    State(app): State<App>,
    by: By,
    request: Request,
) -> Result<Json<LabeledFrames>, Problem> {
    let empty = || BodyError::Malformed("send the data set, the room and the frames as JSON".to_owned());
    let wanted = read_json_list::<LabelsJson>(&app, request).await?.ok_or_else(empty)?;
    blocking(&app, move |app| {
        let labeled = app.teaching()?.inbox.label(by.who(), &wanted)?;
        let n_labeled = labeled.labeled.len();
        if n_labeled > 0 {
            by.did(app, Deed::LabelFrames, &wanted.set, &format!("{n_labeled} as {}", wanted.room));
            app.teaching()?.tell_inbox(&app.engine)?;
            app.engine.events.tell(Event::SetChanged { set: wanted.set.clone() });
            app.trainer()?.labeled(&wanted.set, n_labeled);
        }
        Ok::<_, Problem>(Json(labeled))
    })
    .await
}

/// Throws frames of the inbox away
///
/// Those that teach nothing. Frames that were changed since they were seen stay.
#[utoipa::path(
    post, path = "/v1/inbox/discard", tag = "teaching", security(("key" = [])),
    request_body(content = DiscardJson),
    responses((status = OK, description = "How many went", body = Discarded), AddProblems)
)]
pub async fn discard_frames(
    State(app): State<App>,
    by: By,
    request: Request,
) -> Result<Json<Discarded>, Problem> {
    let empty = || BodyError::Malformed("send the frames as JSON".to_owned());
    let DiscardJson { frames } = read_json_list(&app, request).await?.ok_or_else(empty)?;
    let discarded = blocking(&app, move |app| {
        let teaching = app.teaching()?;
        let discarded = teaching.inbox.discard(&frames)?;
        teaching.tell_inbox(&app.engine)?;
        by.did(app, Deed::DiscardFrames, "inbox", &format!("{discarded} frames"));
        Ok::<_, TeachingError>(discarded)
    })
    .await?;
    Ok(Json(Discarded { discarded }))
}

/// What follows from labels by itself
///
/// A training after so many labels, and how far its model goes.
#[utoipa::path(
    get, path = "/v1/inbox/policy", tag = "teaching", security(("key" = [])),
    responses((status = OK, description = "The policy", body = LearningPolicy), TeachingProblems)
)]
pub async fn show_policy(State(app): State<App>) -> Result<Json<LearningPolicy>, Problem> {
    Ok(Json(blocking(&app, |app| app.trainer()?.policy()).await?))
}

/// Lets something else follow from labels by itself
///
/// Nothing that is trained so serves unless `publish` says `canary` or `stable`, and never where it is worse than what serves.
#[utoipa::path(
    put, path = "/v1/inbox/policy", tag = "teaching", security(("key" = [])),
    request_body(content = LearningPolicy),
    responses((status = OK, description = "The policy", body = LearningPolicy), AddProblems)
)]
pub async fn set_policy(
    State(app): State<App>,
    by: By,
    request: Request,
) -> Result<Json<LearningPolicy>, Problem> {
    let empty = || BodyError::Malformed("send the policy as JSON".to_owned());
    let policy = read_json::<LearningPolicy>(&app, request).await?.ok_or_else(empty)?;
    blocking(&app, move |app| {
        app.trainer()?.set_policy(&policy)?;
        let detail = format!("train after {} labels", policy.train_after);
        by.did(app, Deed::Policy, policy.model.as_deref().unwrap_or_default(), &detail);
        Ok::<_, Problem>(Json(policy))
    })
    .await
}

fn doubted_answer(answer: Answer) -> DoubtedAnswer {
    DoubtedAnswer {
        room: answer.room,
        known: answer.known,
        unknown: answer.unknown,
        probability: answer.probability,
        probabilities: answer.probabilities,
        novelty: answer.novelty,
        model: PublishedVersion { name: answer.model.name, version: answer.model.version },
    }
}
