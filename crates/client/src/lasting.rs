//! A stream that goes on by itself, over broken connections and services that stop.

use super::stream::{Stream, answered_seq};
use super::{Client, ClientError};
use roomsight_protocol::header::Beside;
use roomsight_protocol::stream::{Configure, DropReason, Hello, ServerMessage};
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout_at};

/// The longest wait before the second try; it doubles from try to try.
const FIRST_WAIT: Duration = Duration::from_millis(100);
const LONGEST_WAIT: Duration = Duration::from_secs(5);

/// A stream over which nothing comes for so long has broken: its service hangs, or the network between is gone.
pub(super) const SILENCE: Duration = Duration::from_secs(15);
/// A sign of life is asked for so often in that time.
const N_PINGS: u32 = 3;

/// The codes with which a stream is closed that may go on elsewhere, or later: the service stops, restarts, is full, or is gone
/// without a code.
const PASSING_CODES: [u16; 6] = [1001, 1005, 1006, 1011, 1012, 1013];

/// A stream that goes on by itself. Every frame that was sent gets one answer, in order: one whose service is gone is told as
/// dropped, being lost.
#[derive(Debug)]
pub struct LastingStream {
    client: Client,
    /// All that was configured.
    configure: Configure,
    patience: Duration,
    silence: Duration,
    stream: Stream,
    /// The number of the next frame.
    next_seq: u64,
    /// The frames without an answer.
    unanswered: VecDeque<u64>,
    /// The frames that no service knows, before this is told.
    lost: VecDeque<u64>,
    /// When a sign of life was asked for.
    pinged: Instant,
    /// Since the last message that was no `hello`.
    trouble: Option<Trouble>,
    /// The try to go on that is under way. It goes on where the caller stops waiting, and ends with the stream.
    attempt: JoinSet<Result<Stream, ClientError>>,
}

/// A service that is out of reach, or lets streams begin and no more.
#[derive(Debug)]
struct Trouble {
    began: Instant,
    /// The longest wait before the next try.
    longest_wait: Duration,
}

impl LastingStream {
    pub(super) async fn open(
        client: Client,
        configure: Configure,
        patience: Duration,
    ) -> Result<Self, ClientError> {
        let stream = Stream::open(&client, &configure).await?;
        let next_seq = stream.hello().next_seq;
        Ok(Self {
            client,
            configure,
            patience,
            silence: SILENCE,
            stream,
            next_seq,
            unanswered: VecDeque::new(),
            lost: VecDeque::new(),
            pinged: Instant::now(),
            trouble: None,
            attempt: JoinSet::new(),
        })
    }

    /// What the service said first that has it now.
    pub fn hello(&self) -> &Hello {
        self.stream.hello()
    }

    /// Sends an encoded image, taken at a time in nanoseconds since 1970 where that is known; returns its number.
    ///
    /// # Errors
    /// The service cannot be reached for too long, or refuses the stream.
    pub async fn send(&mut self, frame: &[u8], captured_at_ns: Option<u64>) -> Result<u64, ClientError> {
        self.send_with(Beside { captured_at_ns, ..Beside::default() }, frame).await
    }

    /// The same with what else the robot sensed.
    ///
    /// # Errors
    /// The service cannot be reached for too long, or refuses the stream.
    pub async fn send_with(&mut self, beside: Beside<'_>, frame: &[u8]) -> Result<u64, ClientError> {
        loop {
            self.arrive().await?;
            let seq = self.next_seq;
            // It may have been sent even where that failed.
            self.unanswered.push_back(seq);
            self.next_seq += 1;
            match self.stream.send_with(seq, beside, frame).await {
                Ok(()) => return Ok(seq),
                Err(error) => {
                    // This frame goes out again, under another number: nobody is to hear of this one.
                    self.unanswered.pop_back();
                    self.try_again(error)?;
                }
            }
        }
    }

    /// Changes the stream; what is left out stays. The service answers with `configured`.
    ///
    /// # Errors
    /// The service cannot be reached for too long, or refuses the stream.
    pub async fn configure(&mut self, change: &Configure) -> Result<(), ClientError> {
        self.configure = together(self.configure.clone(), change.clone());
        loop {
            self.arrive().await?;
            match self.stream.configure(change).await {
                Ok(()) => return Ok(()),
                Err(error) => self.try_again(error)?,
            }
        }
    }

    /// The next message.
    ///
    /// # Errors
    /// The service cannot be reached for too long, or refuses the stream.
    pub async fn receive(&mut self) -> Result<ServerMessage, ClientError> {
        loop {
            self.arrive().await?;
            if let Some(seq) = self.next_lost() {
                return Ok(ServerMessage::Dropped { seq, reason: DropReason::Lost });
            }
            match self.hear().await {
                Ok(message) => {
                    self.trouble = None;
                    // Else it was told twice, or of a frame that went out again.
                    if answered_seq(&message).is_none_or(|seq| self.is_answered(seq)) {
                        return Ok(message);
                    }
                }
                Err(error) => self.try_again(error)?,
            }
        }
    }

    /// The next message of the service that has the stream now.
    async fn hear(&mut self) -> Result<ServerMessage, ClientError> {
        loop {
            // By the clock, since the caller may stop waiting at any time, and wait again.
            let quiet_until = self.stream.heard().max(self.pinged) + self.silence / N_PINGS;
            if let Ok(heard) = timeout_at(quiet_until.into(), self.stream.receive()).await {
                return heard;
            }
            if self.stream.heard().elapsed() > self.silence {
                return Err(ClientError::Silent);
            }
            self.pinged = Instant::now();
            self.stream.ping().await?;
        }
    }

    /// A frame that is lost, once those before it have their answers.
    fn next_lost(&mut self) -> Option<u64> {
        let seq = *self.lost.front()?;
        let is_next = self.unanswered.front().is_none_or(|&first| seq < first);
        is_next.then(|| self.lost.pop_front())?
    }

    /// Whether this is the first answer to a frame.
    fn is_answered(&mut self, seq: u64) -> bool {
        let Ok(idx) = self.unanswered.binary_search(&seq) else { return false };
        self.unanswered.remove(idx);
        true
    }

    /// Begins a try to go on with the stream after this error, if that passes.
    fn try_again(&mut self, error: ClientError) -> Result<(), ClientError> {
        if !may_pass(&error) {
            return Err(error);
        }
        let trouble = self.trouble.get_or_insert_with(Trouble::begin);
        let wait = some_of(trouble.longest_wait);
        trouble.longest_wait = (trouble.longest_wait * 2).min(LONGEST_WAIT);
        if trouble.began.elapsed() + wait > self.patience {
            return Err(error);
        }
        let (client, point, configure) =
            (self.client.clone(), self.stream.resume_point(), self.configure.clone());
        self.attempt.spawn(async move {
            sleep(wait).await;
            Stream::resume(&client, &point, &configure).await
        });
        Ok(())
    }

    /// Goes on with the stream where a try to is under way, once one succeeds.
    async fn arrive(&mut self) -> Result<(), ClientError> {
        while let Some(tried) = self.attempt.join_next().await {
            // A task that was ended has opened nothing.
            match tried.unwrap_or(Err(ClientError::Late)) {
                Ok(stream) => {
                    self.stream = stream;
                    self.give_up_unknown();
                }
                Err(error) => self.try_again(error)?,
            }
        }
        Ok(())
    }

    /// Gives up the frames that the service does not know: of those before its next number it tells by itself.
    fn give_up_unknown(&mut self) {
        let hello = self.stream.hello();
        let first_unknown = if hello.resumed { hello.next_seq } else { 0 };
        let idx = self.unanswered.partition_point(|&seq| seq < first_unknown);
        self.lost.extend(self.unanswered.split_off(idx));
        self.next_seq = self.next_seq.max(hello.next_seq);
    }
}

impl Trouble {
    fn begin() -> Self {
        Self { began: Instant::now(), longest_wait: FIRST_WAIT }
    }
}

/// Whether it is worth another try.
fn may_pass(error: &ClientError) -> bool {
    match error {
        ClientError::Broken(_) | ClientError::Late | ClientError::Silent => true,
        ClientError::Closed { code, .. } => PASSING_CODES.contains(code),
        // A proxy whose services are gone, or a service that stops.
        ClientError::Foreign(status) => status.is_server_error(),
        ClientError::Refused { problem, .. } => matches!(problem.status, 429 | 503),
        _ => false,
    }
}

/// A random share of a time, so that robots do not come back all at once.
fn some_of(longest: Duration) -> Duration {
    let share = getrandom::u32().map_or(1.0, |random| f64::from(random) / f64::from(u32::MAX));
    longest.mul_f64(share)
}

/// A configuration after a change.
fn together(before: Configure, change: Configure) -> Configure {
    Configure {
        robot: change.robot.or(before.robot),
        model: change.model.or(before.model),
        mode: change.mode.or(before.mode),
        interval_ms: change.interval_ms.or(before.interval_ms),
        sure_interval_ms: change.sure_interval_ms.or(before.sure_interval_ms),
        filter: change.filter.or(before.filter),
        deadline_ms: change.deadline_ms.or(before.deadline_ms),
        top: change.top.or(before.top),
        explain: change.explain.or(before.explain),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fake::{self, Connection};
    use super::*;
    use roomsight_protocol::stream::Mode;
    use tokio::time::timeout;

    async fn lasting(url: &str, patience: Duration) -> LastingStream {
        let client = Client::new(url, Some("rs_k")).unwrap();
        let configure = Configure { robot: Some("wall-e".into()), ..Configure::default() };
        client.lasting_stream(&configure, patience).await.unwrap()
    }

    fn lost(seq: u64) -> ServerMessage {
        ServerMessage::Dropped { seq, reason: DropReason::Lost }
    }

    #[tokio::test]
    async fn a_stream_goes_on_as_it_was_configured_and_what_nobody_knows_is_lost() {
        let url = fake::serve(|mut connection: Connection| async move {
            if connection.uri.contains("session=") {
                assert!(connection.uri.contains("robot=wall-e&mode=lossless"), "{}", connection.uri);
                assert!(connection.uri.contains("last_seq=0&sent_seq=2"), "{}", connection.uri);
                let (header, _) = connection.frame().await.unwrap();
                connection.say(&fake::result(header.unwrap().seq, "lab")).await;
                let _ = connection.frame().await;
            } else {
                let _ = connection.text().await;
                let _ = connection.frame().await;
                connection.say(&fake::result(0, "lab")).await;
                let _ = (connection.frame().await, connection.frame().await);
            }
        });
        let mut stream = lasting(&url.await, Duration::from_secs(20)).await;
        stream.configure(&Configure { mode: Some(Mode::Lossless), ..Configure::default() }).await.unwrap();
        for seq in 0..3 {
            assert_eq!(stream.send(b"image", None).await.unwrap(), seq);
        }
        assert_eq!(stream.receive().await.unwrap(), fake::result(0, "lab"));
        assert_eq!(stream.receive().await.unwrap(), lost(1));
        assert_eq!(stream.receive().await.unwrap(), lost(2));
        assert_eq!(stream.send(b"image", None).await.unwrap(), 3);
        assert_eq!(stream.receive().await.unwrap(), fake::result(3, "lab"));
    }

    #[tokio::test]
    async fn a_service_that_hangs_is_left_and_one_that_has_nothing_to_say_is_not() {
        let url = fake::serve(|mut connection: Connection| async move {
            if !connection.uri.contains("session=") {
                // Not even pings are answered.
                return sleep(Duration::from_secs(60)).await;
            }
            let (header, _) = connection.frame().await.unwrap();
            // Meanwhile pings are.
            let _ = timeout(Duration::from_millis(600), connection.frame()).await;
            connection.say(&fake::result(header.unwrap().seq, "lab")).await;
        });
        let mut stream = lasting(&url.await, Duration::from_secs(20)).await;
        stream.silence = Duration::from_millis(150);
        assert_eq!(stream.send(b"image", None).await.unwrap(), 0);
        // Who has other things to do between, as robots have, learns of it too.
        let told = timeout(Duration::from_secs(10), async {
            loop {
                if let Ok(told) = timeout(Duration::from_millis(20), stream.receive()).await {
                    return told.unwrap();
                }
            }
        });
        assert_eq!(told.await.unwrap(), lost(0));
        assert_eq!(stream.send(b"image", None).await.unwrap(), 1);
        assert_eq!(stream.receive().await.unwrap(), fake::result(1, "lab"));
    }

    #[tokio::test]
    async fn patience_ends_and_a_refusal_is_no_matter_of_patience() {
        let url = fake::serve(|mut connection: Connection| async move {
            let code = if connection.uri.contains("session=") { 1013 } else { 1001 };
            connection.close(code, "not now").await;
        });
        let mut stream = lasting(&url.await, Duration::from_millis(300)).await;
        let error = stream.receive().await.unwrap_err();
        assert!(matches!(error, ClientError::Closed { code: 1001 | 1013, .. }), "{error}");
        let url = fake::serve(|mut connection: Connection| async move {
            connection.close(1008, "the key is gone").await;
        });
        let mut stream = lasting(&url.await, Duration::from_secs(3600)).await;
        let error = stream.receive().await.unwrap_err();
        assert!(matches!(error, ClientError::Closed { code: 1008, .. }), "{error}");
    }
}
