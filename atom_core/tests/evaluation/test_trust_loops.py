"""Loops of three sensors: which are asked, and what is left where three poses meet."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # trust_parts, which tests share

from trust_parts import BOARD, parts_of, quiet_dataset, replaced

from atom_core.evaluation.trust import checks as module
from atom_core.evaluation.trust.relative import RelativePose, largest_in_sigmas
from atom_core.geometry import se3
from atom_core.model.transforms import Edge


@pytest.fixture(scope="module")
def dataset():
    return quiet_dataset()


# ---- loops


def by_themselves(monkeypatch, dataset, one="rgb_1", other="lidar_1"):
    """Return one sensor in another by these two alone, and how that was asked."""
    calls = []

    def solve(part, parts, what, **changed):
        calls.append((part, what, changed))
        return "solved"

    replaced(monkeypatch, _solved=solve, relative_pose=lambda *args: args)
    return module._by_themselves(dataset, parts_of(dataset), one, other), calls


def shared_by(dataset, count):
    """Return a dataset of which rgb_1 and lidar_1 share so many boards."""
    both = [
        key
        for key, c in dataset.collections.items()
        if {("rgb_1", BOARD), ("lidar_1", BOARD)} <= set(c.labels)
    ]
    for key in both[count:]:
        dataset = dataset.with_labels(key, {("lidar_1", BOARD): None})
    return dataset, both[:count]


def test_two_sensors_that_share_four_boards_are_asked_by_themselves(monkeypatch, dataset):
    fewer, keys = shared_by(dataset, 4)
    found, ((part, what, changed),) = by_themselves(monkeypatch, fewer)
    assert found == ("solved", "rgb_1", "lidar_1")
    assert list(part.sensors) == ["rgb_1", "lidar_1"] and list(part.collections) == keys
    assert what == "rgb_1 and lidar_1 by themselves"
    assert changed == {
        "anchor_sensors": ("rgb_1",),
        "ignore_anchored_sensor": True,
        "additional_tfs": (),
    }


def test_two_sensors_that_share_three_boards_are_not(monkeypatch, dataset):
    assert by_themselves(monkeypatch, shared_by(dataset, 3)[0]) == (None, [])


def test_two_sensors_on_one_edge_or_that_move_are_not(monkeypatch, dataset):
    sensor = replace(dataset.sensors["lidar_1"], edge=dataset.sensors["rgb_1"].edge)
    one_edge = replace(dataset, sensors={**dataset.sensors, "lidar_1": sensor})
    edge = Edge("rig_base", "lidar_1_post")
    value = se3.transform(np.eye(3), np.array([0.1, 0.0, 0.0])) @ dataset.first_value(edge)
    swinging = dataset.with_transforms({"001": {edge: value}})
    for changed in (one_edge, swinging):
        assert by_themselves(monkeypatch, changed) == (None, [])


def loops(monkeypatch, names, missing=()):
    """Return which loops are closed and why none is; ``missing`` are pairs without an answer."""
    dataset = SimpleNamespace(sensors=dict.fromkeys(names))
    parts = parts_of(dataset)
    replaced(
        monkeypatch,
        _by_themselves=lambda d, p, one, other: None if one + other in missing else one + other,
        _loop=lambda around, links: (around, links),
    )
    return module._loops(dataset, parts), parts.untold


def test_each_three_sensors_are_a_loop_of_three_poses(monkeypatch):
    found, untold = loops(monkeypatch, "abcd", missing=("bd",))
    assert found == [(("a", "b", "c"), ["ab", "bc", "ac"]), (("a", "c", "d"), ["ac", "cd", "ad"])]
    assert untold == []


@pytest.mark.parametrize("missing", ["ab", "bc", "ac"])
def test_three_sensors_without_a_loop_are_told(monkeypatch, missing):
    why = "loops: no three sensors of which each two share 4 boards"
    assert loops(monkeypatch, "abc", (missing,)) == ([], [why])


def test_two_sensors_have_no_loop_and_miss_none(monkeypatch):
    assert loops(monkeypatch, "ab") == ([], [])


def test_three_poses_that_fit_close_a_loop():
    rng = np.random.default_rng(0)
    a_T_b, b_T_c = (se3.random_move(1.0, 1.0, rng) for _ in range(2))
    zero = np.zeros((6, 6))
    links = [RelativePose(p, zero) for p in (a_T_b, b_T_c, a_T_b @ b_T_c)]
    found = module._loop(("a", "b", "c"), links)
    assert found.names == ("a", "b", "c")
    assert found.translation_m < 1e-12 and found.rotation_rad < 1e-7


def test_what_is_left_of_a_loop_is_told_in_the_sigma_of_all_three():
    """Without turns shifts add up, each with its own variance, the second in turned axes."""
    shifts = ([1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 2.0, -0.3])
    variances = ([0.01, 0.02, 0.03], [0.04, 0.05, 0.06], [0.07, 0.08, 0.01])
    links = [
        RelativePose(se3.transform(np.eye(3), np.array(s)), np.diag([0.0, 0.0, 0.0, *v]))
        for s, v in zip(shifts, variances)
    ]
    found = module._loop(("a", "b", "c"), links)
    assert found.translation_m == pytest.approx(0.3) and found.rotation_rad < 1e-12
    total = np.diag(np.sum(variances, axis=0))
    wanted = largest_in_sigmas(np.array([0.0, 0.0, 0.3]), total)
    assert wanted == pytest.approx(0.3 / np.sqrt(0.1))
    assert found.sigmas == pytest.approx(wanted, rel=1e-4)
