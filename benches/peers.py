"""How long other libraries take for what roomsight does, on one thread; compare.py asks it and roomsight-bench in turn.

Reads lines of `STEP CAMERA N` and answers each with one line of JSON: the thread's CPU milliseconds a frame over N frames,
and what was found, or which package is missing.
"""

import functools
import importlib
import json
import sys
import time
from pathlib import Path

FOLDER = Path(sys.argv[1])
N_KEYPOINTS = 300


class Missing(Exception):
    """The package that is not there."""


def package(module, name):
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise Missing(name) from error


@functools.cache
def opencv():
    cv2 = package("cv2", "opencv-contrib-python-headless")
    cv2.setNumThreads(1)
    return cv2


def numbers(name, kind):
    return package("numpy", "numpy").fromfile(FOLDER / "training" / name, kind)


def frames(camera, n_frames, suffix):
    """As roomsight-bench spreads them."""
    paths = sorted((FOLDER / camera).glob(f"*.{suffix}"))
    n_frames = min(n_frames, len(paths))
    return [paths[idx * len(paths) // n_frames] for idx in range(n_frames)]


def timed(step):
    start = time.thread_time()
    found = step()
    return 1000 * (time.thread_time() - start), found


def over_images(method, camera, n_frames):
    """`method` gives the keypoints of an image."""
    cv2 = opencv()
    images = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in frames(camera, n_frames, "pgm")]
    method(images[0])
    ms, found = timed(lambda: [method(image) for image in images])
    places = sum(keypoint.pt[0] + 1000 * keypoint.pt[1] for keypoints in found for keypoint in keypoints)
    return {"ms": ms / len(images), "found": sum(map(len, found)), "places": places}, found


def fast(threshold, camera, n_frames):
    cv2 = opencv()
    detector = cv2.FastFeatureDetector_create(threshold, True, cv2.FAST_FEATURE_DETECTOR_TYPE_9_16)
    answer, found = over_images(detector.detect, camera, n_frames)
    # Keypoints become objects of Python, which OpenCV's users in C++ do not pay for: nor is it counted here.
    points = [cv2.KeyPoint_convert(keypoints) for keypoints in found]
    handing_over, _ = timed(lambda: [cv2.KeyPoint_convert(of_frame) for of_frame in points])
    return {**answer, "ms": answer["ms"] - handing_over / len(points)}


def sift(camera, n_frames):
    detector = opencv().SIFT_create(nfeatures=N_KEYPOINTS)
    return over_images(lambda image: detector.detectAndCompute(image, None)[0], camera, n_frames)[0]


def harris_laplace(camera, n_frames):
    cv2 = opencv()
    if not hasattr(cv2, "xfeatures2d"):
        raise Missing("opencv-contrib-python-headless")
    detector, descriptor = cv2.xfeatures2d.HarrisLaplaceFeatureDetector_create(), cv2.SIFT_create()

    def method(image):
        strongest = sorted(detector.detect(image), key=lambda keypoint: -keypoint.response)[:N_KEYPOINTS]
        return descriptor.compute(image, strongest)[0]

    return over_images(method, camera, n_frames)[0]


def turbo(camera, n_frames):
    """To luma, with the slow transform, whose numbers are ours."""
    decode = package("simplejpeg", "simplejpeg").decode_jpeg
    jpegs = [path.read_bytes() for path in frames(camera, n_frames, "jpeg")]
    luma = functools.partial(decode, colorspace="GRAY", fastdct=False, fastupsample=False)
    luma(jpegs[0])
    ms, _ = timed(lambda: [luma(jpeg) for jpeg in jpegs])
    return {"ms": ms / len(jpegs)}


def k_means(_camera, _n_frames):
    faiss = package("faiss", "faiss-cpu")
    faiss.omp_set_num_threads(1)
    rows = numbers("descriptors", "<f4").reshape(100_000, -1)
    # All rows, of which it would draw some.
    clustering = faiss.Kmeans(rows.shape[1], 300, niter=20, seed=0, max_points_per_centroid=len(rows))
    ms, _ = timed(lambda: clustering.train(rows))
    distances, _ = clustering.index.search(rows, 1)
    return {"ms": ms, "inertia": float(distances.sum(dtype="f8"))}


def svm(_camera, _n_frames):
    machines = package("sklearn.svm", "scikit-learn").SVC(C=10, kernel="rbf", gamma=1, tol=1e-3)
    labels = numbers("labels", "<u4")
    bags = numbers("bags", "<f4").astype("f8").reshape(len(labels), -1)
    ms, fitted = timed(lambda: machines.fit(bags, labels))
    return {"ms": ms, "support_vectors": len(fitted.support_)}


STEPS = {
    "turbo": turbo,
    "fast_20": functools.partial(fast, 20),
    "fast_8": functools.partial(fast, 8),
    "sift": sift,
    "harris_laplace": harris_laplace,
    "k_means": k_means,
    "svm": svm,
}


def main():
    for line in sys.stdin:
        step, camera, n_frames = line.split()
        try:
            answer = STEPS[step](camera, int(n_frames))
        except Missing as missing:
            answer = {"missing": str(missing)}
        print(json.dumps(answer), flush=True)


main()
