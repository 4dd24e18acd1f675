//! What is taken as a version, and what is refused, by name.

use super::form::{TAR_MARK, TAR_MARK_OFFSET};
use super::tar::{END_BYTES, MAX_ATTRIBUTE_BYTES};
use super::*;
use ::tar::EntryType;
use flate2::Compression;
use flate2::write::{DeflateEncoder, GzEncoder};
use proptest::prelude::*;
use rawzip::path::EntryPath;
use rawzip::{CompressionMethod, ZipArchiveWriter};
use std::sync::LazyLock;
use tempfile::TempDir;

/// A version's files; what is in them does not matter here.
const FILES: [(&str, &str); 4] = [
    ("golden/golden.json", "[]"),
    ("golden/k\u{fc}che.jpg", "a frame"),
    ("model.json", "{}"),
    ("model.safetensors", "a model"),
];

static PACKED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join(GOLDEN_FOLDER)).unwrap();
    for (name, content) in FILES {
        fs::write(folder.path().join(name), content).unwrap();
    }
    let mut packed = Vec::new();
    pack(folder.path(), &mut packed).unwrap();
    packed
});

/// An entry of a tar, which may be wrong.
fn append(builder: &mut Builder<Vec<u8>>, name: &str, kind: EntryType, content: &[u8]) {
    let mut header = Header::new_gnu();
    // Not by `set_path`, which refuses what is tried here.
    header.as_old_mut().name[..name.len()].copy_from_slice(name.as_bytes());
    header.set_entry_type(kind);
    header.set_size(content.len() as u64);
    if matches!(kind, EntryType::Symlink | EntryType::Link) {
        header.set_link_name("/etc/passwd").unwrap();
    }
    header.set_cksum();
    builder.append(&header, content).unwrap();
}

fn tar(entries: &[(&str, EntryType, &[u8])]) -> Vec<u8> {
    let mut builder = Builder::new(Vec::new());
    for (name, kind, content) in entries {
        append(&mut builder, name, *kind, content);
    }
    builder.into_inner().unwrap()
}

fn unpacked(body: &[u8], limits: &PackageLimits) -> (TempDir, Result<(), PackageError>) {
    let folder = TempDir::new().unwrap();
    let (file, into) = (folder.path().join("body"), folder.path().join("into"));
    fs::write(&file, body).unwrap();
    fs::create_dir(&into).unwrap();
    let result = unpack(&file, &into, limits);
    (folder, result)
}

fn refused(body: &[u8]) -> String {
    unpacked(body, &PackageLimits::default()).1.unwrap_err().to_string()
}

#[test]
fn a_version_comes_out_as_it_went_in() {
    let (folder, result) = unpacked(&PACKED, &PackageLimits::default());
    result.unwrap();
    for (name, content) in FILES {
        assert_eq!(fs::read_to_string(folder.path().join("into").join(name)).unwrap(), content);
    }
}

#[test]
fn the_notations_of_other_programs_are_read() {
    let long = format!("./golden/{}.jpg", "x".repeat(140));
    let named = |path: &str| {
        let n_digits = if path.len() < 90 { 2 } else { 3 };
        format!("{} path={path}\n", path.len() + n_digits + 7).into_bytes()
    };
    let body = tar(&[
        ("./", EntryType::Directory, b""),
        ("pax_global_header", EntryType::XGlobalHeader, b"13 comment=a\n"),
        ("./golden/", EntryType::Directory, b""),
        ("@LongLink", EntryType::GNULongName, format!("{long}\0").as_bytes()),
        ("./golden/xxx", EntryType::Regular, b"long"),
        ("PaxHeader", EntryType::XHeader, &named("golden/m\u{fc}ll.jpg")),
        ("golden/m", EntryType::Regular, b"pax"),
        ("model.json", EntryType::Regular, b"{}"),
        ("./model.safetensors", EntryType::Regular, b"a model"),
    ]);
    let (folder, result) = unpacked(&body, &PackageLimits::default());
    result.unwrap();
    let read = |name: &str| fs::read_to_string(folder.path().join("into").join(name)).unwrap();
    assert_eq!((read(&long), read("golden/m\u{fc}ll.jpg")), ("long".to_owned(), "pax".to_owned()));
}

/// What passes for a model that uses a network, and the network.
fn with_network(digest: &str) -> [(String, Vec<u8>); 4] {
    let entry = serde_json::json!({
        "name": "lite0", "blake3": Digest::of(b"a network"), "n_bytes": 9, "toml_blake3": Digest::of(b""),
    });
    let about = serde_json::json!({ "blake3": Digest::of(b"a model"), "networks": [entry] });
    [
        (format!("networks/{digest}.onnx"), b"a network".to_vec()),
        (format!("networks/{digest}.toml"), Vec::new()),
        ("model.json".to_owned(), about.to_string().into_bytes()),
        ("model.safetensors".to_owned(), b"a model".to_vec()),
    ]
}

#[test]
fn the_networks_that_a_model_names_come_out_as_they_went_in() {
    let files = with_network(&Digest::of(b"a network").to_string());
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join(NETWORKS_FOLDER)).unwrap();
    for (name, content) in &files {
        fs::write(folder.path().join(name), content).unwrap();
    }
    fs::write(folder.path().join("networks/notes.txt"), "none of the version's").unwrap();
    let mut packed = Vec::new();
    pack(folder.path(), &mut packed).unwrap();
    let wrapped = files.each_ref().map(|(name, content)| (format!("7/{name}"), content.as_slice()));
    let mut wrapped = wrapped.each_ref().map(|(name, content)| (name.as_str(), *content)).to_vec();
    wrapped.insert(0, ("7/networks/", b""));
    let bare = files.each_ref().map(|(name, content)| (name.as_str(), content.as_slice()));
    for body in [packed, zipped(&wrapped, true), zipped(&bare, false)] {
        let (folder, result) = unpacked(&body, &PackageLimits::default());
        result.unwrap();
        for (name, content) in &files {
            assert_eq!(fs::read(folder.path().join("into").join(name)).unwrap(), *content, "{name}");
        }
        assert_eq!(fs::read_dir(folder.path().join("into/networks")).unwrap().count(), 2);
    }
    let large = PackageLimits { max_network_bytes: 8, ..PackageLimits::default() };
    let told = unpacked(&zipped(&bare, true), &large).1.unwrap_err().to_string();
    assert!(told.contains("more than 8 bytes"), "{told}");
}

#[test]
fn what_is_no_network_of_the_model_is_refused_by_name() {
    let digest = Digest::of(b"a network").to_string();
    for wrong in [&Digest::of(b"another").to_string(), &digest.to_uppercase(), "lite0", "..", "../model", ""]
    {
        let files = with_network(wrong);
        let entries = files.each_ref().map(|(name, content)| (name.as_str(), content.as_slice()));
        let told = refused(&zipped(&entries, false));
        assert!(told.contains(&format!("networks/{wrong}.")) && told.contains("does not belong"), "{told}");
    }
    for name in ["networks/deeper/", "networks/a.onnx/", "networks"] {
        let told = refused(&zipped(&[(name, b"")], false));
        assert!(told.contains(name), "{told}");
    }
}

fn gzipped(body: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(body).unwrap();
    encoder.finish().unwrap()
}

/// A zip of files, compressed where `deflates`, and of folders, whose names end with a slash.
fn zipped(entries: &[(&str, &[u8])], deflates: bool) -> Vec<u8> {
    let mut body = Vec::new();
    let mut archive = ZipArchiveWriter::new(&mut body);
    for (name, content) in entries {
        // As it is, since some are wrong.
        let path = EntryPath::verbatim(name.as_bytes());
        if name.ends_with('/') {
            archive.new_dir(path).create().unwrap();
        } else if deflates {
            let builder = archive.new_file(path).compression_method(CompressionMethod::DEFLATE);
            let (mut entry, config) = builder.start().unwrap();
            let mut writer = config.wrap(DeflateEncoder::new(&mut entry, Compression::fast()));
            writer.write_all(content).unwrap();
            let (encoder, descriptor) = writer.finish().unwrap();
            encoder.finish().unwrap();
            entry.finish(descriptor).unwrap();
        } else {
            let (mut entry, config) = archive.new_file(path).start().unwrap();
            let mut writer = config.wrap(&mut entry);
            writer.write_all(content).unwrap();
            let (_, descriptor) = writer.finish().unwrap();
            entry.finish(descriptor).unwrap();
        }
    }
    archive.finish().unwrap();
    body
}

/// Whether the files of [`FILES`] come out of a body, and nothing else.
fn assert_comes_out(body: &[u8], what: &str) {
    let (folder, result) = unpacked(body, &PackageLimits::default());
    result.unwrap_or_else(|error| panic!("{what}: {error}"));
    let into = folder.path().join("into");
    for (name, content) in FILES {
        assert_eq!(fs::read_to_string(into.join(name)).unwrap(), content, "{what}: {name}");
    }
    let n_files = |folder: &Path| fs::read_dir(folder).unwrap().count();
    assert_eq!((n_files(&into), n_files(&into.join(GOLDEN_FOLDER))), (3, 2), "{what}");
}

/// [`FILES`] in a folder, which may be empty, as entries of archives.
fn files_in(folder: &str) -> Vec<(String, &'static [u8])> {
    FILES.iter().map(|(name, content)| (format!("{folder}{name}"), content.as_bytes())).collect()
}

#[test]
fn a_tar_gz_and_a_zip_are_read_as_a_tar_is() {
    assert_comes_out(&gzipped(&PACKED), "tar.gz");
    let (first, rest) = PACKED.split_at(700);
    assert_comes_out(&[gzipped(first), gzipped(rest)].concat(), "a tar.gz of two pieces");
    let files = files_in("");
    let mut entries: Vec<(&str, &[u8])> =
        files.iter().map(|(name, content)| (name.as_str(), *content)).collect();
    assert_comes_out(&zipped(&entries, true), "zip");
    assert_comes_out(&zipped(&entries, false), "zip without compression");
    entries.insert(0, ("golden/", b""));
    assert_comes_out(&zipped(&entries, true), "zip with folders");
}

#[test]
fn archives_of_the_folder_itself_and_from_a_mac_are_read() {
    for wrapper in ["7/", "./home/", "my-model_2/", "my model/"] {
        let files = files_in(wrapper);
        let mut entries: Vec<(&str, EntryType, &[u8])> =
            files.iter().map(|(name, content)| (name.as_str(), EntryType::Regular, *content)).collect();
        assert_comes_out(&tar(&entries), wrapper);
        entries.insert(0, (wrapper, EntryType::Directory, b""));
        assert_comes_out(&tar(&entries), wrapper);
    }
    let property = &b"\0\x05\x16\x07"[..];
    let files = files_in("./");
    let of_mac =
        ["./._.", "./._model.json", "./.DS_Store", "./golden/._k\u{fc}che.jpg", "./golden/.DS_Store"];
    let mut entries: Vec<(&str, EntryType, &[u8])> =
        of_mac.iter().map(|name| (*name, EntryType::Regular, property)).collect();
    entries.push(("./", EntryType::Directory, b""));
    entries.extend(files.iter().map(|(name, content)| (name.as_str(), EntryType::Regular, *content)));
    assert_comes_out(&tar(&entries), "tar of a Mac");

    let files = files_in("7/");
    let mut entries: Vec<(&str, &[u8])> = vec![("7/", b""), ("__MACOSX/", b""), ("__MACOSX/._7", property)];
    entries.extend(files.iter().map(|(name, content)| (name.as_str(), *content)));
    entries.extend([("__MACOSX/7/._model.json", property), ("7/.DS_Store", property)]);
    assert_comes_out(&zipped(&entries, true), "zip of a Mac");
}

#[test]
fn what_does_not_belong_in_a_zip_is_refused_by_name() {
    for name in
        ["../model.json", "/model.json", "golden/../../x", "golden/a/b.jpg", "README", "golden\\a.jpg"]
    {
        let error = refused(&zipped(&[(name, b"")], false));
        assert!(error.contains(&format!("{name:?}")), "{name}: {error}");
    }
    let twice = [("model.json", &b"{}"[..]), ("./model.json", b"{}")];
    assert!(refused(&zipped(&twice, true)).contains("twice"));
    // What a link leads to would be its content.
    let mut body = Vec::new();
    let mut archive = ZipArchiveWriter::new(&mut body);
    let (mut entry, config) = archive.new_file("model.json").unix_permissions(0o120_777).start().unwrap();
    let mut writer = config.wrap(&mut entry);
    writer.write_all(b"/etc/passwd").unwrap();
    let (_, descriptor) = writer.finish().unwrap();
    entry.finish(descriptor).unwrap();
    archive.finish().unwrap();
    assert!(refused(&body).contains("no links"));
}

#[test]
fn what_is_cut_or_changed_in_a_compressed_archive_is_damaged() {
    let files = files_in("");
    let entries: Vec<(&str, &[u8])> = files.iter().map(|(name, content)| (name.as_str(), *content)).collect();
    for (what, body) in [("tar.gz", gzipped(&PACKED)), ("zip", zipped(&entries, true))] {
        for length in [20, body.len() / 2, body.len() - 3] {
            let error = refused(&body[..length]);
            assert!(error.contains("damaged"), "{what} cut at {length}: {error}");
        }
    }
    let mut body = zipped(&entries, false);
    let at = body.windows(7).position(|window| window == b"a frame").unwrap();
    body[at] = b'A';
    assert!(refused(&body).contains("damaged"), "the checksum tells");
}

#[test]
fn what_grows_without_end_is_refused_before_it_does() {
    let limits = PackageLimits { max_bytes: 5000, max_model_bytes: 5000, ..PackageLimits::default() };
    let zeros = vec![0; 1 << 20];
    let refused = |body: &[u8]| unpacked(body, &limits).1.unwrap_err().to_string();
    assert!(refused(&gzipped(&zeros)).contains("more than 5000 bytes"));
    assert!(refused(&zipped(&[("model.safetensors", &zeros)], true)).contains("more than 5000 bytes"));
    let [first, second] = ["golden/a", "golden/b"].map(|name| (name, &zeros[..3000]));
    let both = refused(&zipped(&[first, second], true));
    assert!(both.contains("more than 5000 bytes when it is unpacked"), "{both}");
}

#[test]
fn a_name_that_no_disk_takes_is_refused() {
    let long = format!("golden/{}", "x".repeat(256));
    let body = tar(&[
        ("@LongLink", EntryType::GNULongName, format!("{long}\0").as_bytes()),
        ("golden/xxx", EntryType::Regular, b"long"),
    ]);
    let error = refused(&body);
    assert!(error.contains("255 bytes"), "{error}");
}

#[test]
fn what_does_not_belong_in_a_version_is_refused_by_name() {
    let plain = EntryType::Regular;
    for (name, kind) in [
        ("/model.json", plain),
        ("../model.json", plain),
        ("golden/../../model.json", plain),
        ("golden/..", plain),
        ("golden/a/b.jpg", plain),
        ("golden/C:b.jpg", plain),
        ("golden/.hidden", plain),
        ("golden/", plain),
        ("././model.json", plain),
        ("README", plain),
        ("", plain),
        ("golden/deeper", EntryType::Directory),
        ("..", EntryType::Directory),
        ("model.json", EntryType::Symlink),
        ("model.json", EntryType::Link),
        ("golden/null", EntryType::Char),
        ("golden/pipe", EntryType::Fifo),
        ("model.json", EntryType::GNUSparse),
        ("model.json", EntryType::GNULongLink),
    ] {
        let error = refused(&tar(&[(name, kind, b"")]));
        assert!(error.contains(&format!("{name:?}")), "{kind:?} {name}: {error}");
    }
    let twice = [("model.json", plain, &b"{}"[..]), ("./model.json", plain, b"{}")];
    assert!(refused(&tar(&twice)).contains("twice"));
    let renamed =
        [("PaxHeader", EntryType::XHeader, &b"18 path=../../etc\n"[..]), ("model.json", plain, b"")];
    assert!(refused(&tar(&renamed)).contains("../../etc"));
    let resized = [("PaxHeader", EntryType::XHeader, &b"16 size=9999999\n"[..]), ("model.json", plain, b"")];
    assert!(refused(&tar(&resized)).contains("size"));
}

#[test]
fn too_much_is_refused() {
    let limits = PackageLimits {
        max_entries: 2,
        max_model_bytes: 9,
        max_network_bytes: 9,
        max_side_file_bytes: 3,
        max_bytes: 1 << 20,
    };
    let error =
        |entries: &[(&str, EntryType, &[u8])]| unpacked(&tar(entries), &limits).1.unwrap_err().to_string();
    let plain = EntryType::Regular;
    assert!(error(&[("model.safetensors", plain, &[1; 10])]).contains("more than 9 bytes"));
    assert!(error(&[("golden/a", plain, &[1; 4])]).contains("golden/a"));
    let three = [("golden/a", plain, &b""[..]), ("golden/b", plain, b""), ("golden/c", plain, b"")];
    assert!(error(&three).contains("more than 2 entries"));
    let attributes = vec![b' '; MAX_ATTRIBUTE_BYTES as usize + 1];
    assert!(refused(&tar(&[("x", EntryType::XHeader, &attributes)])).contains("attributes"));
    let bare = unpacked(&[7; 10], &limits).1.unwrap_err().to_string();
    assert!(bare.contains("more than 9 bytes"), "{bare}");
}

#[test]
fn a_tar_without_a_model_and_a_body_that_is_none_are_refused() {
    assert!(refused(&tar(&[("model.json", EntryType::Regular, b"{}")])).contains("no model.safetensors"));
    for body in [&b""[..], &[0; 4096]] {
        assert!(refused(body).contains("not a roomsight model"), "{body:?}");
    }
    for (body, name) in [
        (&b"BZh91AY"[..], "bzip2"),
        (b"\xfd7zXZ\0\0", "xz"),
        (b"\x28\xb5\x2f\xfd\0", "zstd"),
        (b"7z\xbc\xaf\x27\x1c\0", "7z"),
        (b"Rar!\x1a\x07\0", "rar"),
    ] {
        let error = refused(body);
        assert!(error.contains(name) && error.contains("tar.gz"), "{error}");
    }
    assert!(refused(&gzipped(&gzipped(&PACKED))).contains("twice"));
}

#[test]
fn a_tar_that_was_cut_is_refused_wherever() {
    for length in (TAR_MARK_OFFSET + TAR_MARK.len()..PACKED.len()).step_by(64) {
        // Less than all of the end is as good as all of it, and ours has some to spare.
        if PACKED[length..].iter().all(|byte| *byte == 0)
            && PACKED[length - END_BYTES..length] == [0; END_BYTES]
        {
            continue;
        }
        assert!(unpacked(&PACKED[..length], &PackageLimits::default()).1.is_err(), "{length}");
    }
}

proptest! {
    #[test]
    fn damaged_tars_write_nothing_outside(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        seals in any::<bool>(),
    ) {
        let mut body = PACKED.clone();
        for (position, value) in edits {
            body[position.index(PACKED.len())] = value;
        }
        if seals {
            seal(&mut body);
        }
        let (folder, _) = unpacked(&body, &PackageLimits::default());
        let mut left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        prop_assert_eq!(left, ["body", "into"]);
    }
}

/// Gives each block that is a header a right checksum, so that damage is not seen by that alone.
fn seal(body: &mut [u8]) {
    for block in body.as_chunks_mut::<512>().0 {
        let mut header = Header::from_byte_slice(block).clone();
        if header.as_bytes()[257..262] == *TAR_MARK {
            header.set_cksum();
            *block = *header.as_bytes();
        }
    }
}
