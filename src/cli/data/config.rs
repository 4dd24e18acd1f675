//! The parameters of a model on the command line: a file, single ones, or what an effort chooses among.

use super::read_image;
use crate::cli::manners::note;
use crate::cli::mistakes::nearest;
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use roomsight_lab::dataset::Dataset;
use roomsight_recognition::model::{
    BAG, Candidate, CarriedNetwork, Config, DEFAULT_NETWORK, Effort, Means, Networks, PATTERNS, Sight,
};
use roomsight_vision::camera::{Camera, CameraKind, Mask, Projection};
use roomsight_vision::image::Limits;
use roomsight_vision::network::Runtime;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

/// The table of opinions in a configuration.
const OPINIONS: &str = "opinions";

/// What a cue is called that is an opinion on patterns.
const FRAME_LBP: &str = "frame_lbp";

/// Tables whose keys are names that people choose.
const BY_NAME: [&str; 2] = [OPINIONS, "weights"];

/// Parameters of a model.
#[derive(Args)]
pub(in crate::cli) struct ConfigArgs {
    /// How much may be spent on a frame, where no parameters are given: among a few combinations of opinions the one is
    /// taken that answers held-out frames best
    #[arg(long, value_enum, default_value = "balanced", conflicts_with_all = ["config", "parameters"])]
    effort: EffortName,
    /// Configuration of the model, as TOML [default: what --effort chooses]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// One parameter, such as representation.n_words=1000 or detector.threshold.fixed=20; give it as often
    /// as needed (`inspect` lists the parameters of a model)
    #[arg(long = "set", value_name = "NAME=VALUE")]
    parameters: Vec<String>,
    /// How often known answers are to be right, from 0 to 1; the more, the fewer are known
    /// [default: 0.95, or as configured]
    #[arg(long, value_name = "SHARE", value_parser = share::<f32>)]
    precision: Option<f32>,
    /// How often answers are to be right that cheap opinions give alone, from 0 to 1: a network is looked through, and blobs are
    /// looked for, only where the others are so sure on held-out frames; where these are too few to show it, always.
    /// 1 always asks all [default: 0.95, 1 with --effort best, or as configured]
    #[arg(long, value_name = "SHARE", value_parser = share::<f64>)]
    early_precision: Option<f64>,
    /// Take these opinions of the configuration only
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    opinions: Vec<String>,
    /// Folder of the networks that opinions look through: NAME.onnx with NAME.toml, and ONNX Runtime's library
    #[arg(long, value_name = "FOLDER", default_value = "networks")]
    networks: PathBuf,
    /// Picture whose dark pixels are parts of the robot that are always in view; it may have any size
    #[arg(long, value_name = "PICTURE")]
    mask: Option<PathBuf>,
}

/// How much may be spent on a frame, on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum EffortName {
    /// A few milliseconds
    Fast,
    /// Some ten milliseconds
    Balanced,
    /// What answers best
    Best,
}

impl From<EffortName> for Effort {
    fn from(name: EffortName) -> Self {
        match name {
            EffortName::Fast => Self::Fast,
            EffortName::Balanced => Self::Balanced,
            EffortName::Best => Self::Best,
        }
    }
}

/// Reads a share.
fn share<T: FromStr + PartialOrd + From<u8>>(text: &str) -> Result<T, String> {
    let share = text.parse().ok().filter(|share| (T::from(0)..=T::from(1)).contains(share));
    share.ok_or_else(|| "it must be from 0 to 1".to_owned())
}

/// Frames that are tried to be read for their size.
const MOST_TRIED: usize = 20;

/// The longest side of frames whose size is not known, in pixels.
const USUAL_SIDE: usize = 640;

/// Of the first of the frames that can be read, which stands for all.
fn longest_side(dataset: &Dataset) -> usize {
    if let Some([width, height]) = dataset.described_size() {
        return width.max(height);
    }
    let frames = dataset.frames.iter().take(MOST_TRIED);
    let mut frames = frames.filter_map(|frame| frame.read(&Limits::default()).ok());
    frames.next().map_or(USUAL_SIDE, |image| image.width().max(image.height()))
}

/// Refuses to look at scans where no frame has one.
fn check_laser(config: &Config, dataset: &Dataset) -> anyhow::Result<()> {
    let wants_scans = config.sights().iter().any(|sight| matches!(sight, Sight::Laser(_)));
    match dataset.laser() {
        None if wants_scans => bail!(
            "the configuration has an opinion that looks at the scans of a laser, and no frame has one: give --laser, and \
             recordings or COLD sequences with scans"
        ),
        Some(_) if !wants_scans => {
            note!("note: the configuration has no opinion of the kind laser: the scans are not looked at");
        }
        _ => (),
    }
    Ok(())
}

impl ConfigArgs {
    /// What is chosen among: what is configured, or else the candidates of the effort.
    pub(in crate::cli) fn candidates(&self, dataset: &Dataset) -> anyhow::Result<Vec<Candidate>> {
        if self.config.is_some() || !self.parameters.is_empty() {
            let config = self.read()?;
            check_laser(&config, dataset)?;
            return Ok(vec![Candidate { name: "as configured".to_owned(), config }]);
        }
        let effort = Effort::from(self.effort);
        let has_network = self.onnx_path(DEFAULT_NETWORK).is_file();
        if !has_network && effort != Effort::Fast {
            note!(
                "note: there is no network in {}, with which up to twice as many frames are answered right: \
                 `make networks` fetches one",
                self.networks.display()
            );
        }
        let camera = dataset.frames.first().map_or(CameraKind::Perspective, |frame| frame.camera);
        let longest_side = longest_side(dataset);
        let means = Means { effort, camera, has_network, longest_side, laser: dataset.laser() };
        let mut candidates = means.candidates();
        for candidate in &mut candidates {
            candidate.config = self.promising(self.with_wanted_opinions(candidate.config.clone()));
        }
        candidates.retain(|candidate| !candidate.config.opinions.is_empty());
        candidates.dedup_by(|later, earlier| later.config == earlier.config);
        let configs = candidates.iter_mut().map(|candidate| &mut candidate.config);
        self.link(configs, Networks::new())?;
        if candidates.is_empty() {
            bail!("no candidate has an opinion called {}: see --help", self.opinions.join(" or "));
        }
        Ok(candidates)
    }

    fn onnx_path(&self, network: &str) -> PathBuf {
        self.networks.join(format!("{network}.onnx"))
    }

    /// Gives configurations the networks that they name: those of `networks`, and others from their files, each opened
    /// once.
    fn link<'c>(
        &self,
        configs: impl Iterator<Item = &'c mut Config>,
        mut networks: Networks,
    ) -> anyhow::Result<()> {
        let configs: Vec<&mut Config> = configs.collect();
        let names: BTreeSet<String> = configs.iter().flat_map(|config| config.network_names()).collect();
        if names.is_empty() {
            return Ok(());
        }
        Runtime::look_into(self.networks.clone());
        for name in names {
            if networks.contains_key(&name) {
                continue;
            }
            let path = self.onnx_path(&name);
            if !path.is_file() {
                bail!(
                    "the network {name} is not in {}: run `make networks`, which fetches it, or name the folder \
                     where it is with --networks",
                    self.networks.display()
                );
            }
            networks.insert(name, Arc::new(CarriedNetwork::read(&path)?));
        }
        Ok(configs.into_iter().try_for_each(|config| config.link(&networks))?)
    }

    /// With the promises that were asked for.
    fn promising(&self, mut config: Config) -> Config {
        let precision = self.precision.unwrap_or(config.calibration.known_precision);
        config.calibration.known_precision = precision;
        config.early_precision = self.early_precision.unwrap_or(config.early_precision);
        config
    }

    fn with_wanted_opinions(&self, config: Config) -> Config {
        if self.opinions.is_empty() {
            return config;
        }
        config.with_opinions(|name| self.opinions.iter().any(|wanted| wanted == name))
    }

    /// The file, changed by the single parameters.
    pub(in crate::cli) fn read(&self) -> anyhow::Result<Config> {
        let mut table = toml::Table::try_from(Config::default())?;
        if let Some(path) = &self.config {
            let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
            let file: toml::Table = text.parse().with_context(|| path.display().to_string())?;
            if file.contains_key(OPINIONS) {
                table.remove(OPINIONS);
            }
            merge(&mut table, spelled_out(file)?);
            table.clone().try_into::<Config>().with_context(|| path.display().to_string())?;
        }
        let config = self.promising(self.with_wanted_opinions(changed(table, &self.parameters)?));
        if let Some(name) = self.opinions.iter().find(|name| !config.opinions.contains_key(*name)) {
            bail!("the configuration has no opinion called {name}");
        }
        self.completed(config, Networks::new())
    }

    /// A configuration changed by these parameters.
    pub(in crate::cli) fn with(&self, config: &Config, parameters: &[String]) -> anyhow::Result<Config> {
        self.completed(changed(toml::Table::try_from(config)?, parameters)?, config.networks())
    }

    /// A configuration with its networks, of which some are open already, if it makes sense.
    fn completed(&self, mut config: Config, networks: Networks) -> anyhow::Result<Config> {
        self.link(std::iter::once(&mut config), networks)?;
        config.check().map_err(anyhow::Error::msg)?;
        Ok(config)
    }

    /// Single parameters alone.
    #[cfg(test)]
    pub(in crate::cli) fn of_parameters(parameters: &[String]) -> Self {
        Self {
            effort: EffortName::Balanced,
            config: None,
            parameters: parameters.to_vec(),
            precision: None,
            early_precision: None,
            opinions: Vec::new(),
            networks: PathBuf::from("networks"),
            mask: None,
        }
    }

    /// The camera of checked frames; the mirror of an omnidirectional one is found in them, unless they were described with it.
    pub(in crate::cli) fn camera(&self, dataset: &Dataset, limits: &Limits) -> anyhow::Result<Camera> {
        let mask = self.mask.as_ref().map(|path| read_image(path, limits).map(Mask::new)).transpose()?;
        if let Some(projection) = dataset.described_projection() {
            return Ok(Camera { projection: *projection, mask });
        }
        let kind = dataset.frames.first().map_or(CameraKind::Perspective, |frame| frame.camera);
        let projection = match kind {
            CameraKind::Perspective => Projection::Perspective,
            CameraKind::Equirectangular => Projection::Equirectangular,
            CameraKind::Omnidirectional => {
                let mirror = dataset.find_mirror(limits).context(
                    "no mirror was found in the frames: take frames of one size, from a robot that moves",
                )?;
                Projection::Omnidirectional(mirror)
            }
        };
        Ok(Camera { projection, mask })
    }
}

/// The configuration that a table becomes by these parameters, one after the other.
fn changed(mut table: toml::Table, parameters: &[String]) -> anyhow::Result<Config> {
    for parameter in parameters {
        let before = table.clone();
        merge(&mut table, spelled_out(parse_parameter(parameter)?)?);
        let config = table.try_into::<Config>();
        let config = config.with_context(|| format!("--set {parameter}{}", hint(&before, parameter)))?;
        // Another variant brings its own parameters, which the next change may name.
        table = toml::Table::try_from(config)?;
    }
    Ok(table.try_into()?)
}

/// Which parameter may have been meant by one that is not there: one whose last part has that name, or nearly.
fn hint(table: &toml::Table, parameter: &str) -> String {
    let name = parameter.split('=').next().unwrap_or_default().trim();
    let mut paths = Vec::new();
    add_paths(table, "", &mut paths);
    let of_bag = format!("{OPINIONS}.{BAG}.");
    let paths: Vec<&str> = paths.iter().map(|path| path.strip_prefix(&of_bag).unwrap_or(path)).collect();
    if paths.contains(&name) {
        return String::new();
    }
    let last = |path: &'_ str| path.rsplit('.').next().unwrap_or_default().to_owned();
    let same = paths.iter().copied().find(|path| last(path) == last(name));
    let meant = same.or_else(|| nearest(name, paths.iter().copied()));
    meant.map_or_else(String::new, |meant| format!(" (did you mean {meant}?)"))
}

/// The dotted names of all values in a table.
fn add_paths(table: &toml::Table, prefix: &str, paths: &mut Vec<String>) {
    for (name, value) in table {
        let path = format!("{prefix}{name}");
        match value {
            toml::Value::Table(inner) => add_paths(inner, &format!("{path}."), paths),
            _ => paths.push(path),
        }
    }
}

/// Reads `a.b.c=value` as the table it would be in a file. A value that is no TOML is a string.
fn parse_parameter(parameter: &str) -> anyhow::Result<toml::Table> {
    let (name, value) =
        parameter.split_once('=').with_context(|| format!("{parameter:?} is not NAME=VALUE"))?;
    let line = format!("{} = {}", name.trim(), value.trim());
    let quoted = || format!("{} = {:?}", name.trim(), value.trim()).parse();
    line.parse().or_else(|_| quoted()).with_context(|| format!("{parameter:?} is not NAME=VALUE"))
}

/// The same table with the parameters of opinions under the names of these: `classifier` alone is that of the bag, and
/// a cue is an opinion on patterns that shares the weight with the bag.
fn spelled_out(mut table: toml::Table) -> anyhow::Result<toml::Table> {
    let mut opinions = toml::Table::new();
    let mut bag = toml::Table::new();
    for name in ["detector", "descriptor", "representation", "classifier"] {
        bag.extend(table.remove(name).map(|value| (name.to_owned(), value)));
    }
    if !bag.is_empty() {
        opinions.insert(BAG.to_owned(), bag.into());
    }
    if let Some(cue) = table.remove("cue") {
        let mut patterns: toml::Table = cue.try_into()?;
        let kind = patterns.remove("kind");
        if let Some(kind) = kind.as_ref().filter(|kind| kind.as_str() != Some(FRAME_LBP)) {
            bail!("cue.kind is {kind}: the only one is {FRAME_LBP}");
        }
        // One that is chosen is heard as much as the bag, unless it is said how much.
        let usual = kind.map(|_| toml::Value::Float(0.5));
        if let Some(weight) = patterns.remove("weight").or(usual) {
            let weight: f64 = weight.try_into()?;
            let weights = [(BAG, 1.0 - weight), (PATTERNS, weight)];
            let weights = weights.map(|(name, weight)| (name.to_owned(), weight.into()));
            table.insert("weights".to_owned(), toml::Table::from_iter(weights).into());
        }
        patterns.insert("kind".to_owned(), PATTERNS.into());
        opinions.insert(PATTERNS.to_owned(), patterns.into());
    }
    if !opinions.is_empty() {
        merge(&mut table, toml::Table::from_iter([(OPINIONS.to_owned(), opinions.into())]));
    }
    Ok(table)
}

/// Overwrites what `changes` names. A table that chooses another variant replaces the old one whole.
fn merge(table: &mut toml::Table, changes: toml::Table) {
    for (name, change) in changes {
        match (table.get_mut(&name), change) {
            (Some(toml::Value::Table(old)), toml::Value::Table(new))
                if BY_NAME.contains(&name.as_str()) || !is_other_variant(old, &new) =>
            {
                merge(old, new);
            }
            (_, change) => {
                table.insert(name, change);
            }
        }
    }
}

/// Variants are told apart by `kind`, or by being the only key of a table.
fn is_other_variant(old: &toml::Table, new: &toml::Table) -> bool {
    match (old.get("kind"), new.get("kind")) {
        (old_kind, Some(new_kind)) => old_kind != Some(new_kind),
        (Some(_), None) => false,
        (None, None) => old.len() == 1 && new.len() == 1 && !old.keys().eq(new.keys()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use roomsight_recognition::classify::svm::InnerKernel;
    use roomsight_recognition::model::{Classifier, Representation};
    use roomsight_recognition::vocabulary::Normalization;
    use roomsight_vision::describe::Descriptor;
    use roomsight_vision::detect::{Detector, Fast, FastThreshold};

    fn read(parameters: &[&str]) -> anyhow::Result<Config> {
        let parameters: Vec<String> = parameters.iter().map(|&parameter| parameter.to_owned()).collect();
        ConfigArgs::of_parameters(&parameters).read()
    }

    #[test]
    fn single_parameters_change_the_defaults() {
        let config = read(&[
            "representation.n_words=50",
            "representation.normalization=l1",
            "detector.threshold.fixed=20",
            "descriptor.kind=lbp",
            "seed=3",
        ]);
        let config = config.unwrap();
        let machines = config.machines().unwrap();
        let Representation::Bag(bag) = &machines.representation else { panic!("no bag") };
        assert_eq!((bag.n_words, bag.normalization, config.seed), (50, Normalization::L1, 3));
        assert_eq!(machines.detector, Detector::Fast(Fast { threshold: FastThreshold::Fixed(20) }));
        assert!(matches!(machines.descriptor, Descriptor::Lbp(_)));
        assert_eq!(read(&[]).unwrap(), Config::default());
        let matching =
            ["representation.kind=descriptors", "classifier.kind=match_svm", "classifier.inner.gamma=2"];
        assert!(
            matches!(&read(&matching).unwrap().machines().unwrap().classifier, Classifier::MatchSvm(config) if config.inner == InnerKernel::Rbf { gamma: 2.0 })
        );
    }

    #[test]
    fn wrong_parameters_are_named() {
        let error = |parameter: &str| format!("{:#}", read(&[parameter]).unwrap_err());
        assert!(error("representation.n_wrods=50").contains("n_wrods"));
        assert!(error("seed").contains("NAME=VALUE"));
        assert!(error("descriptor.kind=brisk").contains("brisk"));
        assert!(error("representation.n_words=0").contains("words"));
        assert!(error("classifier.c=0").contains("positive"));
        assert!(error("classifier.kind=match_svm").contains("representation.kind"));
        assert!(error("representation.kind=descriptors").contains("match_svm"));
        let words = error("representation={ kind = 'descriptors', n_words = 50 }");
        assert!(words.contains("n_words"), "{words}");
    }

    #[test]
    fn frames_whose_scale_space_fills_the_memory_are_refused() {
        let sift = ["detector.kind=sift", "descriptor.kind=sift"];
        let large = read(&[&sift[..], &["longest_side=4096"]].concat()).unwrap_err().to_string();
        assert!(large.contains("4096") && large.contains("GiB") && large.contains("longest_side"), "{large}");
        read(&[&sift[..], &["longest_side=2048"]].concat()).unwrap();
        read(&["longest_side=8192"]).unwrap();
        assert!(read(&["descriptor.kind=sift", "longest_side=8192"]).is_err());
    }
}
