//! A file of blocks, each packed: read at any place, a few of them kept unpacked.

use crate::error::RecordingError;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// The longest block, unpacked, and the longest record, in bytes: some pictures of a hundred megapixels, while what is
/// written is mostly some megabytes.
pub(super) const MAX_BLOCK_BYTES: u64 = 512 << 20;

/// Unpacked blocks that are kept: one for each thread that reads in order, on most machines.
const N_KEPT: usize = 16;

/// Bytes of those, of which the last always stays.
const MAX_KEPT_BYTES: usize = 64 << 20;

/// How a block is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    None,
    Zstd,
    Lz4,
    Bzip2,
}

impl Packing {
    /// By its name in MCAP or in a bag.
    pub(super) fn of(name: &str) -> Option<Self> {
        match name {
            "" | "none" => Some(Self::None),
            "zstd" => Some(Self::Zstd),
            "lz4" => Some(Self::Lz4),
            "bz2" => Some(Self::Bzip2),
            _ => None,
        }
    }
}

/// What came out of a block.
pub(super) struct Unpacked {
    pub(super) bytes: Vec<u8>,
    /// Why not more came out, if so.
    pub(super) cut: Option<String>,
}

impl Unpacked {
    /// All that comes out of a packed block, which may end early.
    pub(super) fn from(packed: &[u8], packing: Packing) -> Self {
        let mut bytes = Vec::new();
        let mut read = |reader: &mut dyn Read| reader.take(MAX_BLOCK_BYTES).read_to_end(&mut bytes);
        let done = match packing {
            Packing::None => read(&mut &*packed),
            Packing::Zstd => zstd::Decoder::with_buffer(packed).and_then(|mut decoder| read(&mut decoder)),
            Packing::Lz4 => lz4::Decoder::new(packed).and_then(|mut decoder| read(&mut decoder)),
            Packing::Bzip2 => read(&mut bzip2::read::BzDecoder::new(packed)),
        };
        let cut = match done {
            Ok(_) if bytes.len() as u64 == MAX_BLOCK_BYTES => Some("it is longer than is read".to_owned()),
            Ok(_) => None,
            Err(error) => Some(error.to_string()),
        };
        Self { bytes, cut }
    }
}

/// A file, read by many threads at once.
#[derive(Debug)]
pub(super) struct Blocks {
    path: PathBuf,
    file: Mutex<File>,
    n_bytes: u64,
    kept: Mutex<VecDeque<(u64, Arc<Vec<u8>>)>>,
}

impl Blocks {
    pub(super) fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = File::open(path).map_err(RecordingError::io(path))?;
        let n_bytes = file.metadata().map_err(RecordingError::io(path))?.len();
        Ok(Self { path: path.to_owned(), file: Mutex::new(file), n_bytes, kept: Mutex::default() })
    }

    pub(super) fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// The bytes from `at` on: so many, or as many as there are.
    pub(super) fn read(&self, at: u64, n_bytes: u64) -> Result<Vec<u8>, RecordingError> {
        let n_there = n_bytes.min(self.n_bytes.saturating_sub(at));
        let mut bytes = Vec::with_capacity(usize::try_from(n_there).unwrap_or_default());
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let mut read = || -> io::Result<()> {
            file.seek(SeekFrom::Start(at))?;
            (&mut *file).take(n_there).read_to_end(&mut bytes)?;
            Ok(())
        };
        read().map_err(RecordingError::io(&self.path))?;
        Ok(bytes)
    }

    /// The block at `at`, by `unpack` where it is not kept.
    pub(super) fn block(
        &self,
        at: u64,
        unpack: impl FnOnce() -> Result<Vec<u8>, RecordingError>,
    ) -> Result<Arc<Vec<u8>>, RecordingError> {
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, block)) = lock().iter().find(|(other, _)| *other == at) {
            return Ok(block.clone());
        }
        let block = Arc::new(unpack()?);
        let mut kept = lock();
        kept.push_front((at, block.clone()));
        kept.truncate(N_KEPT);
        let n_bytes =
            |kept: &VecDeque<(u64, Arc<Vec<u8>>)>| kept.iter().map(|(_, block)| block.len()).sum::<usize>();
        while kept.len() > 1 && n_bytes(&kept) > MAX_KEPT_BYTES {
            kept.pop_back();
        }
        Ok(block)
    }

    /// That it is damaged there.
    pub(super) fn damaged(&self, reason: impl Into<String>) -> RecordingError {
        RecordingError::Damaged { path: self.path.clone(), reason: reason.into() }
    }
}
