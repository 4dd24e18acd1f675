//! Messages in the common data representation of DDS (OMG, DDS-XTypes 1.3, section 7.4.3), plain, version 1, little-endian.

/// Bytes that say how the others lie: little-endian, no options.
const HEAD: [u8; 4] = [0, 1, 0, 0];

/// Writes the fields of a message one after the other.
#[derive(Debug)]
pub(crate) struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    pub(crate) fn new() -> Self {
        Self { bytes: HEAD.to_vec() }
    }

    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Numbers begin at multiples of their size.
    fn number<const N: usize>(&mut self, little_endian: [u8; N]) {
        let aligned = (self.bytes.len() - HEAD.len()).next_multiple_of(N) + HEAD.len();
        self.bytes.resize(aligned, 0);
        self.bytes.extend(little_endian);
    }

    pub(crate) fn u8(&mut self, number: u8) {
        self.number([number]);
    }

    pub(crate) fn bool(&mut self, flag: bool) {
        self.u8(u8::from(flag));
    }

    pub(crate) fn i32(&mut self, number: i32) {
        self.number(number.to_le_bytes());
    }

    pub(crate) fn u32(&mut self, number: u32) {
        self.number(number.to_le_bytes());
    }

    pub(crate) fn f32(&mut self, number: f32) {
        self.number(number.to_le_bytes());
    }

    /// The number of what follows.
    pub(crate) fn length(&mut self, length: usize) {
        // Longer ones have no memory to be in.
        self.u32(length as u32);
    }

    /// A text, with the zero that its length counts; a zero within it would end it, and is left out.
    pub(crate) fn text(&mut self, text: &str) {
        let bytes = || text.bytes().filter(|byte| *byte != 0);
        self.length(bytes().count() + 1);
        self.bytes.extend(bytes());
        self.bytes.push(0);
    }

    /// Bytes as they are.
    pub(crate) fn raw(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_lie_at_multiples_of_their_size_behind_the_head() {
        let mut writer = Writer::new();
        writer.bool(true);
        writer.text("a\0b");
        writer.u8(7);
        writer.f32(1.0);
        let expected = [&HEAD[..], &[1, 0, 0, 0], &[3, 0, 0, 0, b'a', b'b', 0], &[7], &1.0_f32.to_le_bytes()];
        assert_eq!(writer.into_bytes(), expected.concat());
    }
}
