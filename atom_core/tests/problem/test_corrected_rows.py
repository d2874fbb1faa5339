"""Problems corrected by model errors: what each moves, whose rows, and by how much."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import COUNT, moved_camera
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import PATTERN, PoseBlock
from atom_core.problem.board_errors import (
    Bend,
    BoardAspect,
    BoardSize,
    BoardTwist,
    BorderShift,
    BorderSize,
)
from atom_core.problem.corrections import corrected, corrected_cameras
from atom_core.problem.direction_errors import ElevationOffset
from atom_core.problem.model_errors import CameraError, RangeOffset, RangeScale
from atom_core.problem.parameters import Parameters
from atom_core.problem.problem import PoseChains, Problem
from atom_core.problem.residuals import BorderBlock, OrthogonalBlock, ReprojectionBlock

K = np.array([[900.0, 0.0, 640.0], [0.0, 880.0, 400.0], [0.0, 0.0, 1.0]])
CAMERA = Camera(1280, 800, K, [-0.2, 0.05, 0.001, -0.002, 0.01], "plumb_bob")
POSE = se3.from_rpy(np.array([-0.1, 0.05, 1.5]), np.array([0.5, -0.3, 0.2]))
BOARDS = ("big", "small")  # of the detections of each sensor, by turns
RNG = np.random.default_rng(0)
CORNERS = RNG.uniform(-0.3, 0.3, (6, 3)) * [1.0, 1.0, 0.0]
POINTS = RNG.uniform(-0.3, 0.3, (6, 3)) + [0.5, 0.2, 1.5]
CENTRE, HALF_M = RNG.uniform(-0.1, 0.1, (6, 2)), RNG.uniform(0.3, 0.5, (6, 2))
OF_BIG = np.arange(6) < 3  # the others are of the small board


def range_fields(sensor, first):
    return {
        "sensor": sensor,
        "modality": "lidar3d",
        "detection": np.repeat([first, first + 1], 3),
        "sigma": np.full(6, 0.01),
        "ids": np.arange(6),
        "points": POINTS.copy(),
        "range_offset_m": np.zeros(6),
        "range_scale": np.zeros(6),
        "unturned": None,
    }


def problem():
    """Two boards before a camera and before a LiDAR, and the same before another LiDAR."""
    keys = [DetectionKey("000", s, b) for s in ("camera", "lidar", "other") for b in BOARDS]
    blocks = [
        PoseBlock(Edge(k.sensor, f"{k.pattern}_{i}"), PATTERN, str(i), (k.pattern,), POSE)
        for i, k in enumerate(keys)
    ]
    chains = PoseChains(
        np.tile(np.eye(4), (6, 2, 1, 1)), np.arange(6)[:, None], np.zeros((6, 1), dtype=bool)
    )
    pixels, detection = np.zeros((6, 2)), np.repeat([0, 1], 3)
    border = {
        "centre": CENTRE.copy(),
        "half_size": HALF_M.copy(),
        "steps": np.zeros((6, 2, 3)),
        "inset": np.zeros((6, 2)),
    }
    rows = (
        ReprojectionBlock(
            "camera", "rgb", detection, np.ones(6), np.arange(6), CAMERA, CORNERS.copy(), pixels
        ),
        OrthogonalBlock(**range_fields("lidar", 2)),
        BorderBlock(**range_fields("lidar", 2), **border),
        OrthogonalBlock(**range_fields("other", 4)),
    )
    return Problem(Parameters(blocks), tuple(keys), chains, rows)


X = np.zeros(36)
CORNER, HEIGHT, BORDER, OTHER = range(4)  # places of the blocks


def blocks_after(values, of=None):
    return corrected(of or problem(), values, X).residual_blocks


def unchanged(blocks, *places):
    before = problem().residual_blocks
    for place in places:
        for name, value in vars(before[place]).items():
            np.testing.assert_array_equal(getattr(blocks[place], name), value)


def rays():
    return POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)


def test_what_a_problem_is_corrected_by_is_noted():
    values = {RangeOffset("lidar"): 0.01, BoardSize("big"): 0.0}
    assert corrected(problem(), values, X).model_errors == values
    assert corrected(problem(), {}, X).model_errors == {}


def test_a_range_offset_moves_the_points_of_its_sensor_along_their_rays():
    blocks = blocks_after({RangeOffset("lidar"): 0.04})
    for place in (HEIGHT, BORDER):
        np.testing.assert_allclose(blocks[place].points, POINTS + 0.04 * rays())
        np.testing.assert_array_equal(blocks[place].measured_points.shape, POINTS.shape)
        np.testing.assert_allclose(blocks[place].measured_points, POINTS, atol=1e-12)
    unchanged(blocks, CORNER, OTHER)


def test_scale_acts_before_offset():
    blocks = blocks_after({RangeOffset("lidar"): 0.04, RangeScale("lidar"): 0.1})
    np.testing.assert_allclose(blocks[HEIGHT].points, 1.1 * POINTS + 0.04 * rays())


def test_a_range_error_of_zero_moves_nothing():
    unchanged(blocks_after({RangeOffset("lidar"): 0.0, RangeScale("lidar"): 0.0}), HEIGHT, BORDER)


def test_a_direction_error_turns_the_points_and_leaves_what_was_measured():
    error = ElevationOffset("lidar")
    blocks = blocks_after({error: 0.01, RangeOffset("lidar"): 0.02})
    turned = error.directed(POINTS, 0.01)
    unit = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    np.testing.assert_allclose(blocks[HEIGHT].points, turned + 0.02 * unit)
    np.testing.assert_array_equal(blocks[HEIGHT].measured_points, POINTS)
    assert blocks[OTHER].unturned is None
    assert blocks_after({error: 0.0})[HEIGHT].unturned is None


def test_a_size_is_that_of_one_board_only():
    blocks = blocks_after({BoardSize("big"): 0.1})
    factor = np.where(OF_BIG, 1.1, 1.0)[:, None]
    np.testing.assert_allclose(blocks[CORNER].corners_in_pattern, factor * CORNERS)
    np.testing.assert_allclose(blocks[BORDER].centre, factor * CENTRE)
    np.testing.assert_allclose(blocks[BORDER].half_size, factor * HALF_M)
    unchanged(blocks, HEIGHT, OTHER)


def test_sizes_of_both_boards_are_apart():
    blocks = blocks_after({BoardSize("big"): 0.1, BoardSize("small"): -0.2})
    factor = np.where(OF_BIG, 1.1, 0.8)[:, None]
    np.testing.assert_allclose(blocks[CORNER].corners_in_pattern, factor * CORNERS)


def test_an_aspect_makes_the_print_longer_in_x_and_shorter_in_y():
    blocks = blocks_after({BoardAspect("small"): 0.01, BoardSize("small"): 0.1})
    factors = np.where(OF_BIG[:, None], 1.0, 1.1 * np.array([1.01, 0.99]))
    np.testing.assert_allclose(blocks[CORNER].corners_in_pattern[:, :2], factors * CORNERS[:, :2])
    np.testing.assert_allclose(
        blocks[BORDER].half_size, np.where(OF_BIG[:, None], 1.0, 1.1) * HALF_M
    )


@pytest.mark.parametrize("axis", [0, 1])
def test_a_border_is_shifted_and_grows_along_its_axis_after_its_board(axis):
    values = {BorderShift("big", axis): 0.03, BorderSize("big", axis): 0.02, BoardSize("big"): 0.1}
    blocks = blocks_after(values)
    along, factor = np.outer(OF_BIG, np.eye(2)[axis]), np.where(OF_BIG, 1.1, 1.0)[:, None]
    np.testing.assert_allclose(blocks[BORDER].centre, factor * CENTRE + 0.03 * along)
    np.testing.assert_allclose(blocks[BORDER].half_size, factor * HALF_M + 0.02 * along)


def test_a_bend_lifts_corners_and_the_surface_by_its_parabola():
    bend = Bend("big", 1, 0.05, 0.4)
    blocks = blocks_after({bend: 0.002})
    above_m = np.where(OF_BIG, 0.002 * ((CORNERS[:, 1] - 0.05) / 0.4) ** 2, 0.0)
    np.testing.assert_allclose(blocks[CORNER].corners_in_pattern[:, 2], above_m, atol=1e-15)
    in_board = se3.apply(se3.inverse(POSE), POINTS)
    surface_m = np.where(OF_BIG, 0.002 * ((in_board[:, 1] - 0.05) / 0.4) ** 2, 0.0)
    for place in (HEIGHT, OTHER):
        np.testing.assert_allclose(blocks[place].surface_m, surface_m, atol=1e-15)
    unchanged(blocks, BORDER)


def test_bends_over_both_axes_add_up():
    bends = {Bend("big", 0, 0.0, 0.4): 0.002, Bend("big", 1, 0.0, 0.3): -0.001}
    both = blocks_after(bends)[CORNER].corners_in_pattern[:, 2]
    alone = [blocks_after({b: v})[CORNER].corners_in_pattern[:, 2] for b, v in bends.items()]
    np.testing.assert_allclose(both, sum(alone), atol=1e-15)


def test_where_no_board_is_bent_any_more_the_surface_is_flat():
    bent = corrected(problem(), {Bend("big", 0, 0.0, 0.4): 0.002}, X)
    flat = corrected(bent, {}, X)
    assert flat.residual_blocks[HEIGHT].surface_m is None
    np.testing.assert_allclose(flat.residual_blocks[CORNER].corners_in_pattern, CORNERS, atol=1e-15)


def test_a_camera_is_moved_by_its_numbers_each_from_the_given_one():
    focal = CameraError("camera", "focal_length", (0, 1), CAMERA)
    k1 = CameraError("camera", "k1", (4,), CAMERA)
    there = corrected(problem(), {focal: 0.05, k1: 0.02}, X)
    numbers = np.zeros(COUNT)
    numbers[[0, 1, 4]] = 0.05, 0.05, 0.02
    expected = moved_camera(CAMERA, numbers)
    np.testing.assert_allclose(there.residual_blocks[CORNER].camera.K, expected.K)
    np.testing.assert_allclose(there.residual_blocks[CORNER].camera.D, expected.D)
    assert list(corrected_cameras(there)) == ["camera"]
    assert corrected_cameras(there)["camera"] is there.residual_blocks[CORNER].camera
    (again,) = [b for b in blocks_after({k1: 0.01}, of=there) if isinstance(b, ReprojectionBlock)]
    np.testing.assert_allclose(again.camera.K, K)
    np.testing.assert_allclose(again.camera.D, moved_camera(CAMERA, 0.01 * np.eye(COUNT)[4]).D)


def test_numbers_that_two_errors_move_add_up():
    errors = [CameraError("camera", name, (0,), CAMERA) for name in ("fx", "zoom")]
    (block, *_) = blocks_after({errors[0]: 0.05, errors[1]: 0.02})
    assert block.camera.focal_px[0] == pytest.approx(900.0 * np.exp(0.07))


def test_only_cameras_with_an_error_of_theirs_are_moved():
    error = CameraError("another", "fx", (0,), CAMERA)
    there = corrected(problem(), {error: 0.05, RangeOffset("camera"): 0.1}, X)
    assert corrected_cameras(there) == {}
    unchanged(there.residual_blocks, CORNER)


@pytest.mark.parametrize("seed", range(3))
def test_any_values_may_follow_any_others(seed):
    rng, first, second = np.random.default_rng(seed), {}, {}
    for values in (first, second):
        values[BoardSize("big")], values[BoardAspect("big")] = rng.uniform(-0.05, 0.05, 2)
        values[BorderShift("small", 0)], values[BorderSize("small", 1)] = rng.uniform(
            -0.02, 0.02, 2
        )
        values[RangeOffset("lidar")], values[RangeScale("lidar")] = rng.uniform(-0.05, 0.05, 2)
        values[ElevationOffset("lidar")] = rng.uniform(-0.01, 0.01)
        values[Bend("big", 0, 0.05, 0.4)] = rng.uniform(-0.01, 0.01)
        values[BoardTwist("big", 0.05, 0.1, 0.4, 0.3)] = rng.uniform(-0.01, 0.01)
        values[CameraError("camera", "fx", (0,), CAMERA)] = rng.uniform(-0.1, 0.1)
    direct, detour = (corrected(p, second, X) for p in (problem(), corrected(problem(), first, X)))
    for one, other in zip(direct.residual_blocks, detour.residual_blocks):
        for name, value in vars(one).items():
            if isinstance(value, np.ndarray) and value.dtype.kind == "f":
                np.testing.assert_allclose(getattr(other, name), value, atol=1e-12)
        poses = direct.poses(X)
        np.testing.assert_allclose(one.residuals(poses), other.residuals(poses), atol=1e-8)


def test_an_inset_of_the_border_stays():
    inset_m = 0.01 * np.ones((6, 2))
    blocks = blocks_after({BoardSize("big"): 0.1}, of=problem().with_insets({BORDER: inset_m}))
    np.testing.assert_array_equal(blocks[BORDER].inset, inset_m)
