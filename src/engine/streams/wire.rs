//! The bytes of a WebSocket, taken apart as RFC 6455 says: frames into pieces of messages.
//!
//! A library hands out whole messages, and so decides how much of an unfinished one is held. Here nothing is
//! held but what arrived last: whoever gets the pieces decides, byte by byte, what to keep.

use bytes::{Buf, BytesMut};
use std::io::Cursor;
use tokio_tungstenite::tungstenite::protocol::CloseFrame;
use tokio_tungstenite::tungstenite::protocol::frame::FrameHeader;
use tokio_tungstenite::tungstenite::protocol::frame::coding::{CloseCode, Control, Data, OpCode};

/// The longest payload of a control frame, in bytes.
const MAX_CONTROL_BYTES: u64 = 125;

/// What a client's bytes say, whatever pieces they come in.
pub struct Decoder {
    arrived: BytesMut,
    frame: Option<Frame>,
    /// The length so far of the message under way.
    message: Option<usize>,
    max_bytes: usize,
}

/// The frame whose payload comes.
struct Frame {
    opcode: OpCode,
    is_final: bool,
    mask: [u8; 4],
    n_left: usize,
}

/// A piece of what came.
#[derive(Debug, PartialEq, Eq)]
pub enum Piece {
    /// A message begins. It will have at most so many bytes: just so many where it comes in one frame.
    Begin {
        /// A text, or else binary.
        is_text: bool,
        /// The most bytes.
        most: usize,
    },
    /// More of the message.
    Bytes(BytesMut),
    /// The message is whole.
    End,
    /// A ping, to be answered with its payload.
    Ping(BytesMut),
    /// An answer to a ping.
    Pong,
    /// The other side closes, and may say why.
    Close(Option<CloseFrame>),
}

/// Why what came cannot be taken apart any further.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Broken {
    /// It is not what RFC 6455 allows.
    Protocol,
    /// A text that is no UTF-8.
    NotUtf8,
    /// A message longer than allowed.
    TooLong,
}

impl Decoder {
    /// Of messages of up to `max_bytes`.
    pub fn new(max_bytes: usize) -> Self {
        Self { arrived: BytesMut::new(), frame: None, message: None, max_bytes }
    }

    /// Where arriving bytes are put.
    pub fn arrived(&mut self) -> &mut BytesMut {
        &mut self.arrived
    }

    /// The next piece; none where more bytes must arrive first.
    ///
    /// # Errors
    /// What cannot be taken apart: the rest is lost too.
    pub fn next(&mut self) -> Result<Option<Piece>, Broken> {
        loop {
            let Some(frame) = &mut self.frame else {
                match self.begin_frame()? {
                    Begun::Message(piece) => return Ok(Some(piece)),
                    Begun::Frame => continue,
                    Begun::Nothing => return Ok(None),
                }
            };
            if let OpCode::Control(control) = frame.opcode {
                if self.arrived.len() < frame.n_left {
                    return Ok(None);
                }
                let payload = frame.take(&mut self.arrived);
                self.frame = None;
                return control_piece(control, payload).map(Some);
            }
            if frame.n_left > 0 {
                let payload = frame.take(&mut self.arrived);
                return Ok((!payload.is_empty()).then_some(Piece::Bytes(payload)));
            }
            let is_final = frame.is_final;
            self.frame = None;
            if is_final {
                self.message = None;
                return Ok(Some(Piece::End));
            }
        }
    }

    fn begin_frame(&mut self) -> Result<Begun, Broken> {
        let mut cursor = Cursor::new(&self.arrived[..]);
        // Opcodes that nobody has defined are its only error.
        let parsed = FrameHeader::parse(&mut cursor).map_err(|_| Broken::Protocol)?;
        let n_parsed = cursor.position() as usize;
        let Some((header, n_bytes)) = parsed else { return Ok(Begun::Nothing) };
        self.arrived.advance(n_parsed);
        let FrameHeader { is_final, opcode, rsv1: false, rsv2: false, rsv3: false, mask: Some(mask) } =
            header
        else {
            return Err(Broken::Protocol);
        };
        let begun = match (opcode, self.message) {
            (OpCode::Control(_), _) if !is_final || n_bytes > MAX_CONTROL_BYTES => {
                return Err(Broken::Protocol);
            }
            (OpCode::Control(_), _) => Begun::Frame,
            (OpCode::Data(Data::Continue), Some(n_before)) => {
                self.message = Some(n_before + self.checked(n_bytes, n_before)?);
                Begun::Frame
            }
            (OpCode::Data(Data::Continue), None) | (OpCode::Data(_), Some(_)) => {
                return Err(Broken::Protocol);
            }
            (OpCode::Data(data), None) => {
                let n_bytes = self.checked(n_bytes, 0)?;
                self.message = Some(n_bytes);
                let most = if is_final { n_bytes } else { self.max_bytes };
                Begun::Message(Piece::Begin { is_text: data == Data::Text, most })
            }
        };
        // A control frame is short, and all others were checked.
        self.frame = Some(Frame { opcode, is_final, mask, n_left: n_bytes as usize });
        Ok(begun)
    }

    /// The length of a frame, if its message does not become too long.
    fn checked(&self, n_bytes: u64, n_before: usize) -> Result<usize, Broken> {
        let fits = usize::try_from(n_bytes).ok().filter(|&n| n <= self.max_bytes - n_before);
        fits.ok_or(Broken::TooLong)
    }
}

/// What the head of a frame begins.
enum Begun {
    Message(Piece),
    Frame,
    Nothing,
}

impl Frame {
    /// As much of its payload as has arrived.
    fn take(&mut self, arrived: &mut BytesMut) -> BytesMut {
        let mut payload = arrived.split_to(self.n_left.min(arrived.len()));
        self.n_left -= payload.len();
        let (words, rest) = payload.as_chunks_mut::<4>();
        let key = u32::from_ne_bytes(self.mask);
        words.iter_mut().for_each(|word| *word = (u32::from_ne_bytes(*word) ^ key).to_ne_bytes());
        rest.iter_mut().zip(self.mask).for_each(|(byte, key)| *byte ^= key);
        self.mask.rotate_left(rest.len());
        payload
    }
}

fn control_piece(control: Control, mut payload: BytesMut) -> Result<Piece, Broken> {
    match control {
        Control::Ping => Ok(Piece::Ping(payload)),
        Control::Pong => Ok(Piece::Pong),
        Control::Close if payload.is_empty() => Ok(Piece::Close(None)),
        Control::Close => {
            let code = CloseCode::from(payload.try_get_u16().map_err(|_| Broken::Protocol)?);
            let reason = payload.freeze().try_into().map_err(|_| Broken::NotUtf8)?;
            let is_allowed = code.is_allowed();
            is_allowed.then_some(Piece::Close(Some(CloseFrame { code, reason }))).ok_or(Broken::Protocol)
        }
        Control::Reserved(_) => Err(Broken::Protocol),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tokio_tungstenite::tungstenite::protocol::frame::Frame as Sent;

    const MAX_BYTES: usize = 1000;

    /// A frame as a client sends it.
    fn sent(opcode: OpCode, is_final: bool, payload: &[u8]) -> Vec<u8> {
        let header = FrameHeader { is_final, opcode, mask: Some([7, 0, 250, 33]), ..FrameHeader::default() };
        let mut bytes = Vec::new();
        Sent::from_payload(header, payload.to_vec().into()).format(&mut bytes).unwrap();
        bytes
    }

    fn binary(is_final: bool, payload: &[u8]) -> Vec<u8> {
        sent(OpCode::Data(Data::Binary), is_final, payload)
    }

    fn more(is_final: bool, payload: &[u8]) -> Vec<u8> {
        sent(OpCode::Data(Data::Continue), is_final, payload)
    }

    fn control(control: Control, payload: &[u8]) -> Vec<u8> {
        sent(OpCode::Control(control), true, payload)
    }

    /// All pieces, those of one message's bytes joined, and how it ends.
    fn pieces(chunks: &[&[u8]]) -> (Vec<Piece>, Option<Broken>) {
        let mut decoder = Decoder::new(MAX_BYTES);
        let mut pieces = Vec::new();
        for chunk in chunks {
            decoder.arrived().extend_from_slice(chunk);
            loop {
                match (decoder.next(), pieces.last_mut()) {
                    (Ok(Some(Piece::Bytes(bytes))), Some(Piece::Bytes(before))) => {
                        before.extend_from_slice(&bytes);
                    }
                    (Ok(Some(piece)), _) => pieces.push(piece),
                    (Ok(None), _) => break,
                    (Err(broken), _) => return (pieces, Some(broken)),
                }
            }
        }
        (pieces, None)
    }

    fn broken(bytes: &[u8]) -> Option<Broken> {
        pieces(&[bytes]).1
    }

    proptest! {
        #[test]
        fn messages_come_back_however_they_are_cut(
            parts in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..80), 1..6),
            cut in 1_usize..40,
        ) {
            let mut bytes = Vec::new();
            for (part_idx, part) in parts.iter().enumerate() {
                let is_last = part_idx + 1 == parts.len();
                bytes.extend(if part_idx == 0 { binary(is_last, part) } else { more(is_last, part) });
            }
            let whole = parts.concat();
            let (told, error) = pieces(&bytes.chunks(cut).collect::<Vec<_>>());
            prop_assert_eq!(error, None);
            let most = if parts.len() == 1 { whole.len() } else { MAX_BYTES };
            let mut expected = vec![Piece::Begin { is_text: false, most }];
            if !whole.is_empty() {
                expected.push(Piece::Bytes(whole[..].into()));
            }
            expected.push(Piece::End);
            prop_assert_eq!(told, expected);
        }

        #[test]
        fn any_bytes_are_taken_apart_or_refused(bytes: Vec<u8>, cut in 1_usize..40) {
            let once = pieces(&[&bytes]);
            prop_assert_eq!(pieces(&bytes.chunks(cut).collect::<Vec<_>>()), once);
        }
    }

    #[test]
    fn pings_and_the_end_come_between_the_parts_of_a_message() {
        let close = [&1000_u16.to_be_bytes()[..], b"done"].concat();
        let bytes = [
            binary(false, b"one "),
            control(Control::Ping, b"there?"),
            more(false, b""),
            control(Control::Pong, b""),
            more(true, b"message"),
            control(Control::Close, &close),
            control(Control::Close, b""),
        ];
        let (told, error) = pieces(&[&bytes.concat()]);
        let frame = CloseFrame { code: CloseCode::Normal, reason: "done".into() };
        let expected = [
            Piece::Begin { is_text: false, most: MAX_BYTES },
            Piece::Bytes(b"one "[..].into()),
            Piece::Ping(b"there?"[..].into()),
            Piece::Pong,
            Piece::Bytes(b"message"[..].into()),
            Piece::End,
            Piece::Close(Some(frame)),
            Piece::Close(None),
        ];
        assert_eq!((told, error), (expected.into(), None));
    }

    #[test]
    fn what_the_standard_forbids_is_refused() {
        let mut reserved_bit = binary(true, b"x");
        reserved_bit[0] |= 0x40;
        let mut unmasked = binary(true, b"x");
        unmasked[1] &= 0x7f;
        for bytes in [
            reserved_bit,
            unmasked,
            vec![0x83, 0x80, 0, 0, 0, 0],
            vec![0x8b, 0x80, 0, 0, 0, 0],
            sent(OpCode::Control(Control::Ping), false, b""),
            control(Control::Ping, &[0; 126]),
            more(true, b"x"),
            [binary(false, b"x"), binary(true, b"x")].concat(),
            control(Control::Close, b"x"),
            control(Control::Close, &999_u16.to_be_bytes()),
            control(Control::Close, &1005_u16.to_be_bytes()),
        ] {
            assert_eq!(broken(&bytes), Some(Broken::Protocol), "{bytes:?}");
        }
        assert_eq!(broken(&control(Control::Close, &[3, 232, 0xff])), Some(Broken::NotUtf8));
    }

    #[test]
    fn a_message_that_becomes_too_long_is_refused_before_it_comes() {
        assert_eq!(broken(&binary(true, &[0; MAX_BYTES])), None);
        for n_bytes in [MAX_BYTES as u64 + 1, 1 << 63, u64::MAX] {
            let head = [&[0x82, 0xff][..], &n_bytes.to_be_bytes(), &[0; 4]].concat();
            assert_eq!(broken(&head), Some(Broken::TooLong), "{n_bytes}");
        }
        let mut parts = [binary(false, &[0; MAX_BYTES - 1]), more(false, b"x")].concat();
        assert_eq!(broken(&parts), None);
        parts.extend(&more(true, b"x")[..6]);
        assert_eq!(broken(&parts), Some(Broken::TooLong));
    }
}
