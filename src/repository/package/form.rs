//! What a body is, told by its first bytes, whatever its type or name says.

use std::fs::File;
use std::io::{self, Read, Seek};

/// Where each entry of a tar has its mark.
pub(super) const TAR_MARK: &[u8] = b"ustar";
pub(super) const TAR_MARK_OFFSET: usize = 257;

/// What archives begin with that are not read here, and what people call them. None of these begins a model file: its
/// first eight bytes are a length that is a multiple of eight, or far above any that is taken.
const FOREIGN: [(&[u8], &str); 6] = [
    (b"BZh", "a bzip2 archive"),
    (b"\xfd7zXZ\0", "an xz archive"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"Rar!\x1a\x07", "a rar archive"),
    (b"\x04\x22\x4d\x18", "an lz4 archive"),
];

/// The form of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Tar,
    Gzip,
    Zip,
    /// A form that is not read, by its name.
    Foreign(&'static str),
    /// None of these.
    Other,
}

impl Form {
    /// The form of a file, which is then read from its begin again.
    pub fn of(file: &mut File) -> io::Result<Self> {
        let mut head = Vec::new();
        file.rewind()?;
        (&*file).take((TAR_MARK_OFFSET + TAR_MARK.len()) as u64).read_to_end(&mut head)?;
        file.rewind()?;
        let begins = |mark: &[u8]| head.starts_with(mark);
        let foreign = || FOREIGN.iter().find(|(mark, _)| begins(mark)).map(|(_, name)| Self::Foreign(name));
        Ok(match () {
            () if head.get(TAR_MARK_OFFSET..) == Some(TAR_MARK) => Self::Tar,
            // With the one method that there is.
            () if begins(b"\x1f\x8b\x08") => Self::Gzip,
            () if begins(b"PK\x03\x04") || begins(b"PK\x05\x06") => Self::Zip,
            () => foreign().unwrap_or(Self::Other),
        })
    }
}
