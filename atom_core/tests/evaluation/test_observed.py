"""What labels say: points, pixels, corners, poses and borders, and why one is not there."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.geometry import se3
from atom_core.model.dataset import DataSource, pose
from atom_core.model.labels import DetectionKey, RangeLabel
from atom_core.synthetic import Noise
from atom_core.synthetic.scenes import random_scene, two_patterns

PATTERN = "pattern_1"


@pytest.fixture(scope="module")
def scene():
    return random_scene(1, rgb=1, depth=1, lidar3d=1, collections=3, noise=Noise.none())


@pytest.fixture(scope="module")
def dataset(scene):
    return scene.dataset


def first_of(dataset, sensor):
    return next(key for key, _ in dataset.detections() if key.sensor == sensor)


def with_label(dataset, key, label):
    return dataset.with_labels(key.collection, {(key.sensor, key.pattern): label})


def camera_T_board(scene, key):
    dataset = scene.dataset
    frame, parent = dataset.sensors[key.sensor].frame, dataset.patterns[key.pattern].parent_frame
    camera_T_parent = pose(dataset.collections[key.collection], dataset.graph, frame, parent)
    return camera_T_parent @ scene.truth.boards[key.pattern, key.collection]


class Counted(DataSource):
    """Data that tell how often they were read."""

    def __init__(self, data):
        self._data, self.reads = data, 0

    def read(self, collection, sensor):
        self.reads += 1
        return self._data.read(collection, sensor)

    def has_data(self, collection, sensor):
        return self._data.has_data(collection, sensor)


def test_points_are_the_labeled_ones_of_the_cloud(dataset):
    key = first_of(dataset, "lidar_1")
    label, cloud = dataset.label(key), dataset.data.read(key.collection, key.sensor)
    seen = Observed(dataset)
    np.testing.assert_array_equal(seen.points(key).inside, cloud[label.indices])
    np.testing.assert_array_equal(seen.limit_points(key), cloud[label.limit_indices])
    assert len(seen.limit_points(key)) > 0


def test_data_are_read_when_asked_for_and_once(dataset):
    data = Counted(dataset.data)
    seen, key = Observed(replace(dataset, data=data)), first_of(dataset, "lidar_1")
    assert data.reads == 0
    assert seen.points(key) is seen.points(key)
    assert data.reads == 1


def test_absent_data_are_told_by_their_sensor(dataset):
    seen, key = Observed(replace(dataset, data=DataSource())), first_of(dataset, "lidar_1")
    for ask in (seen.points, seen.limit_points):
        with pytest.raises(NotMeasurableError, match="^the data file of 'lidar_1' is absent$"):
            ask(key)


def test_a_label_without_limit_points_has_its_board_points_all_the_same(dataset):
    key = first_of(dataset, "lidar_1")
    bare = RangeLabel(dataset.label(key).indices, np.zeros(0, dtype=int))
    seen = Observed(with_label(dataset, key, bare))
    with pytest.raises(NotMeasurableError, match="^'lidar_1' has no labeled limit points$"):
        seen.limit_points(key)
    assert len(seen.points(key).inside) == len(bare.indices)


@pytest.mark.parametrize("count", [1, 2])
def test_even_a_single_limit_point_counts(dataset, count):
    key = first_of(dataset, "lidar_1")
    label = dataset.label(key)
    few = RangeLabel(label.indices, label.limit_indices[:count])
    assert len(Observed(with_label(dataset, key, few)).limit_points(key)) == count


def test_border_pixels_are_column_and_row_of_the_index_each_once(dataset):
    key = first_of(dataset, "depth_1")
    width = dataset.sensors["depth_1"].camera.width
    indices = np.array([3 * width + 5, 7, 3 * width + 5, width - 1, width])
    label = RangeLabel(dataset.label(key).indices, indices)
    found = Observed(with_label(dataset, key, label)).limit_pixels(key)
    np.testing.assert_array_equal(found, [[7, 0], [width - 1, 0], [0, 1], [5, 3]])
    assert found.dtype == float


def test_a_single_border_pixel_counts_and_none_is_told(dataset):
    key = first_of(dataset, "depth_1")
    one, none = (RangeLabel(dataset.label(key).indices, np.arange(count)) for count in (1, 0))
    assert len(Observed(with_label(dataset, key, one)).limit_pixels(key)) == 1
    with pytest.raises(NotMeasurableError, match="^'depth_1' has no labeled limit pixels$"):
        Observed(with_label(dataset, key, none)).limit_pixels(key)


def test_corners_are_those_of_the_label_with_intrinsics_in_single_precision(dataset):
    camera = dataset.sensors["rgb_1"].camera
    odd = replace(camera, K=camera.K + np.diag([0.1, 0.1, 0.0]), D=camera.D + 1e-5 / 3)
    sensors = {**dataset.sensors, "rgb_1": replace(dataset.sensors["rgb_1"], camera=odd)}
    seen, key = Observed(replace(dataset, sensors=sensors)), first_of(dataset, "rgb_1")
    found, label = seen.corners(key), dataset.label(key)
    np.testing.assert_array_equal(found.pixels, label.pixels)
    np.testing.assert_array_equal(found.ids, label.ids)
    corners_m = dataset.patterns[PATTERN].corners_by_id[label.ids]
    np.testing.assert_array_equal(found.corners_in_pattern[:, :2], corners_m)
    for rounded, exact in ((found.camera.K, odd.K), (found.camera.D, odd.D)):
        np.testing.assert_array_equal(rounded, exact.astype(np.float32))
        assert rounded.dtype == float and np.any(rounded != exact)
    assert seen.camera("rgb_1") is odd
    assert seen.corners(key) is found


def test_the_first_corner_of_a_charuco_is_one_square_in_and_of_a_chessboard_at_the_origin():
    dataset = two_patterns(0, collections=1, noise=Noise.none()).dataset
    seen, square_m = Observed(dataset), dataset.patterns["left"].square_m
    expected = np.eye(4)
    expected[:3, 3] = [square_m, square_m, 0.0]
    np.testing.assert_allclose(seen.first_corner("left"), expected)
    np.testing.assert_array_equal(seen.first_corner("right"), np.eye(4))


def test_the_board_s_pose_by_exact_corners_is_the_true_one(scene):
    key = first_of(scene.dataset, "rgb_1")
    seen = Observed(scene.dataset)
    found = seen.camera_T_pattern(key)
    np.testing.assert_allclose(found, camera_T_board(scene, key), atol=1e-5)
    assert seen.camera_T_pattern(key) is found


def test_too_few_corners_are_told_each_time_they_are_asked(dataset):
    key = first_of(dataset, "rgb_1")
    label = dataset.label(key)
    few = replace(label, ids=label.ids[:3], pixels=label.pixels[:3])
    seen = Observed(with_label(dataset, key, few))
    why = "^the corners of 'rgb_1' do not determine the board's pose$"
    for ask in (seen.camera_T_pattern, seen.camera_T_pattern, seen.border):
        with pytest.raises(NotMeasurableError, match=why):
            ask(key)


def test_without_annotation_the_border_is_the_board_s_by_its_corners(scene):
    key, dataset = first_of(scene.dataset, "rgb_1"), scene.dataset
    seen, board = Observed(dataset), dataset.patterns[PATTERN].border
    camera = dataset.sensors["rgb_1"].camera
    corners = np.column_stack([board.corners, np.zeros(4)])
    corners = corners[camera.in_image(se3.apply(camera_T_board(scene, key), corners))]
    ends = seen.border(key).reshape(-1, 2)
    assert len(corners) and not seen.has_annotation(key)
    for corner in camera.project(se3.apply(camera_T_board(scene, key), corners)):
        assert np.min(np.linalg.norm(ends - corner, axis=1)) < 0.01
    assert seen.border(key) is seen.border(key)


def test_an_annotation_takes_the_border_s_place_in_its_image_alone(dataset):
    key, camera = first_of(dataset, "rgb_1"), dataset.sensors["rgb_1"].camera
    drawn = np.array([[[-50.0, 20.0], [30.0, 20.0]], [[5.0, 5.0], [6.0, 7.0]]])
    seen = Observed(dataset, {tuple(key): drawn})
    assert seen.has_annotation(key)
    expected = [[[-0.5, 20.0], [30.0, 20.0]], [[5.0, 5.0], [6.0, 7.0]]]
    np.testing.assert_allclose(seen.border(key), expected)
    assert camera.width > 30
    others = [k for k, _ in dataset.detections() if k.sensor == "rgb_1" and k != key]
    assert others and not any(seen.has_annotation(other) for other in others)


def test_an_annotation_needs_no_corners_that_tell_a_pose(dataset):
    key = first_of(dataset, "rgb_1")
    label = dataset.label(key)
    few = replace(label, ids=label.ids[:1], pixels=label.pixels[:1])
    drawn = np.array([[[1.0, 2.0], [3.0, 4.0]]])
    seen = Observed(with_label(dataset, key, few), {tuple(key): drawn})
    np.testing.assert_array_equal(seen.border(key), drawn)


def test_a_border_drawn_out_of_the_image_is_told_each_time(dataset):
    key = first_of(dataset, "rgb_1")
    seen = Observed(dataset, {tuple(key): np.array([[[-9.0, -9.0], [-5.0, -9.0]]])})
    for _ in range(2):
        with pytest.raises(
            NotMeasurableError, match="^the board's border is out of the image of 'rgb_1'$"
        ):
            seen.border(key)


def test_a_detection_is_known_by_collection_sensor_and_pattern(dataset):
    key = first_of(dataset, "rgb_1")
    seen = Observed(dataset, {("none", "rgb_1", PATTERN): np.zeros((1, 2, 2))})
    assert seen.has_annotation(DetectionKey("none", "rgb_1", PATTERN))
    assert not seen.has_annotation(key)
