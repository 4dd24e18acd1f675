//! Who streams, for dashboards.

use crate::http::App;
use crate::http::openapi::{RobotProblems, ViewerProblems};
use crate::problem::{Kind, Problem};
use axum::Json;
use axum::extract::{Path, State};
use roomsight_protocol::event::{RobotInfo, RobotList, RobotName};

/// Who streams
///
/// All streams, those included that broke off and can still be resumed.
#[utoipa::path(
    get, path = "/v1/robots", tag = "dashboards", security(("key" = [])),
    responses((status = OK, description = "All streams", body = RobotList), ViewerProblems)
)]
pub async fn list_robots(State(app): State<App>) -> Json<RobotList> {
    Json(RobotList { robots: app.engine.streams.records().iter().map(|record| record.info()).collect() })
}

/// One robot
///
/// By its name or its stream's; of several streams with one name, the one that began last.
#[utoipa::path(
    get, path = "/v1/robots/{id}", tag = "dashboards", security(("key" = [])),
    params(("id" = String, Path, description = "The robot's name, or its stream's")),
    responses((status = OK, description = "The robot", body = RobotInfo), RobotProblems)
)]
pub async fn show_robot(State(app): State<App>, Path(id): Path<String>) -> Result<Json<RobotInfo>, Problem> {
    let is_meant = |name: &RobotName| name.stream == id || name.robot.as_deref() == Some(&id);
    let records = app.engine.streams.records();
    let found = records.iter().filter(|record| is_meant(&record.name())).max_by_key(|record| record.began());
    found.map(|record| Json(record.info())).ok_or_else(|| no_robot(&id))
}

fn no_robot(id: &str) -> Problem {
    Problem::new(Kind::NotFound, format_args!("no robot {id:?} streams; GET /v1/robots lists those that do"))
}
