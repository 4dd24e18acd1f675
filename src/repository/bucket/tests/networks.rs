//! Models that use networks, in a bucket.

use super::*;
use roomsight_recognition::model::{Digest, NETWORKS_FOLDER};
use serde_json::json;

const ONNX: &str = "passes for a network";
const TOML: &str = "size = [224, 224]\n";

/// Writes what passes for a model that uses a network; returns the paths of the network's files.
fn write_version(folder: &Path, model: &str) -> [String; 2] {
    let digest = |text: &str| Digest::of(text.as_bytes());
    let entry = json!({ "name": "lite0", "blake3": digest(ONNX), "n_bytes": ONNX.len(), "toml_blake3": digest(TOML) });
    let about = json!({ "blake3": digest(model), "networks": [entry] });
    let paths = ["onnx", "toml"].map(|end| format!("{NETWORKS_FOLDER}/{}.{end}", digest(ONNX)));
    fs::create_dir_all(folder.join(NETWORKS_FOLDER)).unwrap();
    for (name, content) in
        [(MODEL_FILE, model), (ABOUT_FILE, &about.to_string()), (&paths[0], ONNX), (&paths[1], TOML)]
    {
        fs::write(folder.join(name), content).unwrap();
    }
    paths
}

fn publish(bucket: &Bucket, id: &str) -> [String; 2] {
    let staged = bucket.stage().unwrap();
    let paths = write_version(staged.path(), id);
    bucket.publish(&id.parse().unwrap(), &staged).unwrap();
    paths
}

fn paths(bucket: &Bucket) -> Vec<String> {
    let mut paths: Vec<String> =
        bucket.remote.list("").unwrap().into_iter().map(|object| object.path).collect();
    paths.sort();
    paths
}

fn shared() -> String {
    format!(".networks/{}.onnx", Digest::of(ONNX.as_bytes()))
}

#[test]
fn a_network_lies_in_the_bucket_and_in_the_cache_once_until_nobody_uses_it() {
    let Some(lab) = Lab::new("networks") else { return };
    let bucket = lab.open(BRIEF);
    let [onnx, toml] = publish(&bucket, "lab/1");
    publish(&bucket, "attic/7");
    let networks = || paths(&bucket).into_iter().filter(|path| path.ends_with(".onnx")).collect::<Vec<_>>();
    assert_eq!(networks(), [shared()]);
    let scan = bucket.scan().unwrap();
    assert!(scan.foreign.is_empty() && scan.models.len() == 2, "{scan:?}");
    let folders = ["lab/1", "attic/7"].map(|id| bucket.fetch(&id.parse().unwrap()).unwrap());
    for folder in &folders {
        VerifiedFile::read(folder).unwrap();
        assert_eq!(fs::read_to_string(folder.join(&toml)).unwrap(), TOML);
        #[cfg(unix)]
        assert_eq!(std::os::unix::fs::MetadataExt::nlink(&fs::metadata(folder.join(&onnx)).unwrap()), 2);
    }
    bucket.delete(&"lab/1".parse().unwrap()).unwrap();
    assert_eq!(networks(), [shared()]);
    bucket.delete(&"attic/7".parse().unwrap()).unwrap();
    assert_eq!(paths(&bucket), [""; 0]);
}

#[test]
fn a_network_that_others_may_use_stays() {
    let Some(lab) = Lab::new("networks-in-use") else { return };
    let bucket = lab.open(BRIEF);
    publish(&bucket, "lab/1");
    // Somebody has begun to publish another version of it.
    let (about, _) = bucket.remote.read("lab/1/model.json", MAX_SIDE_FILE_BYTES).unwrap().unwrap();
    overwrite(&bucket, "lab/2/model.json", std::str::from_utf8(&about).unwrap());
    bucket.delete(&"lab/1".parse().unwrap()).unwrap();
    assert_eq!(paths(&bucket), [shared(), "lab/2/model.json".to_owned()]);
    overwrite(&bucket, "lab/3/model.json", "nobody can tell what it names");
    bucket.delete(&"lab/2".parse().unwrap()).unwrap();
    assert_eq!(paths(&bucket), [shared(), "lab/3/model.json".to_owned()]);
}

#[test]
fn a_network_that_is_gone_or_replaced_is_told_and_comes_back() {
    let Some(lab) = Lab::new("networks-gone") else { return };
    let bucket = lab.open(BRIEF);
    publish(&bucket, "lab/1");
    let fetch = || bucket.fetch(&"lab/1".parse().unwrap());
    bucket.remote.remove(&shared()).unwrap();
    let gone = fetch().unwrap_err();
    assert!(matches!(&gone, RepositoryError::NoNetwork { path, .. } if *path == shared()), "{gone}");
    assert!(gone.to_string().contains("lab/1 uses the network lite0"), "{gone}");
    for wrong in ["PASSES for a network", "passes for", &ONNX.repeat(2)] {
        overwrite(&bucket, &shared(), wrong);
        let told = fetch().unwrap_err().to_string();
        assert!(told.contains("lab/1 is damaged") && told.contains(&shared()), "{told}");
    }
    overwrite(&bucket, &shared(), ONNX);
    VerifiedFile::read(&fetch().unwrap()).unwrap();
}

#[test]
fn a_whole_folder_that_was_copied_into_the_bucket_is_a_version() {
    let Some(lab) = Lab::new("networks-by-hand") else { return };
    let bucket = lab.open(BRIEF);
    let folder = TempDir::new().unwrap();
    let [onnx, toml] = write_version(folder.path(), "by hand");
    for name in [&onnx, &toml, ABOUT_FILE, MODEL_FILE] {
        overwrite(&bucket, &format!("lab/1/{name}"), &fs::read_to_string(folder.path().join(name)).unwrap());
    }
    assert_eq!(versions(&bucket.scan().unwrap()), [1]);
    // Another one comes without its network, into a cache that is empty.
    for shared_too in [false, true] {
        let staged = bucket.stage().unwrap();
        write_version(staged.path(), "without");
        fs::remove_dir_all(staged.path().join(NETWORKS_FOLDER)).unwrap();
        bucket.complete(staged.path()).unwrap();
        VerifiedFile::read(staged.path()).unwrap();
        if shared_too {
            break;
        }
        bucket.publish(&"lab/2".parse().unwrap(), &staged).unwrap();
        assert!(paths(&bucket).contains(&shared()));
    }
    VerifiedFile::read(&bucket.fetch(&"lab/1".parse().unwrap()).unwrap()).unwrap();
}
