"""Which room is the webcam in? Needs OpenCV: pip install opencv-python-headless."""

import cv2
from roomsight import Client, Result

camera = cv2.VideoCapture(0)
with Client("http://127.0.0.1:8080") as client, client.stream(robot="webcam") as stream:
    while (picture := camera.read())[0]:
        stream.send(cv2.imencode(".jpg", picture[1])[1].tobytes())
        answer = stream.answer()
        if isinstance(answer, Result):
            print(answer.room, round(answer.probability, 2))
