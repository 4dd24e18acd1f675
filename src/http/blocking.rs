//! Work that waits for the disk or the network, on threads of its own.

use super::App;
use crate::engine::pool::Panicked;
use crate::engine::recognize::RecognizeError;
use crate::problem::Problem;
use tokio::task::spawn_blocking;

/// Runs what waits for disks or networks on a thread for that.
pub async fn blocking<T: Send + 'static, E: Into<Problem> + Send + 'static>(
    app: &App,
    work: impl FnOnce(&App) -> Result<T, E> + Send + 'static,
) -> Result<T, Problem> {
    let app = app.clone();
    let done = spawn_blocking(move || work(&app)).await;
    // A panic on the way is a defect of ours.
    done.map_err(|_| Problem::from(RecognizeError::from(Panicked)))?.map_err(Into::into)
}
