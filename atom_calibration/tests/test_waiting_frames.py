"""Frames of a bag that wait for the end of a stop: few, and pictures as they were sent."""

import json

import cv2
import numpy as np
from sensor_msgs.msg import CompressedImage
from stand_in_rig import STOPS, messages

from atom_calibration.collect.selection import RecentFrames
from atom_calibration.nodes.collecting.collect_from_bag import main


def test_memory_is_that_of_a_few_seconds(place, make, monkeypatch):
    largest = []
    note = RecentFrames.note

    def counted(self, frame):
        note(self, frame)
        largest.append(len(self.between(-np.inf, np.inf)))

    monkeypatch.setattr(RecentFrames, "note", counted)
    assert main(place()) == 0
    assert max(largest) < 2 * 40


def test_compressed_images_wait_compressed_and_give_the_same_dataset(place, make, monkeypatch):
    assert main(place()) == 0
    names = ["dataset.json", *(f"cam_{n:03d}.jpg" for n in range(STOPS))]
    raw = [(place.folder / name).read_bytes() for name in names]
    decoded, note = [], RecentFrames.note

    def counted(self, frame):
        decoded.append(sum(f.sensor.name == "cam" and f.data is not None for f in self._all()))
        note(self, frame)

    monkeypatch.setattr(RecentFrames, "note", counted)
    assert main([*place(compressed(make)), "--overwrite"]) == 0
    assert [(place.folder / name).read_bytes() for name in names[1:]] == raw[1:]
    documents = [json.loads(raw[0]), json.loads((place.folder / names[0]).read_text())]
    assert documents[0]["collections"] == documents[1]["collections"]
    assert max(decoded) <= 2, "those of the collections taken last"


def compressed(make):
    """Yield the rig's messages with images as PNG."""
    for topic, message, time_s in messages(make):
        if topic == "/cam/image_raw":
            pixels = np.frombuffer(message.data, np.uint8).reshape(48, 64, 3)
            png = cv2.imencode(".png", pixels)[1].tobytes()
            message = CompressedImage(header=message.header, format="bgr8; png", data=png)
            topic = "/cam/image_raw/compressed"
        yield topic, message, time_s
