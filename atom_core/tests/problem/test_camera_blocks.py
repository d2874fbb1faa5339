"""Blocks of a camera's intrinsics: which numbers, their units, scales and what is expected."""

import numpy as np
import pytest

from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import (
    COUNT,
    intrinsics_names,
    intrinsics_values,
    moved_camera,
)
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import INTRINSICS
from atom_core.problem.camera_blocks import (
    STATE_SIZE,
    TWIST_SIZE,
    CameraBlock,
    ExpectedCamera,
    camera_blocks,
)

EDGE = Edge("post", "rgb_1_link")
K = np.array([[900.0, 0.0, 600.0], [0.0, 700.0, 420.0], [0.0, 0.0, 1.0]])
PLUMB_BOB = Camera(1280, 800, K, [-0.2, 0.05, 0.001, -0.002, 0.01], "plumb_bob")
RATIONAL = Camera(
    1280, 800, K, [0.3, -0.1, 0.001, -0.002, 0.01, 0.5, -0.1, 0.02], "rational_polynomial"
)
PINHOLE = Camera(1280, 800, K, [], "none")
CAMERAS = {"none": PINHOLE, "plumb_bob": PLUMB_BOB, "rational_polynomial": RATIONAL}
SIGMA = 0.02


def blocks_of(camera, estimated=None, expected=None):
    names = intrinsics_names(camera) if estimated is None else estimated
    return camera_blocks("rgb_1", EDGE, camera, names, expected)


@pytest.fixture(params=CAMERAS)
def camera(request):
    return CAMERAS[request.param]


def test_the_blocks_hold_each_name_of_the_camera_once_and_in_order(camera):
    names = [name for block in blocks_of(camera) for name in block.components]
    used = intrinsics_names(camera)
    assert tuple(names[: len(used)]) == used
    assert set(names[len(used) :]) <= {""} and len(names) % 6 == 0


def test_a_block_belongs_to_its_camera_in_all_collections():
    for block in blocks_of(PLUMB_BOB):
        assert (block.sensor, block.names, block.edge) == ("rgb_1", ("rgb_1",), EDGE)
        assert block.kind == INTRINSICS and block.collection is None
        assert block.is_angle.all() and block.is_angle.shape == (6,)


def test_columns_of_both_blocks_follow_the_twist_and_fill_the_state():
    first, second = blocks_of(RATIONAL)
    columns = [*range(STATE_SIZE)]
    assert [*range(TWIST_SIZE), *columns[first.columns], *columns[second.columns]] == columns
    assert (first.columns, second.columns) == (slice(6, 12), slice(12, 18))
    assert (first.first, second.first) == (0, 6)


def test_only_what_is_estimated_is_free_and_an_idle_block_is_left_out():
    (only,) = blocks_of(PLUMB_BOB, ("fx", "cy", "k1"))
    assert [name for _, name in only.free_components] == ["fx", "cy", "k1"]
    (second,) = blocks_of(PLUMB_BOB, ("k3",))
    assert second.first == 6 and second.free_components == ((2, "k3"),)
    assert blocks_of(PLUMB_BOB, ()) == ()
    (pinhole,) = blocks_of(PINHOLE)
    np.testing.assert_array_equal(pinhole.free, [True] * 4 + [False] * 2)


def test_pixels_are_the_unit_of_focal_lengths_and_centre_only():
    first, second = blocks_of(RATIONAL)
    assert first.units == ("px",) * 4 + ("1",) * 2
    assert second.units == ("1",) * 6


def test_scales_say_by_how_much_a_value_changes_with_its_number(camera):
    h, values = 1e-6, intrinsics_values(camera)
    scales = np.concatenate([block.scales for block in blocks_of(camera)])
    assert len(scales) % 6 == 0 and not scales[len(values) :].any()
    for i, value in enumerate(values):
        changed = intrinsics_values(moved_camera(camera, h * np.eye(COUNT)[i]))[i]
        assert (changed - value) / h == pytest.approx(scales[i], rel=1e-4)


def test_anything_goes_where_nothing_is_expected():
    for block in blocks_of(PLUMB_BOB):
        assert not block.prior_mean.any() and block.prior_mean.shape == (6,)
        assert not block.prior_weight.any() and block.prior_weight.shape == (6,)


def test_the_expected_numbers_move_the_camera_to_the_expected_one():
    numbers = 0.01 * np.arange(1.0, COUNT + 1.0)
    there = moved_camera(RATIONAL, numbers)
    blocks = blocks_of(RATIONAL, expected=ExpectedCamera(there, SIGMA))
    np.testing.assert_allclose(np.concatenate([b.prior_mean for b in blocks]), numbers, atol=1e-9)


def test_coefficients_are_expected_ten_times_as_far_off_as_the_pinhole():
    expected = ExpectedCamera(RATIONAL, SIGMA)
    first, second = blocks_of(RATIONAL, expected=expected)
    tight, wide = 1.0 / SIGMA**2, 1.0 / (10.0 * SIGMA) ** 2
    np.testing.assert_allclose(first.prior_weight, [tight] * 4 + [wide] * 2)
    np.testing.assert_allclose(second.prior_weight, [wide] * 6)
    (some,) = blocks_of(RATIONAL, ("fy", "k2"), expected)
    np.testing.assert_allclose(some.prior_weight, [0.0, tight, 0.0, 0.0, 0.0, wide])


def test_sigmas_are_those_of_the_values_at_the_solution():
    """A focal length is an exponential, so its change by its number is the present one."""
    deviation = 1e-3 * np.arange(1.0, 7.0)
    numbers = np.zeros(COUNT)
    numbers[:6] = 0.3, -0.2, 0.1, 0.05, 0.02, -0.01
    there, h = moved_camera(PLUMB_BOB, numbers), 1e-6
    sigmas = blocks_of(PLUMB_BOB)[0].sigmas(deviation**2, there)
    assert list(sigmas) == ["fx", "fy", "cx", "cy", "k1", "k2"]
    for i, sigma in enumerate(sigmas.values()):
        ahead = intrinsics_values(moved_camera(PLUMB_BOB, numbers + h * np.eye(COUNT)[i]))[i]
        slope = (ahead - intrinsics_values(there)[i]) / h
        assert sigma == pytest.approx(slope * deviation[i], rel=1e-4)
    last = blocks_of(PLUMB_BOB)[1].sigmas(deviation**2, there)
    assert last["k3"] == pytest.approx(blocks_of(PLUMB_BOB)[1].scales[2] * deviation[2])
    assert "fx" not in last and len(last) == 3


def test_a_block_expects_nothing_unless_said():
    block = CameraBlock(EDGE, INTRINSICS, None, ("rgb_1",), PLUMB_BOB, 0, ("fx",))
    assert block.expected is None
