"""Which corners OpenCV's stereo calibration is given, and which pairs it cannot solve."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from atom_core.evaluation.baselines import stereo as module
from atom_core.evaluation.baselines.stereo import stereo_baseline
from atom_core.geometry import se3
from atom_core.model.dataset import pose
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, scenes

BOARD = "pattern_1"
COLUMNS, CORNERS = 11, 88


@pytest.fixture(scope="module")
def scene():
    """Return three cameras with distorting lenses, without noise."""
    return scenes.random_scene(8, rgb=3, depth=0, lidar3d=0, collections=12, noise=Noise.none())


@pytest.fixture(scope="module")
def dataset(scene):
    """Return three collections in which all cameras see the whole board."""
    whole = [
        key
        for key, collection in scene.dataset.collections.items()
        if [len(label.ids) for label in collection.labels.values()] == [CORNERS] * 3
    ]
    return scene.dataset.selected(collections=whole[:3])


def kept(dataset, sensor, ids, collections=None):
    """Return the dataset where a camera sees only some corners."""
    for key in dataset.collections if collections is None else collections:
        label = dataset.collections[key].labels[sensor, BOARD]
        left = np.isin(label.ids, ids)
        fewer = replace(label, ids=label.ids[left], pixels=label.pixels[left])
        dataset = dataset.with_labels(key, {(sensor, BOARD): fewer})
    return dataset


def swinging(dataset, name):
    edge = Edge("rig_base", f"{name}_post")
    value = dataset.first_value(edge) @ se3.transform(np.eye(3), np.array([0.1, 0.0, 0.0]))
    return dataset.with_transforms({list(dataset.collections)[1]: {edge: value}})


NONE_IN_COMMON = "no image pair in which both see 6 corners of a board in common"


@pytest.mark.parametrize("ids, solved", [(range(2, 7), False), ((2, 3, 4, 5, 6, 20), True)])
def test_six_corners_in_common_are_enough_and_five_are_not(dataset, ids, solved):
    views = module._common_views(kept(dataset, "rgb_2", list(ids)), "rgb_1", "rgb_2")
    assert (len(views.corners), views.collections) == ((3, 3) if solved else (0, 0))


def test_corners_that_only_one_camera_sees_do_not_count(dataset):
    fewer = kept(kept(dataset, "rgb_1", np.arange(0, 40)), "rgb_2", np.arange(30, 88))
    views = module._common_views(fewer, "rgb_1", "rgb_2")
    wanted = dataset.patterns[BOARD].corners_of(np.arange(30, 40))
    for corners in views.corners:
        np.testing.assert_allclose(corners, wanted, atol=1e-6)


def test_a_board_that_does_not_count_costs_the_later_ones_nothing(dataset):
    fewer = kept(dataset, "rgb_1", np.arange(3), list(dataset.collections)[:1])
    views = module._common_views(fewer, "rgb_1", "rgb_2")
    assert len(views.corners) == len(views.source) == len(views.target) == 2
    assert views.collections == 2


def test_two_boards_of_one_collection_count_as_one_collection(dataset):
    other = replace(dataset.patterns[BOARD], name="other", frame="other_link")
    two = replace(dataset, patterns={**dataset.patterns, "other": other})
    key = next(iter(dataset.collections))
    labels = dataset.collections[key].labels
    two = two.with_labels(key, {(n, "other"): labels[n, BOARD] for n in ("rgb_1", "rgb_2")})
    views = module._common_views(two, "rgb_1", "rgb_2")
    assert len(views.corners) == 4 and views.collections == 3


def test_pixels_are_those_of_a_pinhole_without_distortion(scene, dataset):
    at, key = 1, list(dataset.collections)[1]
    views = module._common_views(dataset, "rgb_1", "rgb_2")
    for name, pixels in (("rgb_1", views.source[at]), ("rgb_2", views.target[at])):
        sensor = dataset.sensors[name]
        camera_T_world = pose(dataset.collections[key], dataset.graph, sensor.frame, "world")
        points = views.corners[at].astype(float)
        in_camera = se3.apply(camera_T_world @ scene.truth.boards[BOARD, key], points)
        homogeneous = in_camera @ sensor.camera.K.T
        np.testing.assert_allclose(pixels, homogeneous[:, :2] / homogeneous[:, 2:], atol=1e-3)
        raw = dataset.collections[key].labels[name, BOARD].pixels
        assert np.max(np.abs(raw - pixels)) > 0.05


@pytest.mark.parametrize("factor, line", [(0.95, True), (1.05, False)])
def test_corners_are_on_a_line_whose_width_is_a_thousandth_of_their_length(factor, line):
    width = factor * 1e-3
    cross = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, width, 0], [0, -width, 0]]) + [5.0, 7.0, 0.0]
    assert module._on_a_line(cross) == line


def test_one_row_of_corners_is_a_line_and_two_are_none(dataset):
    row = np.arange(COLUMNS)
    for ids, count in ((row, 0), (np.append(row, COLUMNS), 3)):
        views = module._common_views(kept(dataset, "rgb_2", ids), "rgb_1", "rgb_2")
        assert len(views.corners) == count


def test_the_pose_is_the_second_camera_s_view_of_the_first(dataset):
    rig = stereo_baseline(dataset)
    assert [link[:2] for link in rig.links] == [
        ("rgb_1", "rgb_2"),
        ("rgb_1", "rgb_3"),
        ("rgb_2", "rgb_3"),
    ]
    first, graph = next(iter(dataset.collections.values())), dataset.graph
    for link in rig.links:
        frames = (dataset.sensors[name].frame for name in (link.target, link.source))
        np.testing.assert_allclose(link.target_T_source, pose(first, graph, *frames), atol=1e-4)
        assert link.collections == 3
    assert rig.method == "opencv" and not rig.unsolved


@pytest.fixture
def quick(monkeypatch):
    """Answer at once instead of OpenCV, where it does not matter what the answer is."""
    monkeypatch.setattr(module, "_solved", lambda *args: np.eye(4))


def test_a_pair_that_moves_costs_the_later_ones_nothing(dataset, quick):
    rig = stereo_baseline(swinging(dataset, "rgb_2"))
    why = "they move against each other; OpenCV wants a stiff pair"
    assert rig.unsolved == {("rgb_1", "rgb_2"): why, ("rgb_2", "rgb_3"): why}
    assert [link[:2] for link in rig.links] == [("rgb_1", "rgb_3")]


def test_a_pair_without_common_corners_costs_the_later_ones_nothing(dataset, quick):
    rig = stereo_baseline(kept(dataset, "rgb_2", [1, 2, 3]))
    assert rig.unsolved == dict.fromkeys((("rgb_1", "rgb_2"), ("rgb_2", "rgb_3")), NONE_IN_COMMON)
    assert [link[:2] for link in rig.links] == [("rgb_1", "rgb_3")]


def test_a_pair_that_opencv_gives_up_is_told_in_its_last_line(monkeypatch, dataset):
    def gives_up(dataset, source, target, views):
        if source == "rgb_1" and target == "rgb_2":
            raise cv2.error("first line\nsecond line\nno good views \n")
        return np.eye(4)

    monkeypatch.setattr(module, "_solved", gives_up)
    rig = stereo_baseline(dataset)
    assert rig.unsolved == {("rgb_1", "rgb_2"): "OpenCV gives up: no good views"}
    assert [link[:2] for link in rig.links] == [("rgb_1", "rgb_3"), ("rgb_2", "rgb_3")]


def test_other_mistakes_are_not_hidden(monkeypatch, dataset):
    def fails(*args):
        raise KeyError("mistake")

    monkeypatch.setattr(module, "_solved", fails)
    with pytest.raises(KeyError):
        stereo_baseline(dataset)
