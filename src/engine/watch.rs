//! Looks at the repository of models again and again, for what is new in it.
//!
//! Asking every few seconds works for all folders and buckets alike; being told by the system works for local
//! folders only.

use crate::engine::Engine;
use tokio::task::spawn_blocking;
use tokio::time::sleep;

/// Looks until the service stops, or once where the settings say never.
pub async fn watch(engine: Engine) {
    let mut was_reached = true;
    loop {
        let looking = engine.clone();
        let looked = spawn_blocking(move || looking.registry.poll()).await;
        let Ok(looked) = looked else { return tracing::error!("the models are not looked at any more") };
        match &looked {
            Ok(()) if !was_reached => tracing::info!("the models can be looked at again"),
            Err(error) if was_reached => {
                tracing::warn!(%error, "the models cannot be looked at; those that serve serve on");
            }
            _ => {}
        }
        was_reached = looked.is_ok();
        let Some(pause) = engine.settings.models_poll() else { return };
        tokio::select! {
            () = sleep(pause) => {}
            () = engine.stopping.cancelled() => return,
        }
    }
}
