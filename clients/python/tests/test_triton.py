"""The service as NVIDIA's client of the Open Inference Protocol sees it, `tritonclient[http]` as it is."""

import base64
from collections.abc import Callable

import numpy as np
from roomsight import Client
from running import RunningService
from tritonclient.http import InferenceServerClient, InferInput, InferRequestedOutput
from tritonclient.utils import InferenceServerException

MODEL = "simulated-lab"
OUTPUTS = ["room", "probability", "known", "novelty", "probabilities", "rooms"]


def images(frames: "list[bytes]", shape: "list[int]") -> InferInput:
    """Encoded images, as they are."""
    tensor = InferInput("frame", shape, "BYTES")
    return tensor.set_data_from_numpy(np.array(frames, dtype=np.object_).reshape(shape))


class Triton(RunningService):
    """Triton's client against the service."""

    def setUp(self) -> None:
        self.client = InferenceServerClient(self.address)
        self.addCleanup(self.client.close)
        self.bytes = [frame.read_bytes() for frame in self.frames]

    def test_health_and_metadata(self) -> None:
        self.assertTrue(self.client.is_server_live())
        self.assertTrue(self.client.is_server_ready())
        self.assertTrue(self.client.is_model_ready(MODEL))
        self.assertTrue(self.client.is_model_ready(MODEL, "1"))
        self.assertFalse(self.client.is_model_ready(MODEL, "9"))
        self.assertFalse(self.client.is_model_ready("nowhere"))
        self.assertIn("binary_tensor_data", self.client.get_server_metadata()["extensions"])
        metadata = self.client.get_model_metadata(MODEL)
        self.assertEqual((metadata["name"], metadata["versions"]), (MODEL, ["1"]))
        self.assertEqual([output["name"] for output in metadata["outputs"]], OUTPUTS)

    def test_binary_frames_get_the_answers_of_the_rest_api(self) -> None:
        result = self.client.infer(MODEL, [images(self.bytes, [len(self.bytes), 1])], request_id="42")
        response = result.get_response()
        told = (response["id"], response["model_name"], response["model_version"])
        self.assertEqual(told, ("42", MODEL, "1"))
        rooms = [room.decode() for room in result.as_numpy("rooms")]
        with Client(self.url) as client:
            for frame_idx, frame in enumerate(self.bytes):
                answer = client.recognize(frame)
                self.assertEqual(result.as_numpy("room")[frame_idx].decode(), answer.room)
                self.assertEqual(bool(result.as_numpy("known")[frame_idx]), answer.known)
                self.assertAlmostEqual(float(result.as_numpy("novelty")[frame_idx]), answer.novelty or 0.0, places=5)
                self.assertAlmostEqual(float(result.as_numpy("probability")[frame_idx]), answer.probability)
                expected = {room.room: room.probability for room in answer.probabilities}
                for room, probability in zip(rooms, result.as_numpy("probabilities")[frame_idx]):
                    self.assertAlmostEqual(float(probability), expected[room])

    def test_json_both_ways(self) -> None:
        texts = np.array([base64.b64encode(frame) for frame in self.bytes], dtype=np.object_)
        tensor = InferInput("frame", [len(texts)], "BYTES").set_data_from_numpy(texts, binary_data=False)
        outputs = [InferRequestedOutput(name, binary_data=False) for name in OUTPUTS]
        in_json = self.client.infer(MODEL, [tensor], outputs=outputs)
        binary = self.client.infer(MODEL, [images(self.bytes, [len(self.bytes)])], model_version="1")
        for name in ["probability", "known", "novelty", "probabilities"]:
            np.testing.assert_array_equal(in_json.as_numpy(name), binary.as_numpy(name))
        for name in ["room", "rooms"]:
            self.assertEqual(list(in_json.as_numpy(name)), [text.decode() for text in binary.as_numpy(name)])

    def test_outputs_are_chosen_one_by_one(self) -> None:
        outputs = [InferRequestedOutput("known", binary_data=False), InferRequestedOutput("room")]
        result = self.client.infer(MODEL, [images(self.bytes[:1], [1])], outputs=outputs)
        self.assertEqual([output["name"] for output in result.get_response()["outputs"]], ["known", "room"])
        self.assertEqual(result.as_numpy("known").dtype, np.bool_)
        self.assertIsNone(result.as_numpy("rooms"))

    def test_parameters_of_our_own_and_of_triton(self) -> None:
        frame = images(self.bytes[:1], [1])
        self.client.infer(MODEL, [frame], parameters={"robot": "wall-e"}, priority=1, timeout=10_000_000)
        with self.assertRaisesRegex(InferenceServerException, "deadline"):
            self.client.infer(MODEL, [frame], parameters={"deadline_ms": 0})

    def test_many_requests_at_once(self) -> None:
        with InferenceServerClient(self.address, concurrency=4) as client:
            requests = [client.async_infer(MODEL, [images([frame], [1])]) for frame in self.bytes]
            answers = [request.get_result().as_numpy("room")[0] for request in requests]
        together = self.client.infer(MODEL, [images(self.bytes, [len(self.bytes)])])
        self.assertEqual(answers, list(together.as_numpy("room")))

    def test_errors_say_what_is_wrong(self) -> None:
        good = images(self.bytes[:1], [1])
        bad = images([self.bytes[0], b"this is no image"], [2])
        pixels = InferInput("frame", [1, 2], "UINT8").set_data_from_numpy(np.zeros((1, 2), np.uint8))
        classes = [InferRequestedOutput("probabilities", class_count=3)]
        cases: "list[tuple[str, Callable[[], object]]]" = [
            (r"\[400\].*frame 1 ", lambda: self.client.infer(MODEL, [bad])),
            (r"\[400\].*BYTES", lambda: self.client.infer(MODEL, [pixels])),
            (r"\[400\].*classification", lambda: self.client.infer(MODEL, [good], outputs=classes)),
            (r"\[404\].*nowhere", lambda: self.client.infer("nowhere", [good])),
            (r"\[415\].*gzip", lambda: self.client.infer(MODEL, [good], request_compression_algorithm="gzip")),
            (r"\[404\].*nowhere", lambda: self.client.get_model_config("nowhere")),
        ]
        for message, call in cases:
            with self.subTest(message), self.assertRaisesRegex(InferenceServerException, message):
                call()

    def test_how_a_model_is_run_and_what_it_has_done(self) -> None:
        config = self.client.get_model_config(MODEL)
        self.assertEqual((config["name"], config["max_batch_size"]), (MODEL, 0))
        self.assertEqual([output["name"] for output in config["output"]], OUTPUTS)
        self.assertEqual(self.client.get_model_config(MODEL, "1"), config)
        before = self.client.get_inference_statistics(MODEL, "1")["model_stats"][0]
        self.client.infer(MODEL, [images(self.bytes, [len(self.bytes)])])
        after = self.client.get_inference_statistics()["model_stats"][0]
        self.assertEqual((after["name"], after["version"]), (MODEL, "1"))
        self.assertEqual(after["inference_count"] - before["inference_count"], len(self.bytes))

    def test_the_repository(self) -> None:
        index = self.client.get_model_repository_index()
        self.assertEqual(index, [{"name": MODEL, "version": "1", "state": "READY", "reason": ""}])
        self.client.load_model(MODEL)
        self.assertTrue(self.client.is_model_ready(MODEL))
        with self.assertRaisesRegex(InferenceServerException, "parameters"):
            self.client.load_model(MODEL, config="{}")
        with self.assertRaisesRegex(InferenceServerException, "nowhere"):
            self.client.unload_model("nowhere")
