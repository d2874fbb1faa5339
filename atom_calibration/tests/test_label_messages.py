"""Labels survive the way through a message; those of other data are refused."""

import io

import numpy as np
import pytest

from atom_calibration.errors import MessageError
from atom_calibration.labels.label_messages import labels_message, point_count, set_labels
from atom_calibration.messages.poses import pose_matrix
from atom_calibration.modalities.frames import Frame
from atom_calibration.msg import SensorLabels
from atom_calibration.show.annotation import (
    BORDER_RGB,
    INSIDE_RGB,
    POINT,
    annotated,
    picture_message,
)
from atom_core.geometry import se3
from atom_core.labeling.base import Labeled, nothing
from atom_core.model.dataset import pose
from atom_core.synthetic import scenes

HEADER = {"seq": 3, "stamp": {"secs": 100, "nsecs": 250000000}, "frame_id": "driver_frame"}
SCENE = scenes.random_scene(3, rgb=1, depth=1, lidar3d=1, collections=4)
DATASET = SCENE.dataset
(PATTERN,) = DATASET.patterns.values()
SENSORS = list(DATASET.sensors)


def data_of(key, name):
    if name.startswith("rgb"):
        return DATASET.data.read(key, name)
    if name.startswith("depth"):
        return DATASET.data.read(key, name)
    points = DATASET.data.read(key, name)
    table = np.zeros(len(points), dtype=[(axis, "<f4") for axis in "xyz"])
    for axis, values in zip("xyz", points.T):
        table[axis] = values
    return table


def seen(name):
    """Return a collection in which the sensor sees the board."""
    return next(c for c in DATASET.collections.values() if (name, PATTERN.name) in c.labels)


def labeled(name):
    collection = seen(name)
    frame = Frame(DATASET.sensors[name], 100.25, HEADER, data_of(collection.key, name))
    next_seed = None if name.startswith("rgb") else np.array([1.0, 2.0, 3.0])
    label = collection.labels[(name, PATTERN.name)]
    quality = {"plane_rms_m": 0.004}
    frame.set_label(PATTERN.name, Labeled(label, quality=quality, next_seed=next_seed))
    if next_seed is not None:
        frame.seeds[PATTERN.name] = next_seed + 0.5
    return frame


def sent(message):
    """Return the message as it arrives over the wire."""
    wire = io.BytesIO()
    message.serialize(wire)
    return SensorLabels().deserialize(wire.getvalue())


@pytest.mark.parametrize("name", SENSORS)
def test_labels_arrive_as_they_were_sent(name):
    frame = labeled(name)
    message = sent(labels_message(frame, DATASET.patterns, np.array([4.0, 5.0, 6.0])))
    assert message.header.stamp.to_sec() == 100.25
    assert message.header.frame_id == frame.sensor.frame
    assert list(message.manual_seed) == [4.0, 5.0, 6.0]
    bare = Frame(frame.sensor, frame.stamp_s, HEADER, frame.data)
    arrived = set_labels(bare, message).labels[PATTERN.name]
    was = frame.labels[PATTERN.name]
    for field in vars(was.label):
        np.testing.assert_array_equal(getattr(arrived.label, field), getattr(was.label, field))
    assert arrived.quality == was.quality and arrived.detected
    assert bare.sightings[PATTERN.name].motion(frame.sightings[PATTERN.name]) == 0
    if was.next_seed is not None:
        np.testing.assert_array_equal(arrived.next_seed, was.next_seed)
        np.testing.assert_array_equal(bare.seeds[PATTERN.name], was.next_seed + 0.5)


def test_a_cameras_labels_say_where_the_board_is():
    name = SENSORS[0]
    (part,) = labels_message(labeled(name), DATASET.patterns).patterns
    collection = seen(name)
    world_T_camera = pose(collection, DATASET.graph, DATASET.world, DATASET.sensors[name].frame)
    world_T_pattern = SCENE.truth.boards[PATTERN.board_key(collection.key)]
    error = se3.inverse(pose_matrix(part.pose)) @ se3.inverse(world_T_camera) @ world_T_pattern
    assert part.pose_known and np.linalg.norm(error[:3, 3]) < 0.02


@pytest.mark.parametrize("name", SENSORS)
def test_nothing_arrives_with_its_reason(name):
    frame = labeled(name)
    frame.set_label(PATTERN.name, nothing(frame.sensor.modality, "the board is not there"))
    message = sent(labels_message(frame, DATASET.patterns))
    (part,) = message.patterns
    assert (part.detected, part.pose_known, point_count(part)) == (False, False, 0)
    arrived = set_labels(Frame(frame.sensor, 1.0, HEADER, frame.data), message)
    assert arrived.labels[PATTERN.name].reason == "the board is not there"
    assert not arrived.sightings and not arrived.detections


def test_labels_of_another_sensor_or_of_larger_data_are_refused():
    frame = labeled("lidar_1")
    message = labels_message(frame, DATASET.patterns)
    smaller = Frame(frame.sensor, frame.stamp_s, HEADER, frame.data[:10])
    with pytest.raises(MessageError, match=r"'lidar_1'.*only 10 entries.*another labeler"):
        set_labels(smaller, message)
    message.sensor = "lidar_2"
    with pytest.raises(MessageError, match="these labels are of sensor 'lidar_2'"):
        set_labels(frame, message)


def test_the_annotated_cloud_has_the_labeled_points_in_two_colours():
    frame = labeled("lidar_1")
    cloud = annotated(frame)
    points = np.frombuffer(cloud.data, POINT)
    label = frame.labels[PATTERN.name].label
    np.testing.assert_array_equal(points["idx"], label.indices)
    np.testing.assert_array_equal(points["x"], frame.data["x"][label.indices])
    border = np.isin(label.indices, label.limit_indices)
    np.testing.assert_array_equal(points["rgb"], np.where(border, BORDER_RGB, INSIDE_RGB))
    frame.set_label(PATTERN.name, nothing("lidar3d", "gone"))
    assert annotated(frame).width == 0  # so that RViz shows nothing old


def test_the_annotated_image_shows_the_labels_and_why_there_are_none():
    frame = labeled("depth_1")
    image = annotated(frame)
    pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
    inside = frame.labels[PATTERN.name].label.indices
    green = pixels.reshape(-1, 3)[inside].astype(int)
    assert np.mean(green[:, 1] - green[:, 0] > 50) > 0.8
    frame.set_label(PATTERN.name, nothing("depth", "too far away"))
    image = annotated(frame)
    pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
    assert pixels[:30, :120].max() > 240 and pixels[:30, :120].min() == 0


def test_what_is_written_in_a_picture_is_as_large_for_its_width_and_within_it():
    frame = labeled("depth_1")
    frame.set_label(PATTERN.name, nothing("depth", "the board is too far away"))
    extents = []
    for width in (300, 1280):
        picture = np.full((width // 2, width, 3), 128, np.uint8)
        shown = picture_message(frame, picture)
        pixels = np.frombuffer(shown.data, np.uint8).reshape(shown.height, shown.width, 3)
        rows, columns = np.nonzero((pixels != 128).any(axis=2))
        extents.append(np.array([rows.max(), columns.max()]) / width)
        assert columns.max() < 0.98 * width
    np.testing.assert_allclose(extents[1], extents[0], atol=0.02)
    assert extents[1][0] < 0.07, "one line"
