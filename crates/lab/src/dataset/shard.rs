//! Described frames as files: a part of a data set, seen already, which stands in for its pictures.
//!
//! A part is two files: `part-2-of-8.frames.json` says which frames it holds, and names by its digest the file `DIGEST.safetensors` with what
//! was seen of them. The first is written last, so that what is there is whole. A folder of parts is a data set.

#[cfg(test)]
mod tests;

use super::describe::Read;
use super::{Dataset, DatasetError, Format, Frame, Look, Pose, Problem, files};
use crate::part::Part;
use crate::whole_file;
use roomsight_recognition::model::{
    Extractor, FeaturesError, LaserShape, Looked, Sample, features_from_bytes, features_to_bytes,
};
use roomsight_vision::camera::{CameraKind, Projection};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The last version of the layout.
const VERSION: u32 = 1;

/// How the names of the files with the frames end.
const ENDING: &str = ".frames.json";

/// The longest of these files, in bytes.
const MAX_BYTES: u64 = 1 << 30;

/// The file with the frames of a part.
fn file_name(part: Part) -> String {
    let [number, of] = part.into();
    format!("part-{number}-of-{of}{ENDING}")
}

/// A part that was described.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    version: u32,
    part: Part,
    /// A digest of what it was made of: frames, labels, how they were looked at.
    key: String,
    looked: Looked,
    projection: Projection,
    /// Where the pictures were.
    root: PathBuf,
    format: Format,
    /// The digest of the file with the features.
    features: String,
    frames: Vec<ShardFrame>,
    problems: Vec<ShardProblem>,
    notes: Vec<ShardProblem>,
    /// Where it lies.
    #[serde(skip)]
    folder: PathBuf,
}

/// A frame of a part.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ShardFrame {
    /// The picture, within the root.
    file: PathBuf,
    room: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    sequence: String,
    camera: CameraKind,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    split: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    time: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pose: Option<Pose>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    odometry: Option<Pose>,
    name: String,
    /// The BLAKE3 digest of the picture.
    picture: String,
    look: Look,
}

/// A frame that could not be taken, or not as a whole.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ShardProblem {
    path: PathBuf,
    reason: String,
}

/// Why a part was not written.
#[derive(Debug, thiserror::Error)]
pub enum ShardError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// What was being written.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// What was seen cannot be written.
    #[error(transparent)]
    Features(#[from] FeaturesError),
    /// The frames cannot be written.
    #[error("the frames cannot be written: {0}")]
    Unwritable(#[from] serde_json::Error),
}

impl Shard {
    /// The part of this number that lies in a folder already, if it was made of what the key says.
    pub fn find(folder: &Path, part: Part, key: &str) -> Option<Self> {
        let shard = Self::read(&folder.join(file_name(part))).ok()?;
        (shard.key == key && shard.features_path().is_file()).then_some(shard)
    }

    /// How many frames it holds.
    pub fn n_frames(&self) -> usize {
        self.frames.len()
    }

    fn read(path: &Path) -> Result<Self, String> {
        let bytes = files::read_bounded(path, MAX_BYTES).map_err(|error| error.to_string())?;
        let shard: Self = serde_json::from_slice(&bytes)
            .map_err(|error| format!("no described frames, or damaged: {error}"))?;
        if shard.version != VERSION {
            let reason = format!(
                "it has format version {}; this program reads {VERSION}: describe the frames again",
                shard.version
            );
            return Err(reason);
        }
        if blake3::Hash::from_hex(&shard.features).is_err() {
            return Err("the digest of its features is none".to_owned());
        }
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self { folder, ..shard })
    }

    fn features_path(&self) -> PathBuf {
        features_path(&self.folder, &self.features)
    }

    /// The labeled frame of one of its frames.
    fn frame(&self, frame: &ShardFrame) -> Frame {
        Frame {
            path: self.root.join(&frame.file),
            room: frame.room.clone(),
            sequence: frame.sequence.clone(),
            camera: frame.camera,
            split: frame.split.clone(),
            time: frame.time,
            pose: frame.pose,
            odometry: frame.odometry,
            scan: None,
            recorded: None,
        }
    }

    /// What `extractor` would see of its frames, in their order.
    fn seen(&self, extractor: &Extractor) -> Result<Vec<Read>, String> {
        self.looked.check(extractor).map_err(|error| error.to_string())?;
        let path = self.features_path();
        let bytes = fs::read(&path).map_err(|error| format!("what was seen of it is not there: {error}"))?;
        if blake3::hash(&bytes).to_hex().as_str() != self.features {
            return Err(format!("what was seen of it is damaged: {} has another digest", path.display()));
        }
        let features = features_from_bytes(&bytes, extractor).map_err(|error| error.to_string())?;
        if features.len() != self.frames.len() {
            return Err("what was seen is of another number of frames".to_owned());
        }
        let read = |(own, features): (&ShardFrame, _)| {
            let digest = blake3::Hash::from_hex(&own.picture);
            let digest = digest.map_err(|_| "the digest of its picture is none".to_owned())?;
            let Frame { room, sequence, pose, .. } = self.frame(own);
            let picture = Some(super::describe::short(&digest));
            let sample = Sample { room, sequence, name: own.name.clone(), pose, picture, features };
            Ok(Read { sample, digest, look: own.look.clone(), is_damaged: false })
        };
        self.frames.iter().zip(features).map(read).collect()
    }
}

fn features_path(folder: &Path, digest: &str) -> PathBuf {
    folder.join(format!("{digest}.safetensors"))
}

/// The parts that lie in a folder, by their names; empty where it is no folder of parts.
pub(super) fn find(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder)?.collect::<io::Result<Vec<_>>>()?;
    let mut paths: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).collect();
    paths.retain(|path| path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(ENDING)));
    paths.sort_by(|one, other| files::natural_order(&one.to_string_lossy(), &other.to_string_lossy()));
    Ok(paths)
}

/// The data set of these parts, which lie in `folder`.
pub(super) fn read(folder: &Path, paths: &[PathBuf]) -> Result<Dataset, DatasetError> {
    let mut dataset = Dataset::new(folder, Format::Manifest);
    let mut seen: HashMap<PathBuf, PathBuf> = HashMap::new();
    for path in paths {
        let shard = match Shard::read(path) {
            Ok(shard) => shard,
            Err(reason) => {
                dataset.problems.push(Problem::new(path, reason));
                continue;
            }
        };
        for frame in shard.frames.iter().map(|frame| shard.frame(frame)) {
            match seen.insert(frame.path.clone(), path.clone()) {
                Some(other) => {
                    let problem = Problem::new(&frame.path, "it is in two parts: the first is taken");
                    dataset.notes.push(problem.with(other.display().to_string()));
                }
                None => dataset.frames.push(frame),
            }
        }
        let problem = |problem: &ShardProblem| Problem::new(&problem.path, problem.reason.as_str());
        dataset.problems.extend(shard.problems.iter().map(problem));
        dataset.notes.extend(shard.notes.iter().map(problem));
        dataset.shards.push(shard.into());
    }
    // Of one data set: its pictures are named as they are there.
    if let [first, others @ ..] = &dataset.shards[..]
        && others.iter().all(|other| other.root == first.root)
    {
        (dataset.root, dataset.format) = (first.root.clone(), first.format);
    }
    for missing in missing(&dataset) {
        dataset.note(folder, format!("a part is not there: {missing}"));
    }
    Ok(dataset)
}

/// Parts of those that others say there are.
fn missing(dataset: &Dataset) -> Vec<String> {
    let parts: BTreeSet<Part> = dataset.shards.iter().map(|shard| shard.part).collect();
    let siblings: BTreeSet<Part> = parts.iter().flat_map(|part| part.siblings()).collect();
    siblings.difference(&parts).map(ToString::to_string).collect()
}

impl Dataset {
    /// How the frames of described parts project; `None` of pictures.
    pub fn described_projection(&self) -> Option<&Projection> {
        self.shards.first().map(|shard| &shard.projection)
    }

    /// Width and height in pixels of the first picture that was described; `None` of pictures.
    pub fn described_size(&self) -> Option<[usize; 2]> {
        let first = self.frames.first()?;
        let in_shard = |shard: &Arc<Shard>| {
            let frame = shard.frames.iter().find(|frame| shard.root.join(&frame.file) == first.path)?;
            Some([frame.look.width, frame.look.height])
        };
        self.shards.iter().find_map(in_shard)
    }

    /// How the scans of lasers were looked at of frames that are described; `None` where they were not, and of pictures.
    pub fn described_laser(&self) -> Option<LaserShape> {
        self.shards.first().and_then(|shard| shard.looked.laser())
    }

    /// The frames of one part, as many as of the others or one more.
    pub fn with_part(mut self, part: Part) -> Self {
        let range = part.range(self.frames.len());
        self.frames = self.frames.drain(range).collect();
        self
    }

    /// What was seen of each frame before, where it was.
    pub(super) fn seen_before(&self, extractor: &Extractor) -> Vec<Option<Result<Read, Problem>>> {
        let mut places: HashMap<&Path, usize> = HashMap::new();
        places.extend(self.frames.iter().enumerate().map(|(idx, frame)| (frame.path.as_path(), idx)));
        let mut before: Vec<Option<Result<Read, Problem>>> = self.frames.iter().map(|_| None).collect();
        for shard in &self.shards {
            let paths: Vec<PathBuf> = shard.frames.iter().map(|frame| shard.root.join(&frame.file)).collect();
            if !paths.iter().any(|path| places.contains_key(path.as_path())) {
                continue;
            }
            let mut put =
                |path: &Path, seen: Result<Read, Problem>| {
                    if let Some(&idx) = places.get(path) {
                        // Labels are those of the data set, which may have been told otherwise since.
                        let Frame { room, sequence, pose, .. } = self.frames[idx].clone();
                        before[idx].get_or_insert(seen.map(|read| Read {
                            sample: Sample { room, sequence, pose, ..read.sample },
                            ..read
                        }));
                    }
                };
            match shard.seen(extractor) {
                Ok(seen) => paths.iter().zip(seen).for_each(|(path, read)| put(path, Ok(read))),
                Err(reason) => {
                    paths.iter().for_each(|path| put(path, Err(Problem::new(path, reason.as_str()))));
                }
            }
        }
        before
    }

    /// A digest of what a part is made of: the frames as they are now, their labels, how they are looked at.
    pub fn part_key(&self, extractor: &Extractor) -> String {
        let mut digest = blake3::Hasher::new();
        let frames = self.frames.iter().map(|frame| {
            let changed = fs::metadata(frame.file())
                .ok()
                .and_then(|metadata| Some((metadata.len(), metadata.modified().ok()?)));
            format!("{frame:?} {changed:?}")
        });
        digest.update(format!("{:?} {:?}", VERSION, Looked::of(extractor)).as_bytes());
        for frame in frames {
            digest.update(frame.as_bytes());
        }
        digest.finalize().to_hex().to_string()
    }

    /// Writes what `extractor` saw of the frames of a part into a folder, which is made where it is not there. A part of the same
    /// number that was there is replaced. `key` is their [`Dataset::part_key`] from before they were described.
    ///
    /// # Errors
    /// What the system says.
    pub fn write_part(
        &self,
        part: Part,
        key: String,
        described: &super::Described,
        extractor: &Extractor,
        folder: &Path,
    ) -> Result<Shard, ShardError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| ShardError::Io { path, source }
        };
        let features: Vec<_> = described.samples.iter().map(|sample| &sample.features).collect();
        let features = features_to_bytes(&features, extractor)?;
        let digest = blake3::hash(&features).to_hex().to_string();
        let root = self.folder().canonicalize().map_err(io(self.folder()))?;
        let frame = |sample_idx: usize| {
            let (frame_idx, sample) = (described.frame_idxs[sample_idx], &described.samples[sample_idx]);
            let Frame { path, room, sequence, camera, split, time, pose, odometry, .. } =
                self.frames[frame_idx].clone();
            ShardFrame {
                file: path.strip_prefix(self.folder()).map_or_else(|_| absolute(&path), Path::to_owned),
                room,
                sequence,
                camera,
                split,
                time,
                pose,
                odometry,
                name: sample.name.clone(),
                picture: described.digests[sample_idx].to_hex().to_string(),
                look: described.looks[sample_idx].clone(),
            }
        };
        let problem = |problem: &Problem| ShardProblem {
            path: absolute(&problem.path),
            reason: problem.reason.clone(),
        };
        let shard = Shard {
            version: VERSION,
            part,
            key,
            looked: Looked::of(extractor),
            projection: extractor.camera().projection,
            root,
            format: self.format,
            features: digest,
            frames: (0..described.samples.len()).map(frame).collect(),
            problems: described.problems.iter().map(problem).collect(),
            notes: described.notes.iter().map(problem).collect(),
            folder: folder.to_owned(),
        };
        fs::create_dir_all(folder).map_err(io(folder))?;
        let path = folder.join(file_name(part));
        let before = Shard::read(&path).ok();
        whole_file::put(&shard.features_path(), &features).map_err(io(&shard.features_path()))?;
        whole_file::put(&path, &serde_json::to_vec(&shard)?).map_err(io(&path))?;
        if let Some(before) = before.filter(|before| before.features != shard.features) {
            // Nobody names it any more; one that stays does no harm.
            let _ = fs::remove_file(before.features_path());
        }
        Ok(shard)
    }
}

/// The path from the root of the file system, where the system can tell.
fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}
