//! One robot whose stream goes on where its service breaks or stops.

use super::robot::{Drive, Feed, Pending, Shot, kind};
use roomsight_client::{ClientError, LastingStream};
use roomsight_protocol::stream::{Hello, Mode};
use std::sync::Arc;
use tokio::sync::mpsc;

/// Sends over a stream, and waits for the last answers.
pub async fn stream(drive: Arc<Drive>, mut feed: Feed, mut stream: LastingStream) {
    let Hello { settings, limits, .. } = stream.hello().clone();
    let has_window = !drive.is_paced && settings.mode == Mode::Lossless;
    let most_pending = if has_window { limits.window.saturating_sub(1) } else { usize::MAX };
    let is_followed = feed.is_followed;
    let (shots, due) = mpsc::channel(1);
    let feeding = async {
        while let Some(shot) = feed.next(&drive).await
            && shots.send(shot).await.is_ok()
        {}
        drop(shots);
    };
    let playing = play(&drive, is_followed, due, &mut stream, most_pending);
    let ((), played) = tokio::join!(feeding, playing);
    if let Err(error) = played {
        drive.tally().err(kind(&error));
    }
}

async fn play(
    drive: &Drive,
    is_followed: bool,
    mut due: mpsc::Receiver<Shot>,
    stream: &mut LastingStream,
    most_pending: usize,
) -> Result<(), ClientError> {
    let pending = Pending::default();
    let mut has_more = true;
    while has_more || pending.len() > 0 {
        tokio::select! {
            shot = due.recv(), if has_more && pending.len() <= most_pending => match shot {
                Some(shot) => {
                    let sent = drive.send(is_followed, &shot);
                    let seq = stream.send_with(drive.beside(&shot), &shot.loaded.image).await?;
                    pending.add(seq, sent);
                }
                None => has_more = false,
            },
            message = stream.receive() => pending.take(drive, message?),
        }
    }
    Ok(())
}
