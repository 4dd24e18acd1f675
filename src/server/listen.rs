//! Connections: how many, how long, and how they end.

use super::App;
use super::refusal::Refusals;
use super::routes::router;
use super::watch::watch;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinSet;

/// The most that is read ahead on one connection, and so the longest head of a request. What is no HTTP
/// or exceeds it is answered before there is a request, see [`Refusals`].
const MAX_BUFFER_BYTES: usize = 64 << 10;
/// How long to wait after `accept` failed, most likely for want of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(200);

/// The address that a connection comes from; every request carries it as an extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer(pub SocketAddr);

/// Serves until `shutdown` is ready. Then readiness turns 503, new frames are refused, accepted
/// ones are answered within the setting `drain_timeout_ms`, and this returns.
pub async fn serve(app: App, listener: TcpListener, shutdown: impl Future<Output = ()>) -> io::Result<()> {
    let (stop, stopped) = watch::channel(false);
    let acceptor = Acceptor {
        service: TowerToHyperService::new(router(app.clone())),
        app: app.clone(),
        permits: Arc::new(Semaphore::new(app.settings.max_connections)),
        header_timeout: app.settings.header_timeout(),
        listener,
        stopped,
    };
    // They end with this call, as all tasks of a set do that is dropped.
    let mut aside = JoinSet::new();
    aside.spawn(watch(app.clone()));
    aside.spawn({
        let app = app.clone();
        async move { match app.metrics.tidy().await {} }
    });
    let mut connections = JoinSet::new();
    tokio::select! {
        never = acceptor.run(&mut connections, Life::UntilStop) => match never {},
        () = shutdown => {}
    }
    app.drain();
    stop.send_replace(true);
    tracing::info!(connections = connections.len(), "stopping");
    // Whoever asks now still hears that the service is stopping.
    let mut late = JoinSet::new();
    tokio::select! {
        never = acceptor.run(&mut late, Life::OneRequest) => match never {},
        () = finished(&mut connections, &app) => tracing::info!("stopped"),
        () = tokio::time::sleep(app.settings.drain_timeout()) => {
            tracing::warn!(connections = connections.len(), "stopped before all requests were answered");
        }
    }
    Ok(())
}

/// How long a connection is kept.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Life {
    UntilStop,
    OneRequest,
}

struct Acceptor {
    app: App,
    listener: TcpListener,
    service: TowerToHyperService<axum::Router>,
    permits: Arc<Semaphore>,
    header_timeout: Duration,
    stopped: watch::Receiver<bool>,
}

impl Acceptor {
    /// Accepts connections into `connections`, for ever.
    async fn run(&self, connections: &mut JoinSet<()>, life: Life) -> Infallible {
        loop {
            tokio::select! {
                Some((stream, peer, permit)) = self.accept() => {
                    connections.spawn(self.connection(stream, peer, permit, life));
                }
                Some(_) = connections.join_next() => {}
            }
        }
    }

    /// The next connection, once fewer than the most are open.
    async fn accept(&self) -> Option<(TcpStream, Peer, OwnedSemaphorePermit)> {
        let permit = self.permits.clone().acquire_owned().await.ok()?;
        loop {
            match self.listener.accept().await {
                Ok((stream, address)) => return Some((stream, Peer(address), permit)),
                Err(error) => {
                    tracing::warn!(%error, "a connection could not be accepted");
                    tokio::time::sleep(ACCEPT_PAUSE).await;
                }
            }
        }
    }

    fn connection(
        &self,
        stream: TcpStream,
        peer: Peer,
        permit: OwnedSemaphorePermit,
        life: Life,
    ) -> impl Future<Output = ()> + Send + use<> {
        // An answer is one small write: waiting to fill a packet would only delay it.
        if let Err(error) = stream.set_nodelay(true) {
            tracing::debug!(%error, "TCP_NODELAY could not be set");
        }
        let router = self.service.clone();
        let service = service_fn(move |mut request: Request<Incoming>| {
            request.extensions_mut().insert(peer);
            router.call(request)
        });
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(self.header_timeout)
            .max_buf_size(MAX_BUFFER_BYTES)
            .keep_alive(life == Life::UntilStop)
            .serve_connection(TokioIo::new(Refusals::new(stream, self.app.clone())), service)
            .with_upgrades();
        let stopped = self.stopped.clone();
        async move {
            let _permit = permit;
            let mut connection = pin!(connection);
            let result = tokio::select! {
                result = connection.as_mut() => result,
                () = stop(stopped), if life == Life::UntilStop => {
                    connection.as_mut().graceful_shutdown();
                    connection.await
                }
            };
            if let Err(error) = result {
                tracing::debug!(%error, "a connection ended early");
            }
        }
    }
}

/// Ready when the service stops, or its `serve` is gone.
async fn stop(mut stopped: watch::Receiver<bool>) {
    let _ = stopped.wait_for(|stopped| *stopped).await;
}

/// Ready when all connections are done, and the streams that some of them became.
async fn finished(connections: &mut JoinSet<()>, app: &App) {
    while connections.join_next().await.is_some() {}
    app.streams.finished().await;
}
