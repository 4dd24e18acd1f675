//! The fuzz targets on seeds, and on inputs that once broke something (`fuzz/regressions/TARGET/`).
//!
//! With `FUZZ_SEEDS=FOLDER` the seeds are written to `FOLDER/TARGET/` too: `make fuzz` begins with them.

#[path = "../../fuzz/src/lib.rs"]
mod targets;

use image::{DynamicImage, ImageFormat, Luma, Rgb};
use rand::{Rng, SeedableRng};
use roomsight::repository::package;
use roomsight_lab::dataset;
use roomsight_lab::part::Part;
use roomsight_protocol::header::{Beside, Odometry};
use roomsight_protocol::scan::LaserScan;
use roomsight_recognition::classify::{boost, svm};
use roomsight_recognition::model::{
    CarriedNetwork, Classifier, Config, Extractor, GoldenFrame, Model, Networks, PatternsConfig,
    Representation, Sample, Scratch,
};
use roomsight_recognition::vocabulary;
use roomsight_recording::write::JsonRecording;
use roomsight_vision::camera::{Camera, Projection};
use roomsight_vision::image::{Image, Limits};
use roomsight_vision::network::Network;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

struct Target {
    name: &'static str,
    run: fn(&[u8]),
    seeds: Vec<Vec<u8>>,
}

fn all_targets() -> [Target; 11] {
    [
        Target { name: "archive", run: targets::archive, seeds: archives() },
        Target { name: "described", run: targets::described, seeds: described() },
        Target { name: "lists", run: targets::lists, seeds: lists() },
        Target { name: "model", run: targets::model, seeds: models() },
        Target { name: "networks", run: targets::networks, seeds: networks() },
        Target { name: "oip", run: targets::oip, seeds: oip() },
        Target { name: "pictures", run: targets::pictures, seeds: pictures() },
        Target { name: "recordings", run: targets::recordings, seeds: recordings() },
        Target { name: "service", run: targets::service, seeds: service() },
        Target { name: "settings", run: targets::settings, seeds: settings() },
        Target { name: "stream", run: targets::stream, seeds: stream() },
    ]
}

/// What was seen of small frames, and the list of a part of them.
fn described() -> Vec<Vec<u8>> {
    let folder = TempDir::new().unwrap();
    let (pictures, parts) = (folder.path().join("rooms"), folder.path().join("parts"));
    for (idx, room) in ["hall", "lab"].into_iter().enumerate() {
        fs::create_dir_all(pictures.join(room)).unwrap();
        let picture = image::GrayImage::from_fn(48, 36, |x, y| Luma([(x * y * (idx as u32 + 2)) as u8]));
        picture.save(pictures.join(room).join("1.png")).unwrap();
    }
    let (dataset, extractor) = (dataset::open(&pictures).unwrap(), targets::described_by());
    let described = dataset.describe(&extractor, &Limits::default(), || ());
    dataset.write_part(Part::WHOLE, dataset.part_key(&extractor), &described, &extractor, &parts).unwrap();
    fs::read_dir(&parts).unwrap().map(|entry| fs::read(entry.unwrap().path()).unwrap()).collect()
}

fn golden(folder: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut files: Vec<PathBuf> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let is_picture = |path: &PathBuf| path.extension().is_some_and(|end| end == "png" || end == "jpeg");
    files.retain(is_picture);
    assert!(!files.is_empty(), "no pictures are in {}", folder.display());
    files.into_iter().map(|path| fs::read(path).unwrap()).collect()
}

/// Every format, gray and in color, and frames that robots have taken, made small: large ones take time and
/// lead nowhere else.
fn pictures() -> Vec<Vec<u8>> {
    let gray = DynamicImage::from(image::GrayImage::from_fn(20, 12, |x, y| Luma([(x * y) as u8])));
    let color = DynamicImage::from(image::RgbImage::from_fn(17, 9, |x, y| Rgb([x as u8, y as u8, 200])));
    let mut pictures = Vec::new();
    let frames = [golden("crates/vision/tests/golden"), golden("models/simulated-lab/1/golden")].concat();
    let frames = frames.iter().map(|bytes| image::load_from_memory(bytes).unwrap().thumbnail(48, 36));
    for picture in [gray, color].into_iter().chain(frames) {
        for format in
            [ImageFormat::Jpeg, ImageFormat::Png, ImageFormat::WebP, ImageFormat::Bmp, ImageFormat::Pnm]
        {
            let mut bytes = Cursor::new(Vec::new());
            picture.write_to(&mut bytes, format).unwrap();
            pictures.push(bytes.into_inner());
        }
    }
    pictures.push(b"P2 2 2 255 0 10 20 255".to_vec());
    pictures
}

/// One small model of each kind.
fn trained() -> Vec<Model> {
    let bag = vocabulary::Config { n_words: 8, ..vocabulary::Config::default() };
    let words = Config { longest_side: 96, ..Config::default() };
    let words = words.with_bag(|machines| machines.representation = Representation::Bag(bag));
    let with = |classifier| words.with_bag(|machines| machines.classifier = classifier);
    let matched = Classifier::MatchSvm(svm::MatchConfig::default());
    let configs = [
        words.clone().with_patterns(0.5, PatternsConfig::default()),
        with(Classifier::KernelSvm(svm::KernelConfig::default())),
        with(Classifier::Boost(boost::Config { n_rounds: 4 })),
        with(matched).with_bag(|machines| machines.representation = Representation::Descriptors {}),
        words,
    ];
    configs.iter().map(train).collect()
}

fn train(config: &Config) -> Model {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let extractor = Extractor::new(config, Camera::new(Projection::Perspective));
    let sample = |idx: usize| {
        let period = 10 + 6 * (idx % 3);
        let pixel = |idx: usize| {
            let is_bright = (idx % 64 % period < period / 2) != (idx / 64 % period < period / 2);
            random.random_range(0..6) + if is_bright { 200 } else { 40 }
        };
        let frame = Image::from_pixels(64, 48, (0..64 * 48).map(pixel).collect()).unwrap();
        let features = extractor.extract(&frame, &mut Scratch::default());
        Sample {
            room: format!("room {}", idx % 3),
            sequence: format!("drive {}", idx % 2),
            name: format!("{idx}.jpg"),
            pose: None,
            picture: None,
            features,
        }
    };
    let samples: Vec<Sample> = (0..12).map(sample).collect();
    let samples: Vec<&Sample> = samples.iter().collect();
    Model::train(&samples, config, Camera::new(Projection::Perspective), |_| ()).unwrap().model
}

fn models() -> Vec<Vec<u8>> {
    let files = trained().into_iter().map(|model| model.to_bytes().unwrap());
    files.flat_map(|file| [in_parts(&file), file]).collect()
}

/// What [`targets::model`] puts together to the same model.
fn in_parts(file: &[u8]) -> Vec<u8> {
    let (length, rest) = file.split_first_chunk().unwrap();
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    let mut arrays: serde_json::Map<_, _> = serde_json::from_slice(header).unwrap();
    let about = arrays.remove("__metadata__").unwrap()["roomsight"].as_str().unwrap().to_owned();
    let arrays = serde_json::to_vec(&arrays).unwrap();
    let again = Model::from_bytes(&targets::model_file(&arrays, about.as_bytes(), data)).unwrap();
    assert_eq!(again.to_bytes().unwrap(), file);
    joined(&[&arrays, about.as_bytes(), data])
}

fn joined(parts: &[&[u8]]) -> Vec<u8> {
    let (last, first) = parts.split_last().unwrap();
    let length = |part: &[u8]| u16::try_from(part.len()).unwrap().to_le_bytes();
    let mut joined: Vec<u8> = first.iter().flat_map(|part| [&length(part), *part].concat()).collect();
    joined.extend(*last);
    joined
}

fn archives() -> Vec<Vec<u8>> {
    let room = tempfile::tempdir().unwrap();
    let network = CarriedNetwork::new(b"passes for a network".to_vec(), b"size = [224, 224]".to_vec());
    let mut models = trained();
    if let Some(last) = models.pop() {
        models.push(last.with_networks(Networks::from([("lite0".to_owned(), Arc::new(network))])));
    }
    let pack = |(idx, model): (usize, Model)| {
        let folder = room.path().join(idx.to_string());
        let bytes = b"P5 2 2 255 0000".to_vec();
        let name = "frame.pgm".to_owned();
        let golden =
            GoldenFrame { name, bytes, scan: None, room: model.rooms()[0].clone(), probability: 1.0 / 3.0 };
        model.save(&folder, &[golden]).unwrap();
        let mut tar = Vec::new();
        package::pack(&folder, &mut tar).unwrap();
        tar
    };
    models.into_iter().enumerate().map(pack).collect()
}

fn lists() -> Vec<Vec<u8>> {
    let manifest = "file,place,sequence,camera,split\na/1.jpg,kitchen,monday,perspective,train\n";
    let labels = "t1_x1_y1_a1.jpeg CR-A\nt2.5_x-1.5_y0_a0.1.jpeg 2PO1-A\n";
    let windows = "\u{feff}\"Place\";\"File\"\r\n\"k\u{fc}che\";\"a\\1.jpg\"\r\n";
    let [manifest, labels, windows] = [manifest, labels, windows].map(str::as_bytes);
    let ranges = " 1.5".repeat(181);
    let senses = format!("0 0 181 1 5000 0 0 0 0 0 0 0 0 0 0 0{ranges}\n0 0 0 1 9 2 0 6 1.5 2.5 0 0.1 0 0\n");
    vec![joined(&[manifest, labels, senses.as_bytes()]), joined(&[windows, b"\xff\xfet\x001\x00", b""])]
}

/// A recording of MCAP, with an end and without, and a bag, each with a list and a map of its rooms.
fn recordings() -> Vec<Vec<u8>> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("run.mcap");
    let mut mcap = JsonRecording::create(&path).unwrap();
    let schema = serde_json::json!({"type": "object"});
    let packed = mcap.channel("/camera", "foxglove.CompressedImage", &schema).unwrap();
    let raw = mcap.channel("/raw", "foxglove.RawImage", &schema).unwrap();
    for seconds in 0..3 {
        let timestamp = serde_json::json!({"sec": seconds + 1, "nsec": 5});
        let picture = serde_json::json!({"timestamp": timestamp, "frame_id": "c", "format": "pgm", "data": "UDUgMSAxIDI1NSAw"});
        mcap.write(packed, seconds * 1_000_000_000, &picture).unwrap();
        let pixels = serde_json::json!({"timestamp": timestamp, "frame_id": "c", "width": 2, "height": 1,
            "encoding": "yuv422", "step": 4, "data": "gBCAEA=="});
        mcap.write(raw, seconds * 1_000_000_000, &pixels).unwrap();
    }
    mcap.finish().unwrap();
    let mcap = fs::read(path).unwrap();
    let labels = b"time,room\n0,hall\n0:02,kitchen\n";
    let map = b"rooms:\n- {name: hall, polygon: [[0,0],[4,0],[4,2]]}\n";
    let json = br#"{"type":"FeatureCollection","features":[{"type":"Feature","properties":{"name":"a"},"geometry":{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1]]]}}]}"#;
    vec![
        joined(&[labels, map, &mcap]),
        joined(&[b"start;end;room\n0;1;a\n", json, &mcap[..mcap.len() / 2]]),
        joined(&[labels, map, &bag()]),
    ]
}

/// A bag of ROS 1 with a pose, a transform, a text and a picture, whose index names the connections.
fn bag() -> Vec<u8> {
    let block = |bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes(), bytes].concat();
    let header = |fields: &[(&str, &[u8])]| {
        let fields = fields.iter().map(|(name, value)| block(&[name.as_bytes(), b"=", value].concat()));
        block(&fields.collect::<Vec<_>>().concat())
    };
    let record = |fields: &[(&str, &[u8])], data: &[u8]| [header(fields), block(data)].concat();
    let stamped = [&[0; 12][..], &block(b"map")].concat();
    let pose = [0.5_f64, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0].map(f64::to_le_bytes).concat();
    let picture = [&stamped, &block(b"jpeg"), &block(b"P5 1 1 255 0")[..]].concat();
    let sweep = [-1.0_f32, 1.0, 0.1, 0.0, 0.1, 0.1, 8.0].map(f32::to_le_bytes).concat();
    let ranges = [&20_u32.to_le_bytes()[..], &[1.5_f32; 20].map(f32::to_le_bytes).concat()].concat();
    let scan = [&stamped, &sweep[..], &ranges, &[0; 4]].concat();
    let transforms = [&[1, 0, 0, 0], &stamped[..], &block(b"base_link"), &pose].concat();
    let messages = [
        ("/camera", "sensor_msgs/CompressedImage", picture),
        ("/scan", "sensor_msgs/LaserScan", scan),
        ("/pose", "geometry_msgs/PoseStamped", [&stamped[..], &pose].concat()),
        ("/tf", "tf2_msgs/TFMessage", transforms),
        ("/room", "std_msgs/String", block(b"hall")),
    ];
    let (mut connections, mut chunk, mut index) = (Vec::new(), Vec::new(), Vec::new());
    let time = [1, 0, 0, 0, 0, 0, 0, 0];
    for (number, (topic, type_name, message)) in (0_u32..).zip(&messages) {
        let number = number.to_le_bytes();
        let about =
            [block(format!("topic={topic}").as_bytes()), block(format!("type={type_name}").as_bytes())]
                .concat();
        connections.extend(record(&[("op", &[7]), ("conn", &number), ("topic", topic.as_bytes())], &about));
        let place = [&time[..], &(chunk.len() as u32).to_le_bytes()].concat();
        index.extend(record(
            &[("op", &[4]), ("ver", &[1, 0, 0, 0]), ("conn", &number), ("count", &[1, 0, 0, 0])],
            &place,
        ));
        chunk.extend(record(&[("op", &[2]), ("conn", &number), ("time", &time)], message));
    }
    let begins = b"#ROSBAG V2.0\n";
    let first = |index_at: u64| {
        record(&[("op", &[3]), ("index_pos", &index_at.to_le_bytes()), ("conn_count", &[5, 0, 0, 0])], &[])
    };
    let chunk_at = (begins.len() + first(0).len()) as u64;
    let size = (chunk.len() as u32).to_le_bytes();
    let chunk = record(&[("op", &[5]), ("compression", b"none"), ("size", &size)], &chunk);
    let index_at = chunk_at + (chunk.len() + index.len()) as u64;
    let counts: Vec<u8> =
        (0..5_u32).flat_map(|number| [number.to_le_bytes(), 1_u32.to_le_bytes()].concat()).collect();
    let info = [
        ("op", &[6][..]),
        ("chunk_pos", &chunk_at.to_le_bytes()),
        ("start_time", &time),
        ("end_time", &time),
    ];
    [&begins[..], &first(index_at), &chunk, &index, &connections, &record(&info, &counts)].concat()
}

/// A network of two operations with weights, any number of rows and names of all kinds, as its description says and
/// with none.
fn networks() -> Vec<Vec<u8>> {
    let description = b"digest = \"\"\nlicense = \"none\"\norigin = \"a test\"\n[input]\nname = \"image\"\n\
                        size = [16, 8]\nmultiple_of = 8\nlongest_side = 64\nmean = [0.5, 0.0, 0.0]\n\
                        scale = [1.0, 1.0, 1.0]\norder = \"bgr\"\n[vector]\noutput = \"map\"\n\
                        pooling = \"generalized_mean\"\n[grids.all]\noutput = \"map\"\n";
    let attribute = field(5, &[field(1, b"kernel_shape"), vec![8 << 3, 1, 8 << 3, 1, 0xA0, 1, 7]].concat());
    let operation = |operator: &[u8], inputs: &[&[u8]], output: &[u8]| {
        let inputs: Vec<u8> = inputs.iter().flat_map(|input| field(1, input)).collect();
        [inputs, field(2, output), field(4, operator)].concat()
    };
    let weights =
        [vec![1 << 3, 3, 1 << 3, 3, 1 << 3, 1, 1 << 3, 1, 2 << 3, 1], field(8, b"filters")].concat();
    let weights = [weights, field(9, &[0.5_f32; 9].map(f32::to_le_bytes).concat())].concat();
    let sizes: Vec<u8> =
        [&[8_u8, 1][..], &[8, 3], b"\x12\x04rows", &[8, 16]].iter().flat_map(|dim| field(1, dim)).collect();
    let tensor = field(1, &[vec![1 << 3, 1], field(2, &sizes)].concat());
    let value = |name: &str| [field(1, name.as_bytes()), field(2, &tensor)].concat();
    let graph = |output: &str| {
        let convolution = [operation(b"Conv", &[b"image", b"filters"], b"sums"), attribute.clone()].concat();
        let operations =
            [field(1, &convolution), field(1, &operation(b"Relu", &[b"sums"], output.as_bytes()))];
        let values = [field(5, &weights), field(11, &value("image")), field(12, &value(output))];
        [operations.concat(), values.concat()].concat()
    };
    let model = |output: &str| [vec![1 << 3, 8], field(7, &graph(output)), field(8, &[2 << 3, 13])].concat();
    let strange = "Karte \"1\"\u{1}\u{301}";
    let seeds = ["map", strange].map(|output| joined(&[description, &model(output)]));
    for output in ["map", strange] {
        let onnx = model(output);
        let digest = blake3::hash(&onnx).to_hex();
        let text = String::from_utf8_lossy(description).replace("\"\"", &format!("{digest:?}"));
        Network::new("seed", onnx.into(), &text).unwrap();
    }
    seeds.to_vec()
}

/// A field of a message of Protocol Buffers that is bytes, a text or a message.
fn field(number: u8, content: &[u8]) -> Vec<u8> {
    let length = content.len();
    let length =
        if length < 128 { vec![length as u8] } else { vec![0x80 | length as u8, (length >> 7) as u8] };
    [&[number << 3 | 2], &length[..], content].concat()
}

fn oip() -> Vec<Vec<u8>> {
    let in_json = br#"{"id":"1","inputs":[{"name":"frame","datatype":"BYTES","shape":[1],"data":["UDU="]}],"outputs":[{"name":"room"}]}"#;
    let behind = br#"{"parameters":{"robot":"r","timeout":900000,"binary_data_output":true},"inputs":[{"name":"frame","datatype":"BYTES","shape":[2,1],"parameters":{"binary_data_size":11}}]}"#;
    let elements = b"\x02\0\0\0P5\x01\0\0\0P";
    let length = |json: &[u8]| (json.len() as u16).to_le_bytes();
    vec![
        [&length(in_json), &in_json[..]].concat(),
        [&length(behind), &behind[..], elements].concat(),
        b"\0\0{\"ready\":true}".to_vec(),
        b"\0\0{\"parameters\":{\"config\":\"{}\"}}".to_vec(),
        b"\0\0{\"frame\":\"/9j/4AAQ\\u002f\"}".to_vec(),
    ]
}

fn stream() -> Vec<Vec<u8>> {
    let configure = r#"{"type":"configure","robot":"r","model":"m","mode":"sampled","interval_ms":200,"sure_interval_ms":2000,"filter":{"trust":2.0},"deadline_ms":5,"top":3}"#;
    let query = r#"{"robot":"r","mode":"lossless","filter":true,"session":"a","last_seq":7}"#;
    let header = [b"RSF1\x01\0\0\0".as_slice(), &7u64.to_le_bytes(), &9u64.to_le_bytes(), b"P5"].concat();
    let ranges = (1..40).map(|range| Some(range as f32 / 8.0)).collect();
    let scan = LaserScan { angle_min: -1.5, angle_increment: 0.08, range_max: 4.0, ranges };
    let odometry = Some(Odometry { x: 1.0, y: 2.0, heading: 0.5 });
    let sensed = Beside { captured_at_ns: Some(9), odometry, scan: Some(&scan) }.message(7, b"P5");
    let numbers = [4.0, 3.0, 2.0, 1.0, 0.1, 0.5, 0.2, 0.0, 0.9, 0.1, -5.0, f64::NAN, 1e300];
    vec![
        configure.as_bytes().to_vec(),
        query.as_bytes().to_vec(),
        header,
        sensed,
        numbers.iter().flat_map(|number: &f64| number.to_le_bytes()).collect(),
    ]
}

/// A frame in each way that there is, what is asked besides, and a stream.
fn service() -> Vec<Vec<u8>> {
    let frame = pictures().swap_remove(1);
    let key = targets::robots_key();
    let request = |first_line: &str, headers: &str, body: &[u8]| {
        let head = format!(
            "{first_line} HTTP/1.1\r\nhost: 127.0.0.1\r\nx-api-key: {key}\r\n{headers}\r\n",
            headers = if body.is_empty() {
                format!("connection: close\r\n{headers}")
            } else {
                format!("connection: close\r\ncontent-length: {}\r\n{headers}", body.len())
            }
        );
        [head.as_bytes(), body].concat()
    };
    let form = [
        b"--x\r\ncontent-disposition: form-data; name=\"frame\"; filename=\"a.png\"\r\n\r\n",
        &frame[..],
        b"\r\n--x--\r\n",
    ]
    .concat();
    let json = br#"{"frame":"UDUgMiAyIDI1NSAwMDAw"}"#;
    let handshake = "connection: upgrade\r\nupgrade: websocket\r\nsec-websocket-version: 13\r\n\
                     sec-websocket-key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let messages = [
        message(1, br#"{"type":"configure","mode":"lossless","filter":{"trust":1.5},"top":2}"#),
        message(2, &frame),
        message(2, b"RSF1\x01\0\0\0\x07\0\0\0\0\0\0\0\x09\0\0\0\0\0\0\0P5 2 2 255 0000"),
        message(9, b"ping"),
        message(8, &1000u16.to_be_bytes()),
    ];
    let [_, oip, ..] = &oip()[..] else { panic!("two requests of the protocol") };
    let binary = format!("inference-header-content-length: {}\r\n", u16::from_le_bytes([oip[0], oip[1]]));
    let stream = request("GET /v1/stream?robot=r&mode=latest", "", b"");
    let stream = String::from_utf8(stream).unwrap().replace("connection: close\r\n", handshake);
    vec![
        request("POST /v1/recognize?robot=r&top=2&explain=true", "content-type: image/png\r\n", &frame),
        request("POST /v1/recognize", "content-type: multipart/form-data; boundary=x\r\n", &form),
        request("POST /v1/recognize/batch", "content-type: multipart/form-data; boundary=x\r\n", &form),
        request("POST /v1/recognize?deadline_ms=900", "content-type: application/json\r\n", json),
        request("POST /v2/models/simulated-lab/infer", &binary, &oip[2..]),
        [stream.as_bytes(), &messages.concat()].concat(),
    ]
}

/// A message of a client over a WebSocket, masked by zeros.
fn message(kind: u8, payload: &[u8]) -> Vec<u8> {
    let length = payload.len() as u16;
    let length =
        if length < 126 { vec![0x80 | length as u8] } else { [&[0xFE], &length.to_be_bytes()[..]].concat() };
    [&[0x80 | kind], &length[..], &[0; 4], payload].concat()
}

#[test]
fn seeds_of_the_service_are_answered() {
    targets::start_service();
    for seed in service() {
        let answer = String::from_utf8_lossy(&targets::exchange(&seed).unwrap()).into_owned();
        let is_taken =
            ["HTTP/1.1 200", "HTTP/1.1 101", "HTTP/1.1 400"].iter().any(|line| answer.starts_with(line));
        assert!(is_taken, "{} {answer}", String::from_utf8_lossy(&seed));
    }
}

fn settings() -> Vec<Vec<u8>> {
    let settings = roomsight::settings::Settings::default().to_toml().unwrap();
    let config = Config::default().with_patterns(0.5, PatternsConfig::default());
    vec![settings.into_bytes(), toml::to_string(&config).unwrap().into_bytes()]
}

#[test]
fn every_target_takes_its_seeds() {
    let written_to = std::env::var_os("FUZZ_SEEDS").map(PathBuf::from);
    for Target { name, run, seeds } in all_targets() {
        assert!(!seeds.is_empty());
        for seed in seeds {
            run(&seed);
            if let Some(folder) = written_to.as_ref().map(|folder| folder.join(name)) {
                fs::create_dir_all(&folder).unwrap();
                fs::write(folder.join(blake3::hash(&seed).to_hex().as_str()), seed).unwrap();
            }
        }
    }
}

#[test]
fn what_once_broke_something_breaks_nothing() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/regressions");
    for Target { name, run, .. } in all_targets() {
        let Ok(inputs) = fs::read_dir(folder.join(name)) else { continue };
        for input in inputs {
            let path = input.unwrap().path();
            println!("{}", path.display());
            run(&fs::read(path).unwrap());
        }
    }
}
