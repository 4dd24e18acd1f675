"""Milliseconds a frame that OpenCV takes to find and describe keypoints, one thread; see features.rs."""

import json
import statistics
import sys
import time

import cv2

N_KEYPOINTS = 300


def strongest(keypoints):
    return sorted(keypoints, key=lambda keypoint: -keypoint.response)[:N_KEYPOINTS]


def methods():
    sift = cv2.SIFT_create(nfeatures=N_KEYPOINTS)
    yield "sift", lambda image: sift.detectAndCompute(image, None)
    if hasattr(cv2, "xfeatures2d"):
        harris = cv2.xfeatures2d.HarrisLaplaceFeatureDetector_create()
        yield "harris_laplace", lambda image: sift.compute(image, strongest(harris.detect(image)))


def milliseconds(method, image):
    start = time.process_time()
    method(image)
    return 1000 * (time.process_time() - start)


def main():
    cv2.setNumThreads(1)
    images = [cv2.imread(path, cv2.IMREAD_GRAYSCALE) for path in sys.argv[1:]]
    medians = {
        name: statistics.median(milliseconds(method, image) for image in images) for name, method in methods()
    }
    print(json.dumps(medians))


main()
