//! Versions as zips.

use super::unpacker::{Kind, Unpacker, wrong};
use super::{PackageError, damaged};
use flate2::read::DeflateDecoder;
use rawzip::{CompressionMethod, RECOMMENDED_BUFFER_SIZE, ZipArchive};
use std::fs::File;

/// Takes all that a zip has. Its list of files is read one by one, so that a long one takes no memory.
pub(super) fn unpack(file: File, unpacker: &mut Unpacker) -> Result<(), PackageError> {
    let mut buffer = vec![0; RECOMMENDED_BUFFER_SIZE];
    let archive = ZipArchive::from_file(file, &mut buffer).map_err(|error| damaged(&error))?;
    let mut entries = archive.entries(&mut buffer);
    let mut n_entries = 0;
    while let Some(entry) = entries.next_entry().map_err(|error| damaged(&error))? {
        unpacker.count()?;
        n_entries += 1;
        let name = entry.file_path().as_ref().to_vec();
        let kind = match () {
            () if entry.is_dir() => Kind::Folder,
            () if entry.mode().is_symlink() => Kind::Other,
            () => Kind::File,
        };
        let Some(path) = unpacker.place(name, kind)? else { continue };
        if entry.flags().is_encrypted() {
            return Err(wrong(&path, "it is encrypted"));
        }
        let found = archive.get_entry(entry.wayfinder()).map_err(|error| damaged(&error))?;
        // Both check the size and the checksum.
        match entry.compression_method() {
            CompressionMethod::STORE => unpacker.write(&path, &mut found.verifying_reader(found.reader()))?,
            CompressionMethod::DEFLATE => {
                let inflater = DeflateDecoder::new(found.reader());
                unpacker.write(&path, &mut found.verifying_reader(inflater))?
            }
            _ => return Err(wrong(&path, "it is compressed by a method other than deflate")),
        };
    }
    if n_entries != archive.entries_hint() {
        return Err(PackageError::Damaged("its list of files is cut off; send it again".into()));
    }
    Ok(())
}
