//! The wire format of protocol buffers, field by field, without copying anything.
//!
//! A decoder that fills structures makes some hundred bytes of a field of two; here a stranger's file takes no
//! more memory than it has bytes. Source: protobuf.dev/programming-guides/encoding.

/// One field of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Field<'a> {
    /// Its number in the message.
    pub number: u64,
    /// What it holds.
    pub value: Value<'a>,
    /// Its bytes, with its key.
    pub raw: &'a [u8],
}

/// What a field holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Varint(u64),
    Bytes(&'a [u8]),
    Fixed32([u8; 4]),
    Fixed64([u8; 8]),
}

/// The bytes are no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Malformed;

/// The fields of a message, in the order in which they stand there.
pub(super) fn fields(message: &[u8]) -> Fields<'_> {
    Fields { rest: message }
}

pub(super) struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Fields<'a> {
    type Item = Result<Field<'a>, Malformed>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let field = field(&mut self.rest).ok_or(Malformed);
        if field.is_err() {
            self.rest = &[];
        }
        Some(field)
    }
}

impl<'a> Field<'a> {
    /// The bytes of a nested message, a text or a block of numbers.
    pub fn bytes(&self) -> Result<&'a [u8], Malformed> {
        match self.value {
            Value::Bytes(bytes) => Ok(bytes),
            _ => Err(Malformed),
        }
    }

    pub fn text(&self) -> Result<&'a str, Malformed> {
        std::str::from_utf8(self.bytes()?).map_err(|_| Malformed)
    }

    pub fn varint(&self) -> Result<u64, Malformed> {
        match self.value {
            Value::Varint(number) => Ok(number),
            _ => Err(Malformed),
        }
    }

    /// Calls `visit` with each number of a repeated field, whether they stand in one block or one by one.
    pub fn varints(&self, visit: &mut impl FnMut(u64)) -> Result<(), Malformed> {
        match self.value {
            Value::Varint(number) => visit(number),
            Value::Bytes(mut block) => {
                while !block.is_empty() {
                    visit(take_varint(&mut block).ok_or(Malformed)?);
                }
            }
            _ => return Err(Malformed),
        }
        Ok(())
    }
}

fn field<'a>(rest: &mut &'a [u8]) -> Option<Field<'a>> {
    let start = *rest;
    let key = take_varint(rest)?;
    let number = key >> 3;
    let value = match key & 7 {
        0 => Value::Varint(take_varint(rest)?),
        1 => Value::Fixed64(take(rest, 8)?.try_into().ok()?),
        2 => {
            let len = usize::try_from(take_varint(rest)?).ok()?;
            Value::Bytes(take(rest, len)?)
        }
        5 => Value::Fixed32(take(rest, 4)?.try_into().ok()?),
        // Groups are long out of use, and ONNX never had them.
        _ => return None,
    };
    let raw = &start[..start.len() - rest.len()];
    (number > 0).then_some(Field { number, value, raw })
}

fn take<'a>(rest: &mut &'a [u8], len: usize) -> Option<&'a [u8]> {
    let (taken, left) = rest.split_at_checked(len)?;
    *rest = left;
    Some(taken)
}

fn take_varint(rest: &mut &[u8]) -> Option<u64> {
    let mut number = 0_u64;
    for shift in (0..64).step_by(7) {
        let (&byte, left) = rest.split_first()?;
        *rest = left;
        number |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(number);
        }
    }
    None
}

/// Appends a field that holds a number.
pub(super) fn put_varint(message: &mut Vec<u8>, field: u64, number: u64) {
    put(message, field << 3);
    put(message, number);
}

/// Appends a field that holds bytes.
pub(super) fn put_bytes(message: &mut Vec<u8>, field: u64, bytes: &[u8]) {
    put(message, field << 3 | 2);
    put(message, bytes.len() as u64);
    message.extend_from_slice(bytes);
}

fn put(message: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        message.push(number as u8 | 0x80);
        number >>= 7;
    }
    message.push(number as u8);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_put_is_read(numbers in prop::collection::vec((1_u64..1000, any::<u64>()), 0..10), text: Vec<u8>) {
            let mut message = Vec::new();
            for &(field, number) in &numbers {
                put_varint(&mut message, field, number);
            }
            put_bytes(&mut message, 7, &text);
            let read: Vec<_> = fields(&message).map(Result::unwrap).collect();
            let (last, firsts) = read.split_last().unwrap();
            prop_assert_eq!((last.number, last.value), (7, Value::Bytes(&text)));
            let firsts: Vec<_> = firsts.iter().map(|field| (field.number, field.varint().unwrap())).collect();
            prop_assert_eq!(firsts, numbers);
            let raw: Vec<u8> = read.iter().flat_map(|field| field.raw).copied().collect();
            prop_assert_eq!(raw, message);
        }

        #[test]
        fn any_bytes_end(bytes: Vec<u8>) {
            // The second looks into nested messages as the readers of networks do.
            for field in fields(&bytes).flatten() {
                let _ = field.varints(&mut |_| ());
                prop_assert!(fields(field.raw).count() <= bytes.len());
            }
        }
    }

    #[test]
    fn numbers_are_read_in_blocks_and_one_by_one() {
        let mut block = Vec::new();
        put_bytes(&mut block, 1, &[3, 0x80, 1]);
        put_varint(&mut block, 1, 9);
        let mut numbers = Vec::new();
        for field in fields(&block) {
            field.unwrap().varints(&mut |number| numbers.push(number)).unwrap();
        }
        assert_eq!(numbers, [3, 128, 9]);
    }

    #[test]
    fn what_is_cut_off_is_malformed() {
        for cut in [&[0x0a, 5, 1, 2][..], &[0x08, 0x80], &[0x0d, 1, 2], &[0x0b], &[0x80; 11], &[0x00, 1]] {
            assert_eq!(fields(cut).collect::<Vec<_>>(), [Err(Malformed)], "{cut:?}");
        }
    }
}
