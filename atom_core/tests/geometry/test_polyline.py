"""Laws of polylines."""

import numpy as np
import pytest

from atom_core.geometry.polyline import clip_segments, offsets_to_segments, segments_of

BOX = np.array([0.0, 0.0]), np.array([10.0, 6.0])


def sampled(segments, count):
    fraction = np.linspace(0, 1, count)[:, None, None]
    return (segments[:, 0] + fraction * (segments[:, 1] - segments[:, 0])).reshape(-1, 2)


def test_distance_agrees_with_dense_sampling():
    rng = np.random.default_rng(1)
    segments, points = rng.uniform(0, 100, (12, 2, 2)), rng.uniform(0, 100, (200, 2))
    distance = np.linalg.norm(offsets_to_segments(points, segments), axis=1)
    dense = sampled(segments, 20001)
    brute = np.array([np.min(np.linalg.norm(p - dense, axis=1)) for p in points])
    np.testing.assert_allclose(distance, brute, atol=5e-3)
    assert np.all(distance <= brute + 1e-12)


def test_points_on_the_line_have_no_distance():
    segments = segments_of(np.array([[0.0, 0.0], [4.0, 3.0], [8.0, 0.0]]))
    offsets = offsets_to_segments(sampled(segments, 7), segments)
    np.testing.assert_allclose(offsets, 0.0, atol=1e-12)


def test_offset_points_from_the_line_to_the_point():
    segments = np.array([[[0.0, 0.0], [10.0, 0.0]]])
    offsets = offsets_to_segments(np.array([[5.0, 2.0], [13.0, -4.0]]), segments)
    np.testing.assert_allclose(offsets, [[0.0, 2.0], [3.0, -4.0]])


def test_blocks_do_not_change_the_answer():
    rng = np.random.default_rng(2)
    segments, points = rng.uniform(0, 9, (4000, 2, 2)), rng.uniform(0, 9, (250, 2))
    whole = offsets_to_segments(points, segments)
    single = np.concatenate([offsets_to_segments(p[None], segments) for p in points])
    np.testing.assert_array_equal(whole, single)


def test_a_single_point_is_a_segment_without_length():
    segments = segments_of(np.array([[1.0, 2.0]]))
    np.testing.assert_allclose(offsets_to_segments(np.array([[4.0, 6.0]]), segments), [[3.0, 4.0]])


def test_no_segments_are_refused():
    with pytest.raises(ValueError, match="no segments"):
        offsets_to_segments(np.zeros((1, 2)), np.zeros((0, 2, 2)))


def test_closed_polyline_returns_to_its_start():
    square = segments_of(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), closed=True)
    np.testing.assert_array_equal(square[-1], [[1.0, 1.0], [0.0, 0.0]])


def test_clipped_segments_hold_exactly_the_points_in_the_box():
    rng = np.random.default_rng(3)
    segments = rng.uniform(-8, 18, (60, 2, 2))
    clipped = clip_segments(segments, *BOX)
    assert np.all(clipped >= BOX[0] - 1e-9) and np.all(clipped <= BOX[1] + 1e-9)
    dense = sampled(segments, 501)
    inside = np.all((dense >= BOX[0]) & (dense <= BOX[1]), axis=1)
    np.testing.assert_allclose(offsets_to_segments(dense[inside], clipped), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    "segment, expected",
    [
        ([[-5, 3], [15, 3]], [[0, 3], [10, 3]]),
        ([[2, 1], [4, 5]], [[2, 1], [4, 5]]),
        ([[3, -2], [3, 9]], [[3, 0], [3, 6]]),
        ([[3, 2], [3, 2]], [[3, 2], [3, 2]]),
    ],
)
def test_clipping_by_hand(segment, expected):
    clipped = clip_segments(np.array([segment], dtype=float), *BOX)
    np.testing.assert_allclose(clipped, [expected])


@pytest.mark.parametrize("segment", [[[-5, 7], [15, 7]], [[-3, 2], [-1, 4]], [[11, 1], [11, 1]]])
def test_segments_beside_the_box_disappear(segment):
    assert len(clip_segments(np.array([segment], dtype=float), *BOX)) == 0
