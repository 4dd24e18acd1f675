//! Versions as tars.

use super::unpacker::{Kind, Unpacker};
use super::{PackageError, damaged};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use tar::{Archive, Entry, EntryType, PaxExtensions};

/// The longest name that is read, and the most bytes of attributes of one entry.
pub(super) const MAX_ATTRIBUTE_BYTES: u64 = 64 << 10;

/// A tar ends with so many zeros.
pub(super) const END_BYTES: usize = 1024;

/// Takes all that a tar has.
pub(super) fn unpack(mut file: File, unpacker: &mut Unpacker) -> Result<(), PackageError> {
    check_end(&mut file)?;
    let mut long_name = None;
    let mut archive = Archive::new(file);
    // Raw, so that no attribute is believed, or read, before it is looked at here.
    for entry in archive.entries().map_err(|error| damaged(&error))?.raw(true) {
        let mut entry = entry.map_err(|error| damaged(&error))?;
        unpacker.count()?;
        let kind = entry.header().entry_type();
        if matches!(kind, EntryType::GNULongName | EntryType::XHeader | EntryType::XGlobalHeader) {
            long_name = announced_name(kind, &mut entry)?.or(long_name);
            continue;
        }
        let name = long_name.take().unwrap_or_else(|| entry.path_bytes().into_owned());
        let kind = match kind {
            EntryType::Directory => Kind::Folder,
            EntryType::Regular => Kind::File,
            _ => Kind::Other,
        };
        if let Some(path) = unpacker.place(name, kind)? {
            let size = entry.size();
            if unpacker.write(&path, &mut entry)? != size {
                return Err(PackageError::Damaged(format!("{path} is cut off")));
            }
        }
    }
    Ok(())
}

/// Reads an entry that only describes the next one: the name that it gives to it, if any.
fn announced_name(kind: EntryType, entry: &mut Entry<File>) -> Result<Option<Vec<u8>>, PackageError> {
    let size = entry.size();
    if size > MAX_ATTRIBUTE_BYTES {
        return Err(PackageError::Damaged(format!("{size} bytes of attributes are too many")));
    }
    let mut bytes = Vec::new();
    entry.take(size).read_to_end(&mut bytes).map_err(|error| damaged(&error))?;
    if kind == EntryType::GNULongName {
        // It ends with a zero.
        bytes.truncate(bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len()));
        return Ok(Some(bytes));
    }
    let mut name = None;
    for extension in PaxExtensions::new(&bytes) {
        let extension = extension.map_err(|error| damaged(&error))?;
        match extension.key_bytes() {
            b"path" => name = Some(extension.value_bytes().to_vec()),
            b"size" | b"linkpath" => {
                return Err(PackageError::Damaged("it has a size or link in its attributes".into()));
            }
            // Times, owners and the like.
            _ => {}
        }
    }
    Ok(name)
}

/// Refuses a tar that was cut between two entries, which would look whole otherwise.
fn check_end(file: &mut File) -> Result<(), PackageError> {
    let mut end = [0; END_BYTES];
    let read = file
        .seek(SeekFrom::End(-(END_BYTES as i64)))
        .and_then(|_| file.read_exact(&mut end))
        .and_then(|()| file.rewind());
    if read.is_err() || end.iter().any(|byte| *byte != 0) {
        return Err(PackageError::Damaged("it has no end; send it again".into()));
    }
    Ok(())
}
