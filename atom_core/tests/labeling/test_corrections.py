"""Labels corrected by hand: what is added and removed cancels, fills keep to their polygon."""

import cv2
import numpy as np
import pytest

from atom_core.errors import LabelingError
from atom_core.labeling import corrections
from atom_core.labeling.depth import DepthLabeler
from atom_core.labeling.polygon import inside_polygon, polygon_mask
from atom_core.model.labels import RangeLabel, RgbLabel
from atom_core.synthetic import scenes
from atom_core.synthetic.memory import Sampling

SHAPE = (48, 64)
SQUARE = np.array([[10.0, 10.0], [30.0, 10.0], [30.0, 25.0], [10.0, 25.0]])


def label(rng, count=40, size=500):
    """A label in no order, as other programs may have written it; some of it on the border."""
    indices = rng.permutation(size)[:count]
    return RangeLabel(indices, rng.permutation(indices)[: count // 4])


def same(one, other):
    return np.array_equal(one.indices, other.indices) and np.array_equal(
        one.limit_indices, other.limit_indices
    )


# --- points -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("border", [False, True])
def test_adding_and_removing_is_nothing(seed, border):
    rng = np.random.default_rng(seed)
    before = label(rng)
    others = rng.permutation(np.setdiff1d(np.arange(500), before.indices))[:30]
    added = corrections.with_points(before, others, border)
    assert set(added.indices) == set(before.indices) | set(others)
    assert set(added.limit_indices) == set(before.limit_indices) | (
        set(others) if border else set()
    )
    assert same(corrections.without_points(added, others), before)


@pytest.mark.parametrize("seed", range(5))
def test_adding_twice_is_adding_once(seed):
    rng = np.random.default_rng(seed)
    before, more = label(rng), rng.permutation(500)[:50]
    once = corrections.with_points(before, more, True)
    assert same(corrections.with_points(once, more, True), once)
    assert len(np.unique(once.indices)) == len(once.indices)


@pytest.mark.parametrize("seed", range(5))
def test_the_border_stays_a_part_of_the_label(seed):
    rng = np.random.default_rng(seed)
    changed = corrections.with_points(label(rng), rng.permutation(500)[:50], True)
    changed = corrections.without_points(changed, rng.permutation(500)[:250])
    assert np.all(np.isin(changed.limit_indices, changed.indices))


def test_points_are_added_where_nothing_was_detected():
    made = corrections.with_points(None, np.array([7, 3]), False)
    assert made.indices.tolist() == [7, 3]
    assert not corrections.without_points(made, np.array([3, 7])).detected


def test_what_was_not_measured_is_left_out_and_what_is_beyond_refused():
    valid = np.array([True, False, True, True])
    assert corrections.valid_indices(np.array([3, 1, 0, 3]), valid).tolist() == [3, 0]
    for wrong in (4, -1):
        with pytest.raises(LabelingError, match=f"index {wrong} is beyond the data"):
            corrections.valid_indices(np.array([0, wrong]), valid)


# --- polygons ---------------------------------------------------------------------------------


def test_border_pixels_inside_a_polygon_go_and_the_rest_stays():
    rows, columns = np.mgrid[0 : SHAPE[0] : 3, 0 : SHAPE[1] : 3]
    every = (columns + rows * SHAPE[1]).ravel()
    before = RangeLabel(every, every)
    after = corrections.without_border(before, SQUARE, SHAPE)
    row, column = np.divmod(every, SHAPE[1])
    inside = (column >= 10) & (column <= 30) & (row >= 10) & (row <= 25)
    assert np.array_equal(after.limit_indices, every[~inside])
    assert np.array_equal(after.indices, every)


@pytest.mark.parametrize(
    ("polygon", "words"),
    [
        (SQUARE + [200.0, 0.0], "outside the image of 64 x 48"),
        (SQUARE - [0.0, 1e6], "outside the image"),
        (SQUARE[:2], "three corners"),
        (SQUARE * np.nan, "not a number"),
        (np.zeros((0, 2)), "three corners"),
    ],
)
def test_what_is_no_polygon_in_the_image_is_refused(polygon, words):
    with pytest.raises(LabelingError, match=words):
        polygon_mask(polygon, SHAPE)


def test_a_polygon_may_reach_beyond_the_image():
    mask = polygon_mask(np.array([[-1e5, -1e5], [1e5, -1e5], [1e5, 1e5], [-1e5, 1e5]]), SHAPE)
    assert mask.all()


def test_inside_is_told_to_a_fraction_of_a_pixel():
    found = inside_polygon(SQUARE, np.array([[10.01, 12.0], [9.99, 12.0], [30.0, 25.0]]))
    assert found.tolist() == [True, False, True]
    assert inside_polygon(SQUARE, np.zeros((0, 2))).tolist() == []


# --- corners ----------------------------------------------------------------------------------


def corners():
    return RgbLabel(np.array([5, 2, 9]), np.array([[10.5, 10.0], [20.0, 10.0], [40.0, 40.0]]))


def test_the_nearest_corner_within_reach_is_meant():
    assert corrections.nearest_corner(corners(), np.array([17.0, 11.0]), 10.0) == 2
    assert corrections.nearest_corner(corners(), np.array([60.0, 60.0]), 10.0) is None


def test_corners_are_removed_and_moved_in_their_order():
    assert corrections.corners_in(corners(), SQUARE).tolist() == [5, 2]
    assert corrections.without_corners(corners(), {5}).ids.tolist() == [2, 9]
    moved = corrections.with_corner_at(corners(), 2, np.array([21.5, 9.0]))
    assert moved.ids.tolist() == [5, 2, 9]
    assert moved.pixels.tolist() == [[10.5, 10.0], [21.5, 9.0], [40.0, 40.0]]
    back = corrections.with_corner_at(moved, 2, np.array([20.0, 10.0]))
    assert np.array_equal(back.pixels, corners().pixels)
    with pytest.raises(LabelingError, match="no corner 7"):
        corrections.with_corner_at(corners(), 7, np.zeros(2))


# --- fills ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def board():
    """A depth image, its labeler, the automatic label, and the board's outline in the image."""
    dataset = scenes.random_scene(
        3, rgb=1, depth=1, lidar3d=0, collections=4, sampling=Sampling(background_step=1)
    ).dataset
    (pattern,) = dataset.patterns.values()
    labeler = DepthLabeler(dataset.sensors["depth_1"], pattern)
    for key in dataset.collections:
        depth_m = dataset.data.read(key, "depth_1").astype(np.float32)
        found = labeler.label(depth_m)
        if found.detected:
            return depth_m, labeler, found.label, _outline(found.label, depth_m.shape)
    raise AssertionError("the board is in no image")


def _outline(found, shape):
    row, column = np.divmod(found.limit_indices, shape[1])
    hull = cv2.convexHull(np.column_stack([column, row]).astype(np.float32)).reshape(-1, 2)
    return hull.astype(float)


def _grown(outline, factor):
    middle = outline.mean(axis=0)
    return middle + factor * (outline - middle)


def _share(one, other):
    return len(np.intersect1d(one, other)) / len(np.union1d(one, other))


def test_a_fill_around_the_board_is_the_automatic_label(board):
    depth_m, labeler, automatic, outline = board
    found = corrections.refilled(labeler, depth_m, _grown(outline, 1.15))
    assert found.detected and not found.warnings
    assert _share(found.label.indices, automatic.indices) > 0.98
    assert _share(found.label.limit_indices, automatic.limit_indices) > 0.95


def test_a_fill_keeps_to_its_polygon_and_makes_no_border_of_its_edge(board):
    depth_m, labeler, automatic, outline = board
    left, right = outline[:, 0].min(), outline[:, 0].max()
    cut = left + 0.6 * (right - left)  # a person stands before the rest
    polygon = np.array([[left - 20, 0], [cut, 0], [cut, 479], [left - 20, 479]])
    found = corrections.refilled(labeler, depth_m, polygon)
    assert found.detected and found.warnings  # the labeler would not have been sure
    column = found.label.indices % depth_m.shape[1]
    assert column.max() <= cut
    inside_cut = automatic.indices[automatic.indices % depth_m.shape[1] < cut - 6]
    assert np.isin(inside_cut, found.label.indices).mean() > 0.95
    limit = found.label.limit_indices
    assert len(limit) > 50
    row, column = np.divmod(limit, depth_m.shape[1])
    true_row, true_column = np.divmod(automatic.limit_indices, depth_m.shape[1])
    away = np.hypot(row[:, None] - true_row, column[:, None] - true_column).min(axis=1)
    assert np.mean(away <= 2.0) > 0.97, "border pixels that are not the board's"


def test_a_fill_forgives_lost_pixels_and_a_wall_inside_the_polygon(board):
    depth_m, labeler, automatic, outline = board
    behind = np.where(np.isfinite(depth_m), depth_m, np.float32(4.5))
    lost = np.random.default_rng(0).uniform(size=depth_m.shape) < 0.05
    behind[lost & (polygon_mask(outline, depth_m.shape) > 0)] = np.nan
    low, high = outline.min(axis=0) - 25, outline.max(axis=0) + 25
    rectangle = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    found = corrections.refilled(labeler, behind, rectangle)
    assert found.detected, found.reason
    kept = np.isfinite(behind.ravel()[automatic.indices])
    assert np.isin(automatic.indices[kept], found.label.indices).mean() > 0.98


def test_a_fill_where_there_is_no_board_finds_nothing(board):
    depth_m, labeler, _, outline = board
    empty = np.full_like(depth_m, np.nan)
    with pytest.raises(LabelingError, match="no depth inside the polygon"):
        corrections.refilled(labeler, empty, _grown(outline, 1.1))
    wall = np.full_like(depth_m, 3.0)
    assert not corrections.refilled(labeler, wall, _grown(outline, 1.5)).detected
