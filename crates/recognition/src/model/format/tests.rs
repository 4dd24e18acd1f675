use crate::filter::{Step, Transitions};
use crate::model::tests::{config, frame, samples, train, trained};
use crate::model::{Card, Config, Model, Scratch};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use roomsight_vision::camera::{Camera, CameraKind, Mask, Mirror, Projection};
use roomsight_vision::image::Image;

#[test]
fn the_file_holds_everything() {
    let config = config();
    let mask = Mask::new(Image::from_pixels(3, 2, vec![255, 255, 0, 255, 255, 255]).unwrap());
    let mirror = Mirror { center_x: 0.5, center_y: 0.4, inner_radius: 0.05, outer_radius: 0.4 };
    let camera = Camera { projection: Projection::Omnidirectional(mirror), mask: Some(mask) };
    let training = train(&samples(&config, 48, 1), &config, camera).unwrap();
    let card = Card { description: "three patterns".to_owned(), ..Card::default() };
    let step = Step { from: 0, to: 2, seconds: 3.0, meters: Some(1.5) };
    let transitions = Transitions::learn(3, [step]);
    let model = training.finish(card, transitions);
    let bytes = model.to_bytes().unwrap();
    let read = Model::from_bytes(&bytes).unwrap();
    assert_eq!(read.to_bytes().unwrap(), bytes);
    assert_eq!(read.card(), model.card());
    assert_eq!(read.camera(), model.camera());
    assert_eq!(read.transitions(), model.transitions());
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let frame = frame(1, &mut random);
    assert_eq!(
        read.recognize(&frame, &mut Scratch::default()),
        model.recognize(&frame, &mut Scratch::default())
    );
}

#[test]
fn the_same_seed_gives_the_same_file_for_any_number_of_threads() {
    let bytes = |n_threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| trained(&Config { seed, ..config() }).model.to_bytes().unwrap())
    };
    assert_eq!(bytes(1, 7), bytes(3, 7));
    assert_ne!(bytes(1, 7), bytes(1, 8));
}

#[test]
fn foreign_and_newer_files_are_refused_by_name() {
    let refusal = |bytes: &[u8]| Model::from_bytes(bytes).unwrap_err().to_string();
    assert!(refusal(b"").contains("not a roomsight model"));
    assert!(refusal(&u64::MAX.to_le_bytes()).contains("not a roomsight model"));
    let foreign = safetensors::serialize::<&str, safetensors::tensor::TensorView, _>([], None).unwrap();
    assert!(refusal(&foreign).contains("something else"));
    let bytes = trained(&config()).model.to_bytes().unwrap();
    let text = b"\\\"format_version\\\":2";
    let position = bytes.windows(text.len()).position(|window| window == text).unwrap();
    let mut newer = bytes.clone();
    newer[position + text.len() - 1] = b'7';
    assert!(refusal(&newer).contains("format version 7"));
}

#[test]
fn every_camera_kind_has_a_projection_name() {
    for (kind, name) in [
        (CameraKind::Perspective, "perspective"),
        (CameraKind::Equirectangular, "equirectangular"),
        (CameraKind::Omnidirectional, "omnidirectional"),
    ] {
        assert_eq!(serde_json::to_value(kind).unwrap(), name);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn damaged_files_never_panic(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        length in any::<prop::sample::Index>(), cut in any::<bool>(), in_header in any::<bool>(),
    ) {
        static BYTES: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
        let mut bytes = BYTES.get_or_init(|| trained(&config()).model.to_bytes().unwrap()).clone();
        let reach = if in_header { 2500 } else { bytes.len() };
        for (position, value) in edits {
            bytes[position.index(reach)] = value;
        }
        if cut {
            bytes.truncate(length.index(bytes.len()));
        }
        if let Ok(model) = Model::from_bytes(&bytes) {
            let mut random = ChaCha8Rng::seed_from_u64(1);
            let answer = model.recognize(&frame(0, &mut random), &mut Scratch::default());
            prop_assert!(answer.room_idx < model.rooms().len());
            prop_assert!(answer.novelty.is_none_or(|novelty| (0.0..=1.0).contains(&novelty)));
        }
    }
}
