use super::*;
use base64::Engine;
use base64::prelude::{BASE64_STANDARD, BASE64_URL_SAFE_NO_PAD};
use proptest::prelude::*;
use serde_json::{Value, json};

const MAX_FRAMES: usize = 8;

/// The body of a request whose frames follow its JSON, and how long that is.
fn binary(frames: &[Vec<u8>]) -> (Vec<u8>, usize) {
    let tail: Vec<u8> =
        frames.iter().flat_map(|frame| [&(frame.len() as u32).to_le_bytes()[..], frame].concat()).collect();
    let input = json!({
        "name": "frame", "datatype": "BYTES", "shape": [frames.len(), 1],
        "parameters": {"binary_data_size": tail.len()}
    });
    let json = json!({"inputs": [input]}).to_string().into_bytes();
    let json_length = json.len();
    ([json, tail].concat(), json_length)
}

fn in_json(frames: &[Vec<u8>]) -> Value {
    let texts: Vec<String> = frames.iter().map(|frame| BASE64_STANDARD.encode(frame)).collect();
    json!({"inputs": [{"name": "frame", "datatype": "BYTES", "shape": [frames.len()], "data": texts}]})
}

fn read(request: &Value) -> Result<(InferParameters, Vec<AskedOutput>), RequestError> {
    let body = request.to_string();
    let read = Inference::read(body.as_bytes(), None, MAX_FRAMES)?;
    Ok((read.parameters, read.outputs))
}

/// What is said to a good request in which one thing is set.
fn refused(at: &str, value: Value) -> RequestError {
    let mut request = in_json(&[vec![1, 2, 3]]);
    request["outputs"] = json!([{"name": "room", "parameters": {}}]);
    request["inputs"][0]["parameters"] = json!({});
    let (parent, field) = at.rsplit_once('/').unwrap();
    request.pointer_mut(parent).unwrap()[field] = value;
    read(&request).unwrap_err()
}

fn frames() -> impl Strategy<Value = Vec<Vec<u8>>> {
    prop::collection::vec(any::<Vec<u8>>(), 1..=MAX_FRAMES)
}

proptest! {
    #[test]
    fn frames_come_back_from_json_and_from_behind_it(frames in frames()) {
        let (body, json_length) = binary(&frames);
        prop_assert_eq!(&Inference::read(&body, Some(json_length), MAX_FRAMES).unwrap().frames, &frames);
        let body = in_json(&frames).to_string();
        prop_assert_eq!(&Inference::read(body.as_bytes(), None, MAX_FRAMES).unwrap().frames, &frames);
    }

    #[test]
    fn a_damaged_body_is_read_or_refused(
        frames in frames(), damage: Vec<(prop::sample::Index, u8)>, cut: prop::sample::Index, by in 0_usize..9
    ) {
        let (mut body, json_length) = binary(&frames);
        for (at, byte) in damage {
            let at = at.index(body.len());
            body[at] = byte;
        }
        body.truncate(cut.index(body.len()) + by);
        for json_length in [Some(json_length), Some(json_length + by), None] {
            if let Ok(read) = Inference::read(&body, json_length, MAX_FRAMES) {
                prop_assert!((1..=MAX_FRAMES).contains(&read.frames.len()));
                prop_assert!(read.frames.iter().map(|frame| frame.len()).sum::<usize>() <= body.len());
            }
        }
    }

    #[test]
    fn any_bytes_are_refused(body: Vec<u8>, json_length: Option<usize>) {
        prop_assert!(Inference::read(&body, json_length, MAX_FRAMES).is_err());
    }
}

#[test]
fn what_is_asked_is_read() {
    let mut request = in_json(&[vec![1]]);
    request["id"] = json!("42");
    request["parameters"] = json!({
        "robot": "wall-e", "deadline_ms": 200, "timeout": 100_001, "sequence_id": 7, "priority": 1,
        "binary_data_output": true
    });
    request["outputs"] = json!([{"name": "rooms"}, {"name": "room", "parameters": {"binary_data": false}}]);
    let body = request.to_string();
    let read = Inference::read(body.as_bytes(), None, MAX_FRAMES).unwrap();
    assert_eq!(read.id.as_deref(), Some("42"));
    assert_eq!((read.parameters.robot.as_deref(), read.parameters.wait_ms()), (Some("wall-e"), Some(101)));
    let asked = |name, binary| AskedOutput { name, binary };
    assert_eq!(read.outputs, [asked(OutputName::Rooms, true), asked(OutputName::Room, false)]);
}

#[test]
fn without_outputs_all_are_wanted_as_json() {
    for outputs in [json!([]), json!(null)] {
        let mut request = in_json(&[vec![1]]);
        request["outputs"] = outputs;
        let (parameters, outputs) = read(&request).unwrap();
        assert_eq!(outputs.iter().map(|output| output.name).collect::<Vec<_>>(), OutputName::ALL);
        assert!(outputs.iter().all(|output| !output.binary));
        assert_eq!(parameters.wait_ms(), None);
    }
}

#[test]
fn a_timeout_of_zero_is_none() {
    let wait = |deadline_ms, timeout| {
        InferParameters { deadline_ms, timeout, ..InferParameters::default() }.wait_ms()
    };
    assert_eq!(wait(None, Some(0)), None);
    assert_eq!(wait(Some(0), Some(0)), Some(0));
    assert_eq!(wait(None, Some(1)), Some(1));
}

#[test]
fn what_cannot_be_served_is_refused_by_name() {
    use RequestError::*;
    let second = json!({"name": "mask", "datatype": "BYTES", "shape": [1], "data": [""]});
    let both = json!([in_json(&[vec![1]])["inputs"][0], second]);
    for (at, value, error) in [
        ("/inputs", both, Inputs),
        ("/inputs", json!([]), Inputs),
        ("/inputs/0/name", json!("image"), Inputs),
        ("/inputs/0/datatype", json!("UINT8"), Datatype),
        ("/inputs/0/shape", json!([1, 3]), Shape),
        ("/inputs/0/shape", json!([]), Shape),
        ("/inputs/0/shape", json!([0]), NoFrame),
        ("/inputs/0/shape", json!([MAX_FRAMES + 1]), TooManyFrames(MAX_FRAMES)),
        ("/inputs/0/shape", json!([u64::MAX]), TooManyFrames(MAX_FRAMES)),
        ("/inputs/0/shape", json!([2]), Elements(ElementsError::Count { expected: 2 })),
        ("/inputs/0/data", json!(null), NoData),
        ("/inputs/0/parameters", json!({"binary_data_size": 0}), NoData),
        ("/inputs/0/parameters", json!({"binary_data_size": 9}), BinarySize { found: 0, announced: 9 }),
        ("/inputs/0/parameters", json!({"shared_memory_region": "x"}), SharedMemory),
        ("/outputs/0/parameters", json!({"shared_memory_region": "x"}), SharedMemory),
        ("/outputs/0/parameters", json!({"classification": 3}), Classification),
    ] {
        assert_eq!(refused(at, value.clone()), error, "{at} = {value}");
    }
}

#[test]
fn what_is_wrong_in_the_json_is_told_shortly() {
    let list = json!(vec![1; MAX_LIST + 1]);
    for (at, value, word) in [
        ("/outputs/0/name", json!("rom"), "unknown variant `rom`, expected one of `room`"),
        ("/inputs/0/shape", json!([-1]), "-1"),
        ("/inputs/0/shape", list, "a list of at most 64"),
        ("/inputs/0/data", json!([1]), "base64"),
        ("/parameters", json!({"deadline_ms": "soon"}), "soon"),
        ("/outputs/0/name", json!("x".repeat(1 << 20)), "unknown variant"),
    ] {
        let message = refused(at, value).to_string();
        assert!(message.contains(word) && message.len() < 2 * MAX_MESSAGE, "{message}");
    }
    assert!(matches!(refused("/inputs/0/data", json!(["***"])), RequestError::Base64 { frame_idx: 0, .. }));
}

#[test]
fn bytes_that_nobody_announced_are_refused() {
    let (body, json_length) = binary(&[vec![7; 10]]);
    let read = |json_length| Inference::read(&body, json_length, MAX_FRAMES).map(|_| ());
    assert_eq!(read(Some(json_length)), Ok(()));
    assert!(matches!(read(None), Err(RequestError::Json(_))));
    assert_eq!(
        read(Some(body.len() + 1)),
        Err(RequestError::JsonLength { json_length: body.len() + 1, body: body.len() })
    );
    let longer = [&body[..], b"more"].concat();
    let refused = Inference::read(&longer, Some(json_length), MAX_FRAMES).unwrap_err();
    assert_eq!(refused, RequestError::BinarySize { found: 18, announced: 14 });
}

#[test]
fn frames_are_read_as_peoples_libraries_write_them() {
    let frame: Vec<u8> = (0..200).map(|byte: u8| byte.wrapping_mul(37)).collect();
    let in_lines = BASE64_STANDARD
        .encode(&frame)
        .as_bytes()
        .chunks(76)
        .fold(String::new(), |text, line| text + std::str::from_utf8(line).unwrap() + "\n");
    for text in [in_lines, BASE64_URL_SAFE_NO_PAD.encode(&frame)] {
        let mut request = in_json(&[vec![]]);
        request["inputs"][0]["data"] = json!([text]);
        let body = request.to_string();
        assert_eq!(Inference::read(body.as_bytes(), None, MAX_FRAMES).unwrap().frames, [&frame[..]]);
    }
}

#[test]
fn a_list_in_the_place_of_an_object_is_refused() {
    for (at, value) in [
        ("/inputs", json!([["frame", "BYTES", [1], null, [""]]])),
        ("/outputs", json!([["room", null]])),
        ("/parameters", json!([null, null, null, true])),
    ] {
        let message = refused(at, value).to_string();
        assert!(message.contains("expected an object"), "{message}");
    }
}
