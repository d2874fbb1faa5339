"""Two sensors by themselves: from which boards, by which distances, and why there is no answer."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from atom_core.evaluation.baselines import pairwise as module
from atom_core.evaluation.baselines.links import Link
from atom_core.evaluation.baselines.pairwise import pairwise_baseline
from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.dataset import DataSource
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, scenes

BOARD = "pattern_1"
BORDER = Rectangle(-0.2, -0.1, 0.6, 0.3)  # its middle is at (0.2, 0.1)


@pytest.fixture(scope="module")
def dataset():
    return scenes.random_scene(
        1, rgb=2, depth=0, lidar3d=2, collections=4, noise=Noise.none()
    ).dataset


def shift(*metres):
    return se3.transform(np.eye(3), np.array(metres))


# ---- distances


def test_points_are_as_far_from_the_board_as_from_its_plane_and_its_outline():
    inside = np.array([[0.1, 0.0, 0.03], [0.3, 0.2, -0.02]])
    limit = np.array([[0.65, 0.1, 9.0], [0.2, 0.28, 9.0]])
    board = module._Board(shift(0.0, 0.0, 0.5), inside, limit, BORDER)
    found = module._residuals([board], np.eye(4))(np.zeros(6))
    # From the plane 0.5 m before the target, and beyond the right side or within the upper one.
    np.testing.assert_allclose(found, [0.53, 0.48, 0.05, -0.02], atol=1e-12)


def test_all_boards_count_and_the_start_is_moved_by_the_step():
    inside, limit = np.array([[0.0, 0.0, 0.0]]), np.array([[0.6, 0.1, 0.0]])
    boards = [module._Board(shift(0.0, 0.0, z), inside, limit, BORDER) for z in (0.0, 1.0)]
    residuals = module._residuals(boards, shift(0.01, 0.0, 0.0))
    np.testing.assert_allclose(residuals(np.zeros(6)), [0.0, 0.01, 1.0, 0.01], atol=1e-12)
    stepped = residuals(np.array([0.0, 0.0, 0.0, 0.02, 0.0, 0.04]))
    np.testing.assert_allclose(stepped, [0.04, 0.03, 1.04, 0.03], atol=1e-12)


# ---- a range sensor and another one


class Labels:
    """What stands for the labels: the same points in every collection."""

    def __init__(self, inside, limit):
        self.seen = SimpleNamespace(inside=inside, limit=limit)

    def points(self, key):
        return self.seen


def nothing_but_the_step(step):
    return np.append(step, 0.0)


def by_points(
    monkeypatch, boards, source_middles, inside=5, limit=5, distances=nothing_but_the_step
):
    """Solve by boards (4, 4) in the target and their middles (3,) in the source; None: not told."""
    kept = []
    keys = [
        tuple(DetectionKey(str(i), name, BOARD) for name in ("lidar", "camera"))
        for i in range(len(boards))
    ]
    told = dict(zip([str(i) for i in range(len(boards))], zip(boards, source_middles)))

    def residuals(boards, start):
        kept.append((boards, start))
        return distances

    monkeypatch.setattr(module, "_pose_of_board", lambda d, o, key: told[key.collection][0])
    monkeypatch.setattr(module, "board_middle", lambda d, key: told[key.collection][1])
    monkeypatch.setattr(module, "_residuals", residuals)
    kinds = (("lidar", True), ("camera", False))
    dataset = SimpleNamespace(
        patterns={BOARD: SimpleNamespace(border=BORDER)},
        sensors={n: SimpleNamespace(kind=SimpleNamespace(measures_range=r)) for n, r in kinds},
        data=SimpleNamespace(has_data=lambda collection, sensor: True),
    )
    points = Labels(np.arange(3.0 * inside).reshape(-1, 3), np.arange(3.0 * limit).reshape(-1, 3))
    found = module._by_points(dataset, points, keys)
    return found, kept


def posed(count):
    """Return boards in the target, and a motion with their middles in the source."""
    rng = np.random.default_rng(8)
    target_T_source = se3.random_move(1.0, 1.0, rng)
    boards = [se3.random_move(1.0, 0.5, rng) for _ in range(count)]
    middles = [se3.apply(b, np.array([[0.2, 0.1, 0.0]]))[0] for b in boards]
    inverse = np.linalg.inv(target_T_source)
    return target_T_source, boards, [se3.apply(inverse, m[None])[0] for m in middles]


def test_it_starts_where_the_middles_of_the_boards_lie_on_one_another(monkeypatch):
    target_T_source, boards, middles = posed(4)
    found, ((of_boards, start),) = by_points(monkeypatch, boards, middles)
    np.testing.assert_allclose(start, target_T_source, atol=1e-9)
    assert found[:2] == ("lidar", "camera") and found.collections == 4
    np.testing.assert_allclose(found.target_T_source, target_T_source, atol=1e-6)
    for board, pose in zip(of_boards, boards):
        np.testing.assert_allclose(board.board_T_target, np.linalg.inv(pose), atol=1e-9)
        assert board.border is BORDER


def test_a_stray_distance_pulls_no_more_than_one_of_two_centimetres(monkeypatch):
    """Soft L1: ``x / sqrt(1 + x^2 / f^2)`` of each, which of a stray one is ``f`` at most."""

    def distances(step):
        x_m = step[3]
        return np.array([x_m, x_m, x_m - 1.0, *step[:3], *step[4:]])

    target_T_source, boards, middles = posed(3)
    found, _ = by_points(monkeypatch, boards, middles, distances=distances)
    reach_m = 0.02
    pulled_m = reach_m / np.sqrt(3.0)  # where two pull as much as the stray one
    apart = np.linalg.norm(found.target_T_source[:3, 3] - target_T_source[:3, 3])
    assert apart == pytest.approx(pulled_m, rel=2e-3)


@pytest.mark.parametrize("untold", ["board", "middle"])
def test_a_board_that_one_does_not_tell_costs_the_later_ones_nothing(monkeypatch, untold):
    _, boards, middles = posed(4)
    (boards if untold == "board" else middles)[0] = None
    found, _ = by_points(monkeypatch, boards, middles)
    assert found.collections == 3
    (boards if untold == "board" else middles)[2] = None
    found, _ = by_points(monkeypatch, boards, middles)
    assert found.startswith("2 boards that both tell; it takes 3 ('lidar' by itself tells ")


def test_boards_in_a_row_tell_no_start(monkeypatch):
    boards = [shift(0.0, x, 1.0) for x in (0.0, 0.1, 0.2, 0.3)]
    middles = [b[:3, 3] for b in boards]
    found, _ = by_points(monkeypatch, boards, middles)
    assert found == "the boards' middles lie on a line"


@pytest.mark.parametrize("count, left", [(0, 0), (1, 1), (399, 399), (400, 200), (1000, 200)])
def test_of_more_than_two_hundred_points_they_are_taken_evenly(monkeypatch, count, left):
    _, boards, middles = posed(3)
    for counts in ((count, 5), (5, count)):
        _, ((of_boards, _),) = by_points(monkeypatch, boards, middles, *counts)
        for board in of_boards:
            parts = (board.inside, board.limit)
            assert [len(part) for part in parts] == [left if n == count else n for n in counts]
            steps = {float(s) for part in parts for s in np.diff(part[:, 0])}
            assert steps <= {3.0, 3.0 * (count // max(left, 1))}


# ---- pairs


def test_each_two_sensors_are_a_pair_once(dataset):
    pairs = module._pairs(dataset)
    names = list(dataset.sensors)
    wanted = {frozenset((a, b)) for a in names for b in names if a != b}
    assert len(pairs) == len(wanted) and {frozenset(pair) for pair in pairs} == wanted


def test_a_pair_that_moves_costs_the_later_ones_nothing(monkeypatch, dataset):
    edge = Edge("rig_base", "rgb_2_post")
    moved = dataset.first_value(edge) @ shift(0.1, 0.0, 0.0)
    swinging = dataset.with_transforms({"001": {edge: moved}})

    def link(dataset, observed, source, target):
        return "why" if "lidar_2" in (source, target) else Link(source, target, np.eye(4), 1)

    monkeypatch.setattr(module, "_link", link)
    rig = pairwise_baseline(swinging)
    told = {frozenset(pair): why for pair, why in rig.unsolved.items()}
    moving = {frozenset(("rgb_2", other)) for other in dataset.sensors if other != "rgb_2"}
    assert {pair for pair, why in told.items() if why == "they move against each other"} == moving
    assert {frozenset(link[:2]) for link in rig.links} == {frozenset(("rgb_1", "lidar_1"))}
    assert [told[frozenset(("lidar_2", name))] for name in ("rgb_1", "lidar_1")] == ["why"] * 2


def of_pair(monkeypatch, dataset, poses, source="rgb_1", target="rgb_2"):
    monkeypatch.setattr(module, "_pose_of_board", lambda d, o, key: poses[key[:2]])
    return module._link(dataset, None, source, target)


def test_two_cameras_are_linked_by_the_boards_that_both_tell(monkeypatch, dataset):
    rng = np.random.default_rng(9)
    move = se3.random_move(1.0, 1.0, rng)
    in_source = {key: se3.random_move(1.0, 1.0, rng) for key in dataset.collections}
    poses = {(key, "rgb_1"): pose for key, pose in in_source.items()}
    poses.update({(key, "rgb_2"): move @ pose for key, pose in in_source.items()})
    poses["000", "rgb_1"] = poses["001", "rgb_2"] = None
    found = of_pair(monkeypatch, dataset, poses)
    assert found[:2] == ("rgb_1", "rgb_2") and found.collections == 2
    np.testing.assert_allclose(found.target_T_source, move, atol=1e-9)


def test_cameras_that_tell_no_board_both_are_told_so(monkeypatch, dataset):
    poses = {(key, "rgb_1"): None for key in dataset.collections}
    poses.update({(key, "rgb_2"): np.eye(4) for key in dataset.collections})
    found = of_pair(monkeypatch, dataset, poses)
    assert found == "their corners do not determine a board's pose in both"


@pytest.mark.parametrize("pair", [("rgb_1", "rgb_2"), ("lidar_1", "rgb_1")])
def test_without_a_common_board_there_is_no_link(dataset, pair):
    apart = dataset
    for key in dataset.collections:
        apart = apart.with_labels(key, {("rgb_1", BOARD): None})
    assert module._link(apart, None, *pair) == "they share no board"


def test_corners_that_do_not_tell_a_board_tell_no_pose(dataset):
    label = dataset.collections["000"].labels["rgb_1", BOARD]
    few = replace(label, ids=label.ids[:3], pixels=label.pixels[:3])
    fewer = dataset.with_labels("000", {("rgb_1", BOARD): few})
    observed = module.Observed(fewer)
    told = [
        module._pose_of_board(fewer, observed, DetectionKey(key, "rgb_1", BOARD)) is not None
        for key in fewer.collections
    ]
    assert told == [False] + [True] * (len(told) - 1)


def test_without_clouds_a_range_sensor_tells_no_pose(dataset):
    key = DetectionKey("000", "lidar_1", BOARD)
    assert module._pose_of_board(dataset, None, key).shape == (4, 4)
    assert module._pose_of_board(replace(dataset, data=DataSource()), None, key) is None
