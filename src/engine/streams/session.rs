//! One stream from its first connection to its end.
//!
//! A task of its own owns all of it; the threads only take frames from its lane and say what became of them.
//! The task outlives a connection that breaks, so that the robot can come back to its filter and to the
//! answers that it missed. Where it does not, another process may go on with it: `passing`.

mod hello;
mod passing;

pub use passing::TakenOver;

use super::inbox::{Incoming, Received};
use super::intake::Whole;
use super::kept::MAX_UNTOLD;
use super::lane::{Lane, Waiting};
use super::ledger::{Accepted, Ledger, Outcome};
use super::message::text;
use super::socket::{Close, Socket};
use super::teller::Teller;
use super::turn::{News, Turn};
use super::{Arrival, Streams, settings};
use crate::engine::Engine;
use crate::engine::caller::CallerId;
use crate::engine::frame::EMPTY_FRAME;
use crate::engine::metrics::{FrameOutcome, Transport};
use crate::engine::registry::Choice;
use crate::engine::robots::RobotRecord;
use crate::engine::spans::FrameSpans;
use crate::problem::Problem;
use roomsight_protocol::event::Event;
use roomsight_protocol::header::{Header, MAX_SEQ};
use roomsight_protocol::stream::{DropReason, FilterChange, Mode, ServerMessage, StreamSettings};
use std::pin::pin;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::mpsc::{self, UnboundedReceiver, UnboundedSender};
use tokio::time::{MissedTickBehavior, interval_at, sleep_until, timeout};
use tokio_tungstenite::tungstenite::Utf8Bytes;
use tokio_util::sync::CancellationToken;

pub struct Session {
    engine: Engine,
    identity: Identity,
    /// Cancelled when the stream must give its place to another.
    given_up: CancellationToken,
    settings: StreamSettings,
    /// The number of the next frame that brings none.
    next_seq: u64,
    /// In the mode `sampled`: when the last frame queued to be looked at, of those of the present settings.
    last_look: Option<Instant>,
    lane: Arc<Lane>,
    ledger: Ledger,
    teller: Teller,
    record: Arc<RobotRecord>,
    news: UnboundedReceiver<News>,
    /// For the threads.
    newsroom: UnboundedSender<News>,
    /// What became of the filter of a stream that was elsewhere before, until its robot was told.
    taken_over: Option<FilterChange>,
}

/// What a stream is called, and who opened it.
pub struct Identity {
    /// Known to its robot alone: who knows it may resume the stream.
    pub session: String,
    /// Known to all.
    pub stream: String,
    /// Who opened it, without the name of a robot.
    pub caller: CallerId,
}

/// How a conversation ended.
enum End {
    /// For good.
    Closed,
    /// The connection broke; the robot may come back.
    Lost,
    /// The robot came back over another connection before this one was known to be broken.
    Replaced(Box<Arrival>),
}

/// Why a conversation is over.
enum Over {
    /// The robot has closed it.
    Finish,
    /// The service closes it.
    Close(Close),
    /// The service closes the connection; the robot may come back.
    Pause(Close),
    /// The connection broke.
    Lost,
}

impl Over {
    /// Closes the connection. Whoever is at the other end may never answer: nothing waits for that.
    fn end(self, socket: Socket, streams: &Streams) -> End {
        match self {
            Self::Finish => streams.spawn(socket.finish()),
            Self::Close(why) => streams.spawn(socket.close(why)),
            Self::Pause(why) => {
                streams.spawn(socket.close(why));
                return End::Lost;
            }
            Self::Lost => return End::Lost,
        }
        End::Closed
    }
}

impl Session {
    /// A stream that is known as `record` to dashboards.
    ///
    /// # Errors
    /// No model serves.
    pub fn new(
        engine: Engine,
        identity: Identity,
        settings: StreamSettings,
        record: Arc<RobotRecord>,
    ) -> Result<Self, Problem> {
        let served =
            engine.registry.choose(Some(&settings.model), &Choice::Serving, settings.robot.as_deref())?;
        let teller = Teller::new(identity.stream.clone(), &served, &engine.settings);
        Ok(Self::with(teller, engine, identity, settings, record))
    }

    fn with(
        teller: Teller,
        engine: Engine,
        identity: Identity,
        settings: StreamSettings,
        record: Arc<RobotRecord>,
    ) -> Self {
        let (newsroom, news) = mpsc::unbounded_channel();
        record.configured(settings.robot.as_deref(), settings.mode);
        Self {
            teller,
            identity,
            given_up: CancellationToken::new(),
            settings,
            next_seq: 0,
            last_look: None,
            lane: Arc::default(),
            ledger: Ledger::default(),
            record,
            news,
            newsroom,
            taken_over: None,
            engine,
        }
    }

    /// What ends the stream in favor of another, while it has no connection.
    pub fn given_up(&self) -> &CancellationToken {
        &self.given_up
    }

    /// Talks until the stream has ended for good. Robots that come back do so through `arrivals`.
    pub async fn run(mut self, first: Arrival, mut arrivals: mpsc::Receiver<Box<Arrival>>) {
        let mut arrival = Some(Box::new(first));
        loop {
            let Some(arrived) = arrival.take() else { break };
            self.record.connected(true);
            self.engine.events.tell(Event::RobotJoined(self.record.name()));
            let end = self.converse(*arrived, &mut arrivals).await;
            self.record.connected(false);
            self.engine.events.tell(Event::RobotLeft(self.record.name()));
            arrival = match end {
                End::Closed => None,
                End::Replaced(arrival) => Some(arrival),
                End::Lost => self.wait_for_return(&mut arrivals).await,
            };
        }
        // Nobody is left to hear of them.
        self.lane.clear();
        arrivals.close();
        let why = if self.engine.stopping.is_cancelled() { Close::Draining } else { Close::GivenUp };
        while let Ok(late) = arrivals.try_recv() {
            self.engine.streams.spawn(late.socket.close(why));
        }
    }

    /// Talks over one connection.
    async fn converse(
        &mut self,
        Arrival { mut socket, is_resumed, last_seq }: Arrival,
        arrivals: &mut mpsc::Receiver<Box<Arrival>>,
    ) -> End {
        let engine = self.engine.clone();
        let hello = self.hello(is_resumed);
        if socket.send(text(&hello)).await.is_err() {
            return End::Lost;
        }
        let kept = self.teller.told_after(last_seq);
        // What is lost of a stream that was elsewhere.
        let lost = self.tell();
        if socket.say([kept, lost].concat()).await.is_err() {
            return End::Lost;
        }
        let record = self.record.clone();
        let mut revoked = pin!(engine.keyring.revoked(record.key(), || record.robot()));
        let every = engine.settings.stream_ping();
        let mut pings = interval_at(tokio::time::Instant::now() + every, every);
        pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            let look_at = self.look_at();
            let said = tokio::select! {
                biased;
                () = engine.stopping.cancelled() => return self.drain(socket).await,
                () = revoked.as_mut() => return Over::Close(Close::Revoked).end(socket, &engine.streams),
                Some(news) = self.news.recv() => self.hear(news),
                Some(arrival) = arrivals.recv() => {
                    engine.streams.spawn(socket.close(Close::Replaced));
                    return End::Replaced(arrival);
                }
                incoming = socket.receive(self.settings.mode == Mode::Lossless), if self.may_read() => {
                    match self.take_in(incoming, &mut socket) {
                        Ok(said) => said,
                        Err(over) => return over.end(socket, &engine.streams),
                    }
                }
                () = sleep_until(look_at.unwrap_or_else(Instant::now).into()), if look_at.is_some() => {
                    self.queue();
                    Vec::new()
                }
                _ = pings.tick() => {
                    // A stream that we do not read from is not idle: it waits for us.
                    if self.may_read() && socket.heard().elapsed() > engine.settings.stream_idle_timeout() {
                        return Over::Close(Close::Idle).end(socket, &engine.streams);
                    }
                    if socket.ping().await.is_err() {
                        return End::Lost;
                    }
                    Vec::new()
                }
            };
            if let Err(error) = socket.say(said).await {
                tracing::debug!(%error, "a stream lost its connection");
                return End::Lost;
            }
        }
    }

    /// What is said to what came, or that the conversation is over.
    fn take_in(&mut self, incoming: Incoming, socket: &mut Socket) -> Result<Vec<Utf8Bytes>, Over> {
        match incoming {
            Incoming::Frame(received) => Ok(self.accept(*received)),
            Incoming::Text(message) => Ok(vec![text(&self.configure(message.as_deref()))]),
            Incoming::Ping(payload) => {
                socket.note_ping(payload.freeze());
                Ok(Vec::new())
            }
            Incoming::Pong => Ok(Vec::new()),
            Incoming::Closed(farewell) => {
                socket.note_farewell(farewell);
                Err(Over::Finish)
            }
            Incoming::Broken(broken) => Err(Over::Close(Close::Broken(broken))),
            Incoming::Slow => Err(Over::Pause(Close::Slow)),
            Incoming::Stalled => Err(Over::Pause(Close::Stalled)),
            Incoming::Lost(error) => {
                tracing::debug!(%error, "a stream lost its connection");
                Err(Over::Lost)
            }
        }
    }

    /// Answers or drops what was accepted, then closes.
    async fn drain(&mut self, mut socket: Socket) -> End {
        for seq in self.lane.clear() {
            self.ledger.settle(seq, Outcome::Dropped(DropReason::Draining));
        }
        let mut said = vec![text(&ServerMessage::Draining)];
        said.extend(self.tell());
        loop {
            if socket.say(said).await.is_err() {
                return End::Closed;
            }
            if self.ledger.len() == 0 {
                break;
            }
            let Some(news) = self.news.recv().await else { break };
            said = self.hear(news);
        }
        socket.close(Close::Draining).await;
        End::Closed
    }

    /// Goes on with the frames that were accepted, until the robot comes back or its time is up.
    async fn wait_for_return(&mut self, arrivals: &mut mpsc::Receiver<Box<Arrival>>) -> Option<Box<Arrival>> {
        let (engine, record) = (self.engine.clone(), self.record.clone());
        let returned = async {
            loop {
                tokio::select! {
                    biased;
                    () = engine.stopping.cancelled() => return None,
                    () = self.given_up.cancelled() => return None,
                    () = engine.keyring.revoked(record.key(), || record.robot()) => return None,
                    Some(news) = self.news.recv() => { self.hear(news); }
                    arrival = arrivals.recv() => return arrival,
                }
            }
        };
        timeout(engine.settings.stream_resume(), returned).await.ok().flatten()
    }

    /// Whether there is room for another frame. Where there is none TCP holds the sender back.
    fn may_read(&self) -> bool {
        let settings = &self.engine.settings;
        let max_untold =
            if self.settings.mode == Mode::Lossless { settings.stream_window } else { MAX_UNTOLD };
        self.ledger.len() < max_untold && self.ledger.unsettled_bytes() < settings.max_stream_bytes
    }

    /// Takes a frame in.
    fn accept(&mut self, Received { head, n_bytes, message, share }: Received) -> Vec<Utf8Bytes> {
        let header = Header::split(&head).map_err(|error| error.to_string());
        let header = match header.and_then(|header| self.in_order(header)) {
            Ok(header) => header,
            Err(detail) => return vec![self.error(None, &Problem::query(detail))],
        };
        let n_header_bytes = header.map_or(0, |header| header.n_bytes());
        let header = header.unwrap_or(Header { seq: self.next_seq, ..Header::default() });
        let Header { seq, captured_at_ns, odometry, has_scan } = header;
        self.next_seq = seq + 1;
        let arrived = Instant::now();
        self.record.accepted();
        let n_bytes = n_bytes - n_header_bytes;
        self.ledger.accept(Accepted { seq, arrived, captured_at_ns, odometry, n_bytes });
        // In the mode `sampled` it may wait for long, and may have to give way until then.
        let is_kept = self.settings.mode != Mode::Sampled;
        let message = if is_kept { message.and_then(Whole::keep) } else { message };
        match message {
            None => self.ledger.settle(seq, Outcome::Dropped(DropReason::Overload)),
            Some(_) if n_bytes == 0 => self.ledger.settle(seq, Outcome::Failed(Problem::query(EMPTY_FRAME))),
            Some(frame) => {
                let (deadline, spans) = (self.deadline(arrived), FrameSpans::begin(seq));
                self.wait(Waiting { seq, arrived, deadline, frame, n_header_bytes, has_scan, share, spans });
            }
        }
        self.tell()
    }

    /// The header, if its number is one that may come now; else what to do instead.
    fn in_order(&self, header: Option<Header>) -> Result<Option<Header>, String> {
        let next = self.next_seq;
        match header {
            Some(Header { seq, .. }) if next > MAX_SEQ => {
                Err(format!("no number is left for frame {seq}: send frames without a header from now on"))
            }
            Some(Header { seq, .. }) if !(next..=MAX_SEQ).contains(&seq) => {
                Err(format!("frame {seq} is out of order: the next number is from {next} to {MAX_SEQ}"))
            }
            header => Ok(header),
        }
    }

    fn deadline(&self, arrived: Instant) -> Option<Instant> {
        arrived.checked_add(Duration::from_millis(self.settings.deadline_ms?))
    }

    /// Lets a frame wait for its turn.
    fn wait(&mut self, frame: Waiting) {
        match self.settings.mode {
            Mode::Lossless => self.lane.push(frame),
            Mode::Latest | Mode::Sampled => {
                for seq in self.lane.supersede(frame) {
                    self.ledger.settle(seq, Outcome::Dropped(DropReason::Superseded));
                }
            }
        }
        self.queue();
    }

    /// In the mode `sampled`: when the frame that waits may queue.
    fn look_at(&self) -> Option<Instant> {
        let is_held = self.settings.mode == Mode::Sampled && self.lane.may_rest();
        is_held.then(|| self.next_look())
    }

    /// In the mode `sampled`: from when on a frame may be looked at.
    fn next_look(&self) -> Instant {
        let StreamSettings { interval_ms, sure_interval_ms, .. } = self.settings;
        let interval_ms = sure_interval_ms.filter(|_| self.teller.is_sure()).or(interval_ms);
        let next = |last: Instant| last + Duration::from_millis(interval_ms.unwrap_or_default());
        self.last_look.map_or_else(Instant::now, next)
    }

    /// Takes the stream's place in the queue, if it is time, the place is free and something waits.
    fn queue(&mut self) {
        let is_early = self.settings.mode == Mode::Sampled && self.next_look() > Instant::now();
        if !self.lane.claim_turn(is_early) {
            return;
        }
        self.last_look = Some(Instant::now());
        let turn = Turn {
            engine: self.engine.clone(),
            lane: self.lane.clone(),
            model: self.settings.model.clone(),
            robot: self.settings.robot.clone(),
            explain: self.settings.explain,
            record: self.record.clone(),
            newsroom: self.newsroom.clone(),
        };
        let span = tracing::Span::current();
        let caller = self.identity.caller.clone().with_robot(self.settings.robot.as_deref());
        self.engine.pool.queue(&caller, move || span.in_scope(|| turn.run()));
    }

    /// What follows from what a thread tells.
    fn hear(&mut self, news: News) -> Vec<Utf8Bytes> {
        match news {
            News::Took => {
                self.queue();
                Vec::new()
            }
            News::Settled(seq, outcome) => {
                self.ledger.settle(seq, outcome);
                self.tell()
            }
        }
    }

    /// Tells what is settled, in order.
    fn tell(&mut self) -> Vec<Utf8Bytes> {
        let mut said = Vec::new();
        while let Some((frame, outcome)) = self.ledger.next() {
            let seq = frame.seq;
            let messages = match outcome {
                Outcome::Seen(seen) => {
                    self.engine.metrics.answer(&seen.served.name, seen.room(), &seen.recognition);
                    self.count(&seen.served.name, seen.served.version, FrameOutcome::Answered(seen.timings));
                    let standing = self.engine.streams.tokens.are_told().then(|| self.standing());
                    self.teller.result(&frame, *seen, &self.settings, &self.engine, &self.record, standing)
                }
                Outcome::Failed(problem) => {
                    self.record.failed();
                    let model = self.teller.model();
                    self.count(&model.name, model.version, FrameOutcome::Failed(problem.kind().name()));
                    vec![self.error(Some(seq), &problem)]
                }
                Outcome::Dropped(reason) => {
                    self.record.dropped(reason);
                    self.engine.metrics.dropped(reason);
                    vec![text(&ServerMessage::Dropped { seq, reason })]
                }
            };
            for message in &messages {
                self.teller.keep(seq, message);
            }
            said.extend(messages);
        }
        said
    }

    /// Counts a frame that is told; one that cannot be read counts for the model of the last answer.
    fn count(&self, model: &str, version: u64, outcome: FrameOutcome) {
        self.engine.metrics.frame(model, version, Transport::Stream, outcome);
    }

    fn configure(&mut self, message: Option<&str>) -> ServerMessage {
        let changed = || {
            let change = settings::read(message)?;
            if let Some(robot) = &change.robot {
                self.engine.keyring.check_robot(self.record.key(), robot)?;
            }
            settings::changed(&self.settings, change, &self.engine.registry)
        };
        match changed() {
            Ok(settings) => {
                self.settings = settings;
                let robot = self.settings.robot.as_deref();
                self.engine.robots.configured(&self.record, robot, self.settings.mode);
                // What waited for its time in the mode `sampled` may no longer have to.
                self.last_look = None;
                self.queue();
                ServerMessage::Configured { settings: self.settings.clone() }
            }
            Err(problem) => ServerMessage::Error { seq: None, problem: problem.body(&self.identity.stream) },
        }
    }

    fn error(&self, seq: Option<u64>, problem: &Problem) -> Utf8Bytes {
        text(&ServerMessage::Error { seq, problem: problem.body(&self.identity.stream) })
    }
}
