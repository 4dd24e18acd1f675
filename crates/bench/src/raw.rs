//! Numbers in files, one after the other and the lowest byte first, as NumPy's `fromfile` reads them too.

use std::fs;
use std::path::Path;

/// A number in a file.
pub trait Number: Copy {
    /// Its bytes.
    type Bytes: for<'a> TryFrom<&'a [u8]> + AsRef<[u8]>;
    /// To its bytes.
    fn to_bytes(self) -> Self::Bytes;
    /// From its bytes.
    fn of(bytes: Self::Bytes) -> Self;
}

macro_rules! numbers {
    ($($number:ty),+) => {
        $(impl Number for $number {
            type Bytes = [u8; size_of::<$number>()];

            fn to_bytes(self) -> Self::Bytes {
                self.to_le_bytes()
            }

            fn of(bytes: Self::Bytes) -> Self {
                Self::from_le_bytes(bytes)
            }
        })+
    };
}

numbers!(i8, u32, u64, f32);

/// The numbers that these bytes are.
pub fn numbers<N: Number>(bytes: &[u8]) -> Vec<N> {
    let number = |chunk| N::of(N::Bytes::try_from(chunk).ok().unwrap());
    bytes.chunks_exact(size_of::<N>()).map(number).collect()
}

/// Reads a file.
pub fn read<N: Number>(path: &Path) -> Vec<N> {
    numbers(&fs::read(path).unwrap())
}

/// Writes a file.
pub fn write<N: Number>(path: &Path, numbers: &[N]) {
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_bytes().as_ref().to_vec()).collect();
    fs::write(path, bytes).unwrap();
}
