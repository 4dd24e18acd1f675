//! The networks of a model: files beside it, named by what is in them.
//!
//! `networks/DIGEST.onnx` is a network and `networks/DIGEST.toml` is its description; DIGEST is the BLAKE3 digest of the
//! first. The model file names both by their digests, so that its own digest covers them.

use crate::file::disk::{LoadError, read_bounded, refused, write_new};
use roomsight_vision::network::{Network, NetworkError};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

/// Where they lie in a model's folder.
pub const NETWORKS_FOLDER: &str = "networks";

/// The largest network that is read.
pub const MAX_NETWORK_BYTES: u64 = 512 << 20;

/// The longest description of a network that is read.
const MAX_DESCRIPTION_BYTES: u64 = 64 << 10;

/// The most networks of one model.
pub(crate) const MAX_NETWORKS: usize = 8;

/// The most bytes of a network's name.
const MAX_NAME_BYTES: usize = 64;

/// A BLAKE3 digest in its one notation: 64 hexadecimal digits, letters small. It can stand in a path.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Digest(String);

/// What a model says of a network that it uses.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NetworkEntry {
    /// What the model calls it.
    pub name: String,
    /// Of the ONNX file.
    pub blake3: Digest,
    /// The bytes of the ONNX file.
    pub n_bytes: u64,
    /// Of its description.
    pub toml_blake3: Digest,
}

/// A network in memory. Equal ones have the same files.
#[derive(Debug)]
pub struct CarriedNetwork {
    onnx: Arc<[u8]>,
    toml: Vec<u8>,
    digests: NetworkDigests,
    /// From when it was first looked into.
    opened: OnceLock<Network>,
}

impl CarriedNetwork {
    /// What tells it from others: the digests of its files.
    pub(crate) fn key(&self) -> String {
        format!("{} {}", self.digests.onnx, self.digests.toml)
    }
}

impl PartialEq for CarriedNetwork {
    fn eq(&self, other: &Self) -> bool {
        self.digests == other.digests
    }
}

impl Eq for CarriedNetwork {}

/// Of the ONNX file and of its description: what tells networks apart.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct NetworkDigests {
    onnx: Digest,
    toml: Digest,
}

/// The networks of a model by the names that it has for them.
pub type Networks = BTreeMap<String, Arc<CarriedNetwork>>;

/// The networks that are in memory: each once, however many models use it, and as long as one does.
#[derive(Debug, Default)]
pub struct NetworkStore {
    networks: Mutex<BTreeMap<NetworkDigests, Weak<CarriedNetwork>>>,
}

impl Digest {
    /// The digest of these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self(blake3::hash(bytes).to_hex().to_string())
    }

    /// The digest that a text is, or none.
    pub fn parse(text: &str) -> Option<Self> {
        let is_digit = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
        (text.len() == 2 * blake3::OUT_LEN && text.bytes().all(is_digit)).then(|| Self(text.to_owned()))
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl From<Digest> for String {
    fn from(digest: Digest) -> Self {
        digest.0
    }
}

impl TryFrom<String> for Digest {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        Self::parse(&text)
            .ok_or_else(|| format!("{text:?} is no digest: 64 hexadecimal digits, letters small"))
    }
}

impl NetworkEntry {
    fn of(name: &str, network: &CarriedNetwork) -> Self {
        let NetworkDigests { onnx: blake3, toml: toml_blake3 } = network.digests.clone();
        Self { name: name.to_owned(), blake3, n_bytes: network.onnx.len() as u64, toml_blake3 }
    }

    /// Its ONNX file, relative to the model's folder.
    pub fn onnx_path(&self) -> String {
        format!("{NETWORKS_FOLDER}/{}.onnx", self.blake3)
    }

    /// Its description, relative to the model's folder.
    pub fn toml_path(&self) -> String {
        format!("{NETWORKS_FOLDER}/{}.toml", self.blake3)
    }

    fn digests(&self) -> NetworkDigests {
        NetworkDigests { onnx: self.blake3.clone(), toml: self.toml_blake3.clone() }
    }

    /// Whether its files are in a model's folder, and are what the model was trained with.
    pub fn verify(&self, folder: &Path) -> Result<(), LoadError> {
        self.verify_onnx(folder)?;
        self.read_toml(folder).map(drop)
    }

    /// Whether its ONNX file is.
    pub fn verify_onnx(&self, folder: &Path) -> Result<(), LoadError> {
        let path = folder.join(self.onnx_path());
        let file = File::open(&path).map_err(|error| self.unreadable(&path, &error))?;
        let n_bytes = file.metadata().map_err(|error| self.unreadable(&path, &error))?.len();
        if n_bytes != self.n_bytes {
            let reason = format!("damaged or replaced: it has {n_bytes} bytes, not {}", self.n_bytes);
            return Err(refused(&path, reason));
        }
        let mut hasher = blake3::Hasher::new();
        hasher.update_reader(file.take(n_bytes)).map_err(|error| self.unreadable(&path, &error))?;
        check_digest(&path, &Digest(hasher.finalize().to_hex().to_string()), &self.blake3)
    }

    fn read(&self, folder: &Path) -> Result<CarriedNetwork, LoadError> {
        let path = folder.join(self.onnx_path());
        let onnx = read_bounded(&path, MAX_NETWORK_BYTES)?;
        check_digest(&path, &Digest::of(&onnx), &self.blake3)?;
        let (onnx, toml, digests) = (onnx.into(), self.read_toml(folder)?, self.digests());
        Ok(CarriedNetwork { onnx, toml, digests, opened: OnceLock::new() })
    }

    fn read_toml(&self, folder: &Path) -> Result<Vec<u8>, LoadError> {
        let path = folder.join(self.toml_path());
        File::open(&path).map_err(|error| self.unreadable(&path, &error))?;
        let toml = read_bounded(&path, MAX_DESCRIPTION_BYTES)?;
        check_digest(&path, &Digest::of(&toml), &self.toml_blake3)?;
        Ok(toml)
    }

    fn unreadable(&self, path: &Path, error: &io::Error) -> LoadError {
        if error.kind() != io::ErrorKind::NotFound {
            return refused(path, error.to_string());
        }
        let reason = format!(
            "the model needs this file of its network {}, and it is missing: copy the folder {NETWORKS_FOLDER}/ of \
             the model too, or send the model's whole folder as an archive",
            self.name
        );
        refused(path, reason)
    }
}

impl CarriedNetwork {
    /// A network with its description.
    pub fn new(onnx: Vec<u8>, toml: Vec<u8>) -> Self {
        let digests = NetworkDigests { onnx: Digest::of(&onnx), toml: Digest::of(&toml) };
        Self { onnx: onnx.into(), toml, digests, opened: OnceLock::new() }
    }

    /// `NAME.onnx`, and `NAME.toml` beside it.
    pub fn read(path: &Path) -> Result<Self, NetworkError> {
        let network = Network::open(path)?;
        let toml = path.with_extension("toml");
        let toml = fs::read(&toml).map_err(|source| NetworkError::Io { path: toml, source })?;
        let digests = NetworkDigests { onnx: Digest::of(network.onnx()), toml: Digest::of(&toml) };
        Ok(Self { onnx: network.file(), toml, digests, opened: OnceLock::from(network) })
    }

    /// The network that the files are, which all who open it share. `name` is what errors call it.
    pub fn open(&self, name: &str) -> Result<&Network, NetworkError> {
        if let Some(network) = self.opened.get() {
            return Ok(network);
        }
        let network = Network::new(name, Arc::clone(&self.onnx), &String::from_utf8_lossy(&self.toml))?;
        Ok(self.opened.get_or_init(|| network))
    }
}

impl NetworkStore {
    /// A network of the model in a folder: the one in memory, or else from its files.
    pub(crate) fn open(&self, folder: &Path, entry: &NetworkEntry) -> Result<Arc<CarriedNetwork>, LoadError> {
        let mut networks = self.networks.lock().unwrap_or_else(PoisonError::into_inner);
        networks.retain(|_, network| network.strong_count() > 0);
        if let Some(network) = networks.get(&entry.digests()).and_then(Weak::upgrade) {
            return Ok(network);
        }
        let network = Arc::new(entry.read(folder)?);
        networks.insert(entry.digests(), Arc::downgrade(&network));
        Ok(network)
    }
}

/// What a model says of its networks.
pub(crate) fn entries(networks: &Networks) -> Vec<NetworkEntry> {
    networks.iter().map(|(name, network)| NetworkEntry::of(name, network)).collect()
}

/// Refuses what no model says of its networks.
pub(crate) fn check_entries(entries: &[NetworkEntry]) -> Result<(), String> {
    if entries.len() > MAX_NETWORKS {
        return Err(format!("it names {} networks; the limit is {MAX_NETWORKS}", entries.len()));
    }
    if let Some(large) = entries.iter().find(|entry| entry.n_bytes > MAX_NETWORK_BYTES) {
        let NetworkEntry { name, n_bytes, .. } = large;
        return Err(format!("its network {name} has {n_bytes} bytes; the limit is {MAX_NETWORK_BYTES}"));
    }
    if let Some(entry) = entries.iter().find(|entry| !is_name(&entry.name)) {
        return Err(format!(
            "{:?} is no name of a network: names have letters, digits, - _ and dots",
            entry.name
        ));
    }
    let names: BTreeSet<&str> = entries.iter().map(|entry| entry.name.as_str()).collect();
    let digests: BTreeSet<&Digest> = entries.iter().map(|entry| &entry.blake3).collect();
    if names.len() < entries.len() || digests.len() < entries.len() {
        return Err("it names a network twice".to_owned());
    }
    Ok(())
}

fn is_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    (1..=MAX_NAME_BYTES).contains(&name.len()) && name.chars().all(is_plain)
}

fn check_digest(path: &Path, digest: &Digest, expected: &Digest) -> Result<(), LoadError> {
    if digest == expected {
        return Ok(());
    }
    let reason = format!("damaged or replaced: its digest is {digest}, the model says {expected}");
    Err(refused(path, reason))
}

/// Writes the networks of a model into its new folder.
pub(crate) fn write_networks(folder: &Path, networks: &Networks) -> io::Result<()> {
    if networks.is_empty() {
        return Ok(());
    }
    fs::create_dir(folder.join(NETWORKS_FOLDER))?;
    for (name, network) in networks {
        let entry = NetworkEntry::of(name, network);
        write_new(&folder.join(entry.onnx_path()), &network.onnx)?;
        write_new(&folder.join(entry.toml_path()), &network.toml)?;
    }
    Ok(())
}
