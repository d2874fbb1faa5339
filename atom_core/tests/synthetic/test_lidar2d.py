"""The simulated 2D LiDAR against geometry: ranges, labels, ends, noise, several boards."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic.board import charuco, chessboard, held_before
from atom_core.synthetic.lidar2d import Around, Lidar2dModel, scan
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import Room

BOARD = pattern_from_config("board", charuco())
OTHER = pattern_from_config("other", chessboard())
ROOM = Room()
WORLD_T_LIDAR = se3.transform(np.eye(3), np.array([0.3, -0.2, 1.0]))
FAN = Lidar2dModel(-2.0, np.radians(0.5), 400)
MODELS = [Lidar2dModel(), FAN, Lidar2dModel(np.pi, -2 * np.pi / 720, 720)]


def seen(poses, model=None, seed=0, noise=None, others=None, **options):
    patterns = {"board": BOARD, "other": OTHER}
    return scan(
        model or Lidar2dModel(),
        {name: (pose, patterns[name]) for name, pose in poses.items()},
        Around(WORLD_T_LIDAR, ROOM, others),
        noise or Noise.none(),
        np.random.default_rng(seed),
        **options,
    )


def upright(x, y, turn=0.0):
    """Return a board upright in the scan's plane, its middle at (x, y), facing the sensor."""
    lidar_R_board = np.column_stack([[0, -1.0, 0], [0, 0, -1.0], [1.0, 0, 0]])
    turned = se3.rotation_from_rpy(np.array([0.0, 0.0, np.arctan2(y, x) + turn])) @ lidar_R_board
    middle = np.append(BOARD.border.centre, 0.0)
    return se3.transform(turned, np.array([x, y, 0.0]) - turned @ middle)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("seed", range(12))
def test_labeled_points_lie_on_the_board_and_the_others_do_not(model, seed):
    rng = np.random.default_rng(seed)
    centre = np.array([2.0, rng.uniform(-1.0, 1.0), rng.uniform(-0.3, 0.3)])
    pose = held_before(np.zeros(3), centre, BOARD.border, rng)
    made, labels = seen({"board": pose}, model)
    in_board = se3.apply(se3.inverse(pose), made.points)
    on_plane = np.abs(in_board[:, 2]) < 1e-9
    inside, _ = BOARD.border.signed_distance(in_board[:, :2])
    on_board = np.flatnonzero(on_plane & (inside < 1e-9))
    if "board" in labels:
        assert np.array_equal(labels["board"].indices, on_board)
    else:
        span = np.ptp(made.points[on_board], axis=0) if len(on_board) else np.zeros(3)
        assert len(on_board) < 5 or np.linalg.norm(span) < 0.26


def test_the_ends_lie_within_one_step_of_the_border():
    pose = upright(2.0, 0.3, 0.4)
    made, labels = seen({"board": pose})
    label = labels["board"]
    assert label.limit_indices.tolist() == [label.indices[0], label.indices[-1]]
    in_board = se3.apply(se3.inverse(pose), made.points[label.limit_indices])
    distance, _ = BOARD.border.signed_distance(in_board[:, :2])
    step = np.radians(0.25) * np.linalg.norm(made.points[label.limit_indices], axis=1)
    assert np.all(distance < 0.0) and np.all(-distance < step / np.cos(0.75))


def test_both_directions_of_rotation_see_the_same():
    pose = upright(1.5, -0.4, 0.2)
    angles = Lidar2dModel(-1.0, 0.01, 201)
    forward, one = seen({"board": pose}, angles)
    backward, two = seen({"board": pose}, Lidar2dModel(1.0, -0.01, 201))
    assert np.allclose(forward.ranges, backward.ranges[::-1])
    assert np.array_equal(one["board"].indices, 200 - two["board"].indices[::-1])
    assert np.array_equal(one["board"].limit_indices, 200 - two["board"].limit_indices[::-1])


def test_across_the_seam_the_ends_are_those_of_the_board():
    made, labels = seen({"board": upright(-2.0, 0.05)})
    label = labels["board"]
    assert {0, 1439} <= set(label.indices.tolist())
    ends = made.points[label.limit_indices, 1]
    assert len(ends) == 2 and 0.78 < np.ptp(ends) <= 0.8


def test_the_field_of_view_cuts_no_limit_point():
    half = Lidar2dModel(0.0, np.radians(0.5), 200)
    made, labels = seen({"board": upright(2.0, 0.0)}, half)
    label = labels["board"]
    assert label.indices[0] == 0 and label.limit_indices.tolist() == [label.indices[-1]]


def test_a_hidden_end_is_no_limit_point():
    model = Lidar2dModel()
    others = np.where(model.angles > 0.1, 1.0, np.inf)
    label = seen({"board": upright(2.0, 0.0)}, model, others=others)[1]["board"]
    assert label.limit_indices.tolist() == [label.indices[0]]
    assert model.angles[label.indices[-1]] <= 0.1


def test_the_nearer_of_two_boards_hides_the_other():
    poses = {"board": upright(3.0, 0.0), "other": upright(1.5, 0.3)}
    alone = seen({"board": poses["board"]})[1]["board"]
    both = seen(poses)[1]
    assert 0 < len(both["board"].indices) < len(alone.indices)
    assert len(both["board"].limit_indices) == 1
    assert not np.intersect1d(both["board"].indices, both["other"].indices).size


def test_noise_lies_along_the_beams_and_dropouts_only_on_boards():
    pose = upright(2.0, 0.0)
    exact, _ = seen({"board": pose})
    noisy, labels = seen({"board": pose}, noise=Noise(lidar_m=0.010, dropout=0.2))
    error = noisy.ranges - exact.ranges
    assert np.nanstd(error) == pytest.approx(0.010, rel=0.1)
    lost = np.flatnonzero(np.isnan(noisy.ranges))
    first, last = labels["board"].indices[[0, -1]]
    assert len(lost) > 10 and np.all((lost > first - 5) & (lost < last + 5))
    assert not np.intersect1d(lost, labels["board"].indices).size


def test_beams_on_an_edge_are_mixed_and_not_labeled():
    pose = upright(2.0, 0.0)
    wide = Lidar2dModel(beam_width_rad=np.radians(0.25))
    mixed, labels = seen({"board": pose}, wide)
    exact, sharp = seen({"board": pose})
    changed = np.flatnonzero(np.abs(mixed.ranges - exact.ranges) > 1e-9)
    assert 1 <= len(changed) <= 4
    assert not np.intersect1d(changed, labels["board"].indices).size
    assert np.all(mixed.ranges[changed] > exact.ranges[sharp["board"].indices].min())


@pytest.mark.parametrize("x", [0.05, 40.0])
def test_outside_the_range_limits_there_is_no_label(x):
    near = Lidar2dModel(range_m=(0.1, 30.0))
    others = np.where(near.angles > 2.0, 5.0, np.inf)
    made, labels = scan(
        near,
        {"board": (upright(x, 0.0), BOARD)},
        Around(WORLD_T_LIDAR, Room((-60.0,) * 3, (60.0,) * 3), others),
        Noise.none(),
        np.random.default_rng(0),
    )
    assert not labels or np.all(made.ranges[labels["board"].indices] >= 0.1)
    assert np.all(np.isinf(made.ranges[np.abs(near.angles + 2.0) < 0.5]))


def test_the_same_seed_makes_the_same_scan():
    pose = {"board": upright(2.0, 0.3)}
    noise = Noise(gross_fraction=0.2)
    one, two, three = (seen(pose, seed=s, noise=noise)[0].ranges for s in (1, 1, 2))
    assert np.array_equal(one, two) and not np.array_equal(one, three)
