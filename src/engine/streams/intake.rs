//! The memory of frames under way: each byte is taken from the memory for bodies as it arrives.
//!
//! Where none is left, somebody must give way, so that frames that stand still cannot stop all others. In the
//! modes that may drop frames it is the largest frame of the caller who holds most. In the mode `lossless`
//! nothing gives way, so that a frame is not begun before there is room for all of it: these frames are let in
//! in the order in which they came, and have half of the memory at most, so that they never hold each other up,
//! nor the others. One caller has half of that, since a frame may come in as slowly as its sender likes.

use crate::engine::caller::CallerId;
use crate::engine::frame::Frame;
use bytes::BytesMut;
use std::collections::BTreeMap;
use std::future::poll_fn;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_util::sync::PollSemaphore;

/// What is allocated for a long frame before more than this of it has come. Then all that it will have is: memory
/// that is not written to yet costs nothing, while growing step by step leaves holes.
const FIRST_BYTES: usize = 256 << 10;

/// What all frames under way share.
pub struct Intake {
    /// One permit for each byte that may be held, by streams and others.
    memory: Arc<Semaphore>,
    /// What all frames in the mode `lossless` may have.
    room: Arc<Room>,
    /// What those of one caller may have of it, for each caller that is connected or has some.
    rooms: Mutex<BTreeMap<CallerId, Weak<Room>>>,
    max_room_a_caller: usize,
    shelf: Mutex<Shelf>,
    /// The most bytes on the shelf.
    max_shelf: usize,
}

/// The frames under way that may have to give way.
#[derive(Default)]
struct Shelf {
    parcels: BTreeMap<u64, Parcel>,
    next_id: u64,
    n_bytes: usize,
}

struct Parcel {
    holder: CallerId,
    bytes: Vec<u8>,
    held: OwnedSemaphorePermit,
}

impl Intake {
    /// Frames of up to `max_frame_bytes` that share the memory for `max_buffered_bytes`.
    pub fn new(memory: Arc<Semaphore>, max_buffered_bytes: usize, max_frame_bytes: usize) -> Self {
        let share = |divisor: usize| (max_buffered_bytes / divisor).max(max_frame_bytes);
        Self {
            memory,
            room: Arc::new(Room::new(share(2))),
            rooms: Mutex::default(),
            max_room_a_caller: share(4),
            shelf: Mutex::default(),
            max_shelf: share(4),
        }
    }

    /// The room for frames of all callers.
    pub fn room(&self) -> &Room {
        &self.room
    }

    /// The room for frames of one caller: the same for as long as anybody has it.
    pub fn room_of(&self, holder: &CallerId) -> Arc<Room> {
        let mut rooms = self.rooms.lock().unwrap_or_else(PoisonError::into_inner);
        rooms.retain(|_, room| room.strong_count() > 0);
        rooms.get(holder).and_then(Weak::upgrade).unwrap_or_else(|| {
            let room = Arc::new(Room::new(self.max_room_a_caller));
            rooms.insert(holder.clone(), Arc::downgrade(&room));
            room
        })
    }

    fn shelf(&self) -> MutexGuard<'_, Shelf> {
        self.shelf.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes memory, where need be from the frame that gives way first; none where that is `own`, or no frame is.
    fn take(&self, shelf: &mut Shelf, n_bytes: usize, own: Option<u64>) -> Option<OwnedSemaphorePermit> {
        let n_permits = u32::try_from(n_bytes).ok()?;
        loop {
            if (own.is_none() || shelf.n_bytes + n_bytes <= self.max_shelf)
                && let Ok(held) = self.memory.clone().try_acquire_many_owned(n_permits)
            {
                return Some(held);
            }
            let heaviest = shelf.heaviest(own, n_bytes)?;
            shelf.remove(heaviest);
            if own == Some(heaviest) {
                return None;
            }
        }
    }
}

/// Room for frames in the mode `lossless`.
pub struct Room {
    /// One permit for each byte.
    bytes: Arc<Semaphore>,
    /// How many frames wait to be let in.
    n_waiting: AtomicUsize,
}

impl Room {
    fn new(n_bytes: usize) -> Self {
        Self { bytes: Arc::new(Semaphore::new(n_bytes)), n_waiting: AtomicUsize::new(0) }
    }

    /// Whether a frame waits until others leave.
    pub fn is_awaited(&self) -> bool {
        self.n_waiting.load(Ordering::Relaxed) > 0
    }
}

impl Shelf {
    /// The largest frame of the caller who holds most, where `own` has so many more bytes; of two alike `own`.
    fn heaviest(&self, own: Option<u64>, n_more: usize) -> Option<u64> {
        let is_own = |id: &u64| own == Some(*id);
        let weight = |id: &u64, parcel: &Parcel| parcel.bytes.len() + if is_own(id) { n_more } else { 0 };
        let mut totals = BTreeMap::<&CallerId, (usize, bool)>::new();
        for (id, parcel) in &self.parcels {
            let (total, has_own) = totals.entry(&parcel.holder).or_default();
            *total += weight(id, parcel);
            *has_own |= is_own(id);
        }
        let (heaviest, _) = totals.into_iter().max_by_key(|&(_, weight)| weight)?;
        let its = self.parcels.iter().filter(|(_, parcel)| parcel.holder == *heaviest);
        its.max_by_key(|(id, parcel)| (weight(id, parcel), is_own(id))).map(|(id, _)| *id)
    }

    fn remove(&mut self, id: u64) -> Option<Parcel> {
        let parcel = self.parcels.remove(&id)?;
        self.n_bytes -= parcel.bytes.len();
        Some(parcel)
    }
}

/// A frame under way that may have to give way.
pub struct Yielding {
    intake: Arc<Intake>,
    id: u64,
    most: usize,
}

impl Yielding {
    /// A frame of `holder` that will have at most so many bytes.
    pub fn begin(intake: &Arc<Intake>, holder: &CallerId, most: usize) -> Option<Self> {
        let held = intake.memory.clone().try_acquire_many_owned(0).ok()?;
        let parcel = Parcel { holder: holder.clone(), bytes: Vec::new(), held };
        let mut shelf = intake.shelf();
        let id = shelf.next_id;
        shelf.next_id += 1;
        shelf.parcels.insert(id, parcel);
        drop(shelf);
        Some(Self { intake: intake.clone(), id, most })
    }

    /// Adds what arrived; does nothing where the frame has given way, or does so now.
    pub fn push(&self, more: &[u8]) {
        let mut shelf = self.intake.shelf();
        if !shelf.parcels.contains_key(&self.id) {
            return;
        }
        let held = self.intake.take(&mut shelf, more.len(), Some(self.id));
        if let (Some(held), Some(parcel)) = (held, shelf.parcels.get_mut(&self.id)) {
            extend(&mut parcel.bytes, more, self.most);
            parcel.held.merge(held);
            shelf.n_bytes += more.len();
        }
    }

    /// Whether it has not given way.
    pub fn is_here(&self) -> bool {
        self.intake.shelf().parcels.contains_key(&self.id)
    }

    /// The frame, which is whole; none where it has given way.
    pub fn finish(self) -> Option<Frame> {
        let Parcel { bytes, held, .. } = self.intake.shelf().remove(self.id)?;
        Some(Frame::new(bytes.into(), held))
    }
}

impl Drop for Yielding {
    fn drop(&mut self) {
        self.intake.shelf().remove(self.id);
    }
}

/// A frame that is whole.
pub enum Whole {
    /// Nobody else may have its memory.
    Kept(Frame),
    /// It may have to give way until it is taken.
    Yielding(Yielding),
}

impl Whole {
    /// The same, of which nobody else may have the memory from now on; none where it has given way.
    pub fn keep(self) -> Option<Self> {
        self.take().map(Self::Kept)
    }

    /// The frame; none where it has given way.
    pub fn take(self) -> Option<Frame> {
        match self {
            Self::Kept(frame) => Some(frame),
            Self::Yielding(frame) => frame.finish(),
        }
    }
}

/// A frame under way in the mode `lossless`.
pub struct Lossless {
    intake: Arc<Intake>,
    /// In its caller's room, for which it waits first, so that only its own caller's frames wait behind it.
    own: Pending,
    /// In everybody's room.
    shared: Pending,
    memory: PollSemaphore,
    most: usize,
    held: Option<OwnedSemaphorePermit>,
    bytes: Vec<u8>,
    /// What arrived and waits for memory.
    waiting: BytesMut,
}

/// A frame's share of what frames in the mode `lossless` may have, given back when it has been looked at.
pub struct Share {
    _own: Pending,
    _shared: Pending,
}

/// A frame's place in a room, or in line for it.
struct Pending {
    room: Arc<Room>,
    line: PollSemaphore,
    taken: Option<OwnedSemaphorePermit>,
}

impl Pending {
    fn begin(room: Arc<Room>) -> Self {
        Self { line: PollSemaphore::new(room.bytes.clone()), room, taken: None }
    }

    /// Waits until there is room for so many bytes.
    async fn let_in(&mut self, n_bytes: usize) {
        if self.taken.is_none() {
            let _waits = Waits::begin(&self.room.n_waiting);
            self.taken = acquire(&mut self.line, n_bytes).await;
        }
    }

    /// Leaves all but so many bytes.
    fn shrink(&mut self, n_bytes: usize) {
        if let Some(taken) = &mut self.taken {
            drop(taken.split(taken.num_permits().saturating_sub(n_bytes)));
        }
    }
}

impl Lossless {
    /// A frame that will have at most so many bytes, of a caller with this room.
    pub fn begin(intake: &Arc<Intake>, own: Arc<Room>, most: usize) -> Self {
        Self {
            own: Pending::begin(own),
            shared: Pending::begin(intake.room.clone()),
            memory: PollSemaphore::new(intake.memory.clone()),
            intake: intake.clone(),
            most,
            held: None,
            bytes: Vec::new(),
            waiting: BytesMut::new(),
        }
    }

    /// Adds what arrived. It must have been [let in](Self::let_in) before, and must be afterwards.
    pub fn push(&mut self, more: BytesMut) {
        self.waiting = more;
    }

    /// Whether it must be let in before anything else is done with it.
    pub fn is_waiting(&self) -> bool {
        self.shared.taken.is_none() || !self.waiting.is_empty()
    }

    /// Waits until there is room for the frame, and memory for what arrived. Its place in line is kept when the
    /// future is dropped.
    pub async fn let_in(&mut self) {
        self.own.let_in(self.most).await;
        self.shared.let_in(self.most).await;
        if self.waiting.is_empty() {
            return;
        }
        let n_bytes = self.waiting.len();
        let at_once = self.intake.take(&mut self.intake.shelf(), n_bytes, None);
        let held = match at_once {
            None => acquire(&mut self.memory, n_bytes).await,
            held => held,
        };
        match (&mut self.held, held) {
            (Some(before), Some(held)) => before.merge(held),
            (none, held) => *none = held,
        }
        extend(&mut self.bytes, &self.waiting, self.most);
        self.waiting.clear();
    }

    /// The frame, which is whole, and its share.
    pub fn finish(mut self) -> Option<(Frame, Share)> {
        // What came in several parts was let in as if it were as long as it may be.
        self.own.shrink(self.bytes.len());
        self.shared.shrink(self.bytes.len());
        let held = match self.held.take() {
            Some(held) => held,
            None => self.intake.memory.clone().try_acquire_many_owned(0).ok()?,
        };
        Some((Frame::new(self.bytes.into(), held), Share { _own: self.own, _shared: self.shared }))
    }
}

async fn acquire(semaphore: &mut PollSemaphore, n_permits: usize) -> Option<OwnedSemaphorePermit> {
    // The settings see to it that all bytes together fit.
    let n_permits = u32::try_from(n_permits).unwrap_or(u32::MAX);
    poll_fn(|context| semaphore.poll_acquire_many(context, n_permits)).await
}

/// Appends to the bytes of a frame that will have at most `most`.
fn extend(bytes: &mut Vec<u8>, more: &[u8], most: usize) {
    let n_bytes = bytes.len() + more.len();
    if n_bytes > bytes.capacity() {
        let wanted = if n_bytes > FIRST_BYTES { most.max(n_bytes) } else { most.clamp(n_bytes, FIRST_BYTES) };
        bytes.reserve_exact(wanted - bytes.len());
    }
    bytes.extend_from_slice(more);
}

/// One that waits, for as long as it does.
struct Waits<'a>(&'a AtomicUsize);

impl<'a> Waits<'a> {
    fn begin(n_waiting: &'a AtomicUsize) -> Self {
        n_waiting.fetch_add(1, Ordering::Relaxed);
        Self(n_waiting)
    }
}

impl Drop for Waits<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures_util::FutureExt;

    const MAX_BUFFERED_BYTES: usize = 4000;

    fn intake() -> Arc<Intake> {
        let memory = Arc::new(Semaphore::new(MAX_BUFFERED_BYTES));
        Arc::new(Intake::new(memory, MAX_BUFFERED_BYTES, 1000))
    }

    fn yielding(intake: &Arc<Intake>, name: &str, n_bytes: usize) -> Yielding {
        let frame = Yielding::begin(intake, &CallerId::Robot(name.into()), 1000).unwrap();
        frame.push(&vec![7; n_bytes]);
        frame
    }

    fn length(frame: Option<Frame>) -> Option<usize> {
        frame.map(|frame| frame.bytes.len())
    }

    #[test]
    fn the_largest_frame_of_the_caller_who_holds_most_gives_way() {
        let intake = intake();
        let eve: Vec<_> = [300, 350, 300].map(|n_bytes| yielding(&intake, "eve", n_bytes)).into();
        let wall_e = yielding(&intake, "wall-e", 200);
        assert_eq!(intake.memory.available_permits(), MAX_BUFFERED_BYTES - 800);
        let told: Vec<_> = eve.into_iter().map(|frame| length(frame.finish())).collect();
        assert_eq!(told, [Some(300), None, Some(300)]);
        assert_eq!(length(wall_e.finish()), Some(200));
        assert_eq!(intake.memory.available_permits(), MAX_BUFFERED_BYTES, "all is given back");
    }

    #[test]
    fn a_frame_that_would_be_the_largest_gives_way_itself() {
        let intake = intake();
        let first = yielding(&intake, "wall-e", 600);
        let second = yielding(&intake, "eve", 500);
        second.push(&[0; 10]);
        assert_eq!((length(first.finish()), length(second.finish())), (None, Some(10 + 500)));
        let first = yielding(&intake, "wall-e", 500);
        let second = yielding(&intake, "eve", 501);
        assert_eq!((length(first.finish()), length(second.finish())), (Some(500), None));
    }

    #[test]
    fn a_frame_that_is_abandoned_gives_its_memory_back() {
        let intake = intake();
        drop(yielding(&intake, "eve", 900));
        assert_eq!((intake.memory.available_permits(), intake.shelf().n_bytes), (MAX_BUFFERED_BYTES, 0));
    }

    fn lossless(intake: &Arc<Intake>, name: &str, most: usize) -> Lossless {
        Lossless::begin(intake, intake.room_of(&CallerId::Robot(name.into())), most)
    }

    #[test]
    fn lossless_frames_are_let_in_in_their_order_and_only_where_all_of_one_fits() {
        let intake = intake();
        let frames = [("a", 900), ("b", 900), ("c", 900), ("d", 100)];
        let mut frames: Vec<_> = frames.map(|(name, most)| lossless(&intake, name, most)).into();
        let is_in: Vec<bool> =
            frames.iter_mut().map(|frame| frame.let_in().now_or_never().is_some()).collect();
        assert_eq!(
            is_in,
            [true, true, false, false],
            "half of the memory is for them; the last does not overtake"
        );
        frames[0].push(vec![1; 500][..].into());
        assert!(frames[0].let_in().now_or_never().is_some());
        let (frame, share) = frames.remove(0).finish().unwrap();
        assert_eq!(frame.bytes.len(), 500);
        assert!(frames[1].let_in().now_or_never().is_none(), "its room is taken until it has been looked at");
        drop((frame, share));
        assert!(frames[1].let_in().now_or_never().is_some());
        assert!(frames[2].let_in().now_or_never().is_some());
        drop(frames);
        assert_eq!(intake.memory.available_permits(), MAX_BUFFERED_BYTES);
        assert_eq!(intake.room.bytes.available_permits(), MAX_BUFFERED_BYTES / 2);
    }

    #[test]
    fn one_caller_has_half_of_the_room_and_waits_for_itself_alone() {
        let intake = intake();
        let mut eve: Vec<_> = (0..3).map(|_| lossless(&intake, "eve", 600)).collect();
        let is_in: Vec<bool> = eve.iter_mut().map(|frame| frame.let_in().now_or_never().is_some()).collect();
        assert_eq!(is_in, [true, false, false]);
        let mut wall_e = lossless(&intake, "wall-e", 1000);
        assert!(wall_e.let_in().now_or_never().is_some());
        let (_, share) = eve.remove(0).finish().unwrap();
        assert!(eve[0].let_in().now_or_never().is_some(), "it kept only what it has, which is nothing");
        let room = Arc::downgrade(&eve[0].own.room);
        drop(eve);
        assert!(room.strong_count() > 0, "its share is still there");
        drop((share, wall_e));
        assert_eq!((room.strong_count(), intake.room.bytes.available_permits()), (0, MAX_BUFFERED_BYTES / 2));
    }

    #[test]
    fn what_others_hold_gives_way_to_a_lossless_frame_or_is_waited_for() {
        let intake = intake();
        let bodies = intake.memory.clone().try_acquire_many_owned(3000).unwrap();
        let eve = yielding(&intake, "eve", 900);
        let mut frame = lossless(&intake, "wall-e", 1000);
        frame.push(vec![1; 1000][..].into());
        assert!(frame.let_in().now_or_never().is_some());
        assert_eq!(length(eve.finish()), None);
        let mut second = lossless(&intake, "wall-f", 10);
        second.push(vec![1; 10][..].into());
        assert!(second.let_in().now_or_never().is_none());
        assert!(second.is_waiting());
        drop(bodies);
        assert!(second.let_in().now_or_never().is_some());
        assert_eq!(second.finish().unwrap().0.bytes.len(), 10);
    }
}
