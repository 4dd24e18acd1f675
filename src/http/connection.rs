//! Connections: how many, how long, and how they end.

mod misread;
mod write_timeout;

use crate::engine::caller::CallerId;
use crate::engine::history;
use crate::engine::watch::watch;
use crate::http::caller::Peer;
use crate::http::connection::misread::Misread;
use crate::http::connection::write_timeout::WriteTimeout;
use crate::http::routes::router;
use crate::http::seats::{Line, Seat, Seats};
use crate::http::{App, tls};
use crate::outside;
use hyper::body::Incoming;
use hyper::header::{CONNECTION, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper::{Request, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use roomsight_protocol::fleet::Scope;
#[cfg(target_os = "linux")]
use socket2::SockRef;
use std::convert::Infallible;
use std::io;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio_util::either::Either;
use tokio_util::task::AbortOnDropHandle;

/// The most that is read ahead on one connection, and so the longest head of a request. What is no HTTP
/// or exceeds it is answered before there is a request, see [`Misread`].
const MAX_BUFFER_BYTES: usize = 64 << 10;
/// How long to wait after `accept` failed, most likely for want of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(200);
/// How long a connection without a request is kept when the service stops: a request that is on its way
/// then is answered.
const STOP_PAUSE: Duration = Duration::from_millis(200);

/// How long it may take to tell other services that this one stops.
const LAST_WORD: Duration = Duration::from_secs(1);

/// Serves until `shutdown` is ready. Then readiness turns 503, new frames are refused, accepted
/// ones are answered within the setting `drain_timeout_ms`, and this returns.
pub async fn serve(app: App, listener: TcpListener, shutdown: impl Future<Output = ()>) -> io::Result<()> {
    let (stop, stopped) = watch::channel(false);
    let acceptor = Acceptor {
        service: TowerToHyperService::new(router(app.clone())),
        seats: Arc::new(Seats::new(app.engine.settings.max_connections)),
        header_timeout: app.engine.settings.header_timeout(),
        write_timeout: app.engine.settings.write_timeout(),
        #[cfg(target_os = "linux")]
        unacknowledged_timeout: app.engine.settings.unacknowledged_timeout(),
        app: app.clone(),
        listener,
        stopped,
    };
    // They end with this call, as all tasks of a set do that is dropped.
    let mut aside = JoinSet::new();
    aside.spawn(watch(app.engine.clone()));
    aside.spawn({
        let app = app.clone();
        async move { match app.engine.metrics.tidy().await {} }
    });
    aside.spawn({
        let app = app.clone();
        async move { match app.refusals.tell().await {} }
    });
    aside.spawn({
        let app = app.clone();
        async move { match app.engine.live.make(app.engine.view(Scope::Service)).await {} }
    });
    aside.spawn({
        let app = app.clone();
        async move { match app.engine.fleet_live.make(app.engine.view(Scope::Fleet)).await {} }
    });
    aside.spawn(outside::tell(app.engine.clone()));
    let fleet = AbortOnDropHandle::new(tokio::spawn(outside::tell_fleet(app.engine.clone())));
    aside.spawn({
        let engine = app.engine.clone();
        async move { match history::keep(engine).await {} }
    });
    if app.speaks_tls() {
        let app = app.clone();
        aside.spawn(async move { match tls::watch(app).await {} });
    }
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
        () = tokio::time::sleep(app.engine.settings.drain_timeout()) => {
            tracing::warn!(connections = connections.len(), "stopped before all requests were answered");
        }
    }
    // Recordings end whole.
    let engine = app.engine.clone();
    let _ = tokio::task::spawn_blocking(move || engine.recordings.end_all()).await;
    // Other services are told that its robots are here no more.
    let _ = tokio::time::timeout(LAST_WORD, fleet).await;
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
    seats: Arc<Seats>,
    header_timeout: Duration,
    write_timeout: Duration,
    #[cfg(target_os = "linux")]
    unacknowledged_timeout: Duration,
    stopped: watch::Receiver<bool>,
}

impl Acceptor {
    /// Accepts connections into `connections`, for ever.
    async fn run(&self, connections: &mut JoinSet<()>, life: Life) -> Infallible {
        loop {
            let (stream, peer) = tokio::select! {
                accepted = self.accept() => accepted,
                Some(_) = connections.join_next() => continue,
            };
            let seat = loop {
                tokio::select! {
                    seat = self.seats.take(CallerId::at(peer.0.ip())) => break seat,
                    Some(_) = connections.join_next() => {}
                }
            };
            connections.spawn(self.connection(stream, peer, seat, life));
        }
    }

    async fn accept(&self) -> (TcpStream, Peer) {
        loop {
            match self.listener.accept().await {
                Ok((stream, address)) => return (stream, Peer(address)),
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
        seat: Seat,
        life: Life,
    ) -> impl Future<Output = ()> + Send + use<> {
        // An answer is one small write: waiting to fill a packet would only delay it.
        if let Err(error) = stream.set_nodelay(true) {
            tracing::debug!(%error, "TCP_NODELAY could not be set");
        }
        // A robot that reads rarely acknowledges what it is sent nevertheless; one that is gone does not.
        #[cfg(target_os = "linux")]
        if let Err(error) = SockRef::from(&stream).set_tcp_user_timeout(Some(self.unacknowledged_timeout)) {
            tracing::debug!(%error, "TCP_USER_TIMEOUT could not be set");
        }
        let mut http = http1::Builder::new();
        http.timer(TokioTimer::new())
            .header_read_timeout(self.header_timeout)
            .max_buf_size(MAX_BUFFER_BYTES)
            .keep_alive(life == Life::UntilStop);
        let (app, stopped) = (self.app.clone(), self.stopped.clone());
        let (router, write_timeout) = (self.service.clone(), self.write_timeout);
        let stop_pause = STOP_PAUSE.min(app.engine.settings.drain_timeout() / 2);
        async move {
            let line = seat.line().clone();
            let mut paused = pin!(paused(stopped.clone(), stop_pause));
            let stream = match &app.tls {
                None => Either::Left(stream),
                Some(tls) => {
                    let shaken = tokio::select! {
                        shaken = tls.accept(stream) => shaken,
                        () = line.gives_way() => {
                            return tracing::debug!(peer = %peer.0, "a handshake gave way to another connection");
                        }
                        () = paused.as_mut(), if life == Life::UntilStop => return,
                    };
                    match shaken {
                        Ok(stream) => Either::Right(stream),
                        Err(error) => {
                            return tracing::debug!(peer = %peer.0, %error, "a handshake of TLS failed");
                        }
                    }
                }
            };
            let stream = WriteTimeout::new(stream, write_timeout);
            let service = service(router, peer, line.clone(), stream.switch(), stopped.clone());
            let stream = TokioIo::new(Misread::new(stream, app.clone(), peer));
            let mut connection = pin!(http.serve_connection(stream, service).with_upgrades());
            let result = tokio::select! {
                result = connection.as_mut() => result,
                () = paused, if life == Life::UntilStop => {
                    connection.as_mut().graceful_shutdown();
                    connection.await
                }
                () = line.gives_way() => {
                    connection.as_mut().graceful_shutdown();
                    tokio::select! {
                        result = connection => result,
                        () = line.is_given_up() => return tracing::debug!("a connection gave way to another"),
                    }
                }
            };
            drop(seat);
            if let Err(error) = result {
                tracing::debug!(%error, "a connection ended early");
            }
        }
    }
}

/// What answers the requests of one connection. `no_write_timeout` is set when it becomes a stream.
/// An answer that is given after the stop is the connection's last.
fn service(
    router: TowerToHyperService<axum::Router>,
    peer: Peer,
    line: Arc<Line>,
    no_write_timeout: Arc<AtomicBool>,
    stopped: watch::Receiver<bool>,
) -> impl Service<Request<Incoming>, Response = axum::response::Response, Error = Infallible, Future: Send> {
    service_fn(move |mut request: Request<Incoming>| {
        request.extensions_mut().insert(peer);
        request.extensions_mut().insert(line.clone());
        let works = line.works();
        let answer = router.call(request);
        let (no_write_timeout, stopped) = (no_write_timeout.clone(), stopped.clone());
        async move {
            let _works = works;
            let mut answer = answer.await?;
            if answer.status() == StatusCode::SWITCHING_PROTOCOLS {
                // A stream has a time-out of its own.
                no_write_timeout.store(true, Ordering::Relaxed);
            } else if *stopped.borrow() {
                answer.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
            }
            Ok::<_, Infallible>(answer)
        }
    })
}

/// Ready so long after the service stops, or its `serve` is gone.
async fn paused(mut stopped: watch::Receiver<bool>, pause: Duration) {
    let _ = stopped.wait_for(|stopped| *stopped).await;
    tokio::time::sleep(pause).await;
}

/// Ready when all connections are done, and the streams that some of them became.
async fn finished(connections: &mut JoinSet<()>, app: &App) {
    while connections.join_next().await.is_some() {}
    app.engine.streams.finished().await;
}
