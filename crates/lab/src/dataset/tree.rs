//! A folder and all below it: what may be of a data set, and what is left out of it and why.

use super::{DatasetError, Problem, files};
use roomsight_vision::image::{Image, ImageError, Limits};
use std::fs::{self, DirEntry, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// A folder.
#[derive(Debug, Default)]
pub struct Tree {
    /// Where it lies.
    pub path: PathBuf,
    /// The folders in it, sorted; links to folders too, but for those that lead back up.
    pub folders: Vec<Tree>,
    /// What is a picture by its content, or is called one, sorted.
    pub pictures: Vec<PathBuf>,
    /// What may be a list of frames by its name, sorted.
    pub lists: Vec<PathBuf>,
    /// Everything else that can be read, sorted.
    pub left_out: Vec<Problem>,
    /// What cannot be read, be it files or folders, sorted.
    pub unreadable: Vec<Problem>,
    /// Whether something that was left out is a picture of a format that is not read here.
    has_other_pictures: bool,
}

/// The deepest folder that is looked into, counted from the root.
const MAX_DEPTH: usize = 8;

/// The most folders of a data set; who gives more has given a whole disk.
const MAX_FOLDERS: usize = 100_000;

/// What systems, cameras and network drives leave, beside names that begin with a dot; in lower case.
const LEFTOVERS: [&str; 21] = [
    "#recycle",
    "#snapshot",
    "$recycle.bin",
    "@eadir",
    "@recently-snapshot",
    "@recycle",
    "@tmp",
    "__macosx",
    "__pycache__",
    "desktop.ini",
    "ehthumbs.db",
    "found.000",
    "icon\r",
    "lost+found",
    "lost.dir",
    "network trash folder",
    "recycled",
    "recycler",
    "system volume information",
    "temporary items",
    "thumbs.db",
];

/// The first bytes of a file, enough to tell its format.
const HEAD_LENGTH: u64 = 256;

impl Tree {
    /// Reads the folder `root` and all below it. A folder below that cannot be read is left out.
    pub fn read(root: &Path) -> Result<Self, DatasetError> {
        let fail = |error| DatasetError::io(root, error);
        let location = fs::canonicalize(root).map_err(fail)?;
        Walk { above: vec![location], n_folders: 0 }.read(root).map_err(fail)
    }

    /// Its name as text; what is no UTF-8 is replaced.
    pub fn name(&self) -> String {
        files::name(&self.path)
    }

    /// The folder of this name in it.
    pub fn folder(&self, name: &str) -> Option<&Self> {
        self.folders.iter().find(|folder| folder.name() == name)
    }

    /// Whether there is a picture in it, however deep.
    pub fn has_pictures(&self) -> bool {
        !self.pictures.is_empty() || self.folders.iter().any(Self::has_pictures)
    }

    /// The folders in it with a picture.
    pub fn with_pictures(&self) -> Vec<&Self> {
        self.folders.iter().filter(|folder| folder.has_pictures()).collect()
    }

    /// Whether a folder without a picture may be meant as a room: nothing is in it, or what cannot be read here.
    pub fn may_be_room(&self) -> bool {
        let is_empty = self.folders.is_empty() && self.pictures.is_empty() && self.lists.is_empty();
        (is_empty && self.left_out.is_empty()) || self.has_what_cannot_be_read()
    }

    fn has_what_cannot_be_read(&self) -> bool {
        !self.unreadable.is_empty()
            || self.has_other_pictures
            || self.folders.iter().any(Self::has_what_cannot_be_read)
    }

    /// All pictures, those of folders in it too.
    pub fn all_pictures(&self) -> Vec<&PathBuf> {
        self.pictures.iter().chain(self.folders.iter().flat_map(Self::all_pictures)).collect()
    }

    /// All that was left out but for what cannot be read, in folders in it too.
    pub fn all_left_out(&self) -> Vec<&Problem> {
        self.left_out.iter().chain(self.folders.iter().flat_map(Self::all_left_out)).collect()
    }

    /// All that cannot be read, in folders in it too.
    pub fn all_unreadable(&self) -> Vec<&Problem> {
        self.unreadable.iter().chain(self.folders.iter().flat_map(Self::all_unreadable)).collect()
    }

    fn leave_out(&mut self, path: &Path, reason: impl Into<String>) {
        self.left_out.push(Problem::new(path, reason));
    }

    fn fail(&mut self, path: &Path, error: &io::Error) {
        self.unreadable.push(Problem::new(path, format!("cannot be read: {error}")));
    }
}

/// On the way through the folders.
struct Walk {
    /// Where the folder that is read and those above it really lie.
    above: Vec<PathBuf>,
    n_folders: usize,
}

impl Walk {
    fn read(&mut self, folder: &Path) -> io::Result<Tree> {
        let mut tree = Tree { path: folder.to_owned(), ..Tree::default() };
        let mut entries = fs::read_dir(folder)?.collect::<io::Result<Vec<_>>>()?;
        entries.sort_by_key(DirEntry::file_name);
        for entry in &entries {
            let path = entry.path();
            if is_leftover(&path) {
                tree.leave_out(&path, "hidden, or left by a system, a camera or a network drive");
                continue;
            }
            match kind(entry) {
                Ok(kind) if kind.is_dir() => self.descend(&mut tree, &path),
                Ok(kind) if kind.is_file() => add_file(&mut tree, path),
                Ok(_) => tree.leave_out(&path, "a pipe, a socket or a device: only files are read"),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {
                    tree.leave_out(&path, "a link that leads nowhere");
                }
                Err(error) => tree.fail(&path, &error),
            }
        }
        Ok(tree)
    }

    fn descend(&mut self, tree: &mut Tree, folder: &Path) {
        self.n_folders += 1;
        if self.above.len() > MAX_DEPTH {
            return tree.leave_out(folder, "too many folders deep, not read");
        }
        if self.n_folders > MAX_FOLDERS {
            return tree.leave_out(folder, "one folder too many, not read: is the right folder given?");
        }
        let below = fs::canonicalize(folder).and_then(|location| {
            if self.above.iter().any(|above| above.starts_with(&location)) {
                return Ok(None);
            }
            self.above.push(location);
            let below = self.read(folder);
            self.above.pop();
            below.map(Some)
        });
        match below {
            Ok(Some(below)) => tree.folders.push(below),
            Ok(None) => tree.leave_out(folder, "a link back to a folder that it lies in"),
            Err(error) => tree.fail(folder, &error),
        }
    }
}

/// Of a link, what it leads to.
fn kind(entry: &DirEntry) -> io::Result<fs::FileType> {
    let kind = entry.file_type()?;
    if kind.is_symlink() { fs::metadata(entry.path()).map(|metadata| metadata.file_type()) } else { Ok(kind) }
}

/// What is called a picture is taken for one: if it is none, reading it tells why.
fn add_file(tree: &mut Tree, path: PathBuf) {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    if files::is_picture_ending(&extension) {
        return tree.pictures.push(path);
    }
    if extension.eq_ignore_ascii_case("csv") || extension.eq_ignore_ascii_case("tsv") {
        return tree.lists.push(path);
    }
    match head(&path).map(|head| Begins::of(&head)) {
        Ok(Begins::Picture) => tree.pictures.push(path),
        Ok(Begins::Otherwise(reason)) => tree.leave_out(&path, reason),
        Ok(Begins::OtherPicture(reason)) => {
            tree.has_other_pictures = true;
            tree.leave_out(&path, reason);
        }
        Err(error) => tree.fail(&path, &error),
    }
}

/// How a file begins.
#[derive(Debug, PartialEq, Eq)]
enum Begins {
    /// As a picture that can be read.
    Picture,
    /// As one of a format that is not read here, or a video; what is said of it.
    OtherPicture(String),
    /// Otherwise; what is said of it.
    Otherwise(String),
}

impl Begins {
    fn of(head: &[u8]) -> Self {
        match Image::decode(head, &Limits::default()) {
            _ if head.is_empty() => Self::Otherwise("an empty file".to_owned()),
            Err(ImageError::UnknownFormat) => Self::Otherwise("not a picture".to_owned()),
            Err(error @ ImageError::Unsupported { .. }) => Self::OtherPicture(error.to_string()),
            _ => Self::Picture,
        }
    }
}

/// The thumbnails that cameras keep beside videos are pictures, but not frames.
fn is_leftover(path: &Path) -> bool {
    let name = files::name(path).to_lowercase();
    name.starts_with('.') || name.ends_with(".thm") || LEFTOVERS.contains(&name.as_str())
}

fn head(path: &Path) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    File::open(path)?.take(HEAD_LENGTH).read_to_end(&mut head)?;
    Ok(head)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_told_by_how_they_begin() {
        let pictures: [&[u8]; 4] = [
            b"\xff\xd8\xff\xe0\0\x10JFIF\0",
            b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR",
            b"RIFF\x24\0\0\0WEBPVP8 ",
            b"P5\n4 4\n255\n",
        ];
        for head in pictures {
            assert_eq!(Begins::of(head), Begins::Picture, "{head:?}");
        }
        let otherwise = |reason: &str| Begins::Otherwise(reason.to_owned());
        assert_eq!(Begins::of(b""), otherwise("an empty file"));
        assert_eq!(Begins::of(b"file,place\n"), otherwise("not a picture"));
        let told = |head: &[u8], format: &str| {
            assert!(matches!(Begins::of(head), Begins::OtherPicture(reason) if reason.contains(format)));
        };
        told(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", "HEIC");
        told(b"\0\0\0\x18ftypisom\0\0\0\0isommp42", "video");
    }

    #[test]
    fn leftovers_are_told_by_their_names() {
        for name in
            ["@eaDir", "$RECYCLE.BIN", "System Volume Information", "lost+found", "._1.jpg", "MVI_1.THM"]
        {
            assert!(is_leftover(Path::new(name)), "{name}");
        }
        for name in ["kitchen", "@home", "recycling room", "1.jpg", "lost"] {
            assert!(!is_leftover(Path::new(name)), "{name}");
        }
    }
}
