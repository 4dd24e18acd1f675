//! Models in folders, with the networks that they carry.

use super::*;
use crate::file::networks::*;
use crate::model::Model;
use crate::model::golden::load_golden_frames;
use crate::model::tests::{config, samples, trained};
use crate::model::training::Training;
use roomsight_vision::camera::{Camera, Projection};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::{Arc, LazyLock};
use tempfile::TempDir;

const ONNX: &[u8] = b"passes for a network";
const TOML: &[u8] = b"size = [224, 224]\n";

/// A model that says that it uses a network.
static MODEL: LazyLock<Model> = LazyLock::new(|| {
    let (samples, camera) = (samples(&config(), 48, 1), Camera::new(Projection::Perspective));
    let samples: Vec<_> = samples.iter().collect();
    let Training { model, .. } = Model::train(&samples, &config(), camera, |_| ()).unwrap();
    model.with_networks(networks(ONNX))
});

fn networks(onnx: &[u8]) -> Networks {
    Networks::from([("lite0".to_owned(), Arc::new(CarriedNetwork::new(onnx.to_vec(), TOML.to_vec())))])
}

fn saved() -> (TempDir, PathBuf) {
    let room = TempDir::new().unwrap();
    let folder = room.path().join("1");
    MODEL.save(&folder, &[]).unwrap();
    (room, folder)
}

fn refusal(folder: &Path) -> String {
    Model::load(folder).unwrap_err().to_string()
}

#[test]
fn a_model_comes_back_with_its_networks_and_its_digest_covers_them() {
    let (_place, folder) = saved();
    let LoadedModel { model, digest } = Model::load(&folder).unwrap();
    assert_eq!(model.networks(), MODEL.networks());
    assert_eq!(model.to_bytes().unwrap(), MODEL.to_bytes().unwrap());
    let other = MODEL.clone().with_networks(networks(b"another network"));
    assert_ne!(Digest::of(&other.to_bytes().unwrap()).to_string(), digest);
    assert!(matches!(Model::from_bytes(&MODEL.to_bytes().unwrap()), Err(FormatError::OtherNetworks)));
}

#[test]
fn networks_that_are_missing_cut_or_replaced_are_refused_by_name() {
    let entry = &entries(MODEL.networks())[0];
    let (blake3, toml_blake3) = (entry.blake3.to_string(), entry.toml_blake3.to_string());
    for (path, content, reasons) in [
        (entry.onnx_path(), None, ["missing", "lite0", "networks/"]),
        (entry.toml_path(), None, ["missing", "lite0", "networks/"]),
        (entry.onnx_path(), Some(&ONNX[..7]), ["damaged", "7 bytes", "20"]),
        (entry.onnx_path(), Some(b"PASSES for a network"), ["damaged", "digest", &blake3]),
        (entry.toml_path(), Some(b"size = 9"), ["damaged", "digest", &toml_blake3]),
    ] {
        let (_place, folder) = saved();
        match content {
            None => fs::remove_file(folder.join(&path)).unwrap(),
            Some(content) => fs::write(folder.join(&path), content).unwrap(),
        }
        let told = refusal(&folder);
        assert!(told.contains(&path) && reasons.iter().all(|reason| told.contains(reason)), "{told}");
    }
}

/// Edits the list of networks of a `model.json`.
fn edit(folder: &Path, change: impl FnOnce(&mut Vec<Value>)) {
    let path = folder.join(ABOUT_FILE);
    let mut about: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(about["networks"].as_array_mut().unwrap());
    fs::write(&path, about.to_string()).unwrap();
}

#[test]
fn a_list_of_networks_that_is_none_is_refused() {
    type Change = fn(&mut Vec<Value>);
    let changes: [(Change, &str); 9] = [
        (|networks| networks[0]["blake3"] = "../../../etc/passwd".into(), "no digest"),
        (
            |networks| networks[0]["blake3"] = String::from(Digest::of(TOML)).to_uppercase().into(),
            "no digest",
        ),
        (
            |networks| networks[0]["toml_blake3"] = String::from(Digest::of(TOML))[1..].to_owned().into(),
            "no digest",
        ),
        (|networks| networks[0]["n_bytes"] = json!(MAX_NETWORK_BYTES + 1), "limit"),
        (|networks| networks[0]["name"] = "a/b".into(), "no name"),
        (|networks| networks[0]["name"] = "other".into(), "different networks"),
        (Vec::clear, "different networks"),
        (|networks| networks.push(networks[0].clone()), "twice"),
        (|networks| *networks = vec![networks[0].clone(); MAX_NETWORKS + 1], "limit"),
    ];
    for (change, reason) in changes {
        let (_place, folder) = saved();
        edit(&folder, change);
        let told = refusal(&folder);
        assert!(told.contains(reason), "{reason}: {told}");
    }
}

#[test]
fn a_network_is_in_memory_once_and_as_long_as_a_model_uses_it() {
    let ((_one, first), (_two, second)) = (saved(), saved());
    let store = NetworkStore::default();
    let load = |folder: &Path| VerifiedFile::read(folder).unwrap().load(&store).unwrap().model;
    let (one, other) = (load(&first), load(&second));
    assert!(Arc::ptr_eq(&one.networks()["lite0"], &other.networks()["lite0"]));
    let weak = Arc::downgrade(&one.networks()["lite0"]);
    drop((one, other));
    assert!(weak.upgrade().is_none());
    assert_eq!(load(&first).networks(), MODEL.networks());
}

#[test]
fn folders_are_written_whole_and_damage_is_named() {
    let room = tempfile::tempdir().unwrap();
    let folder = room.path().join("lab/1");
    let model = trained(&config()).model;
    let golden = GoldenFrame {
        scan: None,
        name: "bars.png".to_owned(),
        bytes: vec![1, 2, 3],
        room: "bars".to_owned(),
        probability: 0.75,
    };
    model.save(&folder, std::slice::from_ref(&golden)).unwrap();
    let loaded = Model::load(&folder).unwrap();
    assert_eq!(loaded.digest.len(), 64);
    assert_eq!(loaded.model.rooms(), model.rooms());
    assert_eq!(load_golden_frames(&folder).unwrap(), [golden]);
    assert_eq!(fs::read_dir(room.path().join("lab")).unwrap().count(), 1, "nothing temporary is left");
    assert!(matches!(model.save(&folder, &[]), Err(SaveError::Exists(_))));

    let file = folder.join("model.safetensors");
    let mut bytes = fs::read(&file).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&file, &bytes).unwrap();
    assert!(Model::load(&folder).unwrap_err().to_string().contains("damaged or replaced"));
    fs::remove_file(folder.join("model.json")).unwrap();
    assert!(Model::load(&file).unwrap_err().to_string().contains("model.json"));
}
